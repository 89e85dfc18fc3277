import pytest
import torch
from torch import nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import build_segmenter
from semgrid_edu.networks.deeplab import DeepLab, ResNet, interpolate


def _count(module):
    return sum(p.numel() for p in module.parameters())


def _with_random_statistics(net, seed=0):
    """Give batch normalisation other statistics than zero and one."""
    rng = torch.Generator().manual_seed(seed)
    for norm in (m for m in net.modules() if isinstance(m, nn.BatchNorm2d)):
        norm.running_mean.normal_(generator=rng)
        norm.running_var.uniform_(0.5, 2, generator=rng)
    return net.double().eval()


def test_deeplab_has_the_published_parameters():
    with torch.device("meta"):
        net = build_segmenter("deeplab", 21, preset="paper")
    assert [conv.dilation for conv in net.aspp] == [(6, 6), (12, 12), (18, 18), (24, 24)]
    assert _count(net) == 42_500_160 + 4 * (9 * 2048 + 1) * 21


def test_parameters_have_torchvisions_names():
    with torch.device("meta"):
        names = set(ResNet(64, (3, 4, 23, 3)).state_dict())
    norm = ("weight", "bias", "running_mean", "running_var", "num_batches_tracked")
    expected = {"conv1.weight"} | {f"bn1.{part}" for part in norm}
    for layer, depth in enumerate((3, 4, 23, 3), start=1):
        for block in (f"layer{layer}.{k}" for k in range(depth)):
            expected |= {f"{block}.conv{n}.weight" for n in (1, 2, 3)}
            expected |= {f"{block}.bn{n}.{part}" for n in (1, 2, 3) for part in norm}
        expected |= {f"layer{layer}.0.downsample.0.weight"}
        expected |= {f"layer{layer}.0.downsample.1.{part}" for part in norm}
    assert names == expected


@pytest.mark.parametrize(("output_stride", "step"), [(16, 2), (8, 4)])
def test_holes_keep_what_strides_would_have_given(output_stride, step):
    """The atrous network gives the strided one's values, and those between them."""
    strided = _with_random_statistics(ResNet(4, (1, 2, 3, 2), output_stride=32))
    atrous = ResNet(4, (1, 2, 3, 2), output_stride).double().eval()
    atrous.load_state_dict(strided.state_dict())
    image = torch.randn(1, 3, 150, 203, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    dense, sparse = atrous(image), strided(image)
    assert sparse.shape[2:] == (5, 7)
    assert dense.shape[2:] == (-(-150 // output_stride), -(-203 // output_stride))
    torch.testing.assert_close(dense[..., ::step, ::step], sparse)


@pytest.mark.parametrize("preset", ["compact", "paper"])
def test_the_last_two_stages_have_holes_instead_of_strides(preset):
    with torch.device("meta"):
        net = build_segmenter("deeplab", 14, preset)
        assert net.backbone(torch.empty(1, 3, 96, 320)).shape[2:] == (12, 40)
    rates = [[block.conv2.dilation[0] for block in getattr(net.backbone, f"layer{k}")] for k in (1, 2, 3, 4)]
    assert [set(stage[1:]) for stage in rates] == [{1}, {1}, {2}, {4}]
    assert [stage[0] for stage in rates] == [1, 1, 1, 2]
    assert len(net.aspp) == 4
    first = net.aspp[0].dilation[0]
    assert [conv.dilation[0] for conv in net.aspp] == [first, 2 * first, 3 * first, 4 * first]


@pytest.mark.parametrize(("preset", "scale"), [("compact", 0.25), ("paper", 1.0)])
def test_scores_of_the_four_rates_are_summed(monkeypatch, preset, scale):
    monkeypatch.setitem(DeepLab.PRESETS, "paper", {**DeepLab.PRESETS["paper"], "width": 2, "depths": (1, 1, 1, 1)})
    net = build_segmenter("deeplab", 3, preset).double().eval()
    image = torch.rand(1, 3, 41, 33, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    features = net.backbone((image - net.mean) / net.std)
    one_by_one = [scale * conv(features) for conv in net.aspp]
    assert len(one_by_one) == 4
    torch.testing.assert_close(net(image)[..., ::8, ::8], torch.stack(one_by_one).sum(0))


@pytest.mark.parametrize("size", [(33, 41), (38, 35), (40, 40), (1, 8)])
def test_what_is_interpolated_stays_where_it_was(size):
    """Each cell says on which column of pixels it lies; so does each pixel up to the last cell, then."""
    h, w = (-(-side // 8) for side in size)
    columns = 8 * torch.arange(float(w), dtype=torch.float64).expand(1, 1, h, w)
    expected = torch.arange(float(size[1]), dtype=torch.float64).clamp(max=8 * (w - 1)).expand(size)
    torch.testing.assert_close(interpolate(columns, 8, size)[0, 0], expected)


def test_other_output_strides_are_refused():
    with pytest.raises(ArgumentError, match="output_stride: expected 8, 16 or 32, found 12"):
        ResNet(4, (1, 1, 1, 1), output_stride=12)
