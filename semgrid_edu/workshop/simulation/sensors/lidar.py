"""The LIDAR: a scan with noisy ranges, reflectance and lost returns."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.workshop.simulation.sensors.raycast import Hits, Instant, turned
from semgrid_edu.workshop.simulation.sensors.rig import Lidar
from semgrid_edu.workshop.simulation.street.ground import ground_kinds
from semgrid_edu.workshop.simulation.street.layout import Road
from semgrid_edu.workshop.simulation.things.materials import REFLECTANCE, Kind, Material

_RANGE = 100.0
"""Maximum range, metres. The HDL-64E sees dark surfaces up to 80 m and bright ones up to 120 m."""
_FADED, _SCATTER = 0.15, 0.1
"""How much lower the intensity of a return is that comes from 30 m, and the standard deviation of intensities."""
_SECTOR = 30.0
"""Road users are frozen while the scanner turns by this angle, degrees. At 14 m/s they would move 12 cm."""


def labelled_scan(
    world: Callable[[float], Instant], pose: Callable[[float], NDArray], lidar: Lidar, road: Road,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:  # fmt: skip
    """Record one LIDAR scan, and label each return with what it hit.

    In a rolling scan (`Lidar.revolution` > 0) each column is measured from the pose at its own time, and stored in the
    LIDAR frame of that time, like KITTI's raw scans. A return is lost when too little light comes back, so dark,
    distant and grazing surfaces lose more. Glass reflects the light away from the sensor, and car paint scatters little
    of it.

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
    parts = zip(*_sectors(world, pose, lidar, road, rng), strict=True)
    number, *measured = (np.concatenate(part) for part in parts)
    order = np.argsort(number)
    number = number[order]
    distance, cosine, reflectance, kinds = (column[order] for column in measured)
    draws = rng.random(len(rays), dtype=np.float32)
    range_noise = rng.standard_normal(len(rays), dtype=np.float32)
    gain_noise = rng.standard_normal(len(rays), dtype=np.float32)
    signal = reflectance * (0.15 + 0.85 * cosine) * (25.0 / np.maximum(distance, 8.0)) ** 2
    kept = draws[number] > lidar.dropout + np.exp(-signal / lidar.weak_signal)
    measured_range = distance + lidar.range_sigma * range_noise[number]
    # As KITTI's scanner gives it: it falls with the square of the range, scatters, and weak returns read exactly 0.
    faded = _FADED * (distance / 30.0) ** 2
    intensity = reflectance * (0.8 + 0.2 * cosine) - faded + _SCATTER * gain_noise[number]
    points = np.column_stack([rays[number] * measured_range[:, None], np.round(intensity.clip(0, 0.99), 2)])
    return points[kept].astype(np.float32), kinds[kept]


def _sectors(
    world: Callable[[float], Instant], pose: Callable[[float], NDArray], lidar: Lidar, road: Road,
    rng: np.random.Generator,
) -> Iterator[tuple[NDArray, ...]]:  # fmt: skip
    """Yield number, distance, |cos|, reflectance and kind of the rays that hit something, sector by sector.

    An instantaneous scan is one sector.
    """
    times = lidar.times
    rays = lidar.directions
    poses = np.stack([pose(t) for t in times]) if lidar.revolution else pose(0.0)[None]
    sector = np.floor(lidar.azimuths / _SECTOR) * bool(lidar.revolution)
    for current in np.unique(sector):
        columns = np.flatnonzero(sector == current)
        chosen = (columns + len(times) * np.arange(len(lidar.elevations))[:, None]).ravel()
        here = poses[chosen % len(times) if lidar.revolution else 0]
        instant = world(float(times[columns].mean()))
        hits = instant.cast(here[..., :3, 3], turned(rays[chosen], here[..., :3, :3].astype(np.float32)), rng)
        near = np.flatnonzero(hits.distance < _RANGE)
        yield chosen[near], hits.distance[near], *_surface(instant, hits, near, road)


def _surface(
    instant: Instant, hits: Hits, near: NDArray[np.int64], road: Road
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8]]:
    """Return |cos|, reflectance and kind of some hits. Lane marks are bright; grass is brighter than asphalt."""
    triangle = hits.triangle[near]
    kinds = instant.kind[triangle]
    material = instant.material[triangle]
    ground = material == Material.GROUND
    kinds[ground] = ground_kinds(road, hits.position[near[ground], :2].astype(np.float64))
    cosine = np.abs((instant.normals[triangle] * hits.directions[near]).sum(axis=1))
    of_ground = np.full(256, 0.2, np.float32)
    of_ground[[Kind.LANE, Kind.SIDEWALK, Kind.GRASS]] = 0.75, 0.3, 0.45
    return cosine, np.where(ground, of_ground[kinds], REFLECTANCE[material]), kinds
