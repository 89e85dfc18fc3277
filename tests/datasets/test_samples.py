"""The shipped samples, and excerpts like them."""

import json
import os

import pytest
import torch
from tiny_drive import write_tiny_dataset

from semgrid_edu.datasets.samples import (
    FRAMES,
    WEIGHTS,
    read_excerpt,
    sample_drive,
    sample_frames,
    sample_weights,
    samples_problems,
    write_excerpt,
    write_weights,
)
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.files import write_bytes
from semgrid_edu.networks import load_net
from semgrid_edu.provenance import provenance_problems, write_provenance


@pytest.fixture(scope="module")
def excerpt(tmp_path_factory):
    """A data set and the excerpt of both frames of its training split."""
    root = write_tiny_dataset(tmp_path_factory.mktemp("tiny"))
    write_excerpt(root, 2, root / "samples" / "frames")
    return root, root / "samples" / "frames"


def test_an_excerpt_holds_the_frames_of_the_training_set_bit_for_bit(excerpt):
    root, folder = excerpt
    kept, training = read_excerpt(folder), TrainingSet(root, "train")
    assert len(kept) == len(training) == 2
    for sample, original in zip(kept, training, strict=True):
        assert all(map(torch.equal, sample, original))


def test_more_frames_than_there_are_is_refused(excerpt):
    with pytest.raises(ArgumentError, match="n_frames: expected 1 to 2 frames, found 3"):
        write_excerpt(excerpt[0], 3, excerpt[1])


def test_samples_are_checked_one_by_one(excerpt):
    samples = excerpt[1].parent
    assert samples_problems(samples) == []
    write_bytes(samples / "frames" / "stray", b"")
    assert [problem.rsplit("/", 1)[-1] for problem in samples_problems(samples)] == ["stray: not in provenance.json"]


def test_a_kept_training_is_what_it_ended_with(tmp_path):
    run, kept = tmp_path / "run", tmp_path / "weights"
    for name in ("weights.safetensors", "image_stage.safetensors", "log.csv"):
        write_bytes(run / name, name.encode())
    write_provenance(run, "semgrid-edu train", 3, ("torch",), minutes=9)
    os.utime(run / "weights.safetensors", (86400, 86400))
    write_weights(run, kept)
    assert provenance_problems(kept) == []
    assert sorted(path.name for path in kept.iterdir()) == ["log.csv", "provenance.json", WEIGHTS]
    assert (kept / WEIGHTS).read_bytes() == b"weights.safetensors"
    record = json.loads((kept / "provenance.json").read_text())
    assert (record["command"], record["seed"], record["training"]["minutes"]) == ("semgrid-edu train", 3, 9)
    assert record["trained"] == "1970-01-02 00:00 UTC"


def test_a_training_that_was_touched_since_is_not_kept(tmp_path):
    write_bytes(tmp_path / "run" / "weights.safetensors", b"learnt")
    write_provenance(tmp_path / "run", "semgrid-edu train", 0, ("torch",))
    write_bytes(tmp_path / "run" / "weights.safetensors", b"edited")
    with pytest.raises(DataError, match=r"weights\.safetensors: changed"):
        write_weights(tmp_path / "run", tmp_path / "kept")


@pytest.mark.parametrize("content", [None, b"", b"no safetensors"])
def test_a_missing_or_damaged_excerpt_is_named(tmp_path, content):
    if content is not None:
        write_bytes(tmp_path / FRAMES, content)
    with pytest.raises(DataError, match=FRAMES):
        read_excerpt(tmp_path)


def test_no_samples_at_all_is_an_error(tmp_path):
    with pytest.raises(DataError, match="found none"):
        samples_problems(tmp_path)


def test_the_shipped_network_knows_the_shipped_frames():
    """They come from its training split; a frame's commonest class fills at most six cells in ten."""
    net, frames = load_net(sample_weights(), sample_drive().camera), sample_frames()
    assert len(frames) == 6
    for sample in frames:
        with torch.inference_mode():
            predicted = net(sample.image[None] / 255, sample.occupancy[None])[0].argmax(0)
        assert (predicted == sample.truth).float().mean() > 0.75
