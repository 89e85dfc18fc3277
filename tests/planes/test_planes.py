"""Equations (1) and (2): by other ways and other libraries, and by both samplers."""

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from semgrid_edu import fast, planes
from semgrid_edu.camera import Camera, rigid_transform
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.planes import plane_heights, plane_pixels, sample_planes_naive

BOTH = pytest.mark.parametrize("sampler_class", [planes.PlaneSampler, fast.PlaneSampler], ids=["book", "fast"])

# Grid axes (x ahead, y left, z up) to camera axes (z ahead, x right, y down), one metre above the ground.
LOOKING_AHEAD = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])


CAMERA = Camera(np.array([[100.0, 0, 100], [0, 100, 50], [0, 0, 1]]), LOOKING_AHEAD, (101, 201), lidar_height=1.0)


def random_points(rng, size, shape=(2, 3, 4)):
    """Pixels anywhere in an image of that size, its borders included; about a quarter of them aren't visible."""
    last = np.array(size)[::-1] - 1
    pixels = rng.uniform(0, 1, (*shape, 2)) * last
    pixels[0, 0, :3] = [[0, 0], last, [last[0], 0]]
    visible = rng.random(shape) < 0.75
    pixels[~visible] = np.nan
    return pixels, visible


def test_planes_are_at_equal_distances_from_the_ground_up():
    heights = plane_heights()
    assert len(heights) == 20
    assert heights[0] == 0
    np.testing.assert_allclose(np.diff(heights), heights[1])


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-0.6, 0.6), min_size=3, max_size=3), st.lists(st.floats(-1, 1), min_size=3, max_size=3))
def test_equation_1_for_a_camera_that_rolls_pitches_and_yaws(angles, place):
    """Without 4x4 matrices: rotate the vector from the camera to each point, divide by the depth."""
    turn = Rotation.from_matrix(LOOKING_AHEAD[:3, :3]) * Rotation.from_euler("xyz", angles)
    eye = np.array([0.0, 0.0, 1.7]) + place  # in the grid frame
    T_camera_from_grid = rigid_transform(turn.as_matrix(), -turn.apply(eye))
    T_camera_from_lidar = T_camera_from_grid @ rigid_transform(np.eye(3), [0, 0, 1.73])
    camera = Camera(np.array([[90.0, 0, 100], [0, 110, 50], [0, 0, 1]]), T_camera_from_lidar, (101, 201), 1.73)
    spec, heights = GridSpec(x_min=-5, x_max=20, y_min=-8, y_max=8, cell=1.0), np.array([0.0, 0.7, 2.1])
    pixels, visible = plane_pixels(spec, heights, camera)
    for i, delta in enumerate(heights):
        to_points = np.dstack([spec.centers(), np.full(spec.shape, delta)]).reshape(-1, 3) - eye
        X, Y, Z = turn.apply(to_points).T
        sure = np.abs(Z) > 1e-9
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v = 90 * X / Z + 100, 110 * Y / Z + 50
        inside = (Z > 0) & (u >= 0) & (u <= 200) & (v >= 0) & (v <= 100)
        at_border = np.minimum.reduce([abs(u), abs(u - 200), abs(v), abs(v - 100)]) < 1e-9
        assert (visible[i].ravel() == inside)[sure & ~at_border].all()
        np.testing.assert_allclose(pixels[i].reshape(-1, 2)[inside & sure], np.c_[u, v][inside & sure], atol=1e-6)


@pytest.mark.parametrize(
    ("y", "height"), [(10.0, 1.0), (-10.0, 1.0), (0.0, 6.0), (0.0, -4.0)], ids=["left", "right", "top", "bottom"]
)
def test_the_image_border_is_the_centre_of_its_last_pixels(y, height):
    # At 10 m, u = 100 - 10 y and v = 60 - 10 delta: the cases are the first and last column and row of 101 x 201.
    for beyond, inside in ((1.0, True), (1.001, False)):
        left, up = y * beyond, 1 + (height - 1) * beyond
        spec = GridSpec(x_min=9.5, x_max=10.5, y_min=left - 0.5, y_max=left + 0.5, cell=1.0)
        assert plane_pixels(spec, [up], CAMERA)[1].item() is inside


