"""What particles do, in compiled loops and single precision.

Loops that only compute get the coordinates (N, 2) flattened, as (2 N,). The compiler then knows that they are
contiguous and vectorises over particles.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.fast.occupancy.cells import cell_of
from semgrid_edu.fast.occupancy.cellwise import STATIC, open_space
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.state import OUTSIDE, Particles
from semgrid_edu.occupancy.walls import Walls

SLOW = np.float32(16)
"""exp(-16) is negligible beside 1 in single precision, so smaller exponentials needn't be computed."""


class Pace(NamedTuple):
    """How fast the vehicle drives, and which particles can keep pace with it.

    Parameters
    ----------
    speed : float
        Speed of the vehicle along the x axis of the map, m/s, negative backwards.
    least : float
        The least speed at which something has left its cells after `halt`, m/s. Slower things can't keep pace.
    halt : float
        How long ago a particle's past position is checked a second time, seconds.
    """

    speed: float
    least: float
    halt: float

    @property
    def matters(self) -> bool:
        """Whether anything can keep pace: nothing can if the vehicle is stopped or crawls."""
        return 2 * abs(self.speed) >= self.least and self.speed != 0


def pace_of(walls: Walls, driven: float, dt: float, cell: float) -> Pace:
    """Return how fast the vehicle drives, and which particles can keep pace with it.

    Parameters
    ----------
    walls : Walls
        How far the filter looks back.
    driven, dt : float
        How far the vehicle has driven, metres, and in what time, seconds.
    cell : float
        Side of a cell, metres.
    """
    halt = walls.second_look * walls.clearing_time
    least = walls.clearing_cells * cell / halt if halt > 0 else np.inf
    return Pace(float(driven) / dt if dt > 0 else 0.0, float(least), halt)


def cells_of(position: NDArray, spec: GridSpec) -> NDArray[np.int32]:
    """Return the cell that each particle is in, (N,) int32. Parameters are those of `cells_of`."""
    return _cells_of(position.ravel(), spec.shape, *spec.corner)


