"""Grids on which ways to run the CRF are compared: the shipped drive on the compact grid, and crops of the paper's."""

from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf import CrfParams, unary_from_log_probability
from semgrid_edu.datasets.samples import sample_drive, sample_weights
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import build_net, load_net
from semgrid_edu.pipeline import Stages, network_image

FRAME = 9
"""Of the shipped drive: the filter has seen one second."""
CROP = 64
"""Rows and columns of a crop."""
N_CROPS = 3
"""Number of crops, one ahead of the other, the first at the vehicle."""


class CrfProblem(NamedTuple):
    """What the CRF is given.

    Parameters
    ----------
    unary : (C, H, W) float32
        phi_u of eq. (3).
    values : (4, H, W) float32
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        Weights, widths and normalisation.
    """

    unary: NDArray[np.float32]
    values: NDArray[np.float32]
    params: CrfParams


def crf_scenes(seed: int = 0) -> dict[str, list[CrfProblem]]:
    """Return the grids of the shipped drive, each with the default parameters for the size of its cells.

    The shipped network was trained on the compact grid. It is convolutional, so that it takes the paper's grid as well.
    Its labels there are worse, but what is compared is inference.

    Parameters
    ----------
    seed : int
        Seed for the filter's particles.

    Returns
    -------
    dict of str to list of CrfProblem
        "compact grid" (142 x 62 cells) and "64 x 64 crops" of the paper's grid, small enough for all pairs of cells.
    """
    compact, paper = (sample_problem(spec, seed) for spec in (GridSpec.compact(), GridSpec.paper()))
    return {"compact grid": [compact], "64 x 64 crops": crops(paper)}


def sample_problem(spec: GridSpec, seed: int = 0, frame: int = FRAME) -> CrfProblem:
    """Return what the shipped SegNet and the filter make of a frame of the shipped drive.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    seed : int
        Seed for the filter's particles.
    frame : int
        Number of the frame; the filter also sees all frames before.

    Returns
    -------
    CrfProblem
    """
    drive = sample_drive()
    trained = load_net(sample_weights(), drive.camera)
    net = build_net(replace(trained.need_architecture(), grid=spec), drive.camera)
    net.load_state_dict(trained.state_dict())
    stages = Stages.of(net.eval(), seed=seed)
    for belief in stages.track((drive[k] for k in range(frame + 1)), spec):
        o = belief.probability
    image = network_image(drive[frame], trained.need_architecture().image_size).numpy()
    log_g = stages.fuse(stages.sample(stages.segment(image)), o)
    return CrfProblem(unary_from_log_probability(log_g), o, CrfParams.for_cells(spec.cell))


def crops(problem: CrfProblem) -> list[CrfProblem]:
    """Cut squares out of the middle columns, from the vehicle ahead.

    Parameters
    ----------
    problem : CrfProblem
        A grid of at least `CROP` columns and `N_CROPS` times as many rows.

    Returns
    -------
    list of CrfProblem
        `N_CROPS` of them.
    """
    _, height, width = problem.unary.shape
    left = (width - CROP) // 2
    return [
        CrfProblem(*(a[:, row - CROP : row, left : left + CROP] for a in problem[:2]), problem.params)
        for row in islice(range(height, 0, -CROP), N_CROPS)
    ]
