"""The whole pipeline on a hand-made drive: each stage's part equals the stage called by itself."""

import numpy as np
import pytest
import torch
from tiny_drive import DATE, write_tiny_drive

from semgrid_edu.crf import CrfParams, mean_field
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.networks import Architecture, build_net
from semgrid_edu.occupancy import CmcdotParams, track_drive
from semgrid_edu.pipeline import STAGES, network_image, run_pipeline

FEW = CmcdotParams(n_particles=2000)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    root = tmp_path_factory.mktemp("drive")
    write_tiny_drive(root)
    return KittiRawDrive(root, DATE, "0001")


@pytest.fixture(scope="module")
def net(drive):
    return build_net(Architecture(), drive.camera, seed=3).eval()


@pytest.fixture(scope="module")
def results(drive, net):
    return list(run_pipeline(drive, net, occupancy=FEW))


def test_every_frame_comes_out_with_every_stage_timed(drive, results):
    assert len(results) == len(drive)
    for frame, result in zip(drive, results, strict=True):
        np.testing.assert_array_equal(result.frame.points, frame.points)
        assert tuple(result.seconds) == STAGES
        assert min(result.seconds.values()) > 0


def test_occupancy_is_that_of_track_drive(drive, net, results):
    beliefs = track_drive(drive, net.architecture.grid, FEW, seed=0)
    for belief, result in zip(beliefs, results, strict=True):
        np.testing.assert_array_equal(result.belief.probability, belief.probability)
        np.testing.assert_array_equal(result.belief.velocity, belief.velocity)


def test_the_semantic_grid_is_that_of_the_whole_network(net, results):
    for result in results:
        image, occupancy = network_image(result.frame, (96, 320)), torch.from_numpy(result.belief.probability)
        with torch.inference_mode():
            stages = net.stages(image[None], occupancy[None])
        np.testing.assert_array_equal(result.scores, stages.scores[0].numpy())
        np.testing.assert_allclose(result.grid, stages.logits[0].softmax(dim=0).numpy(), atol=1e-6)


def test_refinement_is_the_crf_on_the_semantic_grid(results):
    for result in results:
        refined = mean_field(-np.log(result.grid), result.belief.probability, CrfParams.for_cells(0.5))
        np.testing.assert_allclose(result.refined, refined, atol=1e-4)


def test_both_grids_are_distributions(results):
    for result in results:
        np.testing.assert_allclose(result.grid.sum(axis=0), 1, atol=1e-5)
        np.testing.assert_allclose(result.refined.sum(axis=0), 1, atol=1e-5)


def test_frames_are_read_one_at_a_time(drive, net):
    read = []

    def reading():
        for k in range(len(drive)):
            read.append(k)
            yield drive[k]

    next(run_pipeline(reading(), net, occupancy=FEW))
    assert read == [0]


def test_the_network_sees_the_mean_of_the_pixels_it_gathers(drive):
    image = np.arange(4 * 4 * 3, dtype=np.uint8).reshape(4, 4, 3)
    frame = Frame(image, np.empty((0, 4), np.float32), drive.camera, np.eye(4), time=0.0)
    expected = image.reshape(2, 2, 2, 2, 3).mean(axis=(1, 3)).transpose(2, 0, 1) / 255
    np.testing.assert_allclose(network_image(frame, (2, 2)), expected, atol=0.5 / 255)


def test_a_frame_without_image_is_refused(drive, net):
    frame = drive[0]
    blind = Frame(None, frame.points, frame.camera, frame.T_world_from_lidar, frame.time)
    with pytest.raises(ArgumentError, match="camera image"):
        next(run_pipeline([blind], net, occupancy=FEW))
