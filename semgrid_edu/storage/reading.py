"""Checked reading: bytes, text, JSON, PNG and JPEG images, with errors that name the file."""

import io
import json
from codecs import BOM_UTF8
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import found_at

PNG_END = b"\0\0\0\0IEND\xaeB`\x82"
"""The chunk that ends every PNG. Decoders don't notice when it is missing, so a truncated file would pass."""


def read_bytes(path: Path) -> bytes:
    """Return a file's bytes.

    Parameters
    ----------
    path : Path
        The file to read.
    """
    try:
        if path.exists() and not path.is_file():
            raise DataError(path, "a file", found_at(path))
        content = path.read_bytes()
    except FileNotFoundError:
        raise DataError(path, "a file", "nothing there") from None
    except OSError as error:
        raise DataError(path, "a readable file", error.strerror) from error
    if not content:
        raise DataError(path, "a file with content", "0 bytes")
    return content


def read_text(path: Path) -> str:
    """Return a file's text.

    Parameters
    ----------
    path : Path
        The file to read: ASCII, as all of KITTI's text files are; a byte order mark before it is ignored.
    """
    try:
        return read_bytes(path).removeprefix(BOM_UTF8).decode("ascii")
    except UnicodeDecodeError as error:
        raise DataError(path, "ASCII text", f"byte {error.object[error.start]:#x} at {error.start}") from error


def read_lines(path: Path, n_lines: int) -> list[str]:
    """Return the lines of a file; blank ones after the last are left out.

    Parameters
    ----------
    path : Path
        The file.
    n_lines : int
        How many lines count, blank or not.
    """
    lines = read_text(path).splitlines()
    return lines if any(map(str.strip, lines[n_lines:])) else lines[:n_lines]


def read_json(path: str | Path, kind: type = dict) -> Any:
    """Read a JSON file.

    Parameters
    ----------
    path : path-like
        The file to read: UTF-8.
    kind : type
        The expected type: `dict` for an object, `list` for an array.
    """
    return parse_json(path, read_bytes(Path(path)), kind)


def parse_json(path: str | Path, text: str | bytes, kind: type = dict) -> Any:
    """Parse JSON.

    Parameters
    ----------
    path : path-like
        Where the text comes from, for the error.
    text : str or bytes
        The JSON; bytes are UTF-8.
    kind : type
        The expected type: `dict` for an object, `list` for an array.
    """
    expected = "a JSON array" if kind is list else "a JSON object"
    try:
        content = json.loads(text)
    except RecursionError:
        raise DataError(path, expected, "brackets nested too deeply") from None
    except ValueError as error:  # includes numbers with thousands of digits, and bytes that aren't UTF-8
        raise DataError(path, expected, f"no JSON: {error}"[:300]) from error
    if not isinstance(content, kind):
        raise DataError(path, expected, repr(content)[:200])
    return content


def parse_numbers(path: Path, text: str, what: str) -> NDArray[np.float64]:
    """Return the numbers in a piece of text.

    Parameters
    ----------
    path : Path
        Where the text comes from, for the error.
    text : str
        Numbers separated by spaces.
    what : str
        What the numbers are, for the error.

    Returns
    -------
    (N,) float64
    """
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError as error:
        raise DataError(path, f"numbers for {what}", error) from error
    if not np.isfinite(numbers).all():
        raise DataError(path, f"finite numbers for {what}", text.strip())
    return numbers


def read_png(path: Path, mode: str, size: tuple[int, int] | None) -> NDArray:
    """Return the pixels of a PNG.

    The checksum of every chunk is verified, because a decoder may return half a picture without an error.

    Parameters
    ----------
    path : Path
        The file to read.
    mode : str
        The pixel format: Pillow's "RGB", "L" (8 bits) and "I;16", or "RGB;16" for three channels of 16 bits.
    size : (int, int) or None
        Height and width that the image must have, pixels; None if any size will do.

    Returns
    -------
    (h, w, 3) or (h, w) uint8, or uint16 for 16 bits

    Raises
    ------
    DataError
        If the file isn't a valid PNG of this format and size.
    """
    return _pixels(path, "PNG", mode, size)


def read_image(path: Path, size: tuple[int, int] | None) -> NDArray[np.uint8]:
    """Return the pixels of a photograph, (h, w, 3), RGB: a PNG, or a JPEG if its name ends in .jpg or .jpeg.

    Parameters
    ----------
    path : Path
        The file to read.
    size : (int, int) or None
        Height and width that the image must have, pixels; None if any size will do.
    """
    return _pixels(path, "JPEG" if path.suffix.lower() in (".jpg", ".jpeg") else "PNG", "RGB", size)


def _pixels(path: Path, kind: str, mode: str, size: tuple[int, int] | None) -> NDArray:
    """Return the pixels of an image of one format, "PNG" or "JPEG"."""
    content = read_bytes(path)
    try:
        _opened(content, kind).verify()
        image = _opened(content, kind)
        found = "RGB;16" if image.tile[0][3] == "RGB;16B" else image.mode
        pixels = _sixteen_bits(content) if found == "RGB;16" else np.array(image)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise DataError(path, f"a sound {kind} image", f"{str(error).partition(' <')[0]!r}") from error
    if kind == "PNG" and PNG_END not in content:
        raise DataError(path, "a sound PNG image", "one without its end")
    height, width = pixels.shape[:2]
    if found != mode or (height, width) != (size or (height, width)):
        expected = f"{mode} of {size[0]} x {size[1]} pixels" if size else mode
        raise DataError(path, expected, f"{found} of {height} x {width} pixels")
    return pixels


def _opened(content: bytes, kind: str) -> Image.Image:
    return Image.open(io.BytesIO(content), formats=[kind])


def _sixteen_bits(content: bytes) -> NDArray[np.uint16]:
    """Decode three 16-bit channels. Pillow keeps only 8 bits: the upper ones, or the lower ones on request."""
    upper = _opened(content, "PNG")
    lower = _opened(content, "PNG")
    lower.tile = [(*lower.tile[0][:3], "RGB;16L")]
    return np.array(upper).astype(np.uint16) << 8 | np.array(lower)
