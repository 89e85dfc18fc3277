"""The class of one cell: the factored filter is exact without repeated errors, and costs what its cut edge says."""

import numpy as np
import pytest
from worlds.lecture_00_street import CLASS_OF, SystemWorld
from worlds.lecture_14_class_memory import (
    MemoryWorld,
    exact_classes,
    factored_classes,
    frames_worth,
    loss_by_exponent,
    memory_price,
)  # fmt: skip


def test_with_independent_frames_the_factored_filter_is_exact():
    world = MemoryWorld(steps=4, repeats=0.0)
    named, stopped = np.random.default_rng(0).integers(0, (4, 2), (20, 4, 2)).transpose(2, 0, 1)
    for sequence in zip(named, stopped, strict=True):
        np.testing.assert_allclose(factored_classes(world, *sequence), exact_classes(world, *sequence)[-1], atol=1e-12)
    price = memory_price(world)
    assert price.weighted == pytest.approx(price.exact, abs=1e-9)
    assert price.exponent == pytest.approx(1, abs=1e-3)
    assert price.exact < price.forgotten


def test_one_frame_is_the_whole_systems_image():
    """Whatever repeats, one frame by itself is right as often as the toy street's network."""
    world = MemoryWorld(steps=1, repeats=0.7)
    says = np.einsum("e,mek->mk", world.errors(), world.named())
    np.testing.assert_allclose(says, CLASS_OF @ SystemWorld().confusion(), atol=1e-12)


def test_a_product_of_frames_that_err_together_is_worse_than_forgetting_and_an_exponent_repairs_most():
    price = memory_price(MemoryWorld(steps=3, repeats=0.6))
    assert price.exact < price.weighted < price.forgotten < price.independent
    losses = loss_by_exponent(MemoryWorld(steps=3, repeats=0.6), (price.exponent, 1.0))
    assert losses == pytest.approx([price.weighted, price.independent])


@pytest.mark.parametrize("frames", [2, 3, 4])
def test_the_best_exponent_is_the_textbooks(frames):
    """Derived for Gaussian errors, it holds here within a few per cent up to r = 0.6."""
    exponents = [memory_price(MemoryWorld(frames, repeats)).exponent for repeats in (0.3, 0.6, 0.9)]
    assert exponents == sorted(exponents, reverse=True)
    assert exponents[1] == pytest.approx(frames_worth(frames, 0.6) / frames, rel=0.03)


def test_what_never_changes_and_always_errs_alike_is_worth_one_frame():
    assert frames_worth(100, 1.0) == 1
    assert frames_worth(100, 0.0) == 100
