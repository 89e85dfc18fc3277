"""What moves: velocity as a colour wheel, particles, spread of velocity, occupancy over a drive (section 3.2)."""

from collections.abc import Iterable, Iterator

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.offsetbox import AnnotationBbox, HPacker, OffsetImage, TextArea, VPacker
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, Particles, State
from semgrid_edu.plotting.animations import Animation, animate
from semgrid_edu.plotting.colours import (
    STATE_COLOURS,
    STATE_NAMES,
    WHEEL_SPEED,
    occupancy_colours,
    velocity_colours,
)
from semgrid_edu.plotting.grids import draw_map
from semgrid_edu.plotting.legends import colour_legend

MAX_POINTS = 10_000
"""The most particles in a picture: more would only hide each other."""


def velocity_wheel(
    spec: GridSpec, probability: NDArray, velocity: NDArray, ax: Axes | None = None, legend: bool = True
) -> Axes:
    """Draw an occupancy grid in which what moves has the colour of its velocity.

    FREE, STATIC and UNKNOWN keep their colours. A hue says which way, roughly: `velocity`, called on the same
    axes, adds arrows, which readers who don't tell all hues apart need.

    Parameters
    ----------
    spec : GridSpec
    probability : (4, H, W) float
        FREE, STATIC, DYNAMIC, UNKNOWN; sums to 1 in each cell.
    velocity : (2, H, W) float
        Metres a second over ground, along x and y of the grid frame; NaN where nothing moves.
    ax : Axes, optional
        Where to draw; a new figure when left out.
    legend : bool
        Whether to name the states and to show the wheel.

    Returns
    -------
    Axes

    Raises
    ------
    ArgumentError
        When an array doesn't fit `spec`.
    """
    ax = draw_map(spec, wheel_colours(spec, probability, velocity), ax)
    return _wheel_legend(ax) if legend else ax


def wheel_colours(spec: GridSpec, probability: NDArray, velocity: NDArray) -> NDArray[np.uint8]:
    """Paint an occupancy grid with the colours of `velocity_colours` in place of DYNAMIC's.

    Parameters and errors are those of `velocity_wheel`.

    Returns
    -------
    (H, W, 3) uint8
    """
    if np.shape(velocity) != (2, *spec.shape):
        raise ArgumentError("velocity", f"shape {(2, *spec.shape)}", f"shape {np.shape(velocity)}")
    painted = occupancy_colours(probability)
    if painted.shape[:2] != spec.shape:
        raise ArgumentError("probability", f"shape {(4, *spec.shape)}", f"shape {np.shape(probability)}")
    change = velocity_colours(velocity).astype(float) - STATE_COLOURS[State.DYNAMIC]
    return np.clip(np.rint(painted + probability[State.DYNAMIC][..., None] * change), 0, 255).astype(np.uint8)


