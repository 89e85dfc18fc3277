"""Animations that play in every notebook viewer without a kernel: animated PNGs, small enough to commit."""

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
"""Maximum size of an animation, because readers download it with the notebook."""

SAMPLE = 200_000
"""Approximate number of pixels that determine the palette."""


@dataclass(frozen=True)
class Animation:
    """An animation, displayed when it is the last value of a cell.

    It is an animated PNG because every notebook viewer shows PNGs. nbconvert drops GIF and WebP, and JupyterLab removes
    `<img src="data:...">` from untrusted notebooks. A viewer without animation support shows the first frame.

    Parameters
    ----------
    png : bytes
        Content of the PNG file.
    alt : str
        Description for readers who can't see the animation.
    """

    png: bytes = field(repr=False)
    alt: str

    def _repr_png_(self) -> tuple[bytes, dict[str, str]]:
        """Return the file and its alternative text for the notebook."""
        return self.png, {"alt": self.alt}


def animate(frames: Iterable[Figure | NDArray[np.uint8]], period: float, alt: str) -> Animation:
    """Make an animation that loops forever.

    Parameters
    ----------
    frames : iterable of Figure or (h, w, 3) uint8
        Frames of equal size. A generator may redraw and yield the same figure; figures are closed.
    period : float
        Seconds between frames.
    alt : str
        Description for readers who can't see the animation.

    Returns
    -------
    Animation
        With at most 256 colours over all frames. The same frames give the same bytes.

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
        held = frame is before and not getattr(frame, "stale", True)  # the same figure, unchanged
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
    """Render the current state of a frame."""
    if not isinstance(frame, Figure):
        return Image.fromarray(np.asarray(frame)).convert("RGB")
    # `savefig` would draw twice, and encode a PNG only to decode it again.
    canvas = FigureCanvasAgg(frame)
    canvas.draw()
    plt.close(frame)
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def _with_common_palette(pictures: list[Image.Image]) -> list[Image.Image]:
    """Quantise all pictures to one palette of 256 colours, so that static parts don't flicker and are stored once.

    The palette comes from a small sample in which each colour is about as frequent as in all frames.
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
    """Return a picture from indices into the palette of another picture."""
    picture = Image.fromarray(indices)
    picture.putpalette(like.getpalette())
    return picture


def _animated_png(pictures: list[Image.Image], milliseconds: int) -> bytes:
    """Encode the pictures as one file; each frame stores only the rectangle that changed."""
    stored = io.BytesIO()
    first, *others = pictures
    first.save(stored, "PNG", save_all=True, append_images=others, duration=milliseconds, loop=0, optimize=True)
    return stored.getvalue()
