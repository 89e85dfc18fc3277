"""The occupancy filter switched off: which cells move, and how fast, from the boxes of a simulated drive."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from semgrid_edu.datasets.kitti_raw import KittiRawDrive
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, State
from semgrid_edu.storage.reading import read_json

MARGIN = 0.25
"""Metres, half a cell of the compact grid: a cell moves if any part of a box is likely to be in it."""


def beliefs_of_boxes(drive: KittiRawDrive, beliefs: Sequence[Belief], spec: GridSpec) -> list[Belief]:
    """Return what a filter without errors would say of moving things.

    Parameters
    ----------
    drive : KittiRawDrive
        A simulated drive, whose folder holds the boxes of all road users.
    beliefs : sequence of Belief
        The filter's belief after each frame.
    spec : GridSpec
        Their grid.

    Returns
    -------
    list of Belief
        DYNAMIC with the box's velocity in the cells of each box that moves, STATIC elsewhere.
    """
    x, y = np.moveaxis(spec.centers(), -1, 0)
    found = []
    for belief, things in zip(beliefs, read_json(drive.folder / "labels" / "objects.json").values(), strict=True):
        moves = np.zeros(spec.shape, bool)
        velocity = np.zeros_like(belief.velocity)
        for thing in things:
            dx = x - thing["centre"][0]
            dy = y - thing["centre"][1]
            cos = np.cos(thing["yaw"])
            sin = np.sin(thing["yaw"])
            length, width, _ = np.array(thing["size"]) / 2 + MARGIN
            inside = (abs(cos * dx + sin * dy) < length) & (abs(cos * dy - sin * dx) < width) & thing["moving"]
            moves |= inside
            velocity[:, inside] = np.array(thing["velocity"])[:, None]
        probability = np.zeros_like(belief.probability)
        probability[State.DYNAMIC] = moves
        probability[State.STATIC] = ~moves
        found.append(replace(belief, probability=probability, velocity=velocity))
    return found
