"""Decode images and point clouds of ROS, sensor_msgs/Image, CompressedImage and PointCloud2."""

from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.datasets.frames import LIDAR_RANGE
from semgrid_edu.errors import DataError

RGB, BGR = (0, 1, 2), (2, 1, 0)
ENCODINGS = {
    "rgb8": (RGB, 3),
    "bgr8": (BGR, 3),
    "rgba8": (RGB, 4),
    "bgra8": (BGR, 4),
    "8UC3": (BGR, 3),  # says nothing of colours; OpenCV's order
    "mono8": ((0,), 1),
}
"""Encodings of uncompressed images: where a pixel keeps red, green and blue, and of how many bytes."""

MODES = ("L", "LA", "P", "RGB", "RGBA")
"""Pillow's names for pictures whose channels have 8 bits."""

NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Types of a point's fields, by their number in sensor_msgs/PointField."""

INTENSITIES = ("reflectivity", "intensity", "i")
"""Names of the field that tells how bright a return is; the first that is there. Ouster's intensity is a count of
photons without an upper end, but its reflectivity is calibrated."""

FARTHEST = LIDAR_RANGE - 0.01
"""The longest distance of a return, metres: turning rounds, and readers refuse coordinates beyond `LIDAR_RANGE`."""

BYTE = 255.0
"""The brightest return where brightness is a byte."""


def image_of(message: Any, place: str) -> NDArray[np.uint8]:
    """Decode an image.

    Parameters
    ----------
    message : sensor_msgs/Image or CompressedImage
        One of `ENCODINGS`, whose rows may be padded; or JPEG or PNG of 8 bits.
    place : str
        The topic, for the error.

    Returns
    -------
    (h, w, 3) uint8
        RGB; grey for mono8.
    """
    if not hasattr(message, "encoding"):
        return _decompressed(message, place)
    if message.encoding not in ENCODINGS:
        raise DataError(place, f"images as {', '.join(ENCODINGS)}, JPEG or PNG", repr(message.encoding))
    order, n_bytes = ENCODINGS[message.encoding]
    used = message.width * n_bytes
    if message.step < used or len(message.data) != message.height * message.step:
        found = f"{len(message.data)} bytes in rows of {message.step}"
        raise DataError(place, f"an image of {message.width} x {message.height} pixels, {message.encoding}", found)
    rows = np.asarray(message.data, np.uint8).reshape(message.height, message.step)[:, :used]
    pixels = rows.reshape(message.height, message.width, n_bytes)[..., order]
    return np.ascontiguousarray(np.broadcast_to(pixels, (message.height, message.width, 3)))


def _decompressed(message: Any, place: str) -> NDArray[np.uint8]:
    """Decode a JPEG or PNG, (h, w, 3), RGB."""
    expected = "images as JPEG or PNG with 8 bits"
    try:
        image = Image.open(BytesIO(message.data))
        image.load()
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise DataError(place, expected, f"{message.format!r}: {error}") from error
    if image.mode not in MODES:
        raise DataError(place, expected, f"{message.format!r} with pixels {image.mode!r}")
    return np.asarray(image.convert("RGB"))


class Cloud(NamedTuple):
    """The returns of a scan.

    Parameters
    ----------
    points : (N, 3) float64
        x, y, z in the frame of the message, metres.
    brightness : (N,) float64
        As it was recorded; 0 without a field of this kind, and for NaN.
    n_far : int
        How many returns are beyond `FARTHEST`; they are left out.
    """

    points: NDArray[np.float64]
    brightness: NDArray[np.float64]
    n_far: int


def cloud_of(message: Any, place: str) -> Cloud:
    """Decode a scan. Returns that aren't finite, or that are at the LIDAR itself, mark a beam without return.

    Parameters
    ----------
    message : sensor_msgs/PointCloud2
        Any order of fields and bytes, rows padded or not.
    place : str
        The topic, for the error.
    """
    fields = {field.name: field for field in message.fields}
    brightness = next((name for name in INTENSITIES if name in fields), None)
    names = ["x", "y", "z"]
    if brightness:
        names.append(brightness)
    records = _records(message, names, fields, place)
    points = np.stack([records[name] for name in "xyz"], axis=-1).astype(np.float64)
    bright = records[brightness].astype(np.float64) if brightness else np.zeros(len(points))
    real = np.isfinite(points).all(axis=1) & points.any(axis=1)
    points = points[real]
    bright = np.where(np.isnan(bright), 0, bright)[real]
    if not ((bright >= 0) & np.isfinite(bright)).all():
        raise DataError(place, "a finite brightness from 0 up", f"{bright.min():g} to {bright.max():g}")
    far = np.linalg.norm(points, axis=1) > FARTHEST
    if 2 * far.sum() > len(points):
        expected = f"returns within {LIDAR_RANGE:g} m"
        raise DataError(place, expected, f"{far.sum()} of {len(points)} beyond: are they metres?")
    return Cloud(points[~far], bright[~far], int(far.sum()))


def _records(message: Any, names: list[str], fields: dict[str, Any], place: str) -> NDArray[np.void]:
    """Return some fields of all points, (N,), by the layout that the message describes."""
    missing = [name for name in names if name not in fields]
    if missing:
        raise DataError(place, "points with the fields x, y and z", f"only {', '.join(fields) or 'none'}")
    kinds = {name: NUMBERS.get(fields[name].datatype) for name in names}
    if None in kinds.values():
        raise DataError(place, f"field types {min(NUMBERS)} to {max(NUMBERS)} of sensor_msgs/PointField", kinds)
    order = ">" if message.is_bigendian else "<"
    formats = [np.dtype(order + kinds[name]) for name in names]
    ends = [fields[name].offset + one.itemsize for name, one in zip(names, formats, strict=True)]
    used = message.width * message.point_step
    whole = len(message.data) == message.height * message.row_step and message.row_step >= used
    if not whole or max(ends) > message.point_step:
        found = f"{len(message.data)} bytes, fields up to byte {max(ends)} of a point"
        expected = f"{message.height} rows of {message.row_step} bytes: {message.width} points of {message.point_step}"
        raise DataError(place, expected, found)
    offsets = [fields[name].offset for name in names]
    layout = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": message.point_step})
    rows = np.asarray(message.data, np.uint8).reshape(message.height, message.row_step)[:, :used]
    return np.frombuffer(rows.tobytes(), layout)


def unit_of_brightness(brightest: float) -> float:
    """Return the brightness that is a reflectance of 1.

    A byte's 255; 1 if no return is brighter; and if one is brighter than 255, that of the brightest.

    Parameters
    ----------
    brightest : float
        The brightness of the brightest return of a bag.

    Examples
    --------
    >>> [unit_of_brightness(brightest) for brightest in (0.98, 100, 2450)]
    [1.0, 255.0, 2450]
    """
    return 1.0 if brightest <= 1 else max(BYTE, brightest)
