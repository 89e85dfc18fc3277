"""The shipped samples, and excerpts like them."""

import json

import pytest
import torch
from tiny_drive import write_tiny_dataset

from data_samples.make_frames import write_excerpt
from semgrid_edu.datasets.samples import (
    sample_drive,
    sample_frames,
    sample_image_stage,
    sample_weights,
    samples_dir,
    samples_problems,
    trained_segmenters,
)
from semgrid_edu.datasets.training_set import FRAMES, read_excerpt
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.fast import TrainingSet
from semgrid_edu.networks import load_net
from semgrid_edu.storage.files import write_bytes
from semgrid_edu.storage.provenance import provenance_problems
from semgrid_edu.storage.tensors import read_tensors


@pytest.fixture(scope="module")
def excerpt(tmp_path_factory):
    """A data set and the excerpt of both frames of its training split."""
    root, samples = write_tiny_dataset(tmp_path_factory.mktemp("tiny")), tmp_path_factory.mktemp("samples")
    write_excerpt(root, 2, samples / "frames")
    return root, samples / "frames"


@pytest.mark.parametrize("name", sorted(path.parent.name for path in samples_dir().glob("*/provenance.json")))
def test_what_ships_is_as_it_was_made(name):
    assert provenance_problems(samples_dir() / name) == []


def test_an_excerpt_holds_the_frames_of_the_training_set_bit_for_bit(excerpt):
    root, folder = excerpt
    kept, training = read_excerpt(folder), TrainingSet(root, "train")
    assert len(kept) == len(training) == 2
    for sample, original in zip(kept, training, strict=True):
        assert all(map(torch.equal, sample[:4], original[:4]))
        assert sample.return_heights is None
    _, shipped = read_tensors(samples_dir() / "frames" / FRAMES)
    assert set(shipped) == set(read_tensors(folder / FRAMES)[1])


def test_more_frames_than_there_are_is_refused(excerpt):
    with pytest.raises(ArgumentError, match="n_frames: expected 1 to 2 frames, found 3"):
        write_excerpt(excerpt[0], 3, excerpt[1])


def test_samples_are_checked_one_by_one(excerpt):
    samples = excerpt[1].parent
    assert samples_problems(samples) == []
    write_bytes(samples / "frames" / "stray", b"")
    assert [problem.rsplit("/", 1)[-1] for problem in samples_problems(samples)] == ["stray: not in provenance.json"]


@pytest.mark.parametrize("segmenter", trained_segmenters())
def test_shipped_weights_come_from_whole_training_runs(segmenter):
    folder = sample_weights(segmenter).parent
    assert sample_image_stage(segmenter).parent == folder
    names = {"weights.safetensors", "image_stage.safetensors", "log.csv", "provenance.json"}
    assert {path.name for path in folder.iterdir()} == names
    assert max(path.stat().st_size for path in folder.iterdir()) <= 3e6
    command = json.loads((folder / "provenance.json").read_text())["command"]
    assert f"--out {folder.name} --segmenter {segmenter}" in command


def test_weights_that_are_not_shipped_are_refused():
    assert trained_segmenters() == ["segnet", "fcn", "deeplab"]
    with pytest.raises(ArgumentError, match="segmenter: expected one of segnet, fcn, deeplab, found 'unet'"):
        sample_weights("unet")


@pytest.mark.parametrize("content", [None, b"", b"no safetensors"])
def test_a_missing_or_damaged_excerpt_is_named(tmp_path, content):
    if content is not None:
        write_bytes(tmp_path / FRAMES, content)
    with pytest.raises(DataError, match=FRAMES):
        read_excerpt(tmp_path)


@pytest.mark.parametrize("segmenter", trained_segmenters())
def test_the_shipped_networks_and_image_networks_know_the_shipped_frames(segmenter):
    """They come from their training split; a frame's commonest class fills at most six cells in ten."""
    net, image_stage = (load_net(of(segmenter), sample_drive().camera) for of in (sample_weights, sample_image_stage))
    assert len(sample_frames()) == 6
    for sample in sample_frames():
        image = sample.image[None] / 255
        with torch.inference_mode():
            cells, pixels = net(image, sample.occupancy[None])[0].argmax(0), image_stage.segmenter(image)[0].argmax(0)
        assert (cells == sample.truth).float().mean() > 0.75
        assert (pixels == sample.labels).float().mean() > 0.7
