"""No GPU is needed: whether there are some is what these tests make up."""

from types import SimpleNamespace

import lightning_fabric
import pytest
import torch

from semgrid_edu.errors import ArgumentError
from semgrid_edu.training.devices import choose_device, open_fabric


def _gpus(monkeypatch, number):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: number > 0)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: number)


@pytest.mark.parametrize(
    ("gpus", "name", "process", "expected"),
    [
        (0, "auto", 0, "cpu"),
        (0, "auto", 3, "cpu"),
        (2, "cpu", 1, "cpu"),
        (2, "auto", 0, "cuda:0"),
        (2, "auto", 1, "cuda:1"),
        (2, "cuda", 1, "cuda:1"),
        (2, "cuda:1", 0, "cuda:1"),
    ],
)
def test_a_gpu_is_chosen_where_there_is_one(monkeypatch, gpus, name, process, expected):
    _gpus(monkeypatch, gpus)
    assert str(choose_device(name, process)) == expected


@pytest.mark.parametrize(
    ("gpus", "name", "process", "message"),
    [
        (0, "cuda", 0, "--device: expected cpu or one of the 0 GPUs that PyTorch finds here, found cuda"),
        (2, "cuda:2", 0, "--device: expected cpu or one of the 2 GPUs"),
        (2, "cuda:0", 1, "--device: expected auto, cpu or cuda: each process takes a GPU of its own, found 'cuda:0'"),
        (2, "auto", 2, "--device: expected .*, found auto, the GPU number 2 for process 2"),
        (2, "tpu", 0, "--device: expected auto, cpu, cuda or cuda:N, found 'tpu'"),
        (2, "cuda:-1", 0, "--device: expected auto, cpu, cuda or cuda:N"),
    ],
)
def test_a_device_that_is_not_there_is_named(monkeypatch, gpus, name, process, message):
    _gpus(monkeypatch, gpus)
    with pytest.raises(ArgumentError, match=message):
        choose_device(name, process)


@pytest.mark.parametrize(
    ("gpus", "able", "environment", "expected"),
    [
        (0, False, {}, ("cpu", 1, 1, "auto", "32-true")),
        (2, True, {}, ("cuda", [0], 1, "auto", "bf16-mixed")),
        (2, False, {}, ("cuda", [0], 1, "auto", "32-true")),
        (0, False, {"WORLD_SIZE": 4, "LOCAL_WORLD_SIZE": 2, "LOCAL_RANK": 1}, ("cpu", 2, 2, "ddp", "32-true")),
        (2, True, {"WORLD_SIZE": 2, "LOCAL_WORLD_SIZE": 2, "LOCAL_RANK": 1}, ("cuda", 2, 1, "ddp", "bf16-mixed")),
    ],
)
def test_device_precision_and_processes_are_those_of_machine_and_torchrun(
    monkeypatch, gpus, able, environment, expected
):
    """A GPU computes in half the bits if it can do so itself."""
    _gpus(monkeypatch, gpus)
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda including_emulation: able or including_emulation)
    for name, value in environment.items():
        monkeypatch.setenv(name, str(value))
    asked = []
    monkeypatch.setattr(lightning_fabric, "Fabric", lambda **given: asked.append(given) or SimpleNamespace(launch=int))
    open_fabric("auto")
    names = ("accelerator", "devices", "num_nodes", "strategy", "precision")
    assert asked == [dict(zip(names, expected, strict=True))]
