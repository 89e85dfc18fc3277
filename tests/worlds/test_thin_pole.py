"""A thin pole through pooling, indices, skips, strides and holes, against what can be worked out by hand."""

import numpy as np
import pytest
import torch
from torch import nn
from worlds.lecture_07_thin_pole import (
    REACHED,
    SHORT,
    SHORT_STEPS,
    WAYS,
    PoleNet,
    Way,
    apply_mechanism,
    draw_poles,
    overlap,
    overlap_of,
    train_pole_net,
)


@pytest.fixture(autouse=True)
def one_thread():
    """The bits of a training run depend on the number of threads, its speed hardly."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def _pole(column, shape=(16, 24)):
    image = np.zeros(shape)
    image[:, column] = 1
    return image


@pytest.mark.parametrize("column", [8, 9, 10, 11])
@pytest.mark.parametrize(("mechanism", "width"), [("nearest", 4), ("indices", 1), ("skips", 2), ("atrous", 5)])
def test_where_the_pole_ends_up_and_how_wide(mechanism, width, column):
    """Width is the number of pixels with at least half the largest brightness."""
    row = apply_mechanism(_pole(column), mechanism)[8]
    assert (row >= row.max() / 2).sum() == width
    brightest = np.flatnonzero(np.isclose(row, row.max()))
    assert brightest.mean() == (9.5 if mechanism == "nearest" else column)


def test_indices_leave_fifteen_pixels_of_sixteen_empty():
    """Each window's maximum is where it was, and nothing else is: a pole becomes a dotted line."""
    image = np.random.default_rng(0).random((16, 24))
    unpooled = apply_mechanism(image, "indices")
    windows = unpooled.reshape(4, 4, 6, 4)
    assert ((windows > 0).sum(axis=(1, 3)) == 1).all()
    np.testing.assert_array_equal(unpooled[unpooled > 0], image[unpooled > 0])
    np.testing.assert_array_equal(windows.max(axis=(1, 3)), image.reshape(4, 4, 6, 4).max(axis=(1, 3)))
    assert apply_mechanism(_pole(9), "indices")[:, 9].tolist() == [1, 0, 0, 0] * 4


def test_of_two_poles_in_a_window_indices_keep_one():
    both = _pole(9) + 0.5 * _pole(10)
    assert np.flatnonzero(apply_mechanism(both, "indices").any(axis=0)).tolist() == [9]


def test_networks_differ_in_their_way_alone():
    nets = [PoleNet(way, seed=3) for way in WAYS]
    first = nn.utils.parameters_to_vector(nets[0].parameters())
    for net in nets[1:]:
        assert torch.equal(nn.utils.parameters_to_vector(net.parameters()), first)
    image = torch.rand(1, 1, 32, 32, generator=torch.Generator().manual_seed(0))
    outputs = [net.eval()(image) for net in nets]
    assert all(output.shape == (1, 2, 32, 32) for output in outputs)
    assert all(not torch.allclose(a, b) for k, a in enumerate(outputs) for b in outputs[:k])


def test_the_atrous_network_holds_the_strided_ones_scores():
    strided, atrous = (PoleNet(way).double().eval() for way in (Way("strides", "at once"), Way("atrous", "")))
    image = torch.rand(1, 1, 32, 32, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    torch.testing.assert_close(strided(image)[..., ::4, ::4], atrous(image)[..., ::4, ::4])


def test_poles_are_thin_and_walls_wide():
    images, truth = draw_poles(100, seed=0)
    for image, labels in zip(images[:, 0], truth, strict=True):
        rows, columns = np.nonzero(labels.numpy())
        assert 8 <= np.ptp(rows) + 1 <= 28
        assert np.ptp(columns) in (0, 1)
        assert len(rows) == (np.ptp(rows) + 1) * (np.ptp(columns) + 1)
        # What stands out in the pole's rows is 7 to 12 columns wide, pole and wall together.
        contrast = (image[np.unique(rows)].mean(0) - image[:2].mean()).numpy()
        assert contrast[np.unique(columns)].min() > 0.1
        assert 7 <= (contrast > 0.15).sum() <= 12
    again = draw_poles(100, seed=0)
    assert torch.equal(again[0], images)
    assert torch.equal(again[1], truth)
    assert not torch.equal(draw_poles(100, seed=1)[0], images)


def test_overlap_by_hand():
    truth = [[[0, 1, 0, 0], [0, 1, 0, 0]], [[0, 0, 1, 1], [0, 0, 0, 0]]]
    called = [[[0, 1, 1, 0], [0, 0, 0, 0]], [[0, 0, 1, 1], [0, 0, 0, 1]]]
    assert overlap(called, truth) == 3 / 6
    assert overlap(truth, truth) == 1


def test_learning_is_the_same_each_time():
    images, _ = draw_poles(5, seed=99)
    net, again = (train_pole_net(Way("pooling", "skips"), seed=1, steps=5) for _ in range(2))
    with torch.no_grad():
        assert torch.equal(again(images), net(images))
    assert not net.training


def test_a_network_reaches_what_the_lecture_shows():
    """Other processors round otherwise, so a network ends elsewhere, but not far away."""
    way = Way("strides", "at once")
    assert set(REACHED) == set(SHORT) == set(WAYS)
    assert overlap_of(way, seed=0, steps=SHORT_STEPS) == pytest.approx(SHORT[way][0], abs=8)
