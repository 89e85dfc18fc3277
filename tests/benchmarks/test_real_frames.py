"""The picture of six real frames: its errors are counted as printed, and a frame fills its row."""

import matplotlib.pyplot as plt
import numpy as np
from real_frames import SPEC, draw_frame, errors

from semgrid_edu.datasets.samples import real_drive, real_weights
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.networks import load_net
from semgrid_edu.pipeline import Stages, run_pipeline

ROAD, CAR = KITTI_14.index("road"), KITTI_14.index("car")


def test_errors_are_named_the_most_frequent_first_and_unlabelled_cells_are_left_out():
    labels = np.array([[ROAD, ROAD, ROAD, CAR, CAR, IGNORE]])
    called = np.array([[CAR, ROAD, CAR, ROAD, CAR, CAR]])
    assert errors(labels, called).startswith("2 road called car, 1 car called road, 0 ")


def test_the_row_of_a_frame_says_how_much_of_the_map_is_right(capsys):
    drive = real_drive()
    (result,) = run_pipeline(drive[:1], Stages.of(load_net(real_weights(), drive.camera), keep_steps=True))
    labels = np.full(SPEC.shape, IGNORE)
    labels[:10] = result.grid.argmax(axis=0)[:10]
    labels[0] = (labels[0] + 1) % len(KITTI_14)  # one row of ten is wrong
    _, axes = plt.subplots(1, 4)
    draw_frame(axes, "here", result, labels)
    assert axes[2].get_title() == "map: 90% right"
    assert capsys.readouterr().out.startswith(f"here: 90.0% of {10 * SPEC.shape[1]} cells right")
    plt.close("all")
