"""The LIDAR: a scan with noisy ranges, reflectance and lost returns."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.workshop.simulation.sensors.raycast import MISS, Hits, Instant, turned
from semgrid_edu.workshop.simulation.sensors.rig import Lidar
from semgrid_edu.workshop.simulation.street.ground import ground_kinds
from semgrid_edu.workshop.simulation.street.layout import Road
from semgrid_edu.workshop.simulation.things.materials import REFLECTANCE, Kind, Material

_SECTOR = 30.0
"""Road users are frozen while the scanner turns by this angle, degrees. At 14 m/s they would move 12 cm."""


def labelled_scan(
    world: Callable[[float], Instant], pose: Callable[[float], NDArray], lidar: Lidar, road: Road,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:  # fmt: skip
    """Record one LIDAR scan, and label each return with what it hit.

    With a rolling scan (`Lidar.turn` > 0) each column is measured from the pose at its own time and stored in the LIDAR
    frame of that time, like KITTI's raw scans. A return is lost when too little light comes back. So dark, distant and
    grazing surfaces lose more returns. Glass reflects the light away from the sensor, and car paint scatters little of
    it.

    Parameters
    ----------
    world : callable
        t -> the world at time t. Time counts in seconds from the moment when the scanner points ahead.
    pose : callable
        t -> the pose of the LIDAR at time t, (4, 4), metres.
    lidar : Lidar
        Directions and noise.
    road : Road
        The street, for the reflectance of the ground.
    rng : numpy.random.Generator
        Source of noise and losses.

    Returns
    -------
    points : (N, 4) float32
        x, y, z in the LIDAR frame, metres, and reflectance 0..1, as in KITTI's binary files.
    kinds : (N,) uint8
        Members of `Kind`.
    """
    rays = lidar.directions
    met = [np.concatenate(part) for part in zip(*_sectors(world, pose, lidar, road, rng), strict=True)]
    near, distance, cosine, reflectance, kinds = (part[np.argsort(met[0])] for part in met)
    luck = rng.random(len(rays), dtype=np.float32)
    range_noise = rng.standard_normal(len(rays), dtype=np.float32)
    glow = rng.standard_normal(len(rays), dtype=np.float32)
    signal = reflectance * (0.15 + 0.85 * cosine) * (25.0 / np.maximum(distance, 8.0)) ** 2
    kept = luck[near] > lidar.drop + np.exp(-signal / lidar.weakest)
    measured = distance + lidar.range_sigma * range_noise[near]
    intensity = (reflectance * (0.4 + 0.6 * cosine) * (1 + 0.15 * glow[near])).clip(0, 0.99)
    points = np.column_stack([rays[near] * measured[:, None], np.round(intensity, 2)])
    return points[kept].astype(np.float32), kinds[kept]


def _sectors(
    world: Callable[[float], Instant], pose: Callable[[float], NDArray], lidar: Lidar, road: Road,
    rng: np.random.Generator,
) -> Iterator[tuple[NDArray, ...]]:  # fmt: skip
    """Yield the hits of each sector of a scan, from `_met`; one sector if the whole scan is instantaneous."""
    times = lidar.times
    rays = lidar.directions
    poses = np.stack([pose(t) for t in times]) if lidar.turn else pose(0.0)[None]
    sector = np.floor(lidar.azimuths / _SECTOR) * bool(lidar.turn)
    for one in np.unique(sector):
        columns = np.flatnonzero(sector == one)
        chosen = (columns + len(times) * np.arange(len(lidar.elevations))[:, None]).ravel()
        here = poses[chosen % len(times) if lidar.turn else 0]
        instant = world(float(times[columns].mean()))
        hits = instant.cast(here[..., :3, 3], turned(rays[chosen], here[..., :3, :3].astype(np.float32)), rng)
        yield _met(instant, hits, chosen, lidar, road)


def _met(
    instant: Instant, hits: Hits, rays: NDArray[np.int64], lidar: Lidar, road: Road
) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray]:
    """Return number, distance, |cos|, reflectance and kind of the rays that hit something within range."""
    near = np.flatnonzero(hits.distance < min(lidar.range_max, MISS))
    triangle = hits.triangle[near]
    normals = instant.looked_up("normals", triangle)
    material = instant.looked_up("material", triangle)
    kinds = instant.looked_up("kind", triangle)
    ground = material == Material.GROUND
    kinds[ground] = ground_kinds(road, hits.position[near[ground], :2].astype(np.float64))
    cosine = np.abs((normals * hits.directions[near]).sum(axis=1))
    return rays[near], hits.distance[near], cosine, _reflectance(material, kinds), kinds


def _reflectance(material: NDArray, kinds: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the reflectance of hits. On the ground, lane marks are bright, and grass is brighter than asphalt."""
    by_kind = np.full(256, 0.2, np.float32)
    by_kind[[Kind.LANE, Kind.SIDEWALK, Kind.GRASS]] = 0.75, 0.3, 0.45
    return np.where(material == Material.GROUND, by_kind[kinds], REFLECTANCE[material])
