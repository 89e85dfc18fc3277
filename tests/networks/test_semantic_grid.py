from dataclasses import replace

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from torch import nn

from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import SEGMENTERS, Architecture, FusionNet, SemanticGridNet, build_net, build_segmenter
from semgrid_edu.occupancy import State
from semgrid_edu.planes import PlaneSampler
from semgrid_edu.training.batches import Batch, grid_logits, image_scores

N_CLASSES = 5


def _sampler(image_size):
    """Four planes of 10 x 9 points anywhere in the image, one in five of them not visible."""
    rng = np.random.default_rng(0)
    last = np.array(image_size)[::-1] - 1
    return PlaneSampler(rng.random((4, 10, 9, 2)) * last, rng.random((4, 10, 9)) < 0.8, image_size)


@pytest.fixture
def small_net():
    """A whole network on an image of 16 x 24 pixels and a grid of 10 x 9 cells, float64, evaluation mode."""
    return SemanticGridNet(build_segmenter("segnet", N_CLASSES), _sampler((16, 24)), N_CLASSES).double().eval()


@pytest.fixture
def batch():
    """An image, an occupancy grid and its truth, two of each."""
    rng = torch.Generator().manual_seed(1)
    image = torch.rand(2, 3, 16, 24, generator=rng, dtype=torch.float64)
    occupancy = torch.rand(2, 4, 10, 9, generator=rng, dtype=torch.float64)
    truth = torch.randint(N_CLASSES, (2, 10, 9), generator=rng)
    return image, occupancy / occupancy.sum(1, keepdim=True), truth


def test_the_reduction_is_a_1x1_convolution_of_all_planes():
    fusion = FusionNet(n_scores=3, n_planes=4, n_classes=5, n_reduced=6)
    conv = fusion.reduce[0]
    planes = torch.randn(2, 3, 4, 7, 8, generator=torch.Generator().manual_seed(0))
    as_1x1 = F.conv2d(planes.flatten(1, 2), conv.weight.flatten(1)[..., None, None], conv.bias)
    torch.testing.assert_close(conv(planes).squeeze(2), as_1x1, rtol=1e-4, atol=1e-5)


def test_stages_follow_each_other(small_net, batch):
    image, occupancy, _ = batch
    scores = small_net.segment(image)
    planes = small_net.sample(scores)
    logits = small_net(image, occupancy)
    assert scores.shape == (2, N_CLASSES, 16, 24)
    assert planes.shape == (2, N_CLASSES, 4, 10, 9)
    assert logits.shape == (2, N_CLASSES, 10, 9)
    torch.testing.assert_close(scores, small_net.segmenter(image))
    torch.testing.assert_close(planes, small_net.sampler(scores))
    torch.testing.assert_close(logits, small_net.fusion(planes, occupancy))


def test_a_mirror_exchanges_left_and_right_for_the_learnt_parts_alone(small_net, batch):
    image, occupancy, _ = batch
    batch = Batch(Sample(image, None, occupancy, None), mirrored=True)
    scores, logits = image_scores(small_net, batch), grid_logits(small_net, batch)
    torch.testing.assert_close(scores, small_net.segmenter(image.flip(-1)).flip(-1))
    planes = small_net.sampler(scores)
    torch.testing.assert_close(logits, small_net.fusion(planes.flip(-1), occupancy.flip(-1)).flip(-1))
    assert not torch.allclose(logits, small_net(image, occupancy))


def test_frames_of_a_batch_do_not_touch(small_net, batch):
    image, occupancy, _ = batch
    alone = torch.cat([small_net(image[k : k + 1], occupancy[k : k + 1]) for k in range(2)])
    torch.testing.assert_close(small_net(image, occupancy), alone)


def test_without_occupancy_each_cell_is_unknown_to_the_network(camera):
    small = Architecture(image_size=(16, 24), heights=(0.0, 0.5))
    net, blind = (build_net(replace(small, uses_occupancy=uses), camera, seed=3).eval() for uses in (True, False))
    for name, tensor in net.state_dict().items():
        assert torch.equal(tensor, blind.state_dict()[name])
    rng = torch.Generator().manual_seed(0)
    image, grids = torch.rand(1, 3, 16, 24, generator=rng), torch.rand(2, 1, 4, 142, 62, generator=rng)
    unknown = torch.zeros(1, 4, 142, 62)
    unknown[:, State.UNKNOWN] = 1
    assert torch.equal(blind(image, grids[0]), net(image, unknown))
    assert torch.equal(blind(image, grids[0]), blind(image, grids[1]))
    assert not torch.equal(net(image, grids[0]), net(image, unknown))


