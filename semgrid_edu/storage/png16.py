"""PNG images of three 16-bit channels, which Pillow cuts down to 8 bits: SYNTHIA keeps labels and depth in them."""

import struct
import zlib
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_bytes

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_PIXEL = 6
"""Bytes of a pixel: three channels of two bytes, the higher byte first."""


def read_png16(path: Path, size: tuple[int, int] | None) -> NDArray[np.uint16]:
    """Return the pixels of an RGB image with 16 bits a channel.

    The checksum of every chunk is verified.

    Parameters
    ----------
    path : Path
        The file to read: not interlaced.
    size : (int, int) or None
        Height and width that the image must have, pixels; None where any size will do.

    Returns
    -------
    (h, w, 3) uint16

    Raises
    ------
    DataError
        When the file isn't a sound PNG of this format and size.
    """
    chunks = _chunks(path)
    header = dict(chunks).get(b"IHDR", b"")
    if len(header) != 13:
        raise DataError(path, "a sound PNG image", "one without its header")
    width, height, *form = struct.unpack(">IIBBBBB", header)
    if form != [16, 2, 0, 0, 0]:
        raise DataError(path, "RGB with 16 bits a channel, not interlaced", f"{form[0]} bits, colour type {form[1]}")
    if (height, width) != (size or (height, width)):
        raise DataError(path, "{} x {} pixels".format(*size), f"{height} x {width} pixels")
    try:
        content = zlib.decompress(b"".join(data for kind, data in chunks if kind == b"IDAT"))
    except zlib.error as error:
        raise DataError(path, "a sound PNG image", error) from error
    if len(content) != height * (1 + width * _PIXEL):
        raise DataError(path, f"{height} rows of {width} pixels", f"{len(content)} bytes")
    rows = np.frombuffer(content, dtype=np.uint8).reshape(height, 1 + width * _PIXEL)
    if rows[:, 0].max(initial=0) > 4:
        raise DataError(path, "a sound PNG image", f"a row filter {rows[:, 0].max()}")
    return _unfiltered(rows).view(">u2").reshape(height, width, 3).astype(np.uint16)


def _chunks(path: Path) -> list[tuple[bytes, bytes]]:
    """Return kind and data of every chunk up to the end, their checksums verified."""
    content = read_bytes(path)
    if not content.startswith(_SIGNATURE):
        raise DataError(path, "a sound PNG image", "a file that doesn't begin as one")
    chunks, start = [], len(_SIGNATURE)
    while not chunks or chunks[-1][0] != b"IEND":
        length, kind = struct.unpack(">I4s", content[start : start + 8].ljust(8, b"\0"))
        data, checksum = content[start + 8 : start + 8 + length], content[start + 8 + length : start + 12 + length]
        if len(checksum) < 4:
            raise DataError(path, "a sound PNG image", "one without its end")
        if zlib.crc32(kind + data) != int.from_bytes(checksum):
            raise DataError(path, "a sound PNG image", f"a wrong checksum in chunk {kind!r}")
        chunks.append((kind, data))
        start += 12 + length
    return chunks


@njit(cache=True)
def _unfiltered(rows: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Undo the filter of each row (PNG specification, section 9), whose number is the row's first byte."""
    height, length = rows.shape[0], rows.shape[1] - 1
    pixels = np.zeros((height, length), dtype=np.uint8)
    for r in range(height):
        kind = rows[r, 0]
        for c in range(length):
            left = np.int64(pixels[r, c - _PIXEL]) if c >= _PIXEL else 0
            above = np.int64(pixels[r - 1, c]) if r > 0 else 0
            corner = np.int64(pixels[r - 1, c - _PIXEL]) if r > 0 and c >= _PIXEL else 0
            predicted = 0
            if kind == 1:
                predicted = left
            elif kind == 2:
                predicted = above
            elif kind == 3:
                predicted = (left + above) // 2
            elif kind == 4:
                predicted = _paeth(left, above, corner)
            pixels[r, c] = (np.int64(rows[r, c + 1]) + predicted) & 255
    return pixels


@njit(cache=True)
def _paeth(left: int, above: int, corner: int) -> int:
    """Return the neighbour closest to left + above - corner."""
    estimate = left + above - corner
    to_left, to_above, to_corner = abs(estimate - left), abs(estimate - above), abs(estimate - corner)
    if to_left <= to_above and to_left <= to_corner:
        return left
    return above if to_above <= to_corner else corner