@BOTH
@pytest.mark.parametrize("ahead", [1e-9, 0.0, -0.0, -1e-9, -2.0])
def test_points_beside_the_lens_are_not_visible(sampler_class, ahead):
    # Two cells, their centres half a metre left and right of the lens, and hardly ahead of it.
    spec = GridSpec(x_min=ahead - 0.5, x_max=ahead + 0.5, y_min=-1.0, y_max=1.0, cell=1.0)
    pixels, visible = plane_pixels(spec, [0.0, 1.0, 2.0], CAMERA)
    assert not visible.any()
    assert np.isnan(pixels).all() == (ahead <= 0)
    assert (sampler_class(pixels, visible, CAMERA.size)(torch.ones(1, 3, *CAMERA.size)) == 0).all()


def test_the_naive_function_takes_lists_and_tensors_too():
    scores, points, visible = [[[0.0, 1.0], [2.0, 3.0]]], [[[[0.5, 0.5]]]], [[[True]]]
    assert sample_planes_naive(scores, points, visible).item() == 1.5
    assert sample_planes_naive(*map(torch.tensor, (scores, points, visible))).item() == 1.5


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(1, 7), st.integers(1, 4), st.integers(1, 3))
def test_both_samplers_compute_equation_2(seed, h, w, n_classes, batch):
    rng = np.random.default_rng(seed)
    pixels, visible = random_points(rng, (h, w))
    scores = rng.normal(size=(batch, n_classes, h, w)).astype(np.float32)
    naive = np.stack([sample_planes_naive(image, pixels, visible) for image in scores])
    book = planes.PlaneSampler(pixels, visible, (h, w))
    for sampler in (book, fast.PlaneSampler(pixels, visible, (h, w))):
        found = sampler(torch.from_numpy(scores)).numpy()
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, naive, atol=2e-6)
        assert (found[:, :, ~visible] == 0).all()


def _near(last):
    """Where rounding could reach for a pixel that doesn't exist: on, between and a hair beside centres of pixels."""
    on = np.arange(2 * last + 1) / 2
    beside = np.concatenate([np.nextafter(on, -1), np.nextafter(on, last + 1)])
    return st.sampled_from(np.clip(np.concatenate([on, beside]), 0, last).tolist())


@BOTH
@settings(max_examples=50, deadline=None)
@given(data=st.data(), h=st.integers(1, 4), w=st.integers(1, 5))
def test_values_and_gradients_on_and_beside_pixels_up_to_the_border(sampler_class, data, h, w):
    drawn = data.draw(st.lists(st.tuples(_near(w - 1), _near(h - 1)), min_size=6, max_size=6))
    pixels, visible = np.array(drawn).reshape(1, 2, 3, 2), np.ones((1, 2, 3), dtype=bool)
    rng = np.random.default_rng(0)
    scores = torch.from_numpy(rng.normal(size=(1, 2, h, w))).requires_grad_()
    found = sampler_class(pixels, visible, (h, w)).double()(scores)
    np.testing.assert_allclose(found[0].detach(), sample_planes_naive(scores[0].detach(), pixels, visible), atol=1e-6)
    # dp/ds is the kernel: a point gives each pixel its gradient times k(u - m) k(v - n).
    grad, expected = rng.normal(size=(2, 1, 2, 3)), np.zeros((2, h, w))
    for c, i, row, col, n, m in np.ndindex(2, 1, 2, 3, h, w):
        u, v = pixels[i, row, col]
        expected[c, n, m] += grad[c, i, row, col] * max(0, 1 - abs(u - m)) * max(0, 1 - abs(v - n))
    found.backward(torch.from_numpy(grad)[None])
    np.testing.assert_allclose(scores.grad[0], expected, atol=1e-6)


@BOTH
@pytest.mark.parametrize("size", [(96, 320), (7, 5)])
def test_sampling_agrees_with_scipy_and_grid_sample(sampler_class, size):
    """Two independent oracles. (The book's sampler uses grid_sample, too, but all planes one by one.)"""
    rng = np.random.default_rng(1)
    pixels, visible = random_points(rng, size, shape=(3, 8, 9))
    scores = rng.normal(size=(2, *size)).astype(np.float32)
    ours = sampler_class(pixels, visible, size)(torch.from_numpy(scores)[None])[0].numpy()
    by_scipy = [map_coordinates(image, pixels[visible].T[::-1], order=1) for image in scores]
    np.testing.assert_allclose(ours[:, visible], by_scipy, atol=1e-4)
    grid = torch.from_numpy(2 * pixels[visible] / (size[1] - 1, size[0] - 1) - 1).float()
    by_torch = F.grid_sample(torch.from_numpy(scores)[None], grid[None, None], align_corners=True)[0, :, 0]
    np.testing.assert_allclose(ours[:, visible], by_torch, atol=1e-4)


