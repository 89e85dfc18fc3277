"""Stages of a network that sees the heights of the scan's returns."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import build_net
from semgrid_edu.networks import Architecture
from semgrid_edu.occupancy import CmcdotParams
from semgrid_edu.pipeline import StageError, Stages, network_image, run_frame, run_pipeline
from semgrid_edu.planes import cell_heights

FEW = CmcdotParams(n_particles=2000)
ARCHITECTURE = Architecture(uses_return_heights=True)


@pytest.fixture(scope="module")
def net(drive):
    return build_net(ARCHITECTURE, drive.camera, seed=3).eval()


def even(p, o):
    return np.full((14, *o.shape[1:]), -np.log(14), np.float32)


def test_a_frame_gets_the_grid_of_the_network_and_the_book_equals_the_fast_stages(drive, net):
    frame = drive[0]
    fast, book = (run_frame(frame, make(net, FEW)) for make in (Stages.fast, Stages.of))
    for result in (fast, book):
        heights = torch.from_numpy(cell_heights(frame.points_grid, ARCHITECTURE.grid)).float()
        image = torch.from_numpy(network_image(frame, ARCHITECTURE.image_size))
        with torch.inference_mode():
            logits = net(image[None], torch.from_numpy(result.belief.probability)[None], heights[None])
        np.testing.assert_allclose(result.grid, logits[0].softmax(dim=0).numpy(), atol=1e-5)
    np.testing.assert_allclose(fast.grid, book.grid, atol=1e-3)
    (checked,) = run_pipeline([frame], net, FEW)
    np.testing.assert_array_equal(checked.grid, fast.grid)


def test_the_returns_of_the_vehicle_itself_are_not_seen(drive, net):
    frame = drive[0]
    ghosts = np.array([[x, y, 3.0, 0.5] for x in np.arange(2.2, 40, 0.5) for y in np.arange(-9.7, 10, 0.5)], np.float32)
    mine = np.arange(len(frame.points) + len(ghosts)) >= len(frame.points)
    marked = replace(frame, points=np.concatenate([frame.points, ghosts]), vehicle_returns=mine)
    stages = Stages.fast(net, FEW)
    np.testing.assert_array_equal(stages.return_heights(marked), stages.return_heights(frame))


def test_a_fuse_of_ones_own_brings_its_heights_or_gets_none(drive, net):
    frame, given = drive[0], []

    def fuse(p, o, return_heights):
        given.append(return_heights)
        return even(p, o)

    def heights(frame):
        return cell_heights(frame.points_grid, ARCHITECTURE.grid)

    usual = Stages.fast(net, FEW)
    for own in (Stages(fuse=even), Stages(fuse=fuse, return_heights=heights)):
        (result,) = run_pipeline([frame], own.over(usual))
        np.testing.assert_allclose(result.grid, 1 / 14, rtol=1e-5)
    np.testing.assert_array_equal(given[0], heights(frame))


def test_a_fuse_that_takes_no_heights_is_refused_where_it_would_get_them(drive, net):
    usage = r"fuse: expected a function fuse\(p, o, return_heights\), found fuse\(p, o\)"
    with pytest.raises(ArgumentError, match=usage):
        replace(Stages.fast(net, FEW), fuse=even)
    with pytest.raises(
        ArgumentError, match=r"fuse: expected a function fuse\(p, o\), found fuse\(p, o, return_heights\)"
    ):
        Stages(fuse=lambda p, o, return_heights: even(p, o))


def test_raw_scores_on_the_planes_are_refused(drive, net):
    own = Stages.fast(net, FEW)
    (result,) = run_pipeline([drive[0]], replace(own, sample=lambda s: own.sample(s)))
    (usual,) = run_pipeline([drive[0]], own)
    np.testing.assert_array_equal(result.grid, usual.grid)
    with pytest.raises(StageError, match=r"sample .*expected class probabilities.*found .*: sample the soft-max"):
        next(run_pipeline(drive, replace(own, sample=lambda s: 9 * own.sample(s))))


def test_stages_of_networks_whose_planes_hold_other_numbers_are_not_mixed(net, drive):
    usual = Stages.fast(build_net(Architecture(), drive.camera).eval(), FEW)
    with pytest.raises(ArgumentError, match="architecture"):
        Stages(fuse=even, architecture=ARCHITECTURE).over(usual)
