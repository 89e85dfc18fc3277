"""What `semgrid-edu demo --save` writes: every frame as arrays, maps of the whole drive, and an animation."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.errors import DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LabelSet
from semgrid_edu.occupancy import PlanarMotion, State
from semgrid_edu.pipeline import FrameResult
from semgrid_edu.plotting import STATE_COLOURS, STATE_NAMES
from semgrid_edu.storage.files import atomic_folder, sha256
from semgrid_edu.workshop.demo.record import ESTIMATES

OCCUPIED_PIXEL, FREE_PIXEL, UNSEEN_PIXEL = 0, 254, 205
"""Grey values of map.pgm, as `map_server` writes them."""

YAML = """\
image: map.pgm
resolution: {cell}
origin: [{x:.6f}, {y:.6f}, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
mode: trinary
"""
"""map.yaml. A pixel of 205 is occupied with (255 - 205) / 255 = 0.19608, just above `free_thresh`: unknown.

With a `free_thresh` of 0.25, which is common too, unknown would be read as free.
"""

LARGEST = 10**9
"""The most pixels of a map, which takes about 5 GB then: 40 km2 in cells of 0.2 m. More is a jump of the poses."""

ENLARGED = 3
"""Pixels of the animation along a side of a cell."""

FIRST_STATE = 200
"""The states' numbers in the animation's palette begin here, above those of the classes."""


class WorldMap(NamedTuple):
    """A map of a whole drive, fixed in the world; row 0 has the largest y, column 0 the smallest x.

    Parameters
    ----------
    pixels : (h, w) uint8
        `OCCUPIED_PIXEL`, `FREE_PIXEL` or `UNSEEN_PIXEL`.
    classes : (h, w) uint8
        The class of each pixel; 255 where `pixels` is unseen.
    origin : (float, float)
        x and y of the lower left corner of the lower left pixel in the world, metres.
    """

    pixels: NDArray[np.uint8]
    classes: NDArray[np.uint8]
    origin: tuple[float, float]


@contextmanager
def saved_drive(
    folder: str | Path,
    spec: GridSpec,
    label_set: LabelSet,
    weights: str | Path,
    numbers: Iterator[int],
    stages: str = "",
) -> Iterator[Callable[[FrameResult], None]]:
    """Collect the results of a drive, and write them to a folder when the block ends without an error.

    Parameters
    ----------
    folder : path-like
        The folder to write to, new or empty: frames.npz, map.pgm with map.yaml, classes.png and drive.gif.
    spec : GridSpec
        The grid of the results.
    label_set : LabelSet
        Their classes.
    weights : path-like
        The network's weights, which frames.npz names.
    numbers : iterator of int
        The number of each frame in the drive; one is taken with each result.
    stages : str
        The name of a student's file of stages that made the results.

    Yields
    ------
    callable
        Takes the result of the next frame; raises `DataError` when the map would have more than `LARGEST` pixels.
    """
    frames: list[dict[str, NDArray]] = []
    reached: list[NDArray] = []

    def take(result: FrameResult) -> None:
        number = np.int64(next(numbers))
        pose = PlanarMotion.from_poses(np.eye(4), result.frame.T_world_from_lidar)
        reached.append(pose.parent_from_child(_corners(spec)))
        rows, cols = _around(np.concatenate(reached), spec.cell).shape
        if rows * cols > LARGEST:
            found = f"{rows} x {cols} at frame {number}"
            raise DataError(folder, f"poses of a map of at most {LARGEST:,} pixels", found)
        frames.append(frame_arrays(result) | {"frame": number})

    yield take
    arrays = {name: np.stack([frame.pop(name) for frame in frames]) for name in [*frames[0]]}
    place = world_map(arrays["occupancy"], arrays["refined"], arrays["T_world_from_lidar"], spec)
    with atomic_folder(folder) as temporary:
        np.savez_compressed(temporary / "frames.npz", **arrays, **_about(spec, label_set, weights, stages))
        Image.fromarray(place.pixels).save(temporary / "map.pgm")
        x, y = place.origin
        (temporary / "map.yaml").write_text(YAML.format(cell=float(spec.cell), x=x, y=y), encoding="utf-8")
        _with_palette(place.classes, label_set).save(temporary / "classes.png")
        _save_animation(arrays, label_set, temporary / "drive.gif")


def frame_arrays(result: FrameResult) -> dict[str, NDArray]:
    """Return what frames.npz holds of one frame.

    Probabilities and velocities are rounded to 16 bits, in steps of at most 0.0005 (and 0.016 m/s up to 32 m/s). Of the
    C probabilities of a cell only the largest is kept: all of them would take four times as much space.

    Parameters
    ----------
    result : FrameResult
        The frame's result.

    Returns
    -------
    dict of str to array
        `occupancy` (4, H, W); `velocity` (2, H, W), m/s; for each semantic grid the class numbers `grid` (H, W) uint8
        and `grid_probability` (H, W), also for `refined` and with memory `remembered`; `T_world_from_lidar` (4, 4);
        `time`, seconds.
    """
    frame = result.frame
    belief = result.belief
    arrays = {"occupancy": belief.probability.astype(np.float16), "velocity": belief.velocity.astype(np.float16)}
    for name in ESTIMATES:
        if (grid := getattr(result, name)) is not None:
            arrays[name] = grid.argmax(axis=0).astype(np.uint8)
            arrays[f"{name}_probability"] = grid.max(axis=0).astype(np.float16)
    return arrays | {"T_world_from_lidar": frame.T_world_from_lidar, "time": np.float64(frame.time)}


def _about(spec: GridSpec, label_set: LabelSet, weights: str | Path, stages: str) -> dict[str, object]:
    """Return what frames.npz says of all frames."""
    weights = Path(weights).resolve()
    return {
        "class_names": label_set.names,
        "class_colours": np.array(label_set.rgb, np.uint8),
        "state_names": STATE_NAMES,
        "extent": [spec.x_min, spec.x_max, spec.y_min, spec.y_max],
        "cell": spec.cell,
        "network": f"{weights.parent.name}/{weights.name}",
        "network_sha256": sha256(weights),
        "stages": stages,
    }


def world_map(occupancy: NDArray, classes: NDArray, T_world_from_lidar: NDArray, spec: GridSpec) -> WorldMap:
    """Draw the grids of a drive into one map of the world.

    The last frame that knows whether a place is FREE or STATIC decides. The filter's belief already sums the evidence
    of all scans, so adding up beliefs would count a scan many times. Where anything was ever DYNAMIC, nothing is drawn
    as occupied, because parts of moving things pass for STATIC at first sight: such a pixel is free or unseen.

    Parameters
    ----------
    occupancy : (N, 4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN in each cell of N frames.
    classes : (N, H, W) uint8
        The class of each cell.
    T_world_from_lidar : (N, 4, 4) float
        Poses of the LIDAR, metres; height, pitch and roll are left out.
    spec : GridSpec
        The grid of the frames. A pixel of the map has the size of its cells.

    Returns
    -------
    WorldMap
        The map, one pixel larger on each side than all grids together.
    """
    poses = [PlanarMotion.from_poses(np.eye(4), T) for T in T_world_from_lidar]
    corners = np.array([pose.parent_from_child(_corners(spec)) for pose in poses])
    world = _around(corners.reshape(-1, 2), spec.cell)
    height, width = world.shape
    x = world.x_max - (np.arange(height) + 0.5) * world.cell
    y = world.y_max - (np.arange(width) + 0.5) * world.cell
    pixels = np.full(world.shape, UNSEEN_PIXEL, np.uint8)
    drawn = np.full(world.shape, IGNORE, np.uint8)
    moved = np.zeros(world.shape, bool)
    for probability, labels, pose, its_corners in zip(occupancy, classes, poses, corners, strict=True):
        window = _window(world, its_corners)
        centers = np.stack(np.meshgrid(x[window[0]], y[window[1]], indexing="ij"), axis=-1)
        rows, cols, inside = spec.cells(pose.child_from_parent(centers).reshape(-1, 2))
        state = np.where(inside, probability.argmax(axis=0)[rows, cols], State.UNKNOWN).reshape(pixels[window].shape)
        known = (state == State.FREE) | (state == State.STATIC)
        pixels[window][known] = np.where(state == State.FREE, FREE_PIXEL, OCCUPIED_PIXEL)[known]
        drawn[window][known] = labels[rows, cols].reshape(known.shape)[known]
        moved[window] |= state == State.DYNAMIC
    wiped = moved & (pixels == OCCUPIED_PIXEL)
    pixels[wiped] = UNSEEN_PIXEL
    drawn[wiped] = IGNORE
    return WorldMap(pixels[::-1].T, drawn[::-1].T, (world.x_min, world.y_min))


def _corners(spec: GridSpec) -> NDArray:
    return np.array([[x, y] for x in (spec.x_min, spec.x_max) for y in (spec.y_min, spec.y_max)])


def _around(points: NDArray, cell: float) -> GridSpec:
    """Return a grid of the world, with borders at multiples of the cell, that reaches beyond all points."""
    low = np.floor(points.min(axis=0) / cell) - 1
    high = np.ceil(points.max(axis=0) / cell) + 1
    (x_min, x_max), (y_min, y_max) = (np.stack([low, high]) * cell).T.tolist()
    return GridSpec(x_min, x_max, y_min, y_max, cell)


def _window(world: GridSpec, corners: NDArray) -> tuple[slice, slice]:
    """Return the part of the world's rows and columns that a grid with these corners covers."""
    rows, cols, _ = world.cells(corners)
    return slice(rows.min(), rows.max() + 1), slice(cols.min(), cols.max() + 1)


def _with_palette(numbers: NDArray[np.uint8], label_set: LabelSet) -> Image.Image:
    """Return a picture whose pixels are the numbers of classes (or states, from `FIRST_STATE`); 255 is white."""
    palette = label_set.colours(np.arange(256))
    palette[FIRST_STATE : FIRST_STATE + len(STATE_COLOURS)] = STATE_COLOURS
    image = Image.fromarray(np.ascontiguousarray(numbers))
    image.putpalette(palette.tobytes())
    return image


def _save_animation(arrays: dict[str, NDArray], label_set: LabelSet, path: Path) -> None:
    """Draw the most probable states and, to their right, the refined classes, forward up, as fast as it was."""
    states = FIRST_STATE + arrays["occupancy"].argmax(axis=1).astype(np.uint8)
    gap = np.full_like(states[:, :, :4], IGNORE)
    both = np.concatenate([states, gap, arrays["refined"]], axis=2)
    large = both.repeat(ENLARGED, axis=1).repeat(ENLARGED, axis=2)
    first, *others = (_with_palette(frame, label_set) for frame in large)
    first.save(path, save_all=True, append_images=others, duration=_milliseconds(arrays["time"]), loop=0)


def _milliseconds(times: Sequence[float]) -> int:
    """Return how long each frame of a GIF is shown; players slow down what is faster than 20 ms."""
    return max(20, round(1000 * float(np.median(np.diff(times))))) if len(times) > 1 else 1000
