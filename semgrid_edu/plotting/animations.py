"""Pictures of motion: animations that every notebook viewer plays, the velocity colour wheel, particles (3.2)."""

import io
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain, pairwise

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.offsetbox import AnnotationBbox, HPacker, OffsetImage, TextArea, VPacker
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.errors import ArgumentError, check_shape
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, Particles, State
from semgrid_edu.plotting.colours import (
    STATE_COLOURS,
    STATE_NAMES,
    WHEEL_SPEED,
    colour_legend,
    occupancy_colours,
    velocity_colours,
)
from semgrid_edu.plotting.grids import draw_map

MAX_ANIMATION_BYTES = 600_000
"""Maximum size of an animation, because readers download it with the notebook."""

SAMPLE = 200_000
"""Approximate number of pixels that determine the palette."""

MAX_POINTS = 10_000
"""Maximum number of particles in a picture, because more would only hide each other."""


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
    stored = io.BytesIO()
    first, *others = _with_common_palette(pictures)  # each frame stores only the rectangle that changed
    playing = {"save_all": True, "append_images": others, "duration": round(1000 * period), "loop": 0}
    first.save(stored, "PNG", optimize=True, **playing)
    png = stored.getvalue()
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


def velocity_wheel(
    spec: GridSpec, probability: NDArray, velocity: NDArray, ax: Axes | None = None, legend: bool = True
) -> Axes:
    """Draw an occupancy grid with DYNAMIC coloured by velocity.

    FREE, STATIC and UNKNOWN keep their colours. A hue shows the direction only roughly, and not every reader can
    distinguish all hues. To add arrows, call `velocity` with the same axes.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    probability : (4, H, W) float
        Probabilities of FREE, STATIC, DYNAMIC and UNKNOWN, which sum to 1 in each cell.
    velocity : (2, H, W) float
        Velocity over ground, along x and y of the grid frame, m/s; NaN where nothing moves.
    ax : Axes, optional
        Axes to draw into.
    legend : bool
        Whether to add a legend of the states and the wheel.

    Raises
    ------
    ArgumentError
        When an array doesn't fit `spec`.
    """
    ax = draw_map(spec, wheel_colours(spec, probability, velocity), ax)
    return _wheel_legend(ax) if legend else ax


def wheel_colours(spec: GridSpec, probability: NDArray, velocity: NDArray) -> NDArray[np.uint8]:
    """Colour a grid, with `velocity_colours` instead of the colour of DYNAMIC, (H, W, 3).

    Parameters are those of `velocity_wheel`.
    """
    check_shape("velocity", velocity, (2, *spec.shape))
    painted = occupancy_colours(probability)
    check_shape("probability", probability, (4, *spec.shape))
    change = velocity_colours(velocity).astype(float) - STATE_COLOURS[State.DYNAMIC]
    return np.clip(np.rint(painted + probability[State.DYNAMIC][..., None] * change), 0, 255).astype(np.uint8)


def particles(spec: GridSpec, particles: Particles, ax: Axes | None = None) -> Axes:
    """Add particles to a map: points coloured by velocity, with opacity by weight.

    Of more than `MAX_POINTS` particles, only every k-th is drawn. A line below the map gives the number drawn.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    particles : Particles
        Particles in the grid frame; particles outside the grid aren't drawn.
    ax : Axes, optional
        Axes with the drawn grid; by default a new, empty map.
    """
    ax = ax or draw_map(spec, np.full((*spec.shape, 3), 255, np.uint8))
    inside = np.flatnonzero(spec.cells(particles.position)[2])
    shown = inside[:: max(1, -(-len(inside) // MAX_POINTS))]
    weight = particles.weight[shown] / max(particles.weight[shown].max(initial=0), np.finfo(np.float32).tiny)
    colours = np.column_stack([velocity_colours(particles.velocity[shown].T) / 255, 0.15 + 0.85 * weight])
    ax.scatter(*particles.position[shown, ::-1].T, s=4, c=colours, linewidths=0, zorder=2)
    ax.set_xlabel(f"{ax.get_xlabel()}\n{len(shown):,} of {len(particles):,} particles")
    return ax


def animate_occupancy(
    spec: GridSpec, beliefs: Iterable[Belief], times: Iterable[float], alt: str, ax: Axes | None = None
) -> Animation:
    """Animate the pictures of `velocity_wheel` over a drive in real time, with the time as title.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    beliefs : iterable of Belief
        Beliefs, for example from `track_drive`; only their pictures stay in memory.
    times : iterable of float
        One time per belief, seconds, ascending; the title counts from the first.
    alt : str
        Description for readers who can't see the animation.
    ax : Axes, optional
        Axes to draw into. The whole figure becomes the animation.

    Returns
    -------
    Animation
        Displayed when it is the last value of a cell.

    Raises
    ------
    ArgumentError
        When there is no belief, the times don't match or aren't ascending, a belief doesn't fit `spec`, or the
        animation is too large.
    """
    pictures = [wheel_colours(spec, belief.probability, belief.velocity) for belief in beliefs]
    times = np.array(list(times), dtype=np.float64)
    if not pictures or len(times) != len(pictures) or not (np.diff(times) > 0).all():
        raise ArgumentError("times", f"one ascending time for each of {len(pictures)} beliefs, at least one", times)
    ax = _wheel_legend(draw_map(spec, pictures[0], ax))

    def frames() -> Iterator[Figure]:
        for picture, time in zip(pictures, times - times[0], strict=True):
            ax.images[-1].set_data(picture)
            ax.set_title(f"{time:.1f} s")
            yield ax.figure
            ax.figure.set_layout_engine("none")  # the layout is fixed, and computing it takes longer than drawing

    return animate(frames(), np.diff(times).mean() if len(times) > 1 else 1.0, alt)


def _wheel_legend(ax: Axes) -> Axes:
    """Add a legend of the states that keep their colours, and below it the wheel with its speeds."""
    still = [state for state in State if state != State.DYNAMIC]
    colour_legend(ax, [STATE_NAMES[s] for s in still], [STATE_COLOURS[s] for s in still])
    words = f"{STATE_NAMES[State.DYNAMIC]}, by velocity:", "ahead", "left", "back", "right"
    rings = f"ring {WHEEL_SPEED / 4:.0f} m/s\nrim {WHEEL_SPEED:.0f} m/s"
    name, ahead, left, back, right, speeds = (
        TextArea(text, textprops={"fontsize": "small"}) for text in (*words, rings)
    )
    middle = HPacker(children=[left, OffsetImage(wheel_picture(), zoom=0.55), right], align="center", pad=0, sep=3)
    box = VPacker(children=[name, ahead, middle, back, speeds], align="center", pad=0, sep=3)
    below = {"xybox": (8, -58), "boxcoords": "offset points", "box_alignment": (0, 1), "annotation_clip": False}
    ax.add_artist(AnnotationBbox(box, (1, 1), xycoords="axes fraction", frameon=False, **below))
    return ax


def wheel_picture() -> NDArray[np.uint8]:
    """Draw the velocity colour wheel, (101, 101, 4): RGB and opacity, which is 0 outside the wheel.

    Forward is up. The rim is full speed, the white ring a quarter of it.
    """
    across = np.linspace(1, -1, 101)
    forward, left = np.meshgrid(across, across, indexing="ij")
    radius = np.hypot(forward, left)
    picture = velocity_colours(WHEEL_SPEED * radius * np.stack([forward, left]))
    picture[np.abs(radius - 0.5) < 0.01] = 255
    return np.dstack([picture, np.where(radius <= 1, 255, 0).astype(np.uint8)])
