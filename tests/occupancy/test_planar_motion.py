"""Planar motion, against rigid transforms in space."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import rigid_transform
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast.occupancy.cells import _look_up, look_up
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import PlanarMotion

metres, radians = st.floats(-50, 50), st.floats(-3, 3)
motions = st.builds(PlanarMotion, metres, metres, radians)


def matrix(motion: PlanarMotion) -> np.ndarray:
    return rigid_transform(Rotation.from_euler("z", motion.dyaw).as_matrix(), [motion.dx, motion.dy, 0])


@given(motions, motions)
def test_then_is_the_product_of_transforms(first, second):
    assert np.allclose(matrix(first.then(second)), matrix(first) @ matrix(second), atol=1e-9)


@given(motions, metres, metres)
def test_child_from_parent_undoes_parent_from_child(motion, x, y):
    assert np.allclose(motion.child_from_parent(motion.parent_from_child(np.array([[x, y]]))), [[x, y]], atol=1e-9)


@given(motions, motions)
def test_from_poses_finds_the_motion_between_two_poses(before, motion):
    found = PlanarMotion.from_poses(matrix(before), matrix(before) @ matrix(motion))
    assert np.allclose(matrix(found), matrix(motion), atol=1e-9)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_motion_to_nowhere_is_refused(bad):
    with pytest.raises(ArgumentError, match="motion"):
        PlanarMotion(bad, 0, 0)
    with pytest.raises(ArgumentError, match="T_world_from_now"):
        PlanarMotion.from_poses(np.eye(4), np.full((4, 4), bad))


def test_whole_numbers_are_not_compiled_anew():
    grids = [GridSpec(*map(kind, (0, 4, -2, 2, 1))) for kind in (float, int)]
    motions = [PlanarMotion(*map(kind, (1, 0, 0))) for kind in (float, int)]
    values, nothing = np.arange(16, dtype=np.float32).reshape(1, 4, 4), np.zeros(1, np.float32)
    looked = look_up(values, nothing, grids[0], grids[0], motions[0])
    compiled = len(_look_up.signatures)
    for source, target, motion in itertools.product(grids, grids, motions):
        np.testing.assert_array_equal(look_up(values, nothing, source, target, motion), looked)
    assert len(_look_up.signatures) == compiled
