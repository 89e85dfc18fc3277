"""What particles do, in compiled loops and single precision.

Loops that only compute get the coordinates (N, 2) flattened, as (2 N,). The compiler then knows that they are
contiguous and vectorises over particles.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.fast.occupancy.cells import cell_of
from semgrid_edu.fast.occupancy.cellwise import DYNAMIC, FREE, STATIC, largest_nearby
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.state import OUTSIDE, Particles
from semgrid_edu.occupancy.walls import WALL_EXPONENT, Walls

SLOW = np.float32(16)
"""exp(-16) is negligible beside 1 in single precision, so smaller exponentials needn't be computed."""


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
    scaled = np.zeros(len(weight), np.float32)
    flat = factor.ravel()
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
        vx = velocity[2 * i]
        vy = velocity[2 * i + 1]
        speed = math.sqrt(vx * vx + vy * vy)
        stretch = max(np.float32(1), least / (abs(time) * speed)) if time * speed != 0 else np.float32(0)
        x = xy[2 * i] + stretch * time * vx
        y = xy[2 * i + 1] + stretch * time * vy
        then = cell_of(x, y, shape, x_max, y_max, cell)
        there[i] = then if then != cells[i] else OUTSIDE
    return there


@njit(cache=True, nogil=True)
def keeps_pace(vx, vy, car_x, car_y, least):
    """Return whether a particle moves at the vehicle's speed: its velocity differs by at most that speed.

    Parameters
    ----------
    vx, vy : float
        Velocity along the axes of the map, m/s. A static thing, seen from the vehicle, differs by exactly its speed.
    car_x, car_y : float
        Velocity of the vehicle along the axes of the map, m/s. Nothing keeps pace when it is 0.
    least : float
        The least speed at which something leaves its cells soon enough, m/s. Slower things don't keep pace.
    """
    slip_squared = (vx - car_x) ** 2 + (vy - car_y) ** 2
    speed_squared = vx**2 + vy**2
    car_squared = car_x**2 + car_y**2
    return (slip_squared <= car_squared) & (speed_squared >= least**2) & (car_squared != 0)


def doubt_arrivals(
    particles: Particles,
    cells: NDArray,
    mixed: NDArray,
    spec: GridSpec,
    walls: Walls,
    car_velocity: NDArray,
) -> NDArray[np.float32]:
    """Return the part of each weight that comes out of a wall and moves along it, (N,).

    Parameters
    ----------
    particles : Particles
        N particles after their flight.
    cells : (N,) int32
        The cell that each is in now, from `cells_of`.
    mixed : (4, H, W) float32
        The four states before particles flew.
    spec : GridSpec
        The cells, (H, W).
    walls : Walls
        How far the filter looks ahead and back.
    car_velocity : (2,) float
        Velocity of the vehicle along the axes of the map, m/s.
    """
    since = float(walls.second_look * walls.clearing_time)
    least = walls.clearing_cells * spec.cell / since if since > 0 else np.inf
    times = -walls.clearing_time, -since, walls.clearing_time
    fewest = walls.clearing_cells * np.array([1, walls.second_look, 1])
    other_cells = (cells_at(particles, cells, spec, *path) for path in zip(times, fewest, strict=True))
    wall = mixed[STATIC] ** WALL_EXPONENT
    fields = mixed[FREE], mixed[DYNAMIC], mixed[STATIC], wall, largest_nearby(wall), largest_nearby(mixed[STATIC])
    speeds = *map(float, car_velocity), float(least), float(walls.running_speed)
    return _doubt_arrivals(particles.velocity.ravel(), particles.weight, *other_cells, *fields, *speeds)


@njit(cache=True, nogil=True, error_model="numpy")
def _doubt_arrivals(
    velocity,
    weight,
    before,
    shortly_before,
    ahead,
    free,
    dynamic,
    static,
    wall,
    wall_nearby,
    static_nearby,
    car_x,
    car_y,
    least,
    running,
):
    doubted = np.empty_like(weight)
    free = free.ravel()
    dynamic = dynamic.ravel()
    static = static.ravel()
    wall = wall.ravel()
    wall_nearby = wall_nearby.ravel()
    static_nearby = static_nearby.ravel()
    for i in range(len(weight)):
        vx = velocity[2 * i]
        vy = velocity[2 * i + 1]
        keeps = keeps_pace(vx, vy, car_x, car_y, least)
        runs = vx * vx + vy * vy > running * running
        suspect = np.float32(0)
        if before[i] != OUTSIDE:
            suspect = wall_nearby[before[i]] if runs else static[before[i]]
        if runs and shortly_before[i] != OUTSIDE:
            suspect = max(suspect, wall[shortly_before[i]])
        room = np.float32(0)
        if ahead[i] != OUTSIDE:
            beside = static_nearby[ahead[i]] if keeps else np.float32(0)
            room = (1 - beside) * free[ahead[i]] + dynamic[ahead[i]]
        doubted[i] = weight[i] * suspect * (1 - room)
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
    flown = np.empty_like(position)
    faster = np.empty_like(velocity)
    half = np.float32(0.5)
    two = np.float32(2)
    for i in range(len(position)):
        change = (two * noise[i] - np.float32(1)) * max_change
        flown[i] = position[i] + (velocity[i] + half * change) * dt
        faster[i] = velocity[i] + change
    return flown, faster


def moving_share(velocity: NDArray, stop_rate: float, stop_speed: float, dt: float) -> NDArray[np.float32]:
    """Return which share of its mass still moves after a time step. Parameters are those of `moving_share`."""
    return _moving_share(velocity, np.float32(stop_rate * dt), np.float32(0.5 / stop_speed**2))


@njit(cache=True, nogil=True)
def _moving_share(velocity, stops, scale):
    share = np.ones(len(velocity), np.float32)
    for i in range(len(velocity)):
        speed2 = velocity[i, 0] * velocity[i, 0] + velocity[i, 1] * velocity[i, 1]
        slowness = speed2 * scale
        if slowness < SLOW:
            share[i] = np.exp(-stops * np.exp(-slowness))
    return share


def transform(particles: Particles, motion: PlanarMotion) -> Particles:
    """Express particles in a new frame. Parameters are those of `transform`."""
    T = (float(motion.dx), float(motion.dy), np.cos(motion.dyaw), np.sin(motion.dyaw))
    position, velocity = _transform(particles.position.ravel(), particles.velocity.ravel(), *T)
    return Particles(position.reshape(-1, 2), velocity.reshape(-1, 2), particles.weight)


@njit(cache=True, nogil=True)
def _transform(position, velocity, dx, dy, cos, sin):
    moved = np.empty_like(position)
    turned = np.empty_like(velocity)
    for i in range(0, len(position), 2):
        x = position[i] - dx
        y = position[i + 1] - dy
        vx = velocity[i]
        vy = velocity[i + 1]
        moved[i] = cos * x + sin * y
        moved[i + 1] = cos * y - sin * x
        turned[i] = cos * vx + sin * vy
        turned[i + 1] = cos * vy - sin * vx
    return moved, turned
