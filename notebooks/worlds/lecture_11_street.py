"""What the fast CRF gets to refine in lecture 11: five frames of the sample drive."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.samples import sample_drive, sample_weights
from semgrid_edu.fast import track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import load_net
from semgrid_edu.pipeline import Stages, network_image

FRAMES = (2, 6, 10, 14, 18)
"""Their numbers in the drive; the occupancy grid sees every frame before them, too."""


class Unrefined(NamedTuple):
    """One frame before the CRF.

    Parameters
    ----------
    log_g : (14, H, W) float
        What the network says of each cell: the logarithms of its probabilities.
    o : (4, H, W) float
        The occupancy grid.
    truth : (H, W) int
        The true class of each cell.
    """

    log_g: NDArray
    o: NDArray
    truth: NDArray


def unrefined(spec: GridSpec) -> list[Unrefined]:
    """Run the pipeline up to the CRF.

    Parameters
    ----------
    spec : GridSpec
        The cells of the map.
    """
    drive = sample_drive()
    net = load_net(sample_weights(), drive.camera)
    stages = Stages.fast(net)
    frames = [drive[k] for k in range(FRAMES[-1] + 1)]
    maps = []
    for number, belief in enumerate(track_drive(frames, spec)):
        if number in FRAMES:
            frame = frames[number]
            o = belief.probability
            image = network_image(frame, net.architecture.image_size)
            log_g = stages.fuse(stages.sample(stages.segment(image)), o)
            maps.append(Unrefined(np.asarray(log_g), o, grid_truth(frame.labels, o, spec)))
    return maps
