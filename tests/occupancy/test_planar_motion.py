"""Planar motion, against rigid transforms in space."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import rigid_transform
from semgrid_edu.errors import ArgumentError
from semgrid_edu.occupancy import PlanarMotion

metres, radians = st.floats(-50, 50), st.floats(-3, 3)
motions = st.builds(PlanarMotion, metres, metres, radians)


def matrix(motion: PlanarMotion) -> np.ndarray:
    return rigid_transform(Rotation.from_euler("z", motion.dyaw).as_matrix(), [motion.dx, motion.dy, 0])


@given(motions, motions)
def test_then_is_the_product_of_transforms(first, second):
    assert np.allclose(matrix(first.then(second)), matrix(first) @ matrix(second), atol=1e-9)


@given(motions, metres, metres)
def test_to_now_undoes_to_previous(motion, x, y):
    assert np.allclose(motion.to_now(motion.to_previous(np.array([[x, y]]))), [[x, y]], atol=1e-9)


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
