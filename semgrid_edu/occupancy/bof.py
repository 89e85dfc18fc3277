"""The BOF, the Bayesian Occupancy Filter, from which CMCDOT descends (Coue et al., IJRR 2006; paper, section 3.2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import check_shape
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.bof_state import BofParams, BofState
from semgrid_edu.occupancy.cellwise import clear_wakes, collide, mix, open_space, ratio
from semgrid_edu.occupancy.evidence import Evidence
from semgrid_edu.occupancy.local_belief import local_belief, observe
from semgrid_edu.occupancy.particles import keeps_pace, slow_down
from semgrid_edu.occupancy.planar_motion import MAX_YAW, PlanarMotion, look_up, map_around, scroll
from semgrid_edu.occupancy.state import Belief, FilterState, Particles, State
from semgrid_edu.occupancy.steps import update
from semgrid_edu.occupancy.world import HALT, WorldModel, transition_matrix

FREE, STATIC, DYNAMIC, UNKNOWN = State


def bof_move(state: BofState, spec: GridSpec, motion: PlanarMotion) -> BofState:
    """Express the belief in a new frame, as `move` does for CMCDOT: what enters the map is UNKNOWN.

    Parameters and errors are those of `move`.

    Returns
    -------
    BofState
        The belief in the new frame, with velocities along the new axes.
    """
    check_shape("state", state.free, spec.shape)
    if motion == PlanarMotion():
        return state
    planes = np.concatenate([[state.unknown, state.free], state.occupied])
    entering = np.eye(1, len(planes), dtype=np.float32)[0]
    moved = look_up(planes, entering, spec, spec, motion)
    velocity, remainder = state.velocity @ motion.rotation, state.remainder @ motion.rotation
    return BofState(moved[1], moved[0], moved[2:], velocity, remainder)


def bof_predict(state: BofState, spec: GridSpec, params: BofParams, dt: float, driven: float = 0.0) -> BofState:
    """Predict: every velocity shifts its mass by its own displacement; all else is as in CMCDOT's `predict`.

    Some mass changes to neighbouring velocities, slow mass becomes STATIC, and the states mix by the transition matrix.
    Mass that leaves a cell leaves FREE behind. Where mass arrives, the combinations that can't be true are struck out:
    something arrives where something stands, or comes out of a wall and goes on along it where nothing was seen to be
    free. What becomes DYNAMIC takes the lattice's prior velocities. It moves from the next step on.

    Parameters
    ----------
    state : BofState
        The belief at the previous instant.
    spec : GridSpec
        The cells, (H, W).
    params : BofParams
        The lattice, and how the world changes.
    dt : float
        Time since the previous instant, seconds, not negative.
    driven : float
        How far the vehicle has driven along the x axis in this time, metres; negative backwards.

    Raises
    ------
    ArgumentError
        When the state is over cells other than `spec`, or of another lattice, or `dt` isn't a time.
    """
    check_shape("state", state.occupied, (len(params.lattice), *spec.shape))
    M = transition_matrix(params.world, dt)
    # Mass changes its velocity, some of it stops, and what goes on is shifted.
    kept = (M[DYNAMIC, DYNAMIC] * _going_on(state, params, dt)).astype(np.float32)
    change = np.float32(params.lattice.change_probability(params.world.max_acceleration, dt))
    cells, remainder = whole_cells(state, spec, dt)
    occupied = np.empty_like(state.occupied)
    going, stays, arrives = np.zeros((3, *spec.shape), np.float32)
    for k in range(1, len(occupied)):
        mass = (1 - 4 * change) * state.occupied[k]
        for other in params.lattice.neighbours[k]:
            mass += change * state.occupied[other]
        mass *= kept[k]
        going += mass
        _shift(mass, cells[k], out=occupied[k])
        total = arrives if cells[k].any() else stays
        total += occupied[k]

    # What arrives in a cell meets what the cell holds.
    mixed, newborn = mix(state.probability, np.zeros(spec.shape, np.float32), going, M)
    keeps = keeps_pace(*state.velocity.T, params.world.pace(driven, dt, spec.cell))
    room = open_space(mixed)
    ways = np.stack([origins(state.velocity, spec, params.world, part) for part in (1, HALT)], axis=1)
    came = [k for k in range(1, len(occupied)) if cells[k].any()]
    doubtful = np.zeros(spec.shape, np.float32)
    for k in came:
        doubtful += occupied[k] * _doubt(mixed, room, ways[k], keeps[k])
    probability, newborn, (own, arrival), (_, less) = collide(mixed, newborn, going, stays, arrives, doubtful)
    occupied[0] = probability[STATIC]
    for k in range(1, len(occupied)):
        occupied[k] *= arrival - less * _doubt(mixed, room, ways[k], keeps[k]) if k in came else own
        occupied[k] += params.lattice.prior[k].astype(np.float32) * newborn
    return BofState(probability[FREE], probability[UNKNOWN], occupied, state.velocity, remainder)


def _going_on(state: BofState, params: BofParams, dt: float) -> NDArray[np.float32]:
    """Return which share of each velocity's mass doesn't stop, (V,), by `slow_down` of one particle per velocity."""
    velocity = state.velocity.astype(np.float32)
    particles = Particles(np.zeros_like(velocity), velocity, np.ones(len(velocity), np.float32))
    return slow_down(particles, params.world.stop_rate, params.world.stop_speed, dt).weight


def whole_cells(state: BofState, spec: GridSpec, dt: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return by how many whole cells each velocity shifts its mass, and what remains of its displacement.

    Parameters
    ----------
    state : BofState
        The belief, of which only the velocities and their remainders count.
    spec : GridSpec
        The cells.
    dt : float
        The time step, seconds.

    Returns
    -------
    cells : (V, 2) int64
        Number of cells along the x and y axes of the map.
    remainder : (V, 2) float64
        What remains along the same axes, metres, at most half a cell.
    """
    displacement = state.remainder + state.velocity * dt
    remainder = (displacement + spec.cell / 2) % spec.cell - spec.cell / 2
    cells = np.rint((displacement - remainder) / spec.cell)
    farthest = max(spec.shape)  # all that leaves the grid is lost, however far it goes
    return np.clip(cells, -farthest, farthest).astype(np.int64), remainder


