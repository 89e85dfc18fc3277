"""Decode images and point clouds of ROS, sensor_msgs/Image, CompressedImage and PointCloud2."""

from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.datasets.frames import LIDAR_RANGE
from semgrid_edu.errors import DataError

ENCODINGS = {"rgb8": (0, 1, 2), "bgr8": (2, 1, 0), "mono8": (0,)}
"""Encodings of uncompressed images, and where a pixel keeps red, green and blue."""

NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Types of a point's fields, by their number in sensor_msgs/PointField."""

INTENSITIES = ("reflectivity", "intensity", "i")
"""Names of the field that tells how bright a return is; the first that is there. Ouster's intensity is a count of
photons without an upper end, but its reflectivity is calibrated."""

BYTE = 255.0
"""The brightest return where brightness is a byte."""


def image_of(message: Any, place: str) -> NDArray[np.uint8]:
    """Decode an image.

    Parameters
    ----------
    message : sensor_msgs/Image or CompressedImage
        rgb8, bgr8 or mono8, whose rows may be padded; or JPEG or PNG.
    place : str
        The topic, for the error.

    Returns
    -------
    (h, w, 3) uint8
        RGB; grey for mono8.
    """
    if not hasattr(message, "encoding"):
        try:
            with Image.open(BytesIO(message.data)) as image:
                return np.asarray(image.convert("RGB"))
        except OSError as error:
            raise DataError(place, "images as JPEG or PNG", f"{message.format!r}: {error}") from error
    if message.encoding not in ENCODINGS:
        raise DataError(place, f"images as {', '.join(ENCODINGS)}, JPEG or PNG", repr(message.encoding))
    order = ENCODINGS[message.encoding]
    used = message.width * len(order)
    if message.step < used or len(message.data) != message.height * message.step:
        found = f"{len(message.data)} bytes in rows of {message.step}"
        raise DataError(place, f"an image of {message.width} x {message.height} pixels, {message.encoding}", found)
    rows = np.asarray(message.data, np.uint8).reshape(message.height, message.step)[:, :used]
    pixels = rows.reshape(message.height, message.width, len(order))[..., order]
    return np.ascontiguousarray(np.broadcast_to(pixels, (message.height, message.width, 3)))


def cloud_of(message: Any, place: str) -> tuple[NDArray[np.float64], NDArray[np.float64], bool]:
    """Decode a scan. Returns that aren't finite, or that are at the LIDAR itself, mark a beam without return.

    Parameters
    ----------
    message : sensor_msgs/PointCloud2
        Any order of fields and bytes, rows padded or not.
    place : str
        The topic, for the error.

    Returns
    -------
    points : (N, 3) float64
        x, y, z in the frame of the message, metres.
    brightness : (N,) float64
        As it was recorded; 0 without a field of this kind.
    bytes : bool
        Whether the brightness was recorded as bytes.
    """
    fields = {field.name: field for field in message.fields}
    brightness = next((name for name in INTENSITIES if name in fields), None)
    names = ["x", "y", "z"] + [brightness] * (brightness is not None)
    records = _records(message, names, fields, place)
    points = np.stack([records[name] for name in "xyz"], axis=-1).astype(np.float64)
    bright = records[brightness].astype(np.float64) if brightness else np.zeros(len(points))
    real = np.isfinite(points).all(axis=1) & points.any(axis=1)
    if not (np.abs(points[real]) <= LIDAR_RANGE).all():
        raise DataError(place, f"returns within {LIDAR_RANGE:g} m", f"{np.abs(points[real]).max():g}: are they metres?")
    is_byte = brightness is not None and records[brightness].dtype.itemsize == 1
    return points[real], np.nan_to_num(bright[real], nan=0.0, posinf=np.inf), is_byte


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


class Reflectance:
    """Scale the brightness of returns to reflectance from 0 to 1.

    Bytes are divided by 255. Other numbers are taken as they are if the first scan in which any return is bright has
    none above 1, and else divided by 255. A sensor without brightness gets zeros, by which `sensor.edge_of_splits`
    knows it.

    Parameters
    ----------
    place : str
        The topic, for the error.
    """

    def __init__(self, place: str) -> None:
        self.place = place
        self.brightest: float | None = None

    def scaled(self, brightness: NDArray[np.float64], is_byte: bool) -> NDArray[np.float64]:
        """Return the reflectance of a scan's returns, (N,) from 0 to 1.

        Parameters
        ----------
        brightness : (N,) float64
            From `cloud_of`.
        is_byte : bool
            Whether it was recorded as bytes.
        """
        if not brightness.any():
            return brightness
        if self.brightest is None:
            self.brightest = BYTE if is_byte or brightness.max() > 1 else 1.0
        low, high = brightness.min(), brightness.max()
        if low < 0 or high > self.brightest:
            raise DataError(self.place, f"a brightness of 0 to {self.brightest:g}", f"{low:g} to {high:g}")
        return brightness / self.brightest
