"""Files that are read whole and checked: bytes, text and PNG images, with errors that name the file."""

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.errors import DataError

PNG_END = b"\0\0\0\0IEND\xaeB`\x82"
"""The chunk that ends every PNG; decoders don't miss it in a file that was cut short."""


def read_bytes(path: Path) -> bytes:
    """Return a file's bytes.

    Parameters
    ----------
    path : Path
        The file to read.

    Raises
    ------
    DataError
        When the file is missing, can't be opened or is empty.
    """
    try:
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
        The file to read: ASCII, as all of KITTI's text files are.

    Raises
    ------
    DataError
        When the file is missing, can't be opened, is empty or isn't ASCII.
    """
    try:
        return read_bytes(path).decode("ascii")
    except UnicodeDecodeError as error:
        raise DataError(path, "ASCII text", f"byte {error.object[error.start]:#x} at {error.start}") from error


def parse_numbers(path: Path, text: str, what: str) -> NDArray[np.float64]:
    """Return the numbers in a piece of text.

    Parameters
    ----------
    path : Path
        Where the text comes from, for the error.
    text : str
        Numbers with spaces between them.
    what : str
        What the numbers are, for the error.

    Returns
    -------
    (N,) float64

    Raises
    ------
    DataError
        When a word isn't a finite number.
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

    The checksum of every chunk is verified, because a decoder alone may return half a picture without an error.

    Parameters
    ----------
    path : Path
        The file to read.
    mode : str
        Pillow's name of the pixel format: "RGB", "L" (8 bits) or "I;16".
    size : (int, int) or None
        Height and width that the image must have, pixels; None where any size will do.

    Returns
    -------
    (h, w, 3) or (h, w) uint8, or uint16 for "I;16"

    Raises
    ------
    DataError
        When the file isn't a sound PNG of this format and size.
    """
    content = read_bytes(path)
    try:
        Image.open(io.BytesIO(content), formats=["PNG"]).verify()
        image = Image.open(io.BytesIO(content), formats=["PNG"])
        image.load()
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise DataError(path, "a sound PNG image", f"{str(error).partition(' <')[0]!r}") from error
    if PNG_END not in content:
        raise DataError(path, "a sound PNG image", "one without its end")
    found = (image.height, image.width)
    if image.mode != mode or found != (size or found):
        expected = f"{mode} of {size[0]} x {size[1]} pixels" if size else mode
        raise DataError(path, expected, f"{image.mode} of {image.height} x {image.width} pixels")
    return np.array(image)
