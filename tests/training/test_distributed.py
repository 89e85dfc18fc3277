"""Two processes, started by torchrun, against one that does the same alone."""

import os
import subprocess
import sys
from pathlib import Path

import distributed_worker as worker
import pytest
import torch

from semgrid_edu.training.devices import open_fabric
from semgrid_edu.training.log import read_log


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """All that two processes do together, in one start of torchrun, since starting takes longer than the work."""
    folder = tmp_path_factory.mktemp("together")
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    command = [*torchrun, worker.__file__, str(folder), "share", "refuse", "learn_streets", "fail"]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    return folder, subprocess.run(command, capture_output=True, text=True, env=environment, timeout=240, check=False)


@pytest.fixture(scope="module")
def together(ended) -> Path:
    folder, result = ended
    assert (folder / "resumed" / "weights.safetensors").exists(), result.stderr
    return folder


def test_half_the_batch_in_each_is_the_same_step(together):
    """Losses and weights are those of the whole batch, however its weights are distributed over the processes."""
    expected = worker.fitted(open_fabric("cpu"), worker.fit_batch())
    for k in range(2):
        found = torch.load(together / f"fitted-{k}.pt", weights_only=True)
        torch.testing.assert_close(found, expected, atol=1e-12, rtol=1e-12)


def test_two_processes_learn(together):
    log = read_log(together / "whole" / "log.csv")
    for stage in ("image", "grid"):
        losses = log.loss[log.stage == stage]
        assert losses[-1] < losses[0]


def test_two_processes_resume_bit_for_bit(together):
    names = {path.name for path in (together / "whole").iterdir()}
    assert names == {path.name for path in (together / "resumed").iterdir()}
    for name in names:
        assert (together / "resumed" / name).read_bytes() == (together / "whole" / name).read_bytes(), name


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
