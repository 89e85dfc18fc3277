"""Draw the README's animation, docs/street.png, from the shipped real drive: `python docs/animation.py`."""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.datasets.samples import real_drive, real_weights
from semgrid_edu.fast import load_net
from semgrid_edu.labels import KITTI_14
from semgrid_edu.pipeline import FrameResult, Stages, run_pipeline
from semgrid_edu.plotting import occupancy_colours
from semgrid_edu.plotting.animations import animate
from semgrid_edu.storage.files import write_bytes
from semgrid_edu.workshop.demo.pictures import scores_layer

FILE = Path(__file__).with_name("street.png")
WIDTH, ROWS, SIDE, GAP = 400, 80, 3, 6
"""Pixels of an image's width; rows of the map that are shown, 40 m; pixels of a cell's side, and between pictures."""
ALT = (
    "Two seconds of a real street. Left: the camera's image, and the class that the network gives each pixel. Right, "
    "seen from above: what is free, stands or moves, and the map of classes"
)


def picture(result: FrameResult) -> NDArray[np.uint8]:
    """Put image, scores, occupancy grid and refined grid of a frame side by side.

    Parameters
    ----------
    result : FrameResult
        What the pipeline made of the frame.

    Returns
    -------
    (h, w, 3) uint8
    """
    photo = Image.fromarray(result.frame.image)
    height = round(WIDTH * photo.height / photo.width)
    layer = Image.fromarray(scores_layer(result.scores, KITTI_14)).resize((WIDTH, height), Image.Resampling.NEAREST)
    small = photo.resize((WIDTH, height), Image.Resampling.BOX)
    painted = Image.alpha_composite(small.convert("RGBA"), layer).convert("RGB")
    maps = occupancy_colours(result.belief.probability), KITTI_14.colours(result.refined.argmax(axis=0))
    tall = [np.asarray(one)[-ROWS:, :, :3].repeat(SIDE, axis=0).repeat(SIDE, axis=1) for one in maps]
    sheet = np.full(
        (max(2 * height + GAP, ROWS * SIDE), WIDTH + sum(GAP + one.shape[1] for one in tall), 3), 255, np.uint8
    )
    sheet[:height, :WIDTH], sheet[height + GAP : 2 * height + GAP, :WIDTH] = np.asarray(small), np.asarray(painted)
    left = WIDTH + GAP
    for one in tall:
        sheet[: ROWS * SIDE, left : left + one.shape[1]] = one
        left += one.shape[1] + GAP
    return sheet


def main() -> None:
    """Run the pipeline over the drive, and write the file."""
    drive = real_drive()
    results = run_pipeline(drive, Stages.of(load_net(real_weights(), drive.camera)))
    write_bytes(FILE, animate([picture(result) for result in results], period=0.2, alt=ALT).png)


if __name__ == "__main__":
    sys.exit(main())
