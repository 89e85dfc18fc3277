"""The camera: renders the world at one instant and records what each pixel shows."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.camera import transform_points
from semgrid_edu.workshop.simulation.sensors.raycast import Hits, Instant, turned
from semgrid_edu.workshop.simulation.sensors.rig import Rig
from semgrid_edu.workshop.simulation.sensors.shading import shade
from semgrid_edu.workshop.simulation.street.layout import Road
from semgrid_edu.workshop.simulation.street.light import Light

_SKY_STEP = 3
"""Sky visibility is sampled at every third pixel of every third row, because it varies slowly."""
_SUBPIXELS = ((-0.33, 0.33), (0.33, -0.33))
"""Antialiasing: offsets, right and down in pixels, of two extra rays for each pixel on an edge."""
_NOISE = 0.8
"""Standard deviation of the pixel noise at mid grey, in steps of 1/255."""
_BITS = 6
"""Bits per colour channel: few, to keep PNG files small."""


@dataclass(frozen=True, eq=False)
class Picture:
    """The camera image, and the ground truth of every pixel.

    Parameters
    ----------
    image : (h, w, 3) uint8
        The image, RGB.
    kind : (h, w) uint8
        What each pixel shows, a `Kind`.
    depth : (h, w) float32
        Depth along the optical axis, metres; NaN for sky.
    instance : (h, w) int32
        Number of the car, pedestrian or bicycle that each pixel shows; 0 for anything else.
    """

    image: NDArray[np.uint8]
    kind: NDArray[np.uint8]
    depth: NDArray[np.float32]
    instance: NDArray[np.int32]


def _discontinuities(triangle: NDArray, distance: NDArray, kind: NDArray, material: NDArray) -> NDArray[np.bool_]:
    """Mark the edges to antialias: each pixel that differs from its right or lower neighbour, and that neighbour."""
    edge = np.zeros(triangle.shape, bool)
    for here, beside in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        a = triangle[here]
        b = triangle[beside]
        near = np.minimum(distance[here], distance[beside]).astype(np.float64)
        jump = (a < 0) | (b < 0) | (kind[a] != kind[b]) | (material[a] != material[b])
        jump |= np.abs(distance[here] - distance[beside]) > 0.05 * near
        jump &= a != b
        edge[here] |= jump
        edge[beside] |= jump
    return edge


@njit(cache=True)
def _smooth(values, distance, step, radius, out):
    """Average sparse `values` (one every `step` pixels, -1 for none) over pixels at a similar distance."""
    height, width = distance.shape
    # a compiled loop, because each pixel's distance decides which neighbours count
    for r in range(height):
        for c in range(width):
            total = 0.0
            weight = 0.0
            t = distance[r, c]
            for i in range(max((r - radius) // step, 0), min((r + radius) // step + 1, values.shape[0])):
                for j in range(max((c - radius) // step, 0), min((c + radius) // step + 1, values.shape[1])):
                    if values[i, j] >= 0 and abs(distance[i * step, j * step] - t) < 0.06 * t:
                        total += values[i, j]
                        weight += 1.0
            out[r, c] = total / weight if weight > 0 else 1.0


def _open(
    hits: Hits, instant: Instant, chosen: NDArray, axis: tuple, along_normal: float, spread: float,
    rng: np.random.Generator,
) -> NDArray[np.float32]:  # fmt: skip
    """Return 1 for each chosen pixel whose hit sees the light, 0 if it is occluded, -1 for pixels not chosen.

    Each chosen hit casts one ray, starting slightly off the surface, along `axis` plus the normal plus random scatter.
    """
    scatter = rng.random((len(chosen), 3), dtype=np.float32)
    normal = instant.normals[hits.triangle[chosen]]
    ray = hits.directions[chosen]
    away = normal[:, 0] * ray[:, 0] + normal[:, 1] * ray[:, 1] + normal[:, 2] * ray[:, 2] > 0
    facing = np.where(away, -1.0, 1.0)[:, None] * normal
    offset = 0.004 + 0.0006 * hits.distance[chosen, None].astype(np.float64)
    starts = (hits.position[chosen] + offset * (facing - ray)).astype(np.float32)
    rays = (np.float32(axis) + along_normal * facing + spread * (scatter - 0.5)).astype(np.float32)
    length = np.sqrt((rays**2).sum(axis=1, keepdims=True, dtype=np.float64))
    result = np.full(len(hits.distance), -1, np.float32)
    result[chosen] = ~instant.blocked(starts, (rays / length).astype(np.float32))
    return result


def _sun_and_sky(
    hits: Hits, instant: Instant, light: Light, shape: tuple[int, int], rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return how much of the sun and of the sky each pixel's hit sees, 0..1: one ray to each, then smoothed."""
    distance = hits.distance.reshape(shape)
    met = hits.triangle >= 0
    sunlit = np.empty(shape, np.float32)
    open_sky = np.empty(shape, np.float32)
    sun = _open(hits, instant, np.flatnonzero(met), light.sun, 0.0, 3.5 * light.softness, rng)
    _smooth(sun.reshape(shape), distance, 1, 1 if light.softness < 0.1 else 3, sunlit)
    grid = np.zeros(shape, bool)
    grid[::_SKY_STEP, ::_SKY_STEP] = True
    sky = _open(hits, instant, np.flatnonzero(grid.ravel() & met), (0.0, 0.0, 0.6), 1.0, 1.6, rng).reshape(shape)
    _smooth(np.ascontiguousarray(sky[::_SKY_STEP, ::_SKY_STEP]), distance, _SKY_STEP, 6, open_sky)
    return sunlit.ravel(), open_sky.ravel()


