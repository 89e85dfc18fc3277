import numpy as np
import pytest
import torch
from torch import nn

from semgrid_edu.networks import build_segmenter
from semgrid_edu.networks.fcn import enlarge
from semgrid_edu.networks.vgg import Vgg

PAPER = (64, 128, 256, 512, 512)


def _count(module):
    return sum(p.numel() for p in module.parameters())


def test_fcn8s_has_the_published_parameters():
    """VGG16's 138,357,544 without ImageNet's last layer (4096 -> 1000), and three score layers instead."""
    with torch.device("meta"):
        net = build_segmenter("fcn", 21, preset="paper")
    assert _count(net) == 138_357_544 - 4097 * 1000 + 21 * (4097 + 513 + 257)
    assert net.conv6[0].weight.shape == (4096, 512, 7, 7)
    assert net.conv7[0].weight.shape == (4096, 4096, 1, 1)


@pytest.mark.parametrize(
    ("batch_norm", "numbers"),
    [
        (False, (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)),
        (True, (0, 3, 7, 10, 14, 17, 20, 24, 27, 30, 34, 37, 40)),
    ],
)
def test_convolutions_have_torchvisions_names(batch_norm, numbers):
    vgg = Vgg((1, 1, 1, 1, 1), batch_norm)
    weights = {name for name, p in vgg.named_parameters() if p.ndim == 4}
    assert weights == {f"features.{n}.weight" for n in numbers}


def test_pooling_keeps_a_last_odd_row_or_column():
    pooled = Vgg((1, 1, 1, 1, 1), batch_norm=False)(torch.zeros(1, 3, 375, 1242))
    assert [tuple(p.shape[2:]) for p in pooled] == [(188, 621), (94, 311), (47, 156), (24, 78), (12, 39)]


class Fixed(nn.Module):
    """An encoder that gives the same maps whatever it sees."""

    def __init__(self, maps):
        super().__init__()
        self.maps = maps

    def forward(self, x):
        return self.maps


def _bilinear(n, factor):
    """The (factor n, n) matrix that interpolates between the middles of n cells."""
    places = (np.arange(factor * n) + 0.5) / factor - 0.5
    return np.stack([np.interp(places, np.arange(n), row) for row in np.eye(n)], axis=1)


def test_scores_of_three_depths_are_summed_on_the_way_up():
    net = build_segmenter("fcn", 1).double()
    pool3, pool4 = (np.random.default_rng(0).normal(size=(n, n)) for n in (4, 2))
    maps = [torch.from_numpy(m)[None, None] for m in (pool3, pool4, np.array([[7.0]]))]
    net.backbone, net.conv6, net.conv7 = Fixed([None, None, *maps]), nn.Identity(), nn.Identity()
    for name, weight in [("score_pool3", 2.0), ("score_pool4", 3.0), ("score_conv7", 5.0)]:
        setattr(net, name, nn.Conv2d(1, 1, 1, bias=False).double())
        nn.init.constant_(getattr(net, name).weight, weight)
    by_hand = 5 * 7 + 3 * pool4  # a single cell, enlarged, is the same everywhere
    by_hand = _bilinear(2, 2) @ by_hand @ _bilinear(2, 2).T + 2 * pool3
    by_hand = _bilinear(4, 8) @ by_hand @ _bilinear(4, 8).T
    found = net(torch.zeros(1, 3, 32, 32, dtype=torch.float64))
    np.testing.assert_allclose(found.detach()[0, 0].numpy(), by_hand, rtol=1e-12)


@pytest.mark.parametrize("factor", [2, 8])
def test_what_is_enlarged_stays_where_it_was(factor):
    """Each cell says where the middle of its pixels lies; so does each pixel, then, but those at the border."""
    middles = factor * torch.arange(5.0, dtype=torch.float64) + (factor - 1) / 2
    cells = middles.expand(1, 1, 5, 5)
    pixels = enlarge(cells, factor, (5 * factor - 1, 5 * factor - 1))[0, 0]
    inner = slice(factor // 2, 5 * factor - factor // 2 - 1)
    expected = torch.arange(5.0 * factor, dtype=torch.float64)[inner]
    torch.testing.assert_close(pixels[inner, inner], expected.expand(len(expected), -1))
    torch.testing.assert_close(enlarge(cells.mT, factor, pixels.shape)[0, 0], pixels.T)


def test_only_skips_tell_finer_than_32_pixels():
    """Without the scores of pool3 and pool4, images whose coarsest maps are alike can't be told apart."""
    net, rng = build_segmenter("fcn", 2).eval(), torch.Generator().manual_seed(0)
    maps = [torch.randn(1, width, n, n, generator=rng) for width, n in ((48, 8), (64, 4), (64, 2))]
    other = [maps[0].flip(-1), maps[1].flip(-1), maps[2]]
    image = torch.zeros(1, 3, 64, 64)

    def scores(pooled):
        net.backbone = Fixed([None, None, *pooled])
        return net(image)

    assert not torch.allclose(scores(maps), scores(other))
    for layer in (net.score_pool3, net.score_pool4):
        nn.init.zeros_(layer.weight)
    assert torch.equal(scores(maps), scores(other))
