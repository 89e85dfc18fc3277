"""Baselines of the real street on cells that are computed by hand."""

import numpy as np
import pytest
import torch
from worlds.lecture_08_heights import (
    HeightFusion,
    forest_grids,
    height_channels,
    height_rule,
    learn_fusion,
    scan_heights,
    scores_of_returns,
)

from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14

SPEC = GridSpec(0, 12, -1, 1, 1.0)  # 12 rows, 2 columns; row 11 is the nearest
ROAD, CAR, BUILDING = (KITTI_14.index(name) for name in ("road", "car", "building"))


def _street():
    """Ground at -0.1 m in three cells of the left column; a kerb, a car's roof and a wall stand on it."""
    ground = [(0.5, 0.5, -0.1), (3.5, 0.5, -0.1), (4.5, 0.5, -0.1)]
    kerb, roof, wall = (1.5, 0.5, 0.15), (3.5, 0.5, 1.4), (4.5, 0.5, 2.5)
    far = (10.5, 0.5, 7.0)  # more than four cells from every other return
    return np.array([*ground, kerb, roof, wall, far])


def test_heights_are_above_the_lowest_return_within_four_cells():
    lowest, highest = scan_heights(_street(), SPEC)
    np.testing.assert_allclose(highest[[11, 10, 8, 7, 1], 0], [0, 0.25, 1.5, 2.6, 0], atol=1e-9)
    np.testing.assert_allclose(lowest[[11, 10, 8, 7, 1], 0], [0, 0.25, 0, 0, 0], atol=1e-9)


def test_the_rule_calls_road_up_to_a_quarter_metre_and_car_up_to_a_vans_height():
    """Beyond the last limit it is a building; a lone high return is its own ground; without a return it is road."""
    highest = np.array([[0.0, 0.25, 0.26, 2.2, 2.21, np.nan]])
    assert height_rule(np.stack([highest, highest])).tolist() == [[ROAD, ROAD, CAR, CAR, BUILDING, ROAD]]
    assert height_rule(scan_heights(_street(), SPEC))[[8, 7, 1], 0].tolist() == [CAR, BUILDING, ROAD]


def test_channels_are_finite_and_say_where_a_return_is():
    channels = height_channels(np.array([[[1.0, np.nan]], [[10.0, np.nan]]]))
    np.testing.assert_allclose(channels[:, 0], [[2.0, 0], [0.4, 0], [1, 0]])


def test_a_forest_learns_a_rule_of_one_feature_and_no_unlabelled_cells():
    rng = np.random.default_rng(0)
    feature = rng.random((2, 1, 30, 20))
    truths = np.where(feature[:, 0] > 0.5, CAR, ROAD).astype(np.uint8)
    truths[:, :, 0] = IGNORE
    truths[:, :, 1] = KITTI_14.index("unknown-free")
    asked = np.array([0.1, 0.9]).reshape(1, 1, 1, 2)
    assert forest_grids([feature], truths, [asked]).tolist() == [[[ROAD, CAR]]]


def test_scores_are_averaged_over_the_returns_of_a_cell():
    probability = np.array([[[1.0, 0.5]], [[0.0, 0.5]]])  # two classes, two pixels
    scores = scores_of_returns(probability, np.array([0, 1, 1]), np.array([5, 5, 6]), SPEC)
    np.testing.assert_allclose(scores.reshape(2, -1)[:, 4:8], [[0, 0.75, 0.5, 0], [0, 0.25, 0.5, 0]])


@pytest.mark.parametrize("uses_image", [True, False])
def test_a_fusion_network_learns_from_a_channel_beside_o(uses_image):
    """Class 1 is exactly where the fifth channel is 1; without the image the planes change nothing."""
    torch.manual_seed(0)
    truth = torch.randint(0, 2, (6, 16, 16), dtype=torch.uint8)
    channels = torch.cat([torch.full((6, 4, 16, 16), 0.25), truth[:, None].float()], dim=1)
    planes = torch.randn(6, 3, 2, 16, 16)
    net = HeightFusion(3, 2, 2, 1, uses_image)
    learn_fusion(net, planes, channels, truth, torch.ones(2), steps=30)
    logits = net(planes, channels)
    assert (logits.argmax(dim=1) == truth).float().mean() > 0.95
    assert torch.equal(net(planes + 1, channels), logits) != uses_image
