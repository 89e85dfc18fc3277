"""Every check on real drives and on the shipped drive: numbers only, never a picture (section 4).

In the folder notebooks, `python -m worlds.lecture_13_real_drive ../docs/results/real_drive.json FIRST SECOND` measures
two stretches of a drive of KITTI.
"""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
import typer
from numpy.typing import NDArray

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.samples import sample_drive, sample_image_stage, sample_weights
from semgrid_edu.errors import DataError
from semgrid_edu.frame import Frame, resize_image
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import load_net
from semgrid_edu.occupancy import Belief, State
from semgrid_edu.pipeline import run_pipeline
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table
from worlds import lecture_13_checks as checks
from worlds import lecture_13_domain as domain
from worlds.lecture_04_scenes import hit_cells
from worlds.lecture_13_faults import FAULTS, drive_readings

EVERY = 4
"""Images, ground and networks are measured in each frame of this number."""
SETTLED = 10
"""Number of frames after which grids count: by then the filter has seen a second."""

Boxes = dict[int, list[list[float]]]
"""Boxes of moving cars by frame, each [x_min, x_max, y_min, y_max], metres in the grid frame."""


def compare_drives(roots: Sequence[Path], date: str, drive: str) -> dict[str, object]:
    """Put the shipped drive and real ones through every check, and return the numbers of each.

    Parameters
    ----------
    roots : sequence of Path
        Folders that hold the dates; each may have another stretch of the drive, and `moving_cars_DRIVE.json` with the
        boxes of cars that move, for `read_boxes`.
    date, drive : str
        Such as "2011_09_26" and "0013".

    Returns
    -------
    dict
        What `measure_drive` and `drive_readings` return for each drive, by name, and how it was made; JSON can hold it.
    """
    began = perf_counter()
    known = domain.mean_histograms(domain.training_images())
    drives = {"sample": (sample_drive(), sample_boxes(sample_drive()))}
    for number, root in enumerate(roots, 1):
        boxes = read_boxes(root / f"moving_cars_{drive}.json")
        drives[f"stretch {number}"] = KittiRawDrive(root, date, drive), boxes
    command = f"python -m worlds.lecture_13_real_drive OUT{' FOLDER' * len(roots)} --date {date} --drive {drive}"
    return {
        "drives": {name: measure_drive(*one) for name, one in drives.items()},
        "faults": {
            name: {fault: drive_readings(make(one[:]), known) for fault, make in FAULTS.items()}
            for name, (one, _) in drives.items()
        },
        "training images": _among_training_images(),
        "drive": f"{date}_drive_{drive}",
        "seed": 0,
        "minutes": round((perf_counter() - began) / 60, 1),
        **made_by(command, "numpy", "scipy", "torch", "numba"),
    }


def measure_drive(drive: KittiRawDrive, boxes: Boxes) -> dict[str, object]:
    """Put one drive through every check.

    Parameters
    ----------
    drive : KittiRawDrive
        More than ten frames with images.
    boxes : dict of int to list
        Boxes of moving cars by frame; may be empty.

    Returns
    -------
    dict
        Numbers of the drive, of its ground, motion, images, networks and grids; JSON can hold it.
    """
    frames = drive[:]
    net = load_net(sample_image_stage(), drive.camera)
    scanned = checks.with_scan(frames)
    positions = np.array([frame.T_world_from_lidar[:3, 3] for frame in frames])
    planes = [checks.ground_plane(frame.points, frame.camera.lidar_height) for frame in scanned[::EVERY]]
    images = [resize_image(frame.need_image(), net.architecture.image_size) for frame in frames[::EVERY]]
    return {
        "frames": len(frames),
        "problems": len(drive.problems()),
        "seconds": frames[-1].time - frames[0].time,
        "step ms": 1000 * float(np.median(np.diff([frame.time for frame in frames]))),
        "delay ms": {name: 1000 * float(np.median(late)) for name, late in checks.sensor_delays(drive).items()},
        "metres": float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum()),
        "returns": float(np.mean([len(frame.points) for frame in scanned])),
        "on image": float(np.mean([checks.share_on_image(frame.points, frame.camera) for frame in scanned])),
        "ground": dict(zip(("height", "pitch", "roll"), np.mean(planes, axis=0).tolist(), strict=True)),
        "axes": checks.axes_errors(scanned),
        "images": domain.distances(images, domain.training_images()) | _statistics(images),
        "image network": domain.network_numbers(net, scanned[::EVERY]),
        "image network, colours matched": domain.network_numbers(net, scanned[::EVERY], matched=True),
        "grids": _grid_numbers(frames, boxes),
    }


