"""The whole network from its description and a camera, with either sampler."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from semgrid_edu import fast
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import Architecture, build_net, load_net, save_net
from semgrid_edu.planes import PlaneSampler, plane_pixels

COARSE = Architecture(
    image_size=(32, 64), grid=GridSpec(x_min=2, x_max=12, y_min=-4, y_max=4, cell=1.0), heights=(0.0, 0.5)
)


def test_the_sampler_looks_where_the_scaled_camera_does(camera):
    net = build_net(COARSE, camera)
    pixels, visible = plane_pixels(COARSE.grid, COARSE.heights, camera.resized(COARSE.image_size))
    np.testing.assert_array_equal(net.sampler.pixels, pixels)
    np.testing.assert_array_equal(net.sampler.visible, visible)


def test_the_class_of_the_sampler_changes_nothing_else(camera, tmp_path):
    """Built or loaded: the same weights under the same names, and the same logits."""
    book, quick = build_net(COARSE, camera).eval(), fast.build_net(COARSE, camera).eval()
    save_net(book, tmp_path / "net.safetensors")
    loaded, quickly = (of(tmp_path / "net.safetensors", camera) for of in (load_net, fast.load_net))
    assert type(book.sampler) is type(loaded.sampler) is PlaneSampler
    assert type(quick.sampler) is type(quickly.sampler) is fast.PlaneSampler
    rng = torch.Generator().manual_seed(0)
    inputs = torch.rand(2, 3, 32, 64, generator=rng), torch.rand(2, 4, 10, 8, generator=rng)
    expected = book(*inputs)
    for net in (quick, loaded, quickly):
        assert list(net.state_dict()) == list(book.state_dict())
        torch.testing.assert_close(net(*inputs), expected, rtol=0, atol=1e-4)


@pytest.mark.parametrize("heights", [[[0.0]], [np.inf], []])
def test_heights_that_are_no_planes_are_rejected(camera, heights):
    with pytest.raises(ArgumentError, match="heights: expected one or more finite metres"):
        build_net(replace(COARSE, heights=heights), camera)