def particles(spec: GridSpec, particles: Particles, ax: Axes | None = None) -> Axes:
    """Add particles to a map: each a point with the colour of its velocity, the denser the more it carries.

    Of more than `MAX_POINTS` every k-th is drawn. A second line below the map says how many are.

    Parameters
    ----------
    spec : GridSpec
    particles : Particles
        In the frame of the grid; those outside aren't drawn.
    ax : Axes, optional
        With the grid drawn; a new, empty map when left out.

    Returns
    -------
    Axes
    """
    if ax is None:
        ax = draw_map(spec, np.full((*spec.shape, 3), 255, np.uint8))
    inside = np.flatnonzero(spec.cells(particles.position)[2])
    shown = inside[:: max(1, -(-len(inside) // MAX_POINTS))]
    weight = particles.weight[shown] / max(particles.weight[shown].max(initial=0), np.finfo(np.float32).tiny)
    colours = np.column_stack([velocity_colours(particles.velocity[shown].T) / 255, 0.15 + 0.85 * weight])
    ax.scatter(*particles.position[shown, ::-1].T, s=4, c=colours, linewidths=0, zorder=2)
    ax.set_xlabel(f"{ax.get_xlabel()}\n{len(shown):,} of {len(particles):,} particles")
    return ax


def velocity_spread(velocity: NDArray, weight: NDArray, ax: Axes | None = None) -> Axes:
    """Draw a distribution over velocities, as of one cell's particles or lattice: points, mean, ellipse.

    The area of a point is its weight. A cross marks the mean, and the ellipse is two standard deviations wide.

    Parameters
    ----------
    velocity : (N, 2) float
        Forward and to the left, m/s.
    weight : (N,) float
        Not negative, not all zero; they need not sum to 1.
    ax : Axes, optional
        Where to draw; a new figure when left out.

    Returns
    -------
    Axes

    Raises
    ------
    ArgumentError
        When the shapes don't match, a velocity isn't finite, or the weights can't be any.
    """
    velocity, weight = np.asarray(velocity, dtype=np.float64), np.asarray(weight, dtype=np.float64)
    if velocity.shape != (*weight.shape, 2) or weight.ndim != 1:
        raise ArgumentError("velocity", f"(N, 2) for weights of shape {weight.shape}", f"shape {velocity.shape}")
    if not (weight >= 0).all() or not 0 < weight.sum() < np.inf:
        raise ArgumentError("weight", "finite numbers >= 0, not all zero", weight)
    if not np.isfinite(velocity).all():
        raise ArgumentError("velocity", "finite numbers", velocity)
    if ax is None:
        _, ax = plt.subplots(figsize=(4, 4), layout="constrained")
    share = weight / weight.sum()
    area = 150 * min(1, 60 / len(share)) * share / share.max()
    ax.scatter(*velocity[:, ::-1].T, s=area, c=velocity_colours(velocity.T) / 255, alpha=0.7, linewidths=0)
    mean = share @ velocity
    away = velocity - mean
    velocity_ellipse(mean, np.einsum("n,ni,nj->ij", share, away, away), ax)
    ax.set(xlabel="velocity to the left [m/s]", ylabel="velocity forward [m/s]", aspect="equal")
    if not ax.xaxis_inverted():
        ax.invert_xaxis()
    return ax


def velocity_ellipse(mean: NDArray, covariance: NDArray, ax: Axes) -> Axes:
    """Mark a mean velocity with a cross, and its uncertainty with an ellipse of two standard deviations.

    Parameters
    ----------
    mean : (2,) float
        Forward and to the left, m/s.
    covariance : (2, 2) float
        m^2/s^2.
    ax : Axes
        Left across, forward upwards, as `velocity_spread` makes them.

    Returns
    -------
    Axes

    Raises
    ------
    ArgumentError
        When the covariance isn't one.
    """
    covariance = np.asarray(covariance, dtype=np.float64)
    variance, axes = np.linalg.eigh(covariance) if covariance.shape == (2, 2) else ([np.nan], None)
    rounding = 1e-5 * (np.sum(np.square(mean)) + np.max(variance))  # E[v v^T] - mean mean^T in single precision
    if np.shape(mean) != (2,) or not np.all(np.array(variance) >= -rounding):
        raise ArgumentError("covariance", "(2, 2), symmetric, not negative, beside a mean (2,)", covariance)
    long, short = 4 * np.sqrt(np.maximum(variance[::-1], 0))
    angle = np.degrees(np.arctan2(axes[0, 1], axes[1, 1]))
    ax.add_patch(Ellipse((mean[1], mean[0]), long, short, angle=angle, fill=False, edgecolor="0.2", linewidth=1.2))
    ax.plot(mean[1], mean[0], "+", color="0.2", markersize=9)
    return ax


def animate_occupancy(
    spec: GridSpec, beliefs: Iterable[Belief], times: Iterable[float], alt: str, ax: Axes | None = None
) -> Animation:
    """Animate the pictures of `velocity_wheel` over a drive, with the time as title, as fast as it went.

    Parameters
    ----------
    spec : GridSpec
    beliefs : iterable of Belief
        Such as what `track_drive` yields; only their pictures are kept.
    times : iterable of float
        One per belief, ascending, seconds; the title counts from the first.
    alt : str
        What happens in it, for readers who can't see it.
    ax : Axes, optional
        Where to draw; a new figure when left out. The whole figure becomes the animation.

    Returns
    -------
    Animation
        Leave it as the last value of a cell to show it.

    Raises
    ------
    ArgumentError
        When there is no belief, times don't match or don't ascend, a belief doesn't fit `spec`, or the animation
        gets too large.
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

    return animate(frames(), np.diff(times).mean() if len(times) > 1 else 1.0, alt)


def _wheel_legend(ax: Axes) -> Axes:
    """Name the states that stay, and show the wheel below them, with its speeds."""
    still = [state for state in State if state != State.DYNAMIC]
    colour_legend(ax, [STATE_NAMES[s] for s in still], [STATE_COLOURS[s] for s in still])
    ahead, left, back, right, speeds = (
        TextArea(text, textprops={"fontsize": "small"})
        for text in ("ahead", "left", "back", "right", f"ring {WHEEL_SPEED / 4:.0f} m/s\nrim {WHEEL_SPEED:.0f} m/s")
    )
    middle = HPacker(children=[left, OffsetImage(wheel_picture(), zoom=0.55), right], align="center", pad=0, sep=3)
    box = VPacker(children=[ahead, middle, back, speeds], align="center", pad=0, sep=3)
    below = {"xybox": (8, -58), "boxcoords": "offset points", "box_alignment": (0, 1), "annotation_clip": False}
    ax.add_artist(AnnotationBbox(box, (1, 1), xycoords="axes fraction", frameon=False, **below))
    return ax


def wheel_picture() -> NDArray[np.uint8]:
    """Paint the wheel, (101, 101, 4) with forward up: full speed on its rim, a quarter of it on the white ring."""
    across = np.linspace(1, -1, 101)
    forward, left = np.meshgrid(across, across, indexing="ij")
    radius = np.hypot(forward, left)
    picture = velocity_colours(WHEEL_SPEED * radius * np.stack([forward, left]))
    picture[np.abs(radius - 0.5) < 0.01] = 255
    return np.dstack([picture, np.where(radius <= 1, 255, 0).astype(np.uint8)])
