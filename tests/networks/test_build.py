"""The whole network from its description: what is remembered of calibrations, and the architecture it carries."""

import gc
from dataclasses import replace
from weakref import ref

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import rigid_transform
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import Architecture, build_net
from semgrid_edu.networks import build as building
from semgrid_edu.planes import PlaneOperator, PlaneSampler, plane_pixels

COARSE = Architecture(
    image_size=(32, 64), grid=GridSpec(x_min=2, x_max=12, y_min=-4, y_max=4, cell=1.0), heights=(0.0, 0.5)
)


@pytest.fixture
def built(monkeypatch):
    """Forget what other tests built; return a list that grows by one for each operator built."""
    building._remembered.cache_clear()
    sizes, original = [], PlaneOperator.build
    monkeypatch.setattr(PlaneOperator, "build", lambda *points: sizes.append(points[-1]) or original(*points))
    yield sizes
    building._remembered.cache_clear()


def _tensors(sampler):
    return [*sampler.operator.matrix, *sampler.operator.transpose]


def _turned(camera):
    turn = rigid_transform(Rotation.from_euler("z", 0.1).as_matrix(), np.zeros(3))
    return replace(camera, T_camera_from_lidar=camera.T_camera_from_lidar @ turn)


def _by_hand(architecture, camera):
    camera = camera.resized(architecture.image_size)
    return PlaneSampler(*plane_pixels(architecture.grid, architecture.heights, camera), camera.size)


def test_the_operator_of_a_calibration_is_built_once(built, camera):
    first = build_net(COARSE, camera).sampler
    same = replace(COARSE, segmenter="fcn", grid=replace(COARSE.grid), heights=np.array(COARSE.heights))
    second = build_net(same, replace(camera, K=camera.K.copy())).sampler
    assert len(built) == 1
    for a, b, c in zip(*map(_tensors, (first, second, _by_hand(COARSE, camera))), strict=True):
        assert a.data_ptr() == b.data_ptr()
        assert torch.equal(a, c)


@pytest.mark.parametrize(
    ("part", "change"),
    [
        ("grid", lambda architecture, camera: (replace(architecture, grid=replace(COARSE.grid, cell=0.5)), camera)),
        ("heights", lambda architecture, camera: (replace(architecture, heights=(0.0, 0.6)), camera)),
        ("image_size", lambda architecture, camera: (replace(architecture, image_size=(30, 64)), camera)),
        ("K", lambda architecture, camera: (architecture, replace(camera, K=camera.K * [[0.9], [1], [1]]))),
        ("pose", lambda architecture, camera: (architecture, _turned(camera))),
        ("the camera's size", lambda architecture, camera: (architecture, replace(camera, size=(370, 1242)))),
        ("lidar_height", lambda architecture, camera: (architecture, replace(camera, lidar_height=1.2))),
    ],
)
def test_whatever_decides_the_operator_gets_its_own(built, camera, part, change):
    build_net(COARSE, camera)
    architecture, other = change(COARSE, camera)
    remembered = build_net(architecture, other).sampler
    assert len(built) == 2, part
    for a, b in zip(_tensors(remembered), _tensors(_by_hand(architecture, other)), strict=True):
        assert torch.equal(a, b)


def test_a_camera_changed_in_place_gets_its_own_operator(built, camera):
    before = build_net(COARSE, camera).sampler
    camera.K[0, 0] = 700
    after = build_net(COARSE, camera).sampler
    assert len(built) == 2
    assert not torch.equal(before.operator.matrix.weights, after.operator.matrix.weights)


def test_only_the_last_few_operators_are_remembered(built, camera):
    for height in (1.0, 1.1, 1.2, 1.3, 1.4):
        build_net(COARSE, replace(camera, lidar_height=height))
    build_net(COARSE, replace(camera, lidar_height=1.4))
    assert len(built) == 5
    build_net(COARSE, replace(camera, lidar_height=1.0))
    assert len(built) == 6


def test_the_operator_of_a_batch_goes_with_its_network(built, camera, monkeypatch):
    """It is as many times as large as the batch has images; what is remembered of a calibration takes one image."""
    made, original = [], PlaneOperator.block_diagonal

    def watched(operator, n_images):
        made.append(ref(batch := original(operator, n_images)))
        return batch

    monkeypatch.setattr(PlaneOperator, "block_diagonal", watched)
    net = build_net(COARSE, camera)
    net.sampler(torch.zeros(3, 1, *COARSE.image_size))
    assert [operator().n_images for operator in made] == [3]
    del net
    gc.collect()
    assert [operator() for operator in made] == [None]
    assert len(built) == 1
    assert build_net(COARSE, camera).sampler.operator.n_images == 1


def test_moving_one_network_leaves_the_others_alone(built, camera):
    scores = torch.randn(1, 2, *COARSE.image_size, generator=torch.Generator().manual_seed(0))
    one, other = (build_net(COARSE, camera) for _ in range(2))
    before = other.sampler(scores)
    one.double()
    assert one.sampler(scores.double()).dtype == torch.float64
    for net in (other, build_net(COARSE, camera)):
        assert torch.equal(net.sampler(scores), before)
    assert len(built) == 1


@pytest.mark.parametrize("heights", [[[0.0]], [np.inf], []])
def test_heights_that_are_no_planes_are_refused(camera, heights):
    with pytest.raises(ArgumentError, match="heights: expected one or more finite metres"):
        build_net(replace(COARSE, heights=heights), camera)
