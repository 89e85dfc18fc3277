"""Animations that play wherever a notebook is shown, without a kernel: animated PNGs, small enough to commit."""

import io
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import chain, pairwise

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.errors import ArgumentError

MAX_ANIMATION_BYTES = 600_000
"""The largest animation: readers download it with the notebook."""

SAMPLE = 200_000
"""The number of pixels, about, by which colours are chosen."""


@dataclass(frozen=True)
class Animation:
    """An animation to be shown as the last value of a cell.

    It is an animated PNG because a notebook's PNGs are shown everywhere. nbconvert leaves GIF and WebP out, and
    JupyterLab removes `<img src="data:...">` from a notebook that hasn't run on this machine. A program that can't play
    animations shows the first frame.

    Parameters
    ----------
    png : bytes
        The file; write it to disk as any PNG.
    alt : str
        What happens in it, for readers who can't see it.
    """

    png: bytes = field(repr=False)
    alt: str

    def _repr_png_(self) -> tuple[bytes, dict[str, str]]:
        """Hand the file and its alternative text to the notebook."""
        return self.png, {"alt": self.alt}


def animate(frames: Iterable[Figure | NDArray[np.uint8]], period: float, alt: str) -> Animation:
    """Make an animation that runs for ever.

    Parameters
    ----------
    frames : iterable of Figure or (h, w, 3) uint8
        All of one size. A generator may draw on one figure and yield it again and again; figures are closed.
    period : float
        Seconds from one frame to the next.
    alt : str
        What happens in it, for readers who can't see it.

    Returns
    -------
    Animation
        With at most 256 colours in all its frames together. The same frames give the same bytes.

    Raises
    ------
    ArgumentError
        When there are no frames, their sizes differ, or the file is larger than `MAX_ANIMATION_BYTES`.

    Examples
    --------
    >>> frames = [np.full((20, 30, 3), grey, np.uint8) for grey in (0, 100, 200)]
    >>> animate(frames, period=0.2, alt="a rectangle that turns from black to light grey")
    Animation(alt='a rectangle that turns from black to light grey')
    """
    pictures: list[Image.Image] = []
    for before, frame in pairwise(chain([None], frames)):
        held = frame is before and not getattr(frame, "stale", True)  # a figure in which nothing has changed
        pictures.append(pictures[-1] if held else _picture(frame))
    if not pictures or len(sizes := {picture.size for picture in pictures}) > 1:
        found = f"sizes {sorted(sizes)}" if pictures else "no frames"
        raise ArgumentError("frames", "at least one, all of one size", found)
    if not 0 < period < np.inf:
        raise ArgumentError("period", "seconds > 0", period)
    png = _animated_png(_with_common_palette(pictures), round(1000 * period))
    if len(png) > MAX_ANIMATION_BYTES:
        width, height = pictures[0].size
        found = f"{len(png) // 1000} kB for {len(pictures)} frames of {width} x {height} pixels"
        limit = f"at most {MAX_ANIMATION_BYTES // 1000} kB: show fewer frames, a smaller figure or less that changes"
        raise ArgumentError("frames", limit, found)
    return Animation(png, alt)


def _picture(frame: Figure | NDArray[np.uint8]) -> Image.Image:
    """Return a frame as it looks now."""
    if not isinstance(frame, Figure):
        return Image.fromarray(np.asarray(frame)).convert("RGB")
    # `savefig` would draw twice, and pack a PNG that is unpacked at once.
    canvas = FigureCanvasAgg(frame)
    canvas.draw()
    plt.close(frame)
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def _with_common_palette(pictures: list[Image.Image]) -> list[Image.Image]:
    """Give all pictures the same 256 colours, so that still parts keep their colour and are stored once.

    Which colours these are is decided on a small picture, in which each colour is about as frequent as in all frames.
    """
    codes = np.stack([np.asarray(picture) @ np.array([1 << 16, 1 << 8, 1]) for picture in pictures])
    counts = np.bincount(codes.ravel())
    colours = np.flatnonzero(counts)
    sample = np.repeat(colours, 1 + counts[colours] * SAMPLE // codes.size)
    pixels = np.stack([sample >> 16, sample >> 8 & 255, sample & 255], axis=-1).astype(np.uint8)
    reduced = Image.fromarray(pixels[None]).quantize(256, dither=Image.Dither.NONE, kmeans=5)
    index = np.zeros(len(counts), np.uint8)
    index[sample] = np.asarray(reduced)[0]
    return [_paletted(index[code], reduced) for code in codes]


def _paletted(indices: NDArray[np.uint8], like: Image.Image) -> Image.Image:
    """Return a picture of indices into the palette of another."""
    picture = Image.fromarray(indices)
    picture.putpalette(like.getpalette())
    return picture


def _animated_png(pictures: list[Image.Image], milliseconds: int) -> bytes:
    """Write the pictures into one file; each later one stores only the rectangle in which it differs."""
    stored = io.BytesIO()
    first, *others = pictures
    first.save(stored, "PNG", save_all=True, append_images=others, duration=milliseconds, loop=0, optimize=True)
    return stored.getvalue()
