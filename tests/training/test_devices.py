"""No GPU is needed: whether there are some is what these tests make up."""

import pytest
import torch

from semgrid_edu.errors import ArgumentError
from semgrid_edu.training.devices import choose_device, mixed_precision


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


def test_a_cpu_computes_in_full_precision():
    with mixed_precision(torch.device("cpu")):
        assert torch.mm(torch.ones(2, 2), torch.ones(2, 2)).dtype == torch.float32


@pytest.mark.parametrize("able", [True, False])
def test_a_gpu_computes_in_half_the_bits_if_it_can(monkeypatch, able):
    asked = []
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda including_emulation: able or including_emulation)
    monkeypatch.setattr(torch, "autocast", lambda *args, **kwargs: asked.append((args, kwargs)))
    mixed_precision(torch.device("cuda", 1))
    assert asked == [(("cuda", torch.bfloat16), {"enabled": able})]