@BOTH
def test_the_gradient_is_exact(sampler_class):
    rng = np.random.default_rng(2)
    sampler = sampler_class(*random_points(rng, (4, 5)), (4, 5)).double()
    scores = torch.from_numpy(rng.normal(size=(2, 3, 4, 5))).requires_grad_()
    assert torch.autograd.gradcheck(sampler, scores)


@BOTH
def test_the_type_of_the_scores_is_kept(sampler_class):
    sampler = sampler_class(*random_points(np.random.default_rng(5), (30, 40)), (30, 40))
    scores = torch.randn(2, 3, 30, 40, generator=torch.Generator().manual_seed(0))
    exact = sampler(scores.double())
    assert exact.dtype == torch.float64
    torch.testing.assert_close(sampler(scores).double(), exact, rtol=0, atol=1e-6)


@BOTH
def test_mixed_precision_runs_forward_and_backward(sampler_class):
    sampler = sampler_class(*random_points(np.random.default_rng(5), (30, 40)), (30, 40))
    scores = torch.randn(2, 3, 30, 40, generator=torch.Generator().manual_seed(0))
    conv = torch.nn.Conv2d(3, 3, 1)
    expected = sampler(conv(scores))
    with torch.autocast("cpu", dtype=torch.bfloat16):
        p = sampler(conv(scores))
    assert p.dtype == torch.bfloat16
    p.float().square().sum().backward()
    assert torch.isfinite(conv.weight.grad).all()
    # bfloat16 keeps eight bits.
    torch.testing.assert_close(p.float(), expected, rtol=0, atol=0.05)


@BOTH
@pytest.mark.parametrize("n_images", [1, 3])
def test_a_sampler_made_for_inference_learns_as_well(sampler_class, n_images):
    with torch.inference_mode():
        sampler = sampler_class(*random_points(np.random.default_rng(6), (30, 40)), (30, 40))
        sampler(torch.ones(n_images, 1, 30, 40))
    scores = torch.ones(n_images, 1, 30, 40, requires_grad=True)
    p = sampler(scores)
    p.sum().backward()
    torch.testing.assert_close(scores.grad.sum(), p.sum())


@BOTH
def test_a_sampler_holds_no_weights_and_follows_its_module_to_another_device(sampler_class):
    sampler = sampler_class(*random_points(np.random.default_rng(4), (4, 5)), (4, 5))
    assert not list(sampler.parameters())
    assert not sampler.state_dict()
    sampler(torch.zeros(2, 1, 4, 5))
    torch.nn.Sequential(sampler).to("meta")
    for n_images in (1, 2):
        assert sampler(torch.zeros(n_images, 1, 4, 5, device="meta")).shape == (n_images, 1, 2, 3, 4)


@BOTH
def test_nothing_visible_gives_zero(sampler_class):
    sampler = sampler_class(np.full((1, 2, 2, 2), np.nan), np.zeros((1, 2, 2), dtype=bool), (4, 5))
    assert (sampler(torch.ones(1, 3, 4, 5)) == 0).all()


@BOTH
def test_wrong_inputs_of_samplers_are_named(sampler_class):
    points, visible = np.zeros((1, 2, 2, 2)), np.ones((1, 2, 2), dtype=bool)
    for bad, message in (
        ((points, visible.astype(int)), "visible: expected bool"),
        ((points[:0], visible[:0]), "not empty"),
        ((points[..., 0], visible), r"pixels: expected shape \(1, 2, 2, 2\)"),
        ((points + 4.5, visible), "visible points in an image"),
        ((points * np.nan, visible), "visible points in an image"),
    ):
        with pytest.raises(ArgumentError, match=message):
            sampler_class(*bad, (4, 5))
    with pytest.raises(ArgumentError, match=r"scores: expected shape \(B, C, 4, 5\), found \(1, 3, 5, 4\)"):
        sampler_class(points, visible, (4, 5))(torch.zeros(1, 3, 5, 4))


def test_wrong_heights_are_named():
    for heights in ([np.nan], [[0.0]], [np.inf], []):
        with pytest.raises(ArgumentError, match="heights: expected one or more finite metres"):
            plane_pixels(GridSpec.compact(), heights, CAMERA)
    with pytest.raises(ArgumentError, match="n_planes"):
        plane_heights(0)
    with pytest.raises(ArgumentError, match="spacing"):
        plane_heights(20, spacing=0.0)
