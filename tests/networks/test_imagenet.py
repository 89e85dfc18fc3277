import pytest
import torch
import torch.nn.functional as F
from safetensors.torch import load_file, save_file

from semgrid_edu.errors import DataError
from semgrid_edu.networks import SEGMENTERS, build_segmenter, load_imagenet

WIDTHS = (2, 3, 4, 5, 5)
TINY = {
    "segnet": {"widths": WIDTHS, "depths": (2, 2, 3, 3, 3)},
    "fcn": {"widths": WIDTHS, "hidden": 6, "batch_norm": False},
    "deeplab": {"width": 2, "depths": (3, 4, 23, 3), "rates": (1, 2), "scale": 1.0},
}
"""The published networks' layers with hardly any channels."""
VGG16 = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)


@pytest.fixture
def tiny(monkeypatch):
    for name, preset in TINY.items():
        monkeypatch.setitem(SEGMENTERS[name].PRESETS, "tiny", preset)
    return lambda name: build_segmenter(name, 3, preset="tiny")


@pytest.fixture
def vgg_file(tmp_path):
    """Weights as torchvision's vgg16 names them, of few channels."""
    rng = torch.Generator().manual_seed(0)
    channels = [3, 2, 2, 3, 3, 4, 4, 4, 5, 5, 5, 5, 5, 5]
    shapes = {f"features.{n}": (channels[k + 1], channels[k], 3, 3) for k, n in enumerate(VGG16)}
    shapes |= {"classifier.0": (6, 5 * 7 * 7), "classifier.3": (6, 6), "classifier.6": (10, 6)}
    tensors = {f"{name}.weight": torch.randn(shape, generator=rng) for name, shape in shapes.items()}
    tensors |= {f"{name}.bias": torch.randn(shape[0], generator=rng) for name, shape in shapes.items()}
    save_file(tensors, tmp_path / "vgg16.safetensors")
    return tmp_path / "vgg16.safetensors"


def _change(path, **tensors):
    """Replace tensors of a file; None removes one."""
    changed = load_file(path) | {name.replace("__", "."): tensor for name, tensor in tensors.items()}
    save_file({name: tensor for name, tensor in changed.items() if tensor is not None}, path)


def test_all_of_vgg16_but_its_last_layer_is_loaded_into_fcn():
    with torch.device("meta"):
        tensors = build_segmenter("fcn", 14, preset="paper").imagenet_tensors()
    expected = [*(f"features.{n}" for n in VGG16), "classifier.0", "classifier.3"]
    assert set(tensors) == {f"{name}.{part}" for name in expected for part in ("weight", "bias")}
    assert sum(t.numel() for t in tensors.values()) == 138_357_544 - 4_097_000


def test_thirteen_convolutions_are_loaded_into_segnet():
    with torch.device("meta"):
        tensors = build_segmenter("segnet", 14, preset="paper").imagenet_tensors()
    assert set(tensors) == {f"features.{n}.{part}" for n in VGG16 for part in ("weight", "bias")}
    assert sum(t.numel() for t in tensors.values()) == 14_714_688


def test_parameters_and_statistics_of_resnet101_are_loaded_into_deeplab():
    with torch.device("meta"):
        tensors = build_segmenter("deeplab", 14, preset="paper").imagenet_tensors()
    statistics = [name for name in tensors if "running" in name]
    assert len(statistics) == 2 * 104
    assert sum(t.numel() for name, t in tensors.items() if name not in statistics) == 44_549_160 - 2_049_000


def test_segnet_gets_convolutions_and_keeps_its_normalisation(tiny, vgg_file):
    net, fresh, file = tiny("segnet"), tiny("segnet").state_dict(), load_file(vgg_file)
    load_imagenet(net, vgg_file)
    loaded = [layer[0].weight for stage in net.conv_deconv.encoder for layer in stage]
    for number, weight in zip(VGG16, loaded, strict=True):
        assert torch.equal(weight, file[f"features.{number}.weight"])
    same = {name for name, tensor in net.state_dict().items() if torch.equal(tensor, fresh[name])}
    assert same == {name for name in fresh if "decoder" in name or name.split(".")[-2] != "0"}


def test_fcns_hidden_layers_compute_what_vggs_did(tiny, vgg_file):
    net, file = tiny("fcn"), load_file(vgg_file)
    load_imagenet(net, vgg_file)
    pool5 = torch.randn(1, 5, 7, 7, generator=torch.Generator().manual_seed(1))
    hidden = F.relu(F.linear(pool5.flatten(1), file["classifier.0.weight"], file["classifier.0.bias"]))
    hidden = F.relu(F.linear(hidden, file["classifier.3.weight"], file["classifier.3.bias"]))
    torch.testing.assert_close(net.conv7(net.conv6(pool5))[..., 3, 3], hidden)
    assert torch.equal(net.backbone.features[28].bias, file["features.28.bias"])


def test_deeplab_gets_statistics_as_well(tiny, tmp_path):
    rng = torch.Generator().manual_seed(0)
    other = {name: torch.rand(t.shape, generator=rng) for name, t in tiny("deeplab").imagenet_tensors().items()}
    save_file({**other, "fc.weight": torch.zeros(10, 64)}, tmp_path / "resnet101.safetensors")
    net, fresh = tiny("deeplab"), tiny("deeplab")
    load_imagenet(net, tmp_path / "resnet101.safetensors")
    assert torch.equal(net.backbone.layer3[22].bn2.running_var, other["layer3.22.bn2.running_var"])
    assert torch.equal(net.backbone.layer4[0].downsample[0].weight, other["layer4.0.downsample.0.weight"])
    assert torch.equal(net.aspp[0].weight, fresh.aspp[0].weight)


def test_a_file_that_does_not_fit_changes_nothing(tiny, vgg_file):
    net, fresh = tiny("fcn"), tiny("fcn").state_dict()
    _change(vgg_file, features__28__weight=torch.zeros(5, 5, 5, 5))
    with pytest.raises(
        DataError, match=r"vgg16.*: expected \(5, 5, 3, 3\) for features.28.weight, found \(5, 5, 5, 5\)"
    ):
        load_imagenet(net, vgg_file)
    _change(vgg_file, features__28__weight=None)
    with pytest.raises(DataError, match=r"expected \(5, 5, 3, 3\) for features.28.weight, found nothing"):
        load_imagenet(net, vgg_file)
    for name, tensor in net.state_dict().items():
        assert torch.equal(tensor, fresh[name])


def test_the_classifier_is_expected_as_it_was_published(tiny, vgg_file):
    _change(vgg_file, classifier__0__weight=torch.zeros(6, 5, 7, 7))
    with pytest.raises(DataError, match=r"expected \(6, 245\) for classifier.0.weight, found \(6, 5, 7, 7\)"):
        load_imagenet(tiny("fcn"), vgg_file)


PUBLISHED = [name for name, network in SEGMENTERS.items() if network.IMAGENET]


@pytest.mark.parametrize("name", SEGMENTERS)
def test_a_network_names_its_published_weights_exactly_when_it_takes_some(name):
    with torch.device("meta"):
        assert bool(build_segmenter(name, 3, preset="paper").imagenet_tensors()) == (name in PUBLISHED)
