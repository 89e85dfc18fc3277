"""The class of one cell: the factored filter is exact without repeated errors, and costs what its cut edge says."""

from itertools import pairwise, product

import numpy as np
import pytest
from pyagrum_oracle import assert_oracle_agrees

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import d_separated, enumerate_marginals
from semgrid_edu.stage_models.class_memory import (
    MemoryWorld,
    class_over_time,
    exact_classes,
    factored_classes,
    frames_worth,
    memory_price,
    readings,
    smoothed_classes,
)
from semgrid_edu.stage_models.system_world import CLASS_OF, STREET, SystemWorld

SEEN = [2, 2, 0], [1, 0, 0]


@pytest.mark.parametrize("repeats", [0.0, 0.6, 1.0])
def test_elimination_is_the_sum_over_everything(repeats):
    world = MemoryWorld(repeats=repeats)
    model = class_over_time(world).model
    summed = enumerate_marginals(model, "m2", readings(*SEEN)).normalised().table @ CLASS_OF
    np.testing.assert_allclose(exact_classes(world, *SEEN)[-1], summed, atol=1e-12)
    first = enumerate_marginals(model, "m0", readings(*SEEN)).normalised().table @ CLASS_OF
    np.testing.assert_allclose(exact_classes(world, *SEEN, smooth=True)[0], first, atol=1e-12)


def test_with_independent_frames_the_factored_filter_is_exact():
    world = MemoryWorld(steps=4, repeats=0.0)
    named, stopped = np.random.default_rng(0).integers(0, (4, 2), (20, 4, 2)).transpose(2, 0, 1)
    for sequence in zip(named, stopped, strict=True):
        np.testing.assert_allclose(factored_classes(world, *sequence), exact_classes(world, *sequence)[-1], atol=1e-12)
    price = memory_price(world)
    assert price.weighted == pytest.approx(price.exact, abs=1e-9)
    assert price.exponent == pytest.approx(1, abs=1e-3)
    assert price.exact < price.forgotten


def test_forward_backward_is_the_sum_over_all_contents():
    """With independent frames: five contents at each of five frames, term by term; the last one is the filter's."""
    world, named, stopped = MemoryWorld(steps=5, repeats=0.0), [2, 2, 0, 1, 3], [1, 0, 0, 1, 1]
    says = CLASS_OF @ SystemWorld().confusion()
    joint = np.zeros((5, 5))
    for contents in product(range(5), repeat=5):
        p = STREET[contents[0]] * np.prod([world.street.change()[step] for step in pairwise(contents)])
        p *= np.prod(says[contents, named] * world.returned()[contents, stopped])
        joint[range(5), contents] += p
    smoothed = smoothed_classes(world, named, stopped)
    np.testing.assert_allclose(smoothed, joint / joint.sum(axis=1, keepdims=True) @ CLASS_OF, atol=1e-12)
    weighed = smoothed_classes(world, named, stopped, exponent=0.4)[-1]
    np.testing.assert_allclose(weighed, factored_classes(world, named, stopped, exponent=0.4), atol=1e-12)


def test_one_frame_is_the_whole_systems_image():
    """Whatever repeats, one frame by itself is right as often as the toy street's network."""
    world = MemoryWorld(steps=1, repeats=0.7)
    says = np.einsum("e,mek->mk", world.errors(), world.named())
    np.testing.assert_allclose(says, CLASS_OF @ SystemWorld().confusion(), atol=1e-12)


def test_a_product_of_frames_that_err_together_is_worse_than_forgetting_and_an_exponent_repairs_most():
    price = memory_price(MemoryWorld(steps=3, repeats=0.6))
    assert price.exact < price.weighted < price.forgotten < price.independent


@pytest.mark.parametrize("frames", [2, 3, 4])
def test_the_best_exponent_is_the_textbooks(frames):
    """Derived for Gaussian errors, it holds here within a few per cent up to r = 0.6."""
    exponents = [memory_price(MemoryWorld(frames, repeats)).exponent for repeats in (0.3, 0.6, 0.9)]
    assert exponents == sorted(exponents, reverse=True)
    assert exponents[1] == pytest.approx(frames_worth(frames, 0.6) / frames, rel=0.03)


def test_what_never_changes_and_always_errs_alike_is_worth_one_frame():
    assert frames_worth(100, 1.0) == 1
    assert frames_worth(100, 0.0) == 100


def test_errors_are_what_couples_the_frames_beyond_the_cells_content():
    model = class_over_time(MemoryWorld(steps=2)).model
    assert not d_separated(model, "z0", "z1", given=("m0", "m1"))
    assert d_separated(model, "z0", "z1", given=("m0", "m1", "e0"))
    assert d_separated(model, "l0", "z1", given="m0")


def test_pyagrum_agrees_on_the_memory():
    assert_oracle_agrees(class_over_time(MemoryWorld(steps=3)).model, readings(*SEEN))


def test_what_is_no_memory_world_is_refused():
    for bad in ({"steps": 6}, {"repeats": 1.2}):
        with pytest.raises(ArgumentError, match=next(iter(bad))):
            MemoryWorld(**bad)
    with pytest.raises(ArgumentError, match="stopped"):
        readings([1, 2], [0])
    with pytest.raises(ArgumentError, match="repeats"):
        frames_worth(3, 1.5)
