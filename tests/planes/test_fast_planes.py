"""The frozen operator behind `fast.PlaneSampler`: its memory; layout and threads change no bit."""

from copy import deepcopy

import numpy as np
import pytest
import torch

from semgrid_edu.fast.planes import PlaneSampler

SIZE, SHAPE = (30, 40), (5, 20, 10)


@pytest.fixture
def sampler():
    """Points anywhere in the image; a quarter of them aren't visible."""
    rng = np.random.default_rng(5)
    pixels = rng.uniform(0, 1, (*SHAPE, 2)) * (SIZE[1] - 1, SIZE[0] - 1)
    return PlaneSampler(pixels, rng.random(SHAPE) < 0.75, SIZE)


@pytest.fixture
def scores():
    return torch.randn(2, 3, *SIZE, generator=torch.Generator().manual_seed(0))


def _tensors(operator):
    return [*operator.matrix, *operator.transpose]


def test_layout_in_memory_doesnt_matter(sampler, scores):
    expected = sampler(scores)
    wider = torch.zeros(4, 3, 60, 80)
    wider[::2, :, ::2, ::2] = scores
    for same in (
        scores.contiguous(memory_format=torch.channels_last),
        scores.transpose(2, 3).contiguous().transpose(2, 3),
        wider[::2, :, ::2, ::2],
    ):
        assert torch.equal(sampler(same), expected)
    assert expected.permute(0, 3, 4, 2, 1).is_contiguous()
    one_for_all = scores[:, :1, :1, :1].expand(-1, 3, *SIZE)
    torch.testing.assert_close(sampler(one_for_all), sampler(one_for_all.clone()), rtol=0, atol=0)
    upstream = torch.ones(()).expand(expected.shape)  # as .sum().backward() passes it on
    gradients = [torch.autograd.functional.vjp(sampler, scores, g)[1] for g in (upstream, upstream.clone())]
    assert torch.equal(*gradients)


def test_threads_dont_change_a_bit(sampler, scores):
    threads, results = torch.get_num_threads(), []
    try:
        for n in (1, 2):
            torch.set_num_threads(n)
            results.append((sampler(scores), *torch.autograd.functional.vjp(sampler, scores, sampler(scores))))
    finally:
        torch.set_num_threads(threads)
    for one, two in zip(*results, strict=True):
        assert torch.equal(one, two)


def test_the_gradient_can_be_differentiated_again():
    rng = np.random.default_rng(2)
    sampler = PlaneSampler(rng.uniform(0, 3, (2, 3, 4, 2)), rng.random((2, 3, 4)) < 0.7, (4, 5)).double()
    scores = torch.from_numpy(rng.normal(size=(2, 3, 4, 5))).requires_grad_()
    assert torch.autograd.gradgradcheck(sampler, scores)


def test_a_copy_shares_the_operators_memory(sampler):
    copied = deepcopy(sampler)
    shared = zip(_tensors(copied.operator), _tensors(sampler.operator), strict=True)
    assert all(a.data_ptr() == b.data_ptr() for a, b in shared)
    assert sampler.operator.nbytes == sum(part.numel() * part.element_size() for part in _tensors(sampler.operator))


def test_a_copy_of_another_type_leaves_the_original_alone(sampler, scores):
    """As on the way to a GPU: PyTorch moves a module by calling a function with each of its tensors."""
    before = sampler(scores)
    copied = deepcopy(sampler)
    torch.nn.Sequential(copied).double()
    torch.testing.assert_close(copied(scores.double()).float(), before)
    assert {part.dtype for part in _tensors(copied.operator)} == {torch.float64, torch.int32}
    assert {part.dtype for part in _tensors(sampler.operator)} == {torch.float32, torch.int32}
    assert torch.equal(sampler(scores), before)