def _lens(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Blur the picture like a lens: along each axis a pixel gives 14 % of its light to each neighbour."""
    for axis in (1, 0):
        at = np.arange(radiance.shape[axis])
        neighbours = radiance.take(at - 1, axis, mode="clip") + radiance.take(at + 1, axis, mode="clip")
        radiance = np.float32(0.72) * radiance + np.float32(0.14) * neighbours
    return radiance


def _expose(radiance: NDArray, light: Light, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Turn radiance into pixel values: lens blur, exposure, vignette, tone curve, noise, quantisation."""
    height, width, _ = radiance.shape
    v, u = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    gain = light.exposure * (1 - 0.18 * (u**2 + 0.3 * v**2))[..., None] * np.asarray(light.balance)
    exposed = (_lens(radiance) * gain.astype(np.float32)).clip(0)
    grey = 255 * (1 - np.exp(-1.25 * exposed)) ** np.float32(1 / 2.0)
    sigma = _NOISE * (0.6 + 0.6 * np.sqrt(grey / 128))
    noisy = grey + sigma * rng.standard_normal(grey.shape, dtype=np.float32)
    step = 2 ** (8 - _BITS)
    levels = np.floor(noisy.clip(0, 255) / step)
    return (levels * (255 / (2**_BITS - 1))).clip(0, 255).astype(np.uint8)


def take_picture(
    instant: Instant, T_world_from_lidar: NDArray, rig: Rig, road: Road, light: Light, rng: np.random.Generator
) -> Picture:
    """Take a picture with camera 2.

    Parameters
    ----------
    instant : Instant
        The world.
    T_world_from_lidar : (4, 4) float
        Pose of the LIDAR, metres.
    rig : Rig
        The camera and its pose.
    road : Road
        The street, for the type of ground.
    light : Light
        Sun, sky and exposure.
    rng : numpy.random.Generator
        Source of the sensor noise and of the scattered rays for soft shadows.
    """
    shape = rig.camera.size
    rotation = T_world_from_lidar[:3, :3].astype(np.float32)
    eye = transform_points(T_world_from_lidar @ rig.T_lidar_from_camera, np.zeros(3))
    rays = rig.pixel_directions()
    hits = instant.cast(eye, turned(rays, rotation), rng)
    sunlit, open_sky = _sun_and_sky(hits, instant, light, shape, rng)
    pixel = 1.0 / rig.camera.K[0, 0]
    radiance, kind = shade(hits, instant, road, light, sunlit, open_sky, pixel)

    triangles = hits.triangle.reshape(shape)
    distance = hits.distance.reshape(shape)
    edges = np.flatnonzero(_discontinuities(triangles, distance, instant.kind, instant.material))
    for du, dv in _SUBPIXELS:
        beside = instant.cast(eye, turned(rig.pixel_directions(du, dv)[edges], rotation), rng)
        radiance[edges] += shade(beside, instant, road, light, sunlit[edges], open_sky[edges], pixel)[0]
    radiance[edges] /= 1 + len(_SUBPIXELS)

    ahead = (rays @ rig.camera.T_camera_from_lidar[2, :3]).astype(np.float32) * hits.distance
    return Picture(
        image=_expose(radiance.reshape(*shape, 3), light, rng),
        kind=kind.reshape(shape),
        depth=np.where(hits.triangle < 0, np.float32(np.nan), ahead).reshape(shape),
        instance=np.where(hits.triangle < 0, 0, instant.instance[hits.triangle]).reshape(shape),
    )
