"""Time the whole frame at the paper's grid, stage by stage: `python benchmarks/bench_frame.py [KITTI_ROOT]`.

With a KITTI root, along drive 0013; without, along the shipped drive, whose scans have a tenth of the points. What
`run_pipeline` makes of each frame once it is read from disk is timed by the pipeline's own clocks. The compact network
has fresh weights: the shipped ones are for the compact grid, and no number of theirs changes how long a frame takes.
"""

import sys
import time
from collections import defaultdict

import numpy as np
import torch
from bench_occupancy import stopwatches

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.fast import build_net
from semgrid_edu.fast.allocator import keep_freed_memory
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import Architecture, SemanticGridNet
from semgrid_edu.occupancy.cmcdot import LIDAR_PERIOD
from semgrid_edu.pipeline import network_image, run_pipeline

PASSES = 3
"""Along the drive, after one to warm up."""

ROWS = ("image scaled", "evidence", "filter", "image network", "planes", "fusion")
"""What a frame's time is made of; the CRF and the memory of classes come after."""

EVIDENCE = ("ground", "evidence")
"""The parts of a step of the filter, as `bench_occupancy` names them, that come before its belief."""


def frame_times(frames: list[Frame], net: SemanticGridNet) -> np.ndarray:
    """Return the milliseconds of each frame's rows, their sum, CRF and memory, (frames, rows + 3), along the drive."""
    table = []
    spent = defaultdict(float)
    with stopwatches(spent, time.perf_counter):
        for result in run_pipeline(frames, net, memory=True):
            took = result.seconds
            evidence = sum(spent[part] for part in EVIDENCE)
            row = [scaling_time(result.frame, net), evidence, took["track"] - evidence]
            row += [took[stage] for stage in ("segment", "sample", "fuse")]
            table.append([*row, sum(row), took["refine"], took["remember"]])
            spent.clear()
    return 1e3 * np.array(table)


def scaling_time(frame: Frame, net: SemanticGridNet) -> float:
    """Return the seconds that bringing the image to the network's size takes, which the pipeline's clocks leave out."""
    start = time.perf_counter()
    network_image(frame, net.architecture.image_size)
    return time.perf_counter() - start


def main() -> None:
    keep_freed_memory()
    drive = KittiRawDrive(sys.argv[1], "2011_09_26", "0013") if len(sys.argv) > 1 else sample_drive()
    frames = drive[:]
    net = build_net(Architecture(grid=GridSpec.paper()), drive.camera).eval()
    times = np.concatenate([frame_times(frames, net) for _ in range(1 + PASSES)][1:])
    points = np.median([len(frame.points) for frame in frames])
    print(f"{len(frames)} frames of about {points:,.0f} points, {PASSES} times; {torch.get_num_threads()} threads")
    print(f"{'ms a frame':16}{'median':>8}{'90 %':>8}   of the LIDAR's period")
    for name, column in zip((*ROWS, "sum", "CRF, after it", "memory"), times.T, strict=True):
        share = np.median(column) / 1e3 / LIDAR_PERIOD
        print(f"{name:16}{np.median(column):8.1f}{np.quantile(column, 0.9):8.1f}{share:8.0%}")


if __name__ == "__main__":
    main()