def origins(velocity: NDArray, spec: GridSpec, world: WorldModel, part: float = 1.0) -> NDArray[np.int64]:
    """Return how many cells away mass of each velocity was some time ago, when it still took up another place.

    Parameters
    ----------
    velocity : (V, 2) float
        The velocities along the axes of the map, m/s.
    spec : GridSpec
        The cells.
    world : WorldModel
        How long ago: `clearing_time`, or for slow things the time that they need for `clearing_cells`.
    part : float
        Which part of `clearing_time` ago: `HALT` for the halt on the way.

    Returns
    -------
    (V, 2) int64
        Number of whole cells along the x and y axes of the map, to the place where it was.
    """
    back = -part * world.clearing_time * velocity / spec.cell
    length = np.linalg.norm(back, axis=1, keepdims=True)
    return np.rint(back * np.maximum(1, ratio(np.full_like(length, world.clearing_cells), length))).astype(np.int64)


def bof_update(state: BofState, spec: GridSpec, evidence: Evidence, params: BofParams) -> BofState:
    """Update by Bayes' rule: that of CMCDOT's `update`, because a scan says nothing of velocities.

    All moving mass of a cell shares P(z | occupied), so it is scaled by one factor. The dynamic part of UNKNOWN cells
    that are seen for the first time takes the lattice's prior velocities. In hidden cells, what moves says that nothing
    stands where it was (`clear_wakes`).

    Parameters
    ----------
    state : BofState
        The belief before the scan.
    spec : GridSpec
        The cells, (H, W).
    evidence : Evidence
        What the scan says of each cell.
    params : BofParams
        The lattice, and what UNKNOWN cells turn out to be at first sight.

    Raises
    ------
    ArgumentError
        When state or evidence are over cells other than `spec`, or of another lattice.
    """
    check_shape("state", state.occupied, (len(params.lattice), *spec.shape))
    before = state.probability
    given = update(FilterState(before, Particles.none(), np.zeros_like(before[0])), spec, evidence, params.world)
    factor = ratio(np.maximum(given.probability[DYNAMIC] - given.newborn, 0), before[DYNAMIC])
    occupied = np.empty_like(state.occupied)
    occupied[0] = given.probability[STATIC]
    for k in range(1, len(occupied)):
        np.multiply(state.occupied[k], factor, out=occupied[k])
        occupied[k] += np.float32(params.lattice.prior[k]) * given.newborn
    left = np.zeros(spec.shape, np.float32)
    for mass, back in zip(occupied, origins(state.velocity, spec, params.world), strict=True):
        left += _moved(mass, back)
    cleared = clear_wakes(given.probability, left, evidence.occupied == evidence.free)
    occupied[0] = cleared[STATIC]
    return BofState(cleared[FREE], cleared[UNKNOWN], occupied, state.velocity, state.remainder)