@njit(cache=True, nogil=True, error_model="numpy")
def _cells_of(xy, shape, x_max, y_max, cell):
    cells = np.empty(len(xy) // 2, np.int32)
    for i in range(len(cells)):
        cells[i] = cell_of(xy[2 * i], xy[2 * i + 1], shape, x_max, y_max, cell)
    return cells


@njit(cache=True, nogil=True)
def weight_in_cells(weight: NDArray, cells: NDArray, shape: tuple[int, ...]) -> NDArray:
    """Add the weights up in each cell, in the order of the particles and in double precision.

    Parameters
    ----------
    weight : (N,) float
        The weight of each particle.
    cells : (N,) int
        The cell of each particle, from `cells_of`; or from `by_origin`, for sums of shape (2, H, W).
    shape : (int, int) or (int, int, int)
        Shape of the result: H, W, or 2, H, W.
    """
    total = np.zeros(shape)
    flat = total.ravel()
    for i in range(len(cells)):
        if cells[i] != OUTSIDE:
            flat[cells[i]] += weight[i]
    return total.astype(np.float32)


@njit(cache=True, nogil=True)
def scale_in_cells(weight: NDArray, cells: NDArray, factor: NDArray) -> NDArray[np.float32]:
    """Multiply each weight by the factor of its cell, and by zero outside.

    Parameters
    ----------
    weight : (N,) float
        The weight of each particle.
    cells : (N,) int
        The cell of each particle, from `cells_of`; or from `by_origin`, for factors of shape (2, H, W).
    factor : (H, W) or (2, H, W) float
        The factor of each cell.
    """
    scaled, flat = np.zeros(len(weight), np.float32), factor.ravel()
    for i in range(len(weight)):
        if cells[i] != OUTSIDE:
            scaled[i] = weight[i] * flat[cells[i]]
    return scaled


@njit(cache=True, nogil=True)
def by_origin(before: NDArray, after: NDArray, n_cells: int) -> NDArray[np.int32]:
    """Return each particle's cell, plus `n_cells` if it came from another cell.

    Parameters
    ----------
    before, after : (N,) int32
        The cells in which each particle was and is, from `cells_of`.
    n_cells : int
        Number of cells, H W.

    Returns
    -------
    (N,) int32
        Indices into a flattened array (2, H, W): the first plane is for particles that stayed, the second for particles
        that arrived; `OUTSIDE` for particles that left the map.
    """
    origin = after.copy()
    for i in range(len(after)):
        if after[i] != before[i] and after[i] != OUTSIDE:
            origin[i] += n_cells
    return origin


def cells_at(particles: Particles, cells: NDArray, spec: GridSpec, time: float, fewest: float) -> NDArray[np.int32]:
    """Return the cell of each particle at another time, if it isn't the cell of now.

    Parameters
    ----------
    particles : Particles
        N particles.
    cells : (N,) int32
        The cell that each is in now, from `cells_of`.
    spec : GridSpec
        The cells, (H, W).
    time : float
        Seconds from now, negative for the past: a particle at x with velocity v is assumed to be at x + v time.
    fewest : float
        Least number of cells that a particle moves: a slow one gets more than `time`, unless that is 0.

    Returns
    -------
    (N,) int32
        row * W + column; `OUTSIDE` for a particle that is outside the grid then, or in the same cell as now.
    """
    now = particles.position.ravel(), particles.velocity.ravel()
    return _cells_at(*now, cells, np.float32(time), np.float32(fewest * spec.cell), spec.shape, *spec.corner)


@njit(cache=True, nogil=True, error_model="numpy")
def _cells_at(xy, velocity, cells, time, least, shape, x_max, y_max, cell):
    there = np.empty(len(cells), np.int32)
    for i in range(len(cells)):
        vx, vy = velocity[2 * i], velocity[2 * i + 1]
        speed = math.sqrt(vx * vx + vy * vy)
        stretch = max(np.float32(1), least / (abs(time) * speed)) if time * speed != 0 else np.float32(0)
        x, y = xy[2 * i] + stretch * time * vx, xy[2 * i + 1] + stretch * time * vy
        then = cell_of(x, y, shape, x_max, y_max, cell)
        there[i] = then if then != cells[i] else OUTSIDE
    return there


def keeps_pace(vx: NDArray, vy: NDArray, pace: Pace) -> NDArray[np.bool_]:
    """Return which velocities differ from the vehicle's by at most the vehicle's speed, (N,).

    A static thing differs by exactly this much.

    Parameters
    ----------
    vx, vy : (N,) float
        Velocities along the axes of the map, m/s; in compiled loops those of one particle.
    pace : Pace
        How fast the vehicle drives, and the least speed that counts. Nothing keeps pace with a stopped vehicle.
    """
    slip, speed = (vx - pace.speed) ** 2 + vy**2, vx**2 + vy**2
    return (slip <= pace.speed**2) & (speed >= pace.least**2) & (pace.speed != 0)


_keeps_pace = njit(cache=True, nogil=True)(keeps_pace)


def doubt_arrivals(
    particles: Particles, cells: NDArray, doubt: NDArray, ahead: NDArray, mixed: NDArray, spec: GridSpec, pace: Pace
) -> NDArray[np.float32]:
    """Return the part of each weight that comes out of a wall and moves along it at the vehicle's pace, (N,).

    Parameters
    ----------
    particles : Particles
        N particles after their flight.
    cells, ahead : (N,) int32
        The cell that each is in now, from `cells_of`, and will be in, from `cells_at`.
    doubt : (N,) float32
        The part of each weight that comes out of a wall, judged by its origin alone.
    mixed : (4, H, W) float32
        The four states before particles flew.
    spec : GridSpec
        The cells, (H, W).
    pace : Pace
        How fast the vehicle drives.
    """
    now = particles.position.ravel(), particles.velocity.ravel(), particles.weight, cells
    return _doubt_arrivals(*now, doubt, ahead, mixed[STATIC], open_space(mixed), pace, spec.shape, *spec.corner)


@njit(cache=True, nogil=True, error_model="numpy")
def _doubt_arrivals(xy, velocity, weight, cells, doubt, ahead, static, room, pace, shape, x_max, y_max, cell):
    doubted, standing, rooms = np.empty_like(doubt), static.ravel(), room.reshape(2, -1)
    for i in range(len(cells)):
        vx, vy, solid = velocity[2 * i], velocity[2 * i + 1], doubt[i]
        keeps = _keeps_pace(vx, vy, pace)
        if keeps:
            halt = cell_of(xy[2 * i] - pace.halt * vx, xy[2 * i + 1] - pace.halt * vy, shape, x_max, y_max, cell)
            if halt != OUTSIDE and halt != cells[i]:
                solid = max(solid, weight[i] * standing[halt])
        doubted[i] = solid - solid * rooms[int(keeps), ahead[i]] if ahead[i] != OUTSIDE else solid
    return doubted


def fly(particles: Particles, max_acceleration: float, dt: float, rng: np.random.Generator) -> Particles:
    """Let particles fly for a while, with noise. Parameters are those of `fly`."""
    noise = rng.random((len(particles), 2), np.float32)
    change = np.float32(max_acceleration * dt)
    start = particles.position.ravel(), particles.velocity.ravel()
    position, velocity = _fly(*start, noise.ravel(), change, np.float32(dt))
    return Particles(position.reshape(-1, 2), velocity.reshape(-1, 2), particles.weight)


@njit(cache=True, nogil=True)
def _fly(position, velocity, noise, max_change, dt):
    flown, faster = np.empty_like(position), np.empty_like(velocity)
    half, two = np.float32(0.5), np.float32(2)
    for i in range(len(position)):
        change = (two * noise[i] - np.float32(1)) * max_change
        flown[i] = position[i] + (velocity[i] + half * change) * dt
        faster[i] = velocity[i] + change
    return flown, faster


def slow_down(particles: Particles, stop_rate: float, stop_speed: float, dt: float) -> Particles:
    """Reduce each weight to the share that keeps moving. Parameters are those of `slow_down`."""
    stops, scale = np.float32(stop_rate * dt), np.float32(0.5 / stop_speed**2)
    weight = _slow_down(particles.velocity, particles.weight, stops, scale)
    return Particles(particles.position, particles.velocity, weight)


@njit(cache=True, nogil=True)
def _slow_down(velocity, weight, stops, scale):
    kept = np.empty_like(weight)
    for i in range(len(weight)):
        speed2 = velocity[i, 0] * velocity[i, 0] + velocity[i, 1] * velocity[i, 1]
        slowness = speed2 * scale
        kept[i] = weight[i]
        if slowness < SLOW:
            kept[i] *= np.exp(-stops * np.exp(-slowness))
    return kept


def transform(particles: Particles, motion: PlanarMotion) -> Particles:
    """Express particles in a new frame. Parameters are those of `transform`."""
    T = (float(motion.dx), float(motion.dy), np.cos(motion.dyaw), np.sin(motion.dyaw))
    position, velocity = _transform(particles.position.ravel(), particles.velocity.ravel(), *T)
    return Particles(position.reshape(-1, 2), velocity.reshape(-1, 2), particles.weight)


@njit(cache=True, nogil=True)
def _transform(position, velocity, dx, dy, cos, sin):
    moved, turned = np.empty_like(position), np.empty_like(velocity)
    for i in range(0, len(position), 2):
        x, y, vx, vy = position[i] - dx, position[i + 1] - dy, velocity[i], velocity[i + 1]
        moved[i], moved[i + 1] = cos * x + sin * y, cos * y - sin * x
        turned[i], turned[i + 1] = cos * vx + sin * vy, cos * vy - sin * vx
    return moved, turned
