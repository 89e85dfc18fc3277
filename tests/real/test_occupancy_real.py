"""CMCDOT with its defaults on the first 24 frames of KITTI's drive 0013: what stands. `test_stretches_real` has cars.

The car on the right overtakes; its boxes were found by hand. A fence stands beyond it. A second car follows it into the
grid near the end, so cells there count for neither.
"""

import json

import numpy as np
import pytest
from worlds.lecture_04_scenes import hit_cells

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.fast import track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import SensorModel, State
from semgrid_edu.occupancy.sensor import prepare_scan

pytestmark = pytest.mark.real

SPEC = GridSpec.paper()
centre_x, centre_y = np.moveaxis(SPEC.centers(), -1, 0)
FIRST_BOX, ONE_SECOND = 4, 10


@pytest.fixture(scope="module")
def drive(kitti_root):
    """Return the frames, their beliefs, and the car's box in each frame that has one."""
    boxes_file = kitti_root / "moving_cars_0013.json"
    if not boxes_file.exists():
        pytest.skip("needs moving_cars_0013.json beside the drive")
    boxes = {int(frame): box for frame, box in json.loads(boxes_file.read_text())["car_1"].items()}
    drive = KittiRawDrive(kitti_root, "2011_09_26", "0013")
    frames = [drive[k] for k in range(len(drive))]
    if min(boxes) != FIRST_BOX:
        pytest.skip("places and boxes are those of frames 0 to 23")
    return frames, list(track_drive(frames, SPEC)), boxes


def returned(frame) -> np.ndarray:
    """Return the cells with two or more returns between 0.3 and 1.6 m above the ground, (H, W) bool."""
    return hit_cells(frame.points_grid, SPEC)


def in_box(box, margin=0.0) -> np.ndarray:
    x_min, x_max, y_min, y_max = box[:4]
    return (
        (centre_x > x_min - margin)
        & (centre_x < x_max + margin)
        & (centre_y > y_min - margin)
        & (centre_y < y_max + margin)
    )


def moving(belief) -> np.ndarray:
    return belief.probability[State.DYNAMIC] > belief.probability[State.STATIC]


def test_the_fence_is_static(drive):
    """Of the returns above 0.3 m there, counted from flat ground, a fifth come from the verge: those cells are free."""
    frames, beliefs, _ = drive
    area = (centre_x > 4) & (centre_x < 25) & (centre_y < -5.2)
    standing, static = [], []
    for frame, belief in zip(frames, beliefs, strict=True):
        standing.append(~moving(belief)[returned(frame) & area])
        above_ground = hit_cells(prepare_scan(frame.points_grid, SensorModel()), SPEC)
        static.append((belief.probability.argmax(axis=0) == State.STATIC)[above_ground & area])
    assert np.concatenate(standing).mean() >= 0.99
    assert np.concatenate(static).mean() >= 0.99


def test_the_verges_are_not_taken_for_obstacles(drive):
    """Left of the road grass rises to 0.6 m; in the strip before the fence, to 0.55 m. Two trunks stand on the left."""
    frames, beliefs, _ = drive
    for frame, belief in zip(frames, beliefs, strict=True):
        grass = (centre_x > 5) & (centre_x < 20) & (centre_y > 3) & (centre_y < 9)
        verge = returned(frame) & ~hit_cells(frame.points_grid, SPEC, least=1, low=0.8) & grass
        assert verge.sum() > 200
        assert (belief.probability.argmax(axis=0) == State.FREE)[verge].mean() > 0.97


def test_little_else_is_dynamic(drive):
    frames, beliefs, boxes = drive
    for k in range(ONE_SECOND, len(frames)):
        follower = in_box([-2, 6, -4.9, -2])
        others = (
            returned(frames[k]) & (centre_x < 40) & (abs(centre_y) < 12) & ~in_box(boxes[k], margin=0.5) & ~follower
        )
        assert moving(beliefs[k])[others].mean() <= 0.03, k


def test_the_road_ahead_is_free(drive):
    _, beliefs, _ = drive
    road = in_box([4, 20, -1.5, 1.5])
    for belief in beliefs:
        assert (belief.probability.argmax(axis=0) == State.FREE)[road].mean() >= 0.95
