"""Two processes, started by torchrun, against one that does the same alone."""

import json
import os
import subprocess
import sys
from pathlib import Path

import distributed_worker as worker
import pytest
import torch
from safetensors.torch import load_file

from semgrid_edu.training import loop as training
from semgrid_edu.training import train
from semgrid_edu.training.devices import process_group, rank, world_size


def _two_processes(folder, *tasks):
    """Run tasks of the worker as a user would; a hang fails after two minutes."""
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    command = [*torchrun, str(Path(worker.__file__)), str(folder), *tasks]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120, check=False)


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """All that two processes do together, in one start of torchrun, since starting takes longer than the work."""
    folder = tmp_path_factory.mktemp("together")
    return folder, _two_processes(folder, "share", "refuse", "learn", "fail")


@pytest.fixture(scope="module")
def together(ended):
    folder, result = ended
    assert (folder / "losses.json").exists(), result.stderr
    return folder


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The losses of both ways to train, in one process, one after the other."""
    folder, threads, append_step = tmp_path_factory.mktemp("alone"), torch.get_num_threads(), training.append_step
    torch.set_num_threads(1)
    torch.set_default_dtype(torch.float64)
    try:
        losses = worker.exact_losses()
        for name, params in worker.RUNS.items():
            train(worker.precise_net(), worker.noisy_streets(), folder / name, params)
    finally:  # what other tests find
        training.append_step = append_step
        torch.set_default_dtype(torch.float32)
        torch.set_num_threads(threads)
    return folder, losses


def test_half_the_batch_in_each_is_the_same_step(together, alone):
    """The sum over two processes is the sum over the batch, in each step of both stages, but for rounding."""
    folder, expected = alone
    losses = json.loads((together / "losses.json").read_text())
    assert losses[: len(expected)] == pytest.approx(expected, abs=1e-9)
    for name in worker.RUNS:
        ours, theirs = (load_file(where / name / "weights.safetensors") for where in (together, folder))
        assert ours.keys() == theirs.keys()
        for part in ours:
            torch.testing.assert_close(ours[part], theirs[part], atol=1e-9, rtol=1e-9, msg=part)


def test_two_processes_resume_bit_for_bit(together):
    names = {path.name for path in (together / "end-to-end").iterdir()}
    assert names == {path.name for path in (together / "resumed").iterdir()}
    for name in names:
        assert (together / "resumed" / name).read_bytes() == (together / "end-to-end" / name).read_bytes(), name


def test_batch_normalisation_is_that_of_the_whole_batch(together):
    whole = worker.normalised(*worker.batch())
    first, second = (torch.load(together / f"normalised-{k}.pt", weights_only=True) for k in range(2))
    for name in ("y", "grad"):
        torch.testing.assert_close(torch.cat([first[name], second[name]]), whole[name], atol=2e-4, rtol=1e-4)
    for name in ("mean", "var"):
        torch.testing.assert_close(first[name], whole[name], rtol=1e-5, atol=0)
        assert torch.equal(first[name], second[name])


def test_the_first_process_makes_what_the_others_find(together):
    assert (together / "order-0").read_text() == "False"
    assert (together / "order-1").read_text() == "True"


def test_a_loss_that_is_nan_in_one_process_stops_both(together):
    first, second = ((together / f"nan-{k}").read_text() for k in range(2))
    assert first == second
    assert "with which it is nan in iteration 1" in first  # the first on grids
    assert not (together / "nan" / "weights.safetensors").exists()


def test_a_batch_that_cannot_be_shared_is_refused(together):
    for k in range(2):
        assert (
            together / f"odd-{k}"
        ).read_text() == "batch_size: expected a multiple of 2, the number of processes, found 3"


def test_a_process_that_fails_ends_the_others(ended, together):
    _, result = ended
    assert result.returncode == 1
    assert "InterruptedError" in result.stderr
    assert (together / "fails").is_dir()
    assert not (together / "fails" / "weights.safetensors").exists()


def test_without_torchrun_there_is_one_process():
    with process_group("cpu") as device:
        assert device == torch.device("cpu")
        assert (rank(), world_size()) == (0, 1)
