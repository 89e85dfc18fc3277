"""The figures in a notebook's outputs: how large they are, their resolution, and their alternative texts."""

import base64
import io
from collections.abc import Iterator

import numpy as np
from nbformat import NotebookNode
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import uniform_filter

PNG = "image/png"
"""How matplotlib's figures are stored, and our animations too (animated PNG)."""

JUST_NOTICEABLE = 2.3
"""The distance in CIELAB at which most people begin to tell two colours apart (Mahy et al., 1994)."""

LARGEST_SHIFT = 10.0
"""How far the mean colour of 3 x 3 pixels may move in CIELAB, so that even a small marker keeps its colour."""


def figures(cell: NotebookNode) -> Iterator[NotebookNode]:
    """Yield the outputs of a cell that have an image among their data.

    Parameters
    ----------
    cell : NotebookNode
        A cell of an executed notebook.
    """
    for output in cell.get("outputs", []):
        if any(kind.startswith("image/") for kind in output.get("data", {})):
            yield output


def alternative_text(cell: NotebookNode, figure: NotebookNode) -> str:
    """Return the alternative text of a figure; "" when it has none.

    Parameters
    ----------
    cell : NotebookNode
        The code cell that draws the figure. The text is the entry `alt` of its metadata, as in nbconvert.
    figure : NotebookNode
        One of the cell's outputs. It may have a text itself, as animations do.
    """
    texts = [about.get("alt") for about in figure.metadata.values() if isinstance(about, dict)]
    return next(filter(None, texts), None) or cell.metadata.get("alt", "")


def resolution(png: bytes) -> int | None:
    """Return the dots per inch in a PNG's metadata, along its x axis; None when there are none or it is animated.

    Matplotlib writes them into every figure. Other pictures have no size in inches, and the size of an animation is
    limited in bytes instead.

    Parameters
    ----------
    png : bytes
        A PNG file.
    """
    with Image.open(io.BytesIO(png)) as image:
        dots = image.info.get("dpi")
    return round(dots[0]) if dots and not moves(png) else None


def moves(png: bytes) -> bool:
    """Return whether a PNG has more than one frame.

    Parameters
    ----------
    png : bytes
        A PNG file.
    """
    with Image.open(io.BytesIO(png)) as image:
        return getattr(image, "n_frames", 1) > 1


def finish_figures(cell: NotebookNode) -> None:
    """Make the PNGs in a cell's outputs smaller, and store the alternative texts with the figures.

    Parameters
    ----------
    cell : NotebookNode
        A code cell that has run; changed in place. The texts go into the metadata of the outputs, where nbconvert's
        classic template reads them.
    """
    for figure in figures(cell):
        if PNG in figure.data:
            figure.data[PNG] = base64.b64encode(palette_png(png_bytes(figure))).decode()
        if text := alternative_text(cell, figure):
            for kind in figure.data:
                if kind.startswith("image/"):
                    figure.metadata.setdefault(kind, NotebookNode())["alt"] = text


def png_bytes(figure: NotebookNode) -> bytes:
    """Return the PNG file in an output.

    Parameters
    ----------
    figure : NotebookNode
        An output with a PNG among its data.
    """
    return base64.b64decode(figure.data[PNG])


def palette_png(png: bytes) -> bytes:
    """Reduce a PNG to at most 256 colours, which makes it about half as large, when the eye can't tell the difference.

    Parameters
    ----------
    png : bytes
        A PNG file.

    Returns
    -------
    bytes
        A PNG of 256 colours when the colours of 99 % of the pixels move by less than `JUST_NOTICEABLE`, and the mean
        of 3 x 3 pixels moves by less than `LARGEST_SHIFT` everywhere. Otherwise, as for photographs, it keeps its
        colours. Its dots per inch stay. Animations and transparent pictures are returned as they are. The result
        depends on the bytes of the file alone.
    """
    with Image.open(io.BytesIO(png)) as image:
        if moves(png) or image.convert("RGBA").getextrema()[3][0] < 255:
            return png
        exact = image.convert("RGB")
        reduced = exact.quantize(256, dither=Image.Dither.NONE, kmeans=5)
        looks_the_same = _looks_the_same(np.asarray(exact), np.asarray(reduced.convert("RGB")))
        stored = io.BytesIO()
        size = {"dpi": image.info["dpi"]} if "dpi" in image.info else {}
        (reduced if looks_the_same else exact).save(stored, "PNG", optimize=True, **size)
    return min(png, stored.getvalue(), key=len)


def _looks_the_same(first: NDArray[np.uint8], second: NDArray[np.uint8]) -> bool:
    """Compare two pictures, (h, w, 3), by how far colours move: pixel by pixel, and over 3 x 3 pixels."""
    shift = cielab(first) - cielab(second)
    around = uniform_filter(shift, (3, 3, 0))
    far = np.percentile(np.linalg.norm(shift, axis=-1), 99)
    return bool(far < JUST_NOTICEABLE and np.linalg.norm(around, axis=-1).max() < LARGEST_SHIFT)


def cielab(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Turn sRGB into CIELAB (white point D65), in which distances are about as large as they look.

    Parameters
    ----------
    rgb : (..., 3) uint8
        Red, green and blue, 0..255.

    Returns
    -------
    (..., 3) float32
        Lightness 0..100, green to red, blue to yellow.
    """
    gamma = rgb.astype(np.float32) / 255
    linear = np.where(gamma <= 0.04045, gamma / 12.92, ((gamma + 0.055) / 1.055) ** 2.4)
    to_xyz = np.float32([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = linear @ to_xyz.T / to_xyz.sum(axis=1)
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / 3 / (6 / 29) ** 2 + 4 / 29)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)
