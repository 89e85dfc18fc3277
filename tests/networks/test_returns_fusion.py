"""Fusion that knows the heights of the returns."""

from dataclasses import replace

import pytest
import tiny_streets
import torch
from safetensors import safe_open

from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import with_fast_sampler
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import SemanticGridNet, build_net, save_net
from semgrid_edu.planes import above_ground, pick_planes
from semgrid_edu.training.batches import Batch, grid_logits, image_scores

SMALL = replace(tiny_streets.SMALL, uses_return_heights=True)


@pytest.fixture
def net(camera):
    return build_net(SMALL, camera, seed=3).eval()


@pytest.fixture
def inputs():
    """Image, occupancy, and heights from -0.5 to 6 m, a third of them missing, of two frames."""
    rng = torch.Generator().manual_seed(0)
    shape = SMALL.grid.shape
    lowest, more = torch.rand(2, 2, 1, *shape, generator=rng)
    heights = torch.cat([lowest - 0.5, lowest - 0.5 + 5.5 * more], dim=1)
    heights[(torch.rand(2, 1, *shape, generator=rng) < 1 / 3).expand(-1, 2, -1, -1)] = torch.nan
    occupancy = torch.rand(2, 4, *shape, generator=rng).softmax(dim=1)
    return torch.rand(2, 3, *SMALL.image_size, generator=rng), occupancy, heights


def test_the_conv_deconv_network_sees_picked_probabilities_states_and_heights(net, inputs):
    image, occupancy, heights = inputs
    planes = net.sampler(net.segmenter(image).softmax(dim=1))
    logits = net(image, occupancy, heights)
    picked = pick_planes(planes, heights, SMALL.heights)
    above = above_ground(heights, 1.0).nan_to_num(0).clamp(0, 5) / 2.5
    joined = torch.cat([picked, occupancy, above, (~heights[:, :1].isnan()).float()], dim=1)
    assert joined.shape[1] == 2 * 14 + 4 + 3
    both = (picked > 0).any(dim=1, keepdim=True) & ~heights[:, :1].isnan()
    lowered = torch.zeros_like(logits)
    lowered[:, KITTI_14.n_semantic :] = 20 * both
    torch.testing.assert_close(logits, net.fusion.conv_deconv(joined) - lowered)


def test_only_a_cell_in_view_with_a_return_must_have_a_name(net, inputs):
    """With weights that call everything unknown, cells that a sensor misses stay unknown, the others don't."""
    image, occupancy, heights = inputs
    last = net.fusion.conv_deconv.decoder[0][-1].bias
    with torch.no_grad():
        last[KITTI_14.n_semantic :] += 10
    called = net(image, occupancy, heights).argmax(dim=1)
    visible = torch.as_tensor(net.sampler.visible)
    in_view, out_of_view = visible.all(dim=0), ~visible.any(dim=0)
    has_return = ~heights[:, 0].isnan()
    assert (called[has_return & in_view] < KITTI_14.n_semantic).all()
    assert (called[~has_return | out_of_view] >= KITTI_14.n_semantic).all()
    assert (has_return & in_view).any()


def test_mirrored_it_sees_the_mirror_of_everything(net, inputs):
    image, occupancy, heights = inputs
    batch = Batch(Sample(image, None, occupancy, None, return_heights=heights), mirrored=True)
    logits = grid_logits(net, batch)
    planes = net.sample(image_scores(net, batch))
    mirror = net.fusion(*(part.flip(-1) for part in (planes, occupancy, heights)))
    torch.testing.assert_close(logits, mirror.flip(-1))
    assert not torch.allclose(logits, net(image, occupancy, heights))


def test_every_input_matters_and_a_larger_image_score_alone_does_not(net, inputs):
    image, occupancy, heights = inputs
    logits = net(image, occupancy, heights)
    assert not torch.allclose(logits, net(image.flip(-1), occupancy, heights))
    assert not torch.allclose(logits, net(image, occupancy.flip(1), heights))
    assert not torch.allclose(logits, net(image, occupancy, heights + 1))  # other planes
    scores = net.segment(image)
    torch.testing.assert_close(net.sample(scores + 5), net.sample(scores))


def test_the_fast_sampler_gives_the_same_logits(net, inputs):
    torch.testing.assert_close(with_fast_sampler(net)(*inputs), net(*inputs), rtol=1e-4, atol=1e-4)


def test_without_occupancy_it_still_sees_heights(camera, inputs):
    blind = build_net(replace(SMALL, uses_occupancy=False), camera, seed=3).eval()
    image, occupancy, heights = inputs
    logits = blind(image, occupancy, heights)
    assert torch.equal(logits, blind(image, occupancy.flip(1), heights))
    assert not torch.allclose(logits, blind(image, occupancy, heights.flip(-1)))


def test_other_networks_ignore_heights_and_their_files_do_not_mention_them(camera, tmp_path, inputs):
    usual = build_net(replace(SMALL, uses_return_heights=False), camera, seed=3).eval()
    assert torch.equal(usual(*inputs), usual(*inputs[:2]))
    save_net(usual, tmp_path / "net.safetensors")
    with safe_open(tmp_path / "net.safetensors", "pt") as file:
        assert "uses_return_heights" not in str(file.metadata())


@pytest.mark.parametrize("spoil", [lambda heights: None, lambda heights: heights[:, :1], lambda heights: heights[:1]])
def test_missing_and_misshapen_heights_are_refused(net, inputs, spoil):
    image, occupancy, heights = inputs
    with pytest.raises(ArgumentError, match=r"return_heights: expected shape \(2, 2, 24, 12\).*uses return heights"):
        net(image, occupancy, spoil(heights))
    with pytest.raises(ArgumentError, match="return_heights: "):
        net.fuse(torch.rand(2, 14, 3, 24, 12), occupancy, return_heights=spoil(heights))


def test_heights_in_double_precision_are_those_in_single_precision(net, inputs):
    assert torch.equal(net(*inputs[:2], inputs[2].double()), net(*inputs))


def test_a_sampler_of_other_planes_is_refused(net, camera):
    other = build_net(replace(SMALL, heights=(0.0, 0.5)), camera).sampler
    with pytest.raises(ArgumentError, match="sampler: expected 3 planes, found 2"):
        SemanticGridNet(net.segmenter, other, net.n_classes, architecture=SMALL, fusion=net.fusion)


def test_unreduced_planes_are_refused():
    with pytest.raises(ArgumentError, match="reduces: expected True"):
        replace(SMALL, reduces=False)


def test_planes_in_any_other_order_are_refused():
    with pytest.raises(ArgumentError, match="heights: expected planes from the lowest up"):
        replace(SMALL, heights=(0.5, 0.0))
