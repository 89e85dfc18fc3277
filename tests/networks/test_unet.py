import pytest
import torch
from torch import nn

from semgrid_edu.networks import build_segmenter


def _count(modules):
    return sum(p.numel() for module in modules for p in module.parameters())


def test_unet_has_the_published_parameters():
    """Ronneberger's, of one channel and two classes, are 31,030,658; a colour image and 14 classes add to them."""
    with torch.device("meta"):
        net = build_segmenter("unet", 14, preset="paper")
    convs = [m for m in net.modules() if isinstance(m, nn.Conv2d | nn.ConvTranspose2d)]
    assert len(convs) == 23  # "in total the network has 23 convolutional layers"
    assert _count(convs) == 31_030_658 + 9 * 64 * 2 + 65 * 12
    norms = [m for m in net.modules() if isinstance(m, nn.BatchNorm2d)]
    assert _count([net]) - _count(convs) == _count(norms) == 2 * 2 * (1024 + 2 * (512 + 256 + 128 + 64))


def test_the_decoder_sees_the_encoders_maps():
    """With what comes from below silenced, the finest map alone still tells images apart."""
    net = build_segmenter("unet", 2).eval()
    for parameter in net.up[0].parameters():
        nn.init.zeros_(parameter)
    images = torch.rand(2, 3, 16, 16, generator=torch.Generator().manual_seed(0))
    assert not torch.allclose(net(images[:1]), net(images[1:]))


def test_initial_up_convolutions_keep_signals_at_one_size():
    up = build_segmenter("unet", 2, preset="compact").up[-1]
    x = torch.randn(1, 128, 32, 32, generator=torch.Generator().manual_seed(0))
    assert up(x).std().item() == pytest.approx(1, rel=0.05)