def bof_velocity(state: BofState) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return mean and covariance of the velocity of what moves in each cell.

    Parameters
    ----------
    state : BofState
        The belief, with mass of V velocities in each cell.

    Returns
    -------
    mean : (2, H, W) float32
        Mean velocity along the axes of the map, m/s; NaN where nothing moves.
    covariance : (2, 2, H, W) float32
        Its covariance, m^2/s^2; NaN where nothing moves.
    """
    vx, vy = state.velocity[1:].T
    powers = np.stack([np.ones_like(vx), vx, vy, vx * vx, vx * vy, vy * vy]).astype(np.float32)
    moment = np.tensordot(powers, state.occupied[1:], axes=1)
    moment = np.where(moment[0] > 0, moment / np.where(moment[0] > 0, moment[0], 1), np.float32(np.nan))
    mean = moment[1:3]
    covariance = moment[[3, 4, 4, 5]].reshape(2, 2, *mean.shape[1:]) - mean[:, None] * mean[None]
    for axis in range(2):
        np.maximum(covariance[axis, axis], 0, out=covariance[axis, axis])
    return mean, covariance


class Bof:
    """The exact filter on a lattice of velocities: what `Cmcdot` tends to as its particles grow in number.

    It has no randomness and no sampling error. The price is time and memory that grow with the number of velocities,
    in every cell, whether anything moves there or not. Its map scrolls under the vehicle as that of `Cmcdot` does.

    Parameters
    ----------
    spec : GridSpec
        The grid in which the filter hands out its beliefs, (H, W) cells.
    params : BofParams, optional
        The lattice of velocities, and what the filter assumes of the world and of its sensor.

    Raises
    ------
    ArgumentError
        When the lattice has so many velocities that their mass in all cells doesn't fit into memory.

    Examples
    --------
    >>> tracker = Bof(GridSpec.compact())
    >>> wall = np.array([[20.25, y, 1.0] for y in np.arange(-3, 3, 0.1)])
    >>> belief = tracker.step(wall, PlanarMotion(), dt=0.1)
    >>> belief.probability[:, 101, 31].argmax(), belief.probability[:, 120, 31].argmax()
    (np.int64(1), np.int64(0))
    """

    def __init__(self, spec: GridSpec, params: BofParams | None = None) -> None:
        self.spec = spec
        self.params = params or BofParams()
        self.map_spec = map_around(spec, MAX_YAW)
        self._pose = PlanarMotion()
        self._state = BofState.nothing_known(self.map_spec, self.params.lattice)

    def step(self, points_grid: NDArray, motion: PlanarMotion, dt: float) -> Belief:
        """Take in one scan: move, predict, update.

        Parameters, result and errors are those of `Cmcdot.step`.
        """
        world = self.params.world
        shift, pose = scroll(self._pose.then(motion), self.map_spec.cell, MAX_YAW)
        seen = observe(world.sensor, points_grid, pose, self.map_spec, self.spec)
        moved = bof_move(self._state, self.map_spec, shift)
        predicted = bof_predict(moved, self.map_spec, self.params, dt, motion.dx)
        self._state, self._pose = bof_update(predicted, self.map_spec, seen.on_map, self.params), seen.pose
        velocity = bof_velocity(self._state)
        return local_belief(predicted.probability, velocity, seen, self.map_spec, self.spec, world)


def _doubt(mixed: NDArray, room: NDArray, way: NDArray[np.int64], keeps: bool) -> NDArray[np.float32]:
    """Return which part of the mass of one velocity comes out of a wall and goes on along it, cell by cell.

    `way` says where the mass was: its origin and its halt, in cells along x and y. A plane moved the other way shows in
    each cell what is there; a plane moved by the origin itself, what is where the mass goes. The halt counts only
    if the mass `keeps` pace; then the second plane of `room` is the open space, else the first.
    """
    static = np.max([_moved(mixed[STATIC], -cells) for cells in (way if keeps else way[:1])], axis=0)
    return static * (1 - _moved(room[int(keeps)], way[0]))


def _moved(plane: NDArray, cells: NDArray[np.int64]) -> NDArray:
    """Return a plane moved by whole cells along x and y; all zeros when they are 0, because then nothing has moved."""
    out = np.zeros_like(plane)
    if cells.any():
        _shift(plane, cells, out)
    return out


def _shift(plane: NDArray, cells: NDArray[np.int64], out: NDArray) -> None:
    """Move a plane by whole cells along x and y, which is up and left; nothing comes in from outside."""
    up, left = np.clip(cells, np.negative(plane.shape), plane.shape)
    height, width = plane.shape
    out[...] = 0
    source = plane[max(up, 0) : height + min(up, 0), max(left, 0) : width + min(left, 0)]
    out[max(-up, 0) : height - max(up, 0), max(-left, 0) : width - max(left, 0)] = source