@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("name", SEGMENTERS)
def test_the_loss_on_the_grid_teaches_the_first_convolution_of_the_image(name, training):
    """The gradient through fusion, planes and image network equals finite differences.

    ReLU and max-pooling have kinks, where a central difference lies between two slopes. Behind normalised layers a
    step of 1e-5 takes some units across one, and errs by up to a tenth; 1e-7 takes hardly any, and rounding still
    leaves six digits. Along a direction all weights change at once, by a derivative that is a scalar product with the
    gradient: a random one sees every entry of it, and along the gradient itself it is the gradient's length.
    """
    rng = torch.Generator().manual_seed(1)
    net = SemanticGridNet(build_segmenter(name, N_CLASSES), _sampler((45, 64)), N_CLASSES).double().train(training)
    image = torch.rand(2, 3, 45, 64, generator=rng, dtype=torch.float64)
    occupancy = torch.rand(2, 4, 10, 9, generator=rng, dtype=torch.float64)
    truth = torch.randint(N_CLASSES, (2, 10, 9), generator=rng)
    weight = next(m for m in net.segmenter.modules() if isinstance(m, nn.Conv2d)).weight

    def loss():
        return F.cross_entropy(net(image, occupancy / occupancy.sum(1, keepdim=True)), truth)

    gradient = torch.autograd.grad(loss(), weight)[0]
    assert gradient.norm() > 1e-3
    random = torch.randn(weight.shape, generator=rng, dtype=torch.float64)
    for direction in (gradient / gradient.norm(), random / random.norm()):
        expected = (gradient * direction).sum().item()
        assert _slope(loss, weight, direction) == pytest.approx(expected, abs=1e-5 * gradient.norm().item())


@torch.no_grad()
def _slope(loss, weight, direction, step=1e-7):
    """The central difference of the loss as the weight moves along a direction."""
    weight += step * direction
    above = loss().item()
    weight -= 2 * step * direction
    below = loss().item()
    weight += step * direction
    return (above - below) / (2 * step)


def test_unknown_names_are_refused_with_those_there_are(camera):
    with pytest.raises(ArgumentError, match=f"name: expected one of {', '.join(SEGMENTERS)}, found 'vit'"):
        build_segmenter("vit", 14)
    with pytest.raises(ArgumentError, match="label_set: expected one of KITTI-14, SYNTHIA-10"):
        build_net(Architecture(label_set="COCO"), camera)


def test_inputs_of_another_size_or_type_are_refused(small_net, batch):
    image, occupancy, _ = batch
    with pytest.raises(ArgumentError, match=r"image: expected shape \(B, 3, 16, 24\), found \(2, 3, 16, 23\)"):
        small_net(image[..., :-1], occupancy)
    with pytest.raises(ArgumentError, match=r"occupancy: expected shape \(B, 4, 10, 9\), found \(2, 3, 10, 9\)"):
        small_net(image, occupancy[:, :3])
    with pytest.raises(ArgumentError, match=r"image: expected floats in 0..1, found torch.uint8"):
        small_net((255 * image).to(torch.uint8), occupancy)
    with pytest.raises(ArgumentError, match="occupancy: expected one for each of the 2 images, found 1"):
        small_net(image, occupancy[:1])


def test_any_module_can_be_the_image_network(small_net, batch):
    image, occupancy, _ = batch
    net = SemanticGridNet(nn.Conv2d(3, N_CLASSES, 1), small_net.sampler, N_CLASSES).double().eval()
    assert net(image, occupancy).shape == (2, N_CLASSES, 10, 9)


def test_the_seed_alone_decides_the_first_weights_of_the_whole_net(camera):
    architecture, before = Architecture(image_size=(16, 24), heights=(0.0, 0.5)), torch.get_rng_state()
    one, same, other = (build_net(architecture, camera, seed) for seed in (1, 1, 2))
    assert torch.equal(torch.get_rng_state(), before)
    for part in ("segmenter", "fusion"):
        weights = [nn.utils.parameters_to_vector(getattr(net, part).parameters()) for net in (one, same, other)]
        assert torch.equal(weights[0], weights[1])
        assert not torch.equal(weights[0], weights[2])


def test_without_the_reduction_all_planes_reach_the_conv_deconv_network():
    fusion = FusionNet(n_scores=3, n_planes=4, n_classes=5, n_reduced=None)
    planes = torch.randn(2, 3, 4, 8, 8, generator=torch.Generator().manual_seed(0))
    kept = fusion.reduce(planes)
    assert torch.equal(kept[:, :, 0], planes.flatten(1, 2))
    assert fusion(planes, torch.full((2, 4, 8, 8), 0.25)).shape == (2, 5, 8, 8)
    first = next(module for module in fusion.conv_deconv.modules() if isinstance(module, torch.nn.Conv2d))
    assert first.in_channels == 3 * 4 + 4
