import pytest
import torch
from torch import nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.conv_deconv import ConvDeconv
from semgrid_edu.networks.segmenter import fresh_weights, initialise


def _convolutions(module):
    return [m for m in module.modules() if isinstance(m, nn.Conv2d | nn.Conv3d)]


def test_unpooling_puts_maxima_back_where_they_were():
    net = ConvDeconv(1, 1, widths=(1,), depths=(1,)).eval()
    for conv in _convolutions(net):
        nn.init.dirac_(conv.weight)  # the convolution that changes nothing
        nn.init.zeros_(conv.bias)
    x = torch.tensor([[1.0, 2, 8, 0], [3, 4, 5, 6], [9, 0, 1, 1], [0, 0, 1, 7]])
    expected = torch.tensor([[0.0, 0, 8, 0], [0, 4, 0, 0], [9, 0, 0, 0], [0, 0, 0, 7]])
    torch.testing.assert_close(net(x[None, None])[0, 0], expected, rtol=1e-4, atol=0)


@pytest.mark.parametrize("size", [(16, 16), (17, 23), (35, 62), (9, 30)])
@pytest.mark.parametrize("skips", [False, True])
def test_every_size_comes_back(size, skips):
    net = ConvDeconv(2, 5, widths=(3, 4, 6), depths=(1, 2, 1), skips=skips).eval()
    assert net(torch.randn(2, 2, *size, generator=torch.Generator().manual_seed(0))).shape == (2, 5, *size)


def test_a_map_that_cannot_be_halved_often_enough_is_refused():
    net = ConvDeconv(2, 5, widths=(3, 4, 6), depths=(1, 1, 1)).eval()
    assert net(torch.zeros(1, 2, 8, 8)).shape == (1, 5, 8, 8)
    with pytest.raises(ArgumentError, match="x: expected maps of 8 x 8 or larger"):
        net(torch.zeros(1, 2, 20, 7))


@pytest.mark.parametrize("skips", [False, True])
def test_as_many_layers_up_as_down(skips):
    net = ConvDeconv(3, 14, widths=(8, 16, 32), depths=(1, 2, 3), skips=skips)
    assert len(_convolutions(net.encoder)) == len(_convolutions(net.decoder)) == 6


def test_skips_carry_what_pooling_forgets():
    """Two inputs with the same maxima: without skips the network can't tell them apart, with skips it can."""
    x = torch.tensor([[[[5.0, 1], [2, 3]]]])
    y = torch.tensor([[[[5.0, 2], [1, 3]]]])
    for skips in (False, True):
        net = ConvDeconv(1, 1, widths=(1,), depths=(1,), skips=skips).eval()
        for conv in _convolutions(net):
            nn.init.zeros_(conv.bias)
            nn.init.zeros_(conv.weight)
            conv.weight.data[:, :, 1, 1] = 1
        assert torch.equal(net(x), net(y)) is not skips


class _EveryLayer(nn.Module):
    """Layers whose weights `initialise` doesn't draw: they come from PyTorch, as the layers are made."""

    def __init__(self, seed):
        super().__init__()
        with fresh_weights(self, seed):
            self.parts = nn.ModuleList(
                [nn.Linear(3, 4), nn.Embedding(5, 6), nn.ConvTranspose3d(2, 3, 2), nn.GRU(3, 4), nn.Conv2d(2, 3, 1)]
            )


def test_the_seed_alone_decides_the_weights_of_every_kind_of_layer():
    """From two states of the global generator, both of which it leaves as they were."""
    weights = []
    with torch.random.fork_rng(devices=[]):
        for state, seed in ((11, 1), (12, 1), (11, 2)):
            torch.manual_seed(state)
            before = torch.get_rng_state()
            net = _EveryLayer(seed)
            assert torch.equal(torch.get_rng_state(), before)
            weights.append([nn.utils.parameters_to_vector(part.parameters()) for part in net.parts])
    one, same, other = weights
    for a, b, c in zip(one, same, other, strict=True):
        assert torch.equal(a, b)
        assert not torch.equal(a, c)


def test_initial_signals_keep_their_size():
    # He et al.: each layer's weights have variance 2 / fan-in.
    net = ConvDeconv(64, 64, widths=(64,), depths=(3,))
    initialise(net, 0)
    for conv in _convolutions(net):
        assert conv.weight.var().item() == pytest.approx(2 / (64 * 9), rel=0.05)
