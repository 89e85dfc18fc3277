"""What the fusion network needs: variants see what they should, counts come back, the table is the lecture's."""

import numpy as np
import pytest
import torch
from worlds import lecture_08_gains as gains
from worlds.lecture_08_ablation import VARIANTS, build, class_weights, train
from worlds.lecture_08_street import Streets, confusions, named

from semgrid_edu.labels import IGNORE, KITTI_14


def _street(seed, n_planes):
    """One frame of 16 x 16 cells."""
    rng = np.random.default_rng(seed)
    planes = torch.from_numpy(rng.normal(size=(1, 14, n_planes, 16, 16)).astype(np.float32))
    o = torch.from_numpy(rng.dirichlet(np.ones(4), (1, 16, 16)).astype(np.float32)).permute(0, 3, 1, 2)
    return Streets(None, None, planes, o, torch.from_numpy(rng.integers(0, 14, (1, 16, 16))))


@pytest.mark.parametrize("name", VARIANTS)
def test_a_variant_depends_on_what_it_is_given_and_on_nothing_else(name):
    variant = VARIANTS[name]
    fusion, street = build(variant, seed=0).eval(), _street(0, variant.n_planes)
    planes, o = (each.clone().requires_grad_() for each in (street.planes, street.o))
    fusion(planes, o)[0, :, 8, 8].sum().backward()
    reach = (planes.grad.abs().sum(dim=(0, 1, 2)) > 0).sum()
    assert (reach > 1) == variant.neighbours
    assert (o.grad is not None and bool(o.grad.abs().any())) == variant.occupancy


def test_the_wide_network_without_neighbours_is_as_large_as_one_with():
    wide, usual = (
        sum(w.numel() for w in build(VARIANTS[name], 0).parameters())
        for name in ("20 planes, one cell, wide", "20 planes, neighbours")
    )
    assert 0.9 < wide / usual < 1.1


def test_training_lowers_the_loss_on_its_own_frame():
    street, fusion = _street(1, 1), build(VARIANTS["ground plane, one cell"], seed=0)
    before = (named(fusion, street) == street.truth.numpy()).mean()
    train(fusion, street, class_weights(street.truth, balanced=True), steps=30)
    assert (named(fusion, street) == street.truth.numpy()).mean() > before + 0.05


def test_unknown_and_unlabelled_cells_are_not_scored():
    road, car, hidden = map(KITTI_14.index, ("road", "car", "unknown-unobserved"))
    truth = torch.tensor([[[road, road, car, hidden, IGNORE]]])
    counts = confusions(np.array([[[road, car, car, car, car]]]), truth)
    assert counts.sum() == 3
    np.testing.assert_allclose(gains.scores(counts[None]), [[200 / 3, 75]])


def test_counts_come_back_from_their_text():
    counts = gains.read()
    assert {len(of_streets) for of_streets in counts["table of both"]} == {20}
    assert all(len(counts[name]) == 3 for name in VARIANTS)
    text = gains.written(counts["table of both"][0])
    assert [int(n) for n in text[0].split()] == counts["table of both"][0, 0].ravel().tolist()
