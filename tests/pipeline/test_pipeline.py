"""The whole pipeline on a hand-made drive: each stage's part equals the stage called by itself."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from semgrid_edu.crf import CrfParams
from semgrid_edu.datasets.samples import sample_weights, segnet_real_weights
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import build_net, load_net, mean_field, track_drive
from semgrid_edu.frame import Frame
from semgrid_edu.networks import Architecture
from semgrid_edu.occupancy import CmcdotParams
from semgrid_edu.pipeline import STAGES, Stages, network_image, run_frame, run_pipeline

FEW = CmcdotParams(n_particles=2000)


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
        assert tuple(result.seconds) == tuple(STAGES)
        assert min(result.seconds.values()) > 0


@pytest.mark.parametrize(
    "spoil", [lambda i: i[:, 1:], lambda i: i[..., 0], lambda i: i / 255], ids=["size", "grey", "float"]
)
def test_an_image_that_is_not_its_cameras_is_refused(drive, net, spoil):
    frame = drive[0]
    with pytest.raises(ArgumentError, match=r"image: expected \(.*, 3\) uint8, the size of its camera"):
        next(run_pipeline([replace(frame, image=spoil(frame.image))], net, FEW))


def test_occupancy_is_that_of_track_drive(drive, net, results):
    beliefs = track_drive(drive, net.architecture.grid, FEW, seed=0)
    for belief, result in zip(beliefs, results, strict=True):
        np.testing.assert_array_equal(result.belief.probability, belief.probability)
        np.testing.assert_array_equal(result.belief.velocity, belief.velocity)


def test_the_semantic_grids_are_those_of_network_and_crf_bit_for_bit(net, results):
    for result in results:
        image = torch.from_numpy(network_image(result.frame, (96, 320)))
        occupancy = torch.from_numpy(result.belief.probability)
        with torch.inference_mode():
            scores = net.segmenter(image[None])[0].numpy()
            log_g = net(image[None], occupancy[None])[0].log_softmax(dim=0).numpy()
        refined = mean_field(-log_g, result.belief.probability, CrfParams.for_cells(0.5))
        np.testing.assert_array_equal(result.scores, scores)
        np.testing.assert_array_equal(result.grid, np.exp(log_g))
        np.testing.assert_array_equal(result.refined, refined)


def assert_equal_results(result, expected):
    for name in ("scores", "grid", "refined"):
        np.testing.assert_array_equal(getattr(result, name), getattr(expected, name))
    np.testing.assert_array_equal(result.belief.probability, expected.belief.probability)


def test_the_stages_of_a_net_do_what_the_net_does(drive, net, results):
    for result, expected in zip(run_pipeline(drive, Stages.fast(net, FEW)), results, strict=True):
        assert_equal_results(result, expected)


def test_stages_that_are_left_out_are_the_packages_own(drive):
    def keep(log_g, o):
        return np.exp(log_g)

    shipped = load_net(sample_weights(), drive.camera)
    ours, theirs = run_pipeline(drive, shipped, FEW), run_pipeline(drive, Stages(refine=keep), FEW)
    for result, expected in zip(theirs, ours, strict=True):
        assert_equal_results(replace(result, refined=None), replace(expected, refined=None))
        np.testing.assert_array_equal(result.refined, expected.grid)


def test_the_book_gives_what_the_fast_twins_give(drive, net):
    """The same random numbers, in double and in single precision."""
    few = CmcdotParams(n_particles=200)
    fast = next(run_pipeline(drive, Stages.fast(net, few, memory=True)))
    book = next(run_pipeline(drive, Stages.of(net, few, memory=True)))
    np.testing.assert_allclose(book.belief.probability, fast.belief.probability, atol=1e-4)
    for name in ("scores", "grid", "refined", "remembered"):
        np.testing.assert_allclose(getattr(book, name), getattr(fast, name), atol=2e-3)


def test_run_frame_carries_the_filter_from_frame_to_frame(drive, net, results):
    stages = Stages.fast(net, FEW)
    for frame, expected in zip(drive, results, strict=True):
        assert_equal_results(run_frame(frame, stages), expected)


def test_a_set_can_be_used_for_several_drives(drive, net, results):
    stages = Stages.fast(net, FEW)
    for _ in range(2):
        for result, expected in zip(run_pipeline(drive, stages), results, strict=True):
            assert_equal_results(result, expected)


def test_stages_of_networks_with_other_image_networks_can_be_mixed(drive, net, results):
    """The SegNets of the real street are three image networks: their stages take and give the same arrays."""
    real = Stages.fast(load_net(segnet_real_weights(), drive.camera), FEW)
    mixed = replace(real, segment=None, sample=None).over(Stages.fast(net, FEW))
    result = next(run_pipeline(drive, mixed))
    np.testing.assert_array_equal(result.scores, results[0].scores)
    assert not np.array_equal(result.grid, results[0].grid)


def test_a_set_that_lacks_stages_does_not_start(net):
    with pytest.raises(ArgumentError, match=r"^stages: expected all of track, .*, found no fuse"):
        replace(Stages.fast(net), fuse=None).started()


def test_run_frame_names_what_its_stages_lack(drive, net):
    def track(frames, spec):
        yield from track_drive(frames, spec)

    with pytest.raises(
        ArgumentError, match=r"^stages: expected all of track, .*, found no fuse, sample, segment, track"
    ):
        run_frame(drive[0], Stages(refine=lambda log_g, o: np.exp(log_g)))
    with pytest.raises(ArgumentError, match=r"^track: expected an object with step\(frame\), .* found function"):
        run_frame(drive[0], replace(Stages.of(net), track=track))


@pytest.mark.parametrize("stages", [lambda log_g, o: np.exp(log_g), {"refine": None}, Stages, None])
def test_what_is_neither_stages_nor_a_network_is_refused(drive, stages):
    with pytest.raises(ArgumentError, match=r"^stages: expected a network, or Stages\(\.\.\.\)"):
        run_pipeline(drive, stages)


def test_what_is_no_frame_is_refused(net):
    with pytest.raises(ArgumentError, match=r"^frames: expected the frames of a drive, found 'a'"):
        next(run_pipeline("abc", net))


def test_no_frames_give_no_results(net):
    assert list(run_pipeline([], net)) == []


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
    frame = Frame(image, np.empty((0, 4), np.float32), drive.camera.resized((4, 4)), np.eye(4), time=0.0)
    expected = image.reshape(2, 2, 2, 2, 3).mean(axis=(1, 3)).transpose(2, 0, 1) / 255
    np.testing.assert_allclose(network_image(frame, (2, 2)), expected, atol=0.5 / 255)


def test_a_frame_without_image_is_refused(drive, net):
    frame = drive[0]
    blind = Frame(None, frame.points, frame.camera, frame.T_world_from_lidar, frame.time)
    with pytest.raises(ArgumentError, match="camera image"):
        next(run_pipeline([blind], net, occupancy=FEW))


def test_a_memory_is_added_to_a_complete_set(drive, net):
    (result,) = run_pipeline(drive[:1], Stages.fast(net, FEW), memory=True)
    (expected,) = run_pipeline(drive[:1], Stages.fast(net, FEW, memory=True))
    np.testing.assert_array_equal(result.remembered, expected.remembered)


@pytest.mark.parametrize("option", [{"occupancy": FEW}, {"crf": CrfParams()}, {"seed": 3}, {"memory": True}])
def test_a_parameter_of_a_stage_that_the_set_has_is_refused(drive, net, option):
    own = Stages.fast(net, FEW, memory=True)
    with pytest.raises(ArgumentError, match=rf"^{next(iter(option))}: expected nothing, because the set has a stage"):
        run_pipeline(drive, own, **option)  # before a frame is asked for


def test_a_tracker_that_has_seen_a_drive_does_not_start_another(drive, net):
    stages = Stages.fast(net, FEW)
    for frame in drive:
        run_frame(frame, stages)
    with pytest.raises(ArgumentError, match=r"^frames: expected frames in the order of time, and a new tracker"):
        next(run_pipeline(drive, stages))
