"""The study of what a frame is worth: on made-up frames whose errors are known."""

import numpy as np
import pytest
from worlds.lecture_14_gain import worth_by_distance

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.frame import LABEL_GRID, Frame, FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.memory import View
from semgrid_edu.occupancy import Belief

SPEC = GridSpec(0, 71, -15.5, 15.5, 1.0)


def drive(camera: Camera, independent: bool) -> list[View]:
    """A standing vehicle sees road and sidewalk, and is wrong in three cells of ten: new ones each time, or not."""
    rng, truth = np.random.default_rng(0), np.zeros(LABEL_GRID.shape, np.uint8)
    labels = FrameLabels(KITTI_14, np.zeros((1, 1), np.uint8), np.zeros((1, 1)), truth, np.ones(truth.shape, bool))
    nothing = np.full((2, 2, *SPEC.shape), np.nan, np.float32)
    o = np.zeros((4, *SPEC.shape), np.float32)
    o[0], wrong, views = 1, rng.random(SPEC.shape) < 0.3, []
    for k in range(8):
        wrong = rng.random(SPEC.shape) < 0.3 if independent else wrong
        g = np.zeros((14, *SPEC.shape), np.float32)
        g[0], g[1] = np.where(wrong, 0.3, 0.7), np.where(wrong, 0.7, 0.3)
        frame = Frame(None, np.empty((0, 4), np.float32), camera, np.eye(4), 0.1 * k, labels)
        views.append(View(frame, Belief(o, nothing[0], nothing), g))
    return views


@pytest.mark.parametrize("independent", [True, False])
def test_the_last_frame_alone_is_worst_where_errors_are_new_in_each(independent):
    camera = sample_drive().camera
    found = worth_by_distance([drive(camera, independent)], SPEC, (0.2, 1.0), (0, 30, 80))
    assert found.cells.sum() == 8 * np.prod(SPEC.shape)
    if independent:
        np.testing.assert_array_equal(found.best, 0.2)
    else:  # every frame says the same, so it doesn't matter how they are weighted
        np.testing.assert_allclose(found.log_loss[0], found.log_loss[1], rtol=1e-4)
