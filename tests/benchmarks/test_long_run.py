"""Eighty steps of the long run: what ten thousand must keep."""

import numpy as np
import pytest
from long_run import LAP, SPEED, long_run, pose_at, scene_at

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import CmcdotParams

SPEC, PARAMS = GridSpec(0, 40, -10, 10, 0.5), CmcdotParams(n_particles=20_000)


def test_the_circle_closes_and_has_the_vehicles_speed():
    start, end, soon = pose_at(0), pose_at(LAP), pose_at(1e-3)
    np.testing.assert_allclose([end.dx, end.dy, end.dyaw], [start.dx, start.dy, 2 * np.pi], atol=1e-9)
    np.testing.assert_allclose([soon.dx, soon.dy], [SPEED * 1e-3, 0], atol=1e-6)


def test_nothing_in_the_scene_stands_in_the_vehicles_way():
    for time in np.linspace(0, 3 * LAP, 400):
        pose = pose_at(time)
        for box in scene_at(time):
            nearest = np.clip([pose.dx, pose.dy], (box.x_min, box.y_min), (box.x_max, box.y_max))
            assert np.hypot(*(nearest - [pose.dx, pose.dy])) > 0.5, box


def test_eighty_steps_keep_distributions_bits_and_memory():
    first = list(long_run(80, 20, SPEC, PARAMS))
    again, other = (list(long_run(20, 20, SPEC, PARAMS, seed)) for seed in (0, 1))
    for found in first:
        assert found.worst_sum < 1e-5
        assert found.worst_class_sum < 1e-4
        assert found.lowest >= 0
        assert found.velocities > 0
    assert first[0].digest == again[0].digest != other[0].digest
    assert not first[-1].memory - first[0].memory >= 10  # NaN where the system doesn't tell


@pytest.mark.parametrize(("steps", "every"), [(0, 1), (1, 0)])
def test_no_steps_are_refused(steps, every):
    with pytest.raises(ArgumentError, match="steps, every"):
        next(long_run(steps, every, SPEC, PARAMS))
