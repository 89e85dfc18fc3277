"""The sixth stage in the pipeline: it changes nothing that stands before it, and a student's own takes its place."""

from dataclasses import replace

import numpy as np
import pytest

from semgrid_edu.errors import ArgumentError
from semgrid_edu.memory import MemoryParams, View, remember_drive
from semgrid_edu.networks import Architecture, build_net
from semgrid_edu.occupancy import CmcdotParams
from semgrid_edu.pipeline import StageError, Stages, run_pipeline

FEW = CmcdotParams(n_particles=2000)


@pytest.fixture(scope="module")
def net(drive):
    return build_net(Architecture(), drive.camera, seed=3).eval()


@pytest.fixture(scope="module")
def results(drive, net):
    return list(run_pipeline(drive, net, occupancy=FEW, memory=True))


def test_memory_changes_nothing_else_and_is_what_remember_drive_does(drive, net, results):
    plain = list(run_pipeline(drive, net, occupancy=FEW))
    views = [View(result.frame, result.belief, result.grid) for result in plain]
    expected = remember_drive(views, net.architecture.grid)
    for result, without, remembered in zip(results, plain, expected, strict=True):
        assert without.remembered is None
        assert set(result.seconds) - set(without.seconds) == {"remember"}
        np.testing.assert_array_equal(result.refined, without.refined)
        np.testing.assert_array_equal(result.remembered, remembered.astype(np.float32))
        np.testing.assert_allclose(result.remembered.sum(axis=0), 1, atol=1e-4)


def test_a_memory_of_ones_own_takes_the_place_of_the_packages(drive, net, results):
    def remember(views, spec):
        for k, view in enumerate(views):
            view.grid[:] = k  # its own copy
            yield np.full(view.grid.shape, 1 / len(view.grid))

    own = replace(Stages.fast(net, FEW), remember=remember)
    for result, expected in zip(run_pipeline(drive, own), results, strict=True):
        np.testing.assert_allclose(result.remembered, 1 / 14)
        np.testing.assert_array_equal(result.grid, expected.grid)


def test_what_a_memory_does_wrong_is_named(drive, net):
    def all_at_once(views, spec):
        return [view.grid for view in views]

    def wrong_sum(views, spec):
        for view in views:
            yield 2 * view.grid

    own = Stages.fast(net, FEW)
    for bad, message in (
        (all_at_once, r"remember \(.*takes a frame, yields its grid"),
        (wrong_sum, "remember .*sum to 1"),
    ):
        with pytest.raises(StageError, match=message):
            list(run_pipeline(drive, replace(own, remember=bad)))


def test_memory_is_refused_where_it_cant_be(drive, net):
    with pytest.raises(ArgumentError, match=r"^memory: expected True, False or MemoryParams"):
        next(run_pipeline(drive, net, memory="yes"))
    other = build_net(Architecture(label_set="SYNTHIA-10"), drive.camera).eval()
    with pytest.raises(ArgumentError, match=r"^memory: expected the classes of KITTI-14, .*SYNTHIA-10"):
        Stages.of(other, memory=MemoryParams())
