"""RGB images of 16 bits a channel: what OpenCV writes is read to the bit, and damage is named."""

import struct
import zlib

import cv2
import numpy as np
import pytest
from PIL import Image

from semgrid_edu.errors import DataError
from semgrid_edu.storage.png16 import read_png16


@pytest.fixture
def picture():
    """Smooth slopes and noise, for which an encoder picks different filters."""
    rng = np.random.default_rng(0)
    slopes = np.add.outer(np.arange(24) * 700, np.arange(37) * 90)[..., None] * np.array([1, 2, 0.5])
    noise = rng.integers(0, 65536, (8, 37, 3))
    return np.concatenate([slopes, noise]).astype(np.uint16)


@pytest.fixture
def path(tmp_path, picture):
    cv2.imwrite(str(tmp_path / "a.png"), picture[..., ::-1])  # OpenCV takes blue, green, red
    return tmp_path / "a.png"


def test_reads_what_opencv_writes(path, picture):
    np.testing.assert_array_equal(read_png16(path, picture.shape[:2]), picture)


@pytest.mark.parametrize("kind", range(5))
def test_undoes_every_filter(tmp_path, kind):
    # The filters as the specification defines them, byte by byte, forward.
    pixels = np.random.default_rng(kind).integers(0, 256, (3, 4 * 6)).astype(int)
    padded = np.pad(pixels, ((1, 0), (6, 0)))
    left, above, corner = padded[1:, :-6], padded[:-1, 6:], padded[:-1, :-6]
    estimate = left + above - corner
    near = np.argmin([abs(estimate - x) for x in (left, above, corner)], axis=0)
    paeth = np.choose(near, [left, above, corner])
    predicted = [0 * left, left, above, (left + above) // 2, paeth][kind]
    rows = np.c_[np.full(3, kind), (pixels - predicted) % 256].astype(np.uint8)
    write_png(tmp_path / "a.png", struct.pack(">IIBBBBB", 4, 3, 16, 2, 0, 0, 0), rows.tobytes())
    expected = pixels.astype(np.uint8).tobytes()
    assert read_png16(tmp_path / "a.png", None).astype(">u2").tobytes() == expected


def write_png(path, header, content):
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(content)), (b"IEND", b"")]
    packed = [struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(packed))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda content: content[:-20], "one without its end"),
        (lambda content: content[:60] + bytes([content[60] ^ 1]) + content[61:], "a wrong checksum in chunk b'IDAT'"),
        (lambda content: b"GIF89a" + content[6:], "doesn't begin as one"),
        (lambda content: b"", "0 bytes"),
    ],
)
def test_damage_is_named(path, damage, message):
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(DataError, match=message):
        read_png16(path, None)


def test_another_format_is_named(path, tmp_path):
    Image.new("RGB", (3, 2)).save(tmp_path / "b.png")
    with pytest.raises(DataError, match="expected RGB with 16 bits a channel, not interlaced, found 8 bits"):
        read_png16(tmp_path / "b.png", None)
    with pytest.raises(DataError, match="expected 5 x 5 pixels, found 32 x 37 pixels"):
        read_png16(path, (5, 5))


def test_too_few_rows_and_unknown_filters_are_named(tmp_path):
    header = struct.pack(">IIBBBBB", 4, 3, 16, 2, 0, 0, 0)
    write_png(tmp_path / "a.png", header, bytes(2 * 25))
    with pytest.raises(DataError, match="expected 3 rows of 4 pixels, found 50 bytes"):
        read_png16(tmp_path / "a.png", None)
    write_png(tmp_path / "a.png", header, bytes([9, *bytes(24)]) * 3)
    with pytest.raises(DataError, match="a row filter 9"):
        read_png16(tmp_path / "a.png", None)
