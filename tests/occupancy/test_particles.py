"""What many particles say together: mean and covariance of their velocities, held to numpy's."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from semgrid_edu.occupancy import Particles, PlanarMotion
from semgrid_edu.occupancy.cmcdot import velocity_moments
from semgrid_edu.occupancy.planar_motion import turn_moments
from semgrid_edu.occupancy.state import OUTSIDE, transform

SHAPE = (2, 3)


def particles_in(cells: list[int], seed: int) -> Particles:
    rng = np.random.default_rng(seed)
    velocity, weight = rng.normal(0, 10, (len(cells), 2)), rng.uniform(0.01, 1, len(cells))
    return Particles(np.zeros((len(cells), 2), np.float32), velocity.astype(np.float32), weight.astype(np.float32))


@settings(deadline=None)
@given(st.lists(st.integers(OUTSIDE, 5), min_size=1, max_size=60), st.integers(0, 1000))
def test_moments_of_velocity_are_numpys(cells, seed):
    particles, cells = particles_in(cells, seed), np.array(cells, np.int32)
    mean, covariance = velocity_moments(particles, cells, SHAPE)
    for cell in range(6):
        here, at = cells == cell, np.unravel_index(cell, SHAPE)
        if here.any():
            velocity, weight = particles.velocity[here].astype(float), particles.weight[here].astype(float)
            expected = np.cov(velocity.T, aweights=weight, ddof=0)
            np.testing.assert_allclose(mean[:, *at], np.average(velocity, axis=0, weights=weight), rtol=1e-5, atol=1e-5)
            np.testing.assert_allclose(covariance[:, :, *at], expected, rtol=1e-4, atol=1e-4)
        else:
            assert np.isnan(mean[:, *at]).all()
            assert np.isnan(covariance[:, :, *at]).all()


@settings(deadline=None)
@given(st.integers(0, 1000), st.floats(-7, 7))
def test_turned_moments_are_the_moments_of_turned_particles(seed, dyaw):
    cells = np.random.default_rng(seed).integers(0, 6, 40, dtype=np.int32)
    particles, motion = particles_in(cells, seed), PlanarMotion(dyaw=dyaw)
    turned = turn_moments(*velocity_moments(particles, cells, SHAPE), motion)
    expected = velocity_moments(transform(particles, motion), cells, SHAPE)
    assert np.array_equal(turned[1], turned[1].swapaxes(0, 1), equal_nan=True)
    for moments, others in zip(turned, expected, strict=True):
        np.testing.assert_allclose(moments, others, rtol=1e-3, atol=1e-3)
