"""What holds for every image network of the registry."""

import re

import numpy as np
import pytest
import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import SEGMENTERS, build_segmenter

N_CLASSES = 5


@pytest.fixture(params=SEGMENTERS)
def name(request):
    return request.param


def _images(*shape, dtype=torch.float32):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(0), dtype=dtype)


@pytest.mark.parametrize("preset", ["compact", "paper"])
def test_scores_are_at_image_resolution_though_kittis_is_no_multiple_of_32(name, preset):
    with torch.device("meta"):
        net = build_segmenter(name, 14, preset)
        assert net(torch.empty(1, 3, 375, 1242)).shape == (1, 14, 375, 1242)


def test_images_are_normalised_as_imagenets_were(name, monkeypatch):
    """Red, green and blue have mean 0 and deviation 1 over ImageNet: its published statistics.

    EfficientNet-Lite was published with (byte - 127) / 128.
    """
    net, seen = build_segmenter(name, N_CLASSES), []
    monkeypatch.setattr(net, "scores", lambda x: seen.append(x) or x)
    mean, deviation = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])
    if name == "efficientnet":
        mean, deviation = np.full(3, 127 / 255), np.full(3, 128 / 255)
    net(torch.from_numpy(np.stack([mean, mean + deviation])[..., None, None]).float().expand(2, 3, 16, 16))
    torch.testing.assert_close(seen[0], torch.tensor([0.0, 1.0])[:, None, None, None].expand(2, 3, 16, 16))


def test_scores_are_no_probabilities(name):
    scores = build_segmenter(name, N_CLASSES)(_images(2, 3, 32, 40))
    assert scores.min() < 0
    assert scores.max() > 0  # nor their logarithms


def test_the_seed_alone_decides_the_first_weights(name):
    before = torch.get_rng_state()
    one, same, other = (nn.utils.parameters_to_vector(build_segmenter(name, 4, seed=s).parameters()) for s in (1, 1, 2))
    assert torch.equal(one, same)
    assert not torch.equal(one, other)
    assert torch.equal(torch.get_rng_state(), before)


def test_images_of_a_batch_do_not_touch(name):
    net = build_segmenter(name, N_CLASSES).double().eval()
    images = _images(2, 3, 32, 40, dtype=torch.float64)
    alone = torch.cat([net(image[None]) for image in images])
    torch.testing.assert_close(net(images), alone)


def test_the_gradient_reaches_every_weight(name):
    net = build_segmenter(name, N_CLASSES)
    net(_images(2, 3, 45, 37)).square().mean().backward()
    for parameter in net.parameters():
        assert torch.isfinite(parameter.grad).all()
    first = next(m for m in net.modules() if isinstance(m, nn.Conv2d))
    assert first.in_channels == 3
    assert (first.weight.grad != 0).all()


def test_images_of_another_shape_or_type_are_refused(name):
    net = build_segmenter(name, N_CLASSES)
    with pytest.raises(ArgumentError, match=r"image: expected shape \(B, 3, h, w\), found \(1, 4, 32, 32\)"):
        net(torch.zeros(1, 4, 32, 32))
    with pytest.raises(ArgumentError, match=r"image: expected shape \(B, 3, h, w\), found \(3, 32, 32\)"):
        net(torch.zeros(3, 32, 32))
    with pytest.raises(ArgumentError, match=r"image: expected floats in 0..1, found torch.uint8"):
        net(torch.zeros(1, 3, 32, 32, dtype=torch.uint8))


def test_half_precision_images_are_taken(name):
    """What a file holds in 16 bits needs no conversion: weights and scores stay in 32."""
    net = build_segmenter(name, N_CLASSES).eval()
    images = _images(1, 3, 33, 47).half()
    with torch.no_grad():
        scores = net(images)
        torch.testing.assert_close(scores, net(images.float()), rtol=1e-3, atol=1e-3)
    assert scores.dtype == torch.float32


def test_a_single_image_can_be_learnt_from(name):
    """Batch normalisation needs two values of each channel, which the pixels of one image give."""
    net = build_segmenter(name, N_CLASSES).train()
    net(_images(1, 3, 96, 320)).square().mean().backward()
    assert all(torch.isfinite(parameter.grad).all() for parameter in net.parameters())


@pytest.mark.parametrize("size", [(15, 40), (40, 15), (1, 1)])
def test_the_smallest_images_work_or_are_refused(name, size):
    """Four poolings that round down leave nothing of 15 pixels; those that round up, and strides, leave one."""
    net, image = build_segmenter(name, N_CLASSES).eval(), _images(1, 3, *size)
    try:
        scores = net(image)
    except ArgumentError as error:
        smallest = int(re.search(r"expected .*?(\d+) x \1", str(error))[1])
        assert min(size) < smallest
        scores, size = net(_images(1, 3, smallest, smallest)), (smallest, smallest)
    assert scores.shape == (1, N_CLASSES, *size)
    assert torch.isfinite(scores).all()


def test_unknown_presets_and_class_numbers_are_refused(name):
    with pytest.raises(ArgumentError, match="preset: expected one of compact, paper, found 'huge'"):
        build_segmenter(name, 14, preset="huge")
    with pytest.raises(ArgumentError, match="n_classes: expected at least one class, found 0"):
        build_segmenter(name, 0)


@pytest.mark.parametrize("name", ["segnet", "fcn", "deeplab", "unet", "efficientnet"])
def test_the_compact_networks_that_are_compared_cost_alike(name):
    """What is compared is the architecture, not the effort: weights, and arithmetic of a forward pass.

    EfficientNet has its published weights, and so six times as many.
    """
    net, image = build_segmenter(name, 14).eval(), _images(1, 3, 96, 320)
    assert sum(p.numel() for p in net.parameters()) <= (3_100_000 if name == "efficientnet" else 500_000)
    with torch.inference_mode(), FlopCounterMode(display=False) as counter:
        net(image)
    assert 0.3e9 < counter.get_total_flops() < 0.9e9