def _grid_numbers(frames: Sequence[Frame], boxes: Boxes) -> dict[str, object]:
    """Run the pipeline with the shipped network, and measure its grids without any truth but the boxes.

    "states" are shares of the cells by their most likely state; "confidence" and "entropy" are those of the semantic
    grid; "moving cells" is how many cells of moving cars were hit, and "found" the share of them called DYNAMIC.
    """
    net = load_net(sample_weights(), frames[0].camera)
    states = []
    semantic = []
    found = []
    for k, result in enumerate(run_pipeline(frames, net)):
        if k >= SETTLED:
            likely = result.belief.probability.argmax(axis=0)
            states.append(np.bincount(likely.ravel(), minlength=len(State)) / likely.size)
            semantic.append([result.grid.max(axis=0).mean(), domain.normalised_entropy(result.grid).mean()])
            found.append(moving_hits(result.frame, result.belief, boxes.get(k, []), net.architecture.grid))
    found = np.concatenate(found)
    return {
        "states": dict(zip((state.name for state in State), np.mean(states, axis=0).tolist(), strict=True)),
        **dict(zip(("confidence", "entropy"), np.mean(semantic, axis=0).tolist(), strict=True)),
        "moving cells": len(found),
        "found": float(found.mean()) if len(found) else None,
    }


def _among_training_images() -> dict[str, object]:
    """Return how far each shipped training image is from the others, largest distance last, and their statistics."""
    images = domain.training_images()
    each = [domain.distances([images[k]], images[:k] + images[k + 1 :]) for k in range(len(images))]
    return {name: sorted(one[name] for one in each) for name in each[0]} | _statistics(images)


def _statistics(images: Sequence[NDArray]) -> dict[str, float]:
    return {name: float(mean) for name, mean in domain.mean_over(images, domain.image_statistics).items()}


def real_drive_table(result: dict) -> str:
    """Return the numbers of all drives as a Markdown table.

    Parameters
    ----------
    result : dict
        From `compare_drives`, or from the JSON file that it was written to.
    """
    columns = [dict(_flat(one)) for one in result["drives"].values()]
    rows = [[key, *("-" if one[key] is None else f"{one[key]:.4g}" for one in columns)] for key in columns[0]]
    return markdown_table([["", *result["drives"]], *rows])


def _flat(numbers: dict, before: str = "") -> Iterator[tuple[str, float | None]]:
    """Yield every number with its whole name, such as "ground: height"."""
    for key, value in numbers.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{key}: ")
        else:
            yield before + key, value


def read_boxes(path: Path) -> Boxes:
    """Read boxes of moving cars; there are none when there is no such file.

    Parameters
    ----------
    path : Path
        JSON: for each name that begins with "car" the boxes by frame, [x_min, x_max, y_min, y_max, ...], metres.

    Raises
    ------
    DataError
        When the file holds something else.
    """
    cars = read_json(path) if path.exists() else {}
    boxes: Boxes = {}
    try:
        for name, by_frame in cars.items():
            for frame, box in by_frame.items() if name.startswith("car") else ():
                x_min, x_max, y_min, y_max = map(float, box[:4])
                boxes.setdefault(int(frame), []).append([x_min, x_max, y_min, y_max])
    except (AttributeError, TypeError, ValueError) as error:
        raise DataError(path, "boxes of moving cars by frame, four metres each", error) from error
    return boxes


def sample_boxes(drive: KittiRawDrive) -> Boxes:
    """Return the boxes of the cars that move, as a simulated drive knows them.

    Parameters
    ----------
    drive : KittiRawDrive
        A simulated drive whose cars drive along the road.
    """
    known = read_json(drive.folder / "labels" / "objects.json")
    boxes: Boxes = {}
    for frame, things in known.items():
        for thing in things:
            if thing["moving"] and thing["class"] == "car":
                (x, y, _) = thing["centre"]
                (length, width, _) = thing["size"]
                boxes.setdefault(int(frame), []).append([x - length / 2, x + length / 2, y - width / 2, y + width / 2])
    return boxes


def moving_hits(frame: Frame, belief: Belief, boxes: Iterable[Sequence[float]], spec: GridSpec) -> NDArray[np.bool_]:
    """Return whether each cell of a moving car that is hit is more likely DYNAMIC than STATIC, (n,) bool.

    Parameters
    ----------
    frame : Frame
        The frame.
    belief : Belief
        The occupancy grid of this frame.
    boxes : iterable of sequence of float
        The moving cars' boxes in this frame, [x_min, x_max, y_min, y_max], metres.
    spec : GridSpec
        The grid.
    """
    x, y = np.moveaxis(spec.centers(), -1, 0)
    hit = hit_cells(frame.points_grid, spec)
    inside = np.zeros(spec.shape, np.bool_)
    for x_min, x_max, y_min, y_max in boxes:
        inside |= (x > x_min) & (x < x_max) & (y > y_min) & (y < y_max)
    return (belief.probability[State.DYNAMIC] > belief.probability[State.STATIC])[hit & inside]


def main(out: Path, folders: list[Path], date: str = "2011_09_26", drive: str = "0013") -> None:
    """Measure the drives, write the result and print its table.

    Parameters
    ----------
    out : Path
        A JSON file.
    folders : list of Path
        Folders of KITTI raw drives, one for each stretch.
    date, drive : str
        As `compare_drives` takes them.
    """
    result = compare_drives(folders, date, drive)
    write_json(out, result)
    print(real_drive_table(result))


if __name__ == "__main__":
    typer.run(main)
