"""Heights of returns and the scores at these heights, in cases that are computed by hand."""

import numpy as np
import pytest
import torch

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import SensorModel, scan_evidence
from semgrid_edu.planes import above_ground, cell_heights, pick_planes

SPEC = GridSpec(0, 12, -1, 1, 1.0)  # 12 rows, 2 columns; row 11 is the nearest
PLANES = [0.0, 0.5, 1.0]


def test_the_lowest_and_the_highest_return_of_a_cell():
    points = np.array([(3.5, 0.5, -0.1), (3.5, 0.5, 1.4), (3.2, 0.1, 0.6), (1.5, 0.5, 0.15), (99.0, 0.5, 1.0)])
    lowest, highest = cell_heights(points, SPEC)
    assert (lowest[8, 0], highest[8, 0]) == (-0.1, 1.4)
    assert (lowest[10, 0], highest[10, 0]) == (0.15, 0.15)
    assert np.isfinite(lowest).sum() == np.isfinite(highest).sum() == 2


def test_heights_above_ground_are_above_the_lowest_return_within_four_cells():
    """A wall from 0.5 to 2 m, ground at -0.25 m four cells away; another return at 7 m sees neither."""
    heights = torch.full((2, 12, 2), torch.nan)
    heights[:, 11, 0] = torch.tensor([0.5, 2.0])
    heights[:, 7, 1] = -0.25
    heights[:, 2, 0] = 7.0
    above = above_ground(heights, 0.5)
    assert above[:, [11, 7, 2], [0, 1, 0]].tolist() == [[0.75, 0, 0], [2.25, 0, 0]]
    assert torch.equal(above.isnan(), heights.isnan())
    batch = above_ground(heights[None].expand(3, -1, -1, -1), 0.5)
    assert torch.equal(batch.nan_to_num(-1)[1], above.nan_to_num(-1))


@pytest.mark.parametrize("cell", [0.2, 0.5])
def test_a_flat_roof_is_as_high_above_the_ground_in_small_cells(cell):
    """The ground ends 1.8 m before the cell: more than four cells of 0.2 m."""
    spec = GridSpec(0, 12, -1, 1, cell)
    points = np.array([(4.3, 0.1, -0.1), (6.1, 0.1, 3.0)])
    heights = torch.from_numpy(cell_heights(points, spec))
    rows, cols, _ = spec.cells(points)
    assert above_ground(heights, cell)[:, rows, cols].tolist() == [[0, 3.1], [0, 3.1]]


@pytest.mark.parametrize("marked", [False, True])
def test_own_returns_change_neither_occupancy_nor_heights(marked):
    """Bonnet, mirror, and a dark return from a split beam; beyond the outline the filter keeps what isn't dark."""
    street = np.array([(9.0, 0.5, 1.2, 0.4), (9.1, 0.5, 0.1, 0.4), (3.1, 0.3, 0.8, 0.4), (1.0, 0.5, 0.1, 0.4)])
    own = np.array([(1.5, 0.4, 0.9, 0.4), (1.9, -0.9, 1.1, 0.4), (2.0, 1.5, 1.3, 0.0)])
    scan = np.concatenate([street, own])
    if marked:
        street, scan = (np.column_stack([points, np.arange(len(points)) >= 4]) for points in (street, scan))
    spec = GridSpec(0, 12, -2, 2, 0.5)
    np.testing.assert_array_equal(cell_heights(scan, spec), cell_heights(street, spec))
    with_own, without = (scan_evidence(points, spec, SensorModel()) for points in (scan, street))
    np.testing.assert_array_equal(with_own.occupied, without.occupied)
    np.testing.assert_array_equal(with_own.free, without.free)


def test_scores_between_two_planes_below_above_and_without_a_return():
    """Two classes in five cells: the scores are 10, 20, 40 on the planes, and ten times that."""
    planes = torch.tensor([10.0, 20.0, 40.0]) * torch.tensor([1.0, 10.0])[:, None]
    planes = planes[None, :, :, None, None].expand(1, 2, 3, 1, 5)
    z = torch.tensor([[0.1, 0.75, -0.3, 3.0, torch.nan], [0.5, 1.0, 0.0, 0.25, torch.nan]])[None, :, None]
    picked = pick_planes(planes, z, PLANES)
    low, high = [12.0, 30, 10, 40, 10], [20.0, 40, 10, 15, 10]
    expected = torch.tensor([low, [10 * score for score in low], high, [10 * score for score in high]])
    torch.testing.assert_close(picked[0, :, 0], expected)


def test_a_single_plane_is_picked_at_every_height():
    planes = torch.rand(2, 3, 1, 4, 5)
    picked = pick_planes(planes, torch.rand(2, 2, 4, 5) * 4 - 1, [0.0])
    assert torch.equal(picked, torch.cat([planes[:, :, 0]] * 2, dim=1))


@pytest.mark.parametrize("side", [torch.nan, 0.3])
def test_the_gradient_of_what_is_picked_equals_finite_differences(side):
    rng = torch.Generator().manual_seed(0)
    planes = torch.rand(2, 2, 3, 2, 3, generator=rng, dtype=torch.float64, requires_grad=True)
    z = torch.rand(2, 2, 2, 3, generator=rng, dtype=torch.float64) * 2 - 0.5
    z[0, :, 0, 0] = side
    assert torch.autograd.gradcheck(lambda planes: pick_planes(planes, z, PLANES), planes)
