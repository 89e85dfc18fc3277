import json
from dataclasses import replace

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from semgrid_edu.datasets.samples import sample_weights
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import (
    SEGMENTERS,
    Architecture,
    SemanticGridNet,
    build_net,
    load_net,
    save_net,
    with_mean_scores,
)
from semgrid_edu.storage.files import sha256

SMALL = Architecture(image_size=(24, 80), grid=GridSpec(0, 30, -6, 6, 1.0), heights=(0.0, 0.5, 1.0))


@pytest.fixture
def net(camera):
    return build_net(SMALL, camera, seed=3).eval()


@pytest.fixture
def saved(net, tmp_path):
    path = tmp_path / "net.safetensors"
    save_net(net, path)
    return path


def _inputs(architecture):
    rng = torch.Generator().manual_seed(0)
    image = torch.rand(1, 3, *architecture.image_size, generator=rng)
    return image, torch.rand(1, 4, *architecture.grid.shape, generator=rng)


def _header(path):
    with safe_open(path, "pt") as file:
        return file.metadata()


def _rewrite(path, change_tensors=lambda t: t, header=None):
    save_file(change_tensors(load_file(path)), path, metadata=header)


def test_half_the_space_holds_convolutions_to_three_digits_and_the_rest_exactly(net, saved, camera, tmp_path):
    for name, tensor in net.state_dict().items():
        if name.endswith("running_var"):
            tensor.fill_(1e-9)  # 0 in 16 bits
    save_net(net, tmp_path / "half.safetensors", half=True)
    assert (tmp_path / "half.safetensors").stat().st_size < 0.65 * saved.stat().st_size
    for name, tensor in load_net(tmp_path / "half.safetensors", camera).state_dict().items():
        assert tensor.dtype == net.state_dict()[name].dtype
        tolerance = {"rtol": 1e-3, "atol": 1e-7} if tensor.ndim > 1 else {"rtol": 0, "atol": 0}
        torch.testing.assert_close(tensor, net.state_dict()[name], **tolerance)


def test_several_image_networks_come_back_and_their_scores_are_averaged(net, camera, tmp_path):
    mean = with_mean_scores([net, build_net(SMALL, camera, seed=4).eval()]).eval()
    save_net(mean, tmp_path / "mean.safetensors")
    loaded = load_net(tmp_path / "mean.safetensors", camera)
    assert loaded.architecture == replace(SMALL, n_segmenters=2)
    image, occupancy = _inputs(SMALL)
    each = [member(image) for member in loaded.segmenter.members]
    assert not torch.equal(*each)
    torch.testing.assert_close(loaded.segment(image), torch.stack(each).mean(dim=0))
    assert torch.equal(loaded(image, occupancy), mean(image, occupancy))


def test_the_mean_of_means_is_of_all_image_networks(camera):
    one, other, third = (build_net(SMALL, camera, seed=seed) for seed in (3, 4, 5))
    both = with_mean_scores([one, other])
    assert with_mean_scores([one]) is one
    assert both.fusion is one.fusion
    joined = with_mean_scores([both, third])
    assert [*joined.segmenter.members] == [one.segmenter, other.segmenter, third.segmenter]
    assert joined.architecture.n_segmenters == 3


def test_as_many_image_networks_as_one_wants_have_other_first_weights(camera):
    one, other = build_net(replace(SMALL, n_segmenters=2), camera, seed=3).segmenter.members
    alone = build_net(SMALL, camera, seed=3).segmenter
    assert all(map(torch.equal, one.parameters(), alone.parameters()))
    assert not all(map(torch.equal, one.parameters(), other.parameters()))
    with pytest.raises(ArgumentError, match=r"n_segmenters: expected 1 to 9, found 0"):
        replace(SMALL, n_segmenters=0)


def test_shipped_networks_are_written_again_byte_for_byte(camera, tmp_path):
    """Their files are older than the switch for the occupancy grid, and their checksums stand in documents."""
    shipped = sample_weights()
    save_net(load_net(shipped, camera), tmp_path / "again.safetensors")
    assert sha256(tmp_path / "again.safetensors") == sha256(shipped)


@pytest.mark.parametrize(
    "architecture",
    [*(replace(SMALL, segmenter=name) for name in SEGMENTERS), replace(SMALL, uses_occupancy=False)],
    ids=[*SEGMENTERS, "without occupancy"],
)
def test_weights_come_back_bit_for_bit(architecture, camera, tmp_path):
    net = build_net(architecture, camera, seed=3).eval()
    save_net(net, tmp_path / "net.safetensors")
    loaded = load_net(tmp_path / "net.safetensors", camera)
    assert loaded.architecture == architecture
    assert not loaded.training
    for name, tensor in net.state_dict().items():
        assert torch.equal(tensor, loaded.state_dict()[name])
    assert torch.equal(loaded(*_inputs(SMALL)), net(*_inputs(SMALL)))


def test_a_network_made_by_hand_is_saved_with_the_architecture_it_was_given(net, tmp_path, camera):
    by_hand = SemanticGridNet(net.segmenter, net.sampler, net.n_classes, seed=3, architecture=SMALL).eval()
    save_net(by_hand, tmp_path / "net.safetensors")
    assert torch.equal(load_net(tmp_path / "net.safetensors", camera)(*_inputs(SMALL)), net(*_inputs(SMALL)))


def test_a_missing_or_extra_tensor_is_refused(saved, camera):
    header = _header(saved)
    _rewrite(saved, lambda t: {**t, "more": torch.zeros(2)}, header)
    with pytest.raises(DataError, match=r"expected nothing for more, found \(2,\)"):
        load_net(saved, camera)
    _rewrite(saved, lambda t: {k: v for k, v in t.items() if k not in ("more", "fusion.reduce.0.bias")}, header)
    with pytest.raises(DataError, match=r"expected \(16,\) for fusion.reduce.0.bias, found nothing"):
        load_net(saved, camera)


@pytest.mark.parametrize("changed", ["no json", {"more": 1}, {"heights": ["low"]}])
def test_a_header_of_another_program_is_refused(saved, camera, changed):
    text = changed if isinstance(changed, str) else json.dumps(json.loads(_header(saved)["architecture"]) | changed)
    _rewrite(saved, header={"architecture": text})
    with pytest.raises(DataError, match="the architecture of a network in the header"):
        load_net(saved, camera)
