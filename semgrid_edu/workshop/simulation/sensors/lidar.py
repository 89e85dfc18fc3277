"""The LIDAR: a scan of returns with noisy ranges and reflectance, some of them lost."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.workshop.simulation.sensors.raycast import MISS, Hits, Instant, turned
from semgrid_edu.workshop.simulation.sensors.rig import Lidar
from semgrid_edu.workshop.simulation.street.ground import ground_kinds
from semgrid_edu.workshop.simulation.street.layout import Road
from semgrid_edu.workshop.simulation.things.materials import REFLECTANCE, Kind, Material


def scan(
    instant: Instant, T_world_from_lidar: NDArray, lidar: Lidar, road: Road, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Take one LIDAR scan, all of it at this instant (as if the ego-motion within a turn had been undone).

    A return is lost when too little light comes back. So dark, far and grazed surfaces lose more of their returns than
    others. Glass reflects the light away from the sensor, and car paint scatters little of it.

    Parameters
    ----------
    instant : Instant
        The world.
    T_world_from_lidar : (4, 4) float
        Pose of the LIDAR, metres.
    lidar : Lidar
        Directions and noise.
    road : Road
        The street, for what the ground reflects.
    rng : numpy.random.Generator
        Source of noise and losses.

    Returns
    -------
    (N, 4) float32
        x, y, z in the LIDAR frame, metres, and reflectance 0..1, as KITTI's binary files hold them.
    """
    return labelled_scan(instant, T_world_from_lidar, lidar, road, rng)[0]


def labelled_scan(
    instant: Instant, T_world_from_lidar: NDArray, lidar: Lidar, road: Road, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Take a scan, and say what each return hit. Parameters are those of `scan`.

    Returns
    -------
    points : (N, 4) float32
        What `scan` returns.
    kinds : (N,) uint8
        Members of `Kind`.
    """
    rays = lidar.directions
    rotation = T_world_from_lidar[:3, :3].astype(np.float32)
    hits = instant.cast(T_world_from_lidar[:3, 3], turned(rays, rotation), rng)
    luck, range_noise = rng.random(len(rays), dtype=np.float32), rng.standard_normal(len(rays), dtype=np.float32)
    glow = rng.standard_normal(len(rays), dtype=np.float32)
    near = np.flatnonzero(hits.distance < min(lidar.range_max, MISS))
    triangle, distance = hits.triangle[near], hits.distance[near]
    cosine = np.abs((instant.normals[triangle] * hits.directions[near]).sum(axis=1))
    kinds = _kinds(instant, hits, near, road)
    reflectance = _reflectance(instant.material[triangle], kinds)
    signal = reflectance * (0.15 + 0.85 * cosine) * (25.0 / np.maximum(distance, 8.0)) ** 2
    kept = luck[near] > lidar.drop + np.exp(-signal / 0.05)
    measured = distance + lidar.range_sigma * range_noise[near]
    intensity = (reflectance * (0.4 + 0.6 * cosine) * (1 + 0.15 * glow[near])).clip(0, 0.99)
    points = np.column_stack([rays[near] * measured[:, None], np.round(intensity, 2)])
    return points[kept].astype(np.float32), kinds[kept]


def _kinds(instant: Instant, hits: Hits, chosen: NDArray, road: Road) -> NDArray[np.uint8]:
    """Return what chosen hits are of; the ground is one piece of many kinds."""
    kinds = instant.kind[hits.triangle[chosen]]
    ground = instant.material[hits.triangle[chosen]] == Material.GROUND
    kinds[ground] = ground_kinds(road, hits.position[chosen[ground], :2].astype(np.float64))
    return kinds


def _reflectance(material: NDArray, kinds: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the reflectance of hits; on the ground lane marks are bright and grass brighter than asphalt."""
    by_kind = np.full(256, 0.2, np.float32)
    by_kind[[Kind.LANE, Kind.SIDEWALK, Kind.GRASS]] = 0.75, 0.3, 0.45
    return np.where(material == Material.GROUND, by_kind[kinds], REFLECTANCE[material])
