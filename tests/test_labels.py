"""Label sets and the pooling of fine bird's-eye labels."""

import numpy as np
import pytest

from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import LABEL_GRID, FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, SYNTHIA_10, UNKNOWN_OF_STATE
from semgrid_edu.plotting import STATE_COLOURS


def labels_with(patch: np.ndarray) -> FrameLabels:
    """Put a patch of fine cells into the top left corner of an unlabelled map."""
    birdseye = np.full(LABEL_GRID.shape, IGNORE, dtype=np.uint8)
    birdseye[: patch.shape[0], : patch.shape[1]] = patch
    nothing = np.zeros((1, 1))
    return FrameLabels(KITTI_14, nothing, nothing, birdseye, birdseye == KITTI_14.index("car"))


def test_the_papers_class_counts():
    assert (len(KITTI_14), KITTI_14.n_semantic, len(SYNTHIA_10)) == (14, 10, 10)
    assert [KITTI_14.names[c] for c in UNKNOWN_OF_STATE] == [
        "unknown-free",
        "unknown-static",
        "unknown-dynamic",
        "unknown-unobserved",
    ]


def test_every_class_has_a_colour_of_its_own():
    for label_set in (KITTI_14, SYNTHIA_10):
        assert len(set(label_set.rgb)) == len(label_set)


def test_unlabelled_is_painted_white():
    np.testing.assert_array_equal(KITTI_14.colours(np.array([0, IGNORE])), [KITTI_14.rgb[0], (255, 255, 255)])


def test_an_unknown_name_is_refused_with_the_names_there_are():
    with pytest.raises(ArgumentError, match=r"road, sidewalk.*found 'tram'"):
        KITTI_14.index("tram")


def test_pooling_lets_what_stands_win_over_the_ground():
    road, sidewalk, car, signage = (KITTI_14.index(name) for name in ("road", "sidewalk", "car", "signage"))
    patch = np.full((5, 20), road)
    patch[:, 5:8] = sidewalk  # 15 of the second cell's 25 fine cells
    patch[0, 10] = signage  # one pole in the third cell
    patch[:2, 15:20], patch[4, 19] = car, signage  # more car than sign in the fourth
    pooled = labels_with(patch).birdseye_on(GridSpec.compact())
    assert pooled[0, :5].tolist() == [road, sidewalk, signage, car, IGNORE]


def test_a_cell_is_seen_when_any_part_of_it_is():
    patch = np.zeros((5, 10))
    patch[3, 7] = KITTI_14.index("car")
    assert labels_with(patch).visible_on(GridSpec.compact())[0, :3].tolist() == [False, True, False]


def test_pooling_to_a_grid_that_cuts_fine_cells_is_refused():
    with pytest.raises(ArgumentError, match="coarsening"):
        labels_with(np.zeros((1, 1))).birdseye_on(GridSpec(0, 71, -15.5, 15.5, 0.25))
    with pytest.raises(ArgumentError, match="coarsening"):
        labels_with(np.zeros((1, 1))).birdseye_on(GridSpec(0, 70, -15.5, 15.5, 0.5))


def test_no_class_has_the_colour_of_an_occupancy_state():
    """Else a cell of the state DYNAMIC and one of the class unknown-dynamic would look the same."""
    assert not set(KITTI_14.rgb) & set(STATE_COLOURS)
