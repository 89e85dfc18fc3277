"""Whether the occupancy filter, which learns nothing, finds the cars that move (section 3.2)."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.errors import DataError
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, State
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.studies.filter.scenes import hit_cells

Boxes = dict[int, list[list[float]]]
"""Boxes of moving cars by frame, each [x_min, x_max, y_min, y_max], metres in the grid frame."""


def read_boxes(path: Path) -> Boxes:
    """Read boxes of moving cars.

    Parameters
    ----------
    path : Path
        JSON: for each name that begins with "car" the boxes by frame, [x_min, x_max, y_min, y_max, ...], metres.

    Returns
    -------
    dict of int to list
        The boxes in each frame; none when there is no such file.

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

    Returns
    -------
    dict of int to list
        The boxes in each frame, [x_min, x_max, y_min, y_max], metres.
    """
    known = read_json(drive.folder / "labels" / "objects.json")
    boxes: Boxes = {}
    for frame, things in known.items():
        for thing in things:
            if thing["moving"] and thing["class"] == "car":
                (x, y, _), (length, width, _) = thing["centre"], thing["size"]
                boxes.setdefault(int(frame), []).append([x - length / 2, x + length / 2, y - width / 2, y + width / 2])
    return boxes


def moving_hits(frame: Frame, belief: Belief, boxes: Iterable[Sequence[float]], spec: GridSpec) -> NDArray[np.bool_]:
    """Tell of each cell of a moving car that is hit whether it is more likely DYNAMIC than STATIC.

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

    Returns
    -------
    (n,) bool
    """
    x, y = np.moveaxis(spec.centers(), -1, 0)
    hit, inside = hit_cells(frame.points_grid, spec), np.zeros(spec.shape, np.bool_)
    for x_min, x_max, y_min, y_max in boxes:
        inside |= (x > x_min) & (x < x_max) & (y > y_min) & (y < y_max)
    moves = belief.probability[State.DYNAMIC] > belief.probability[State.STATIC]
    return moves[hit & inside]
