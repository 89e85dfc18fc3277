"""RGB images of 16 bits a channel: what OpenCV writes is read to the bit, and damage is named."""

import cv2
import numpy as np
import pytest
from PIL import Image

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_png


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
    np.testing.assert_array_equal(read_png(path, "RGB;16", picture.shape[:2]), picture)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda content: content[:-20], "Truncated File Read"),
        (lambda content: content[:-3], "one without its end"),
        (lambda content: content[:60] + bytes([content[60] ^ 1]) + content[61:], "broken PNG file"),
        (lambda content: b"GIF89a" + content[6:], "cannot identify image file"),
        (lambda content: b"", "0 bytes"),
    ],
)
def test_damage_is_named(path, damage, message):
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(DataError, match=message):
        read_png(path, "RGB;16", None)


def test_another_format_is_named(path, tmp_path):
    Image.new("RGB", (3, 2)).save(tmp_path / "b.png")
    with pytest.raises(DataError, match="expected RGB;16, found RGB of 2 x 3 pixels"):
        read_png(tmp_path / "b.png", "RGB;16", None)
    with pytest.raises(DataError, match="expected RGB, found RGB;16 of 32 x 37 pixels"):
        read_png(path, "RGB", None)
    with pytest.raises(DataError, match="expected RGB;16 of 5 x 5 pixels, found RGB;16 of 32 x 37 pixels"):
        read_png(path, "RGB;16", (5, 5))
