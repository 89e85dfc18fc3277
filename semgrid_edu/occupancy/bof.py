"""The BOF, the Bayesian Occupancy Filter, from which CMCDOT descends (Coue et al., IJRR 2006; paper, section 3.2)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import check_shape
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.bof_state import BofParams, BofState, origins, whole_cells
from semgrid_edu.occupancy.cmcdot import local_belief
from semgrid_edu.occupancy.planar_motion import PlanarMotion, look_up, map_around, scroll, shift_plane
from semgrid_edu.occupancy.sensor import Evidence, evidence_of, take_scan
from semgrid_edu.occupancy.state import Belief, State, moving_share
from semgrid_edu.occupancy.steps import bayes, initialise_unknown, mix, strike_out, transition_matrix
from semgrid_edu.occupancy.walls import WALL_EXPONENT, Walls, largest_nearby, strike_out_wakes, velocity_of

FREE, STATIC, DYNAMIC, UNKNOWN = State


def bof_move(state: BofState, spec: GridSpec, motion: PlanarMotion, to: GridSpec | None = None) -> BofState:
    """Express the belief in a new frame, as `move` does for CMCDOT: what enters the map is UNKNOWN.

    Parameters and errors are those of `move`.

    Returns
    -------
    BofState
        The belief in the new frame, with velocities along the new axes.
    """
    check_shape("state", state.free, spec.shape)
    planes = np.concatenate([[state.unknown, state.free], state.occupied])
    # Cells that enter the map have all their mass on the first plane, UNKNOWN.
    entering = np.eye(1, len(planes), dtype=np.float32)[0]
    moved = look_up(planes, entering, spec, to or spec, motion)
    velocity = state.velocity @ motion.rotation
    remainder = state.remainder @ motion.rotation
    return BofState(moved[1], moved[0], moved[2:], velocity, remainder)


def bof_predict(
    state: BofState, spec: GridSpec, params: BofParams, dt: float, driven: ArrayLike = (0.0, 0.0)
) -> BofState:
    """Predict: every velocity shifts its mass by its own displacement; all else is as in CMCDOT's `predict`.

    Some mass changes to neighbouring velocities, slow mass becomes STATIC, and the states mix by the transition matrix.
    Mass that leaves a cell leaves FREE behind. Where mass arrives, the combinations that can't be true are struck out:
    something arrives in a cell that is STATIC, or what arrives may be only a wall that comes into view (`world.walls`).
    What becomes DYNAMIC takes the lattice's prior velocities. It moves from the next step on.

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
    driven : (2,) float
        How far the vehicle has driven in this time, along the axes of the map, metres.

    Raises
    ------
    ArgumentError
        When the state covers cells other than `spec`, or another lattice, or `dt` isn't a time.
    """
    check_shape("state", state.occupied, (len(params.lattice), *spec.shape))
    M = transition_matrix(params.world, dt)
    cells, remainder = whole_cells(state, spec, dt)
    # A velocity may move by no whole cell in this step. Its mass stays, and the way is added to the next step's.
    moves = cells.any(axis=1)
    occupied, going = _shifted(state, cells, M[DYNAMIC, DYNAMIC], params, dt)
    arrives = occupied.sum(axis=0, dtype=np.float64, where=moves[:, None, None])
    stays = occupied.sum(axis=0, dtype=np.float64, where=~moves[:, None, None])
    vacated = going - stays
    mixed, newborn = mix(state.probability, np.zeros(spec.shape), going, M)
    car_velocity = velocity_of(driven, dt)
    blocked = _blocked(state.velocity, mixed, mixed[UNKNOWN] + vacated, spec, params.world.walls, car_velocity)

    # What arrives in a cell meets what the cell holds.
    believed = {k: 1 - blocked(k) for k in np.flatnonzero(moves)}
    possible = np.zeros(spec.shape)
    for k, share in believed.items():
        possible += occupied[k] * share
    keep, take = strike_out(arrives, possible)
    newborn = keep * newborn
    for k in range(1, len(occupied)):
        # As in `collide`: arrivals are scaled as possible arrivals, mass that stayed as what the cell held.
        occupied[k] *= take * believed[k] if moves[k] else keep
        occupied[k] += params.lattice.prior[k] * newborn
    occupied[0] = keep * mixed[STATIC]
    free = keep * (mixed[FREE] + vacated)
    unknown = keep * mixed[UNKNOWN]
    dtype = occupied.dtype
    return BofState(free.astype(dtype), unknown.astype(dtype), occupied, state.velocity, remainder)


def _shifted(
    state: BofState, cells: NDArray[np.int64], stays_dynamic: float, params: BofParams, dt: float
) -> tuple[NDArray, NDArray[np.float64]]:
    """Return the mass of each velocity in its new cells, (V, H, W), and all that moves in its old cells, (H, W)."""
    world = params.world
    kept = stays_dynamic * moving_share(state.velocity, world.stop_rate, world.stop_speed, dt)
    occupied = np.zeros_like(state.occupied)
    going = np.zeros(state.free.shape)
    for k in range(1, len(occupied)):
        mass = float(kept[k]) * _accelerated(state, k, params, dt)
        occupied[k] = shift_plane(mass, cells[k])
        going += mass
    return occupied, going


def _accelerated(state: BofState, k: int, params: BofParams, dt: float) -> NDArray[np.floating]:
    """Return the mass of one velocity, (H, W), after a part has changed to each neighbouring velocity and back."""
    change = params.lattice.change_probability(params.world.max_acceleration, dt)
    mass = (1 - 4 * change) * state.occupied[k]
    for other in params.lattice.neighbours[k]:
        mass += change * state.occupied[other]
    return mass


def _blocked(
    velocity: NDArray, mixed: NDArray, unseen: NDArray, spec: GridSpec, walls: Walls, car_velocity: NDArray
) -> Callable[[int], NDArray]:
    """Return a function that tells with what probability mass of velocity k can't have arrived in a cell, (H, W).

    It can't if the cell is STATIC. What `walls` doubts is that of `Walls.doubt`, for whole planes: a plane shifted the
    other way shows in each cell the value at the place where its mass is at another time.
    """
    wall = mixed[STATIC] ** WALL_EXPONENT
    nearby = largest_nearby(wall)
    runs = np.hypot(*velocity.T) > walls.running_speed
    keeps = walls.keeps_pace(velocity, car_velocity, spec.cell)
    before = origins(velocity, spec, walls)
    shortly_before = origins(velocity, spec, walls, walls.second_look)
    open_space = mixed[FREE] + mixed[DYNAMIC]
    open_to_pace = open_space - mixed[FREE] * largest_nearby(mixed[STATIC])

    def blocked(k: int) -> NDArray[np.floating]:
        from_wall = _elsewhere(nearby if runs[k] else mixed[STATIC], before[k])
        if runs[k]:
            from_wall = np.maximum(from_wall, _elsewhere(wall, shortly_before[k]))
        open_ahead = _elsewhere(open_to_pace if keeps[k] else open_space, -before[k])
        return mixed[STATIC] + from_wall * (1 - open_ahead) * unseen

    return blocked


def bof_update(state: BofState, spec: GridSpec, evidence: Evidence, params: BofParams) -> BofState:
    """Update by Bayes' rule: that of CMCDOT's `update`, because a scan tells nothing about velocities.

    All moving mass of a cell shares P(z | occupied), so it is scaled by one factor. The dynamic part of UNKNOWN cells
    that are seen for the first time takes the lattice's prior velocities. Hidden cells that moving mass has left become
    free (`world.walls`).

    Parameters
    ----------
    state : BofState
        The belief before the scan.
    spec : GridSpec
        The cells, (H, W).
    evidence : Evidence
        What the scan tells about each cell.
    params : BofParams
        The lattice, and what UNKNOWN cells turn out to be at first sight.

    Raises
    ------
    ArgumentError
        When state or evidence cover cells other than `spec`, or another lattice.
    """
    check_shape("state", state.occupied, (len(params.lattice), *spec.shape))
    check_shape("evidence", evidence.free, spec.shape)
    prior, born = initialise_unknown(state.probability, evidence.seen, params.world)
    probability, factor = bayes(prior, evidence)
    occupied = np.zeros_like(state.occupied)
    for k in range(1, len(occupied)):
        occupied[k] = factor * (state.occupied[k] + params.lattice.prior[k] * born)
    left = np.zeros(spec.shape)
    for mass, back in zip(occupied[1:], origins(state.velocity[1:], spec, params.world.walls), strict=True):
        left += _elsewhere(mass, -back)
    probability = strike_out_wakes(probability, left, ~evidence.seen)
    occupied[0] = probability[STATIC]
    dtype = occupied.dtype
    free = probability[FREE].astype(dtype)
    unknown = probability[UNKNOWN].astype(dtype)
    return BofState(free, unknown, occupied, state.velocity, state.remainder)


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
    # Six sums over the velocities: of the mass, and of the mass times vx, vy, vx^2, vx vy and vy^2.
    moment = np.tensordot(powers, state.occupied[1:], axes=1)
    moment = np.where(moment[0] > 0, moment / np.where(moment[0] > 0, moment[0], 1), np.float32(np.nan))
    mean = moment[1:3]
    covariance = moment[[3, 4, 4, 5]].reshape(2, 2, *mean.shape[1:]) - mean[:, None] * mean[None]
    for axis in range(2):
        np.maximum(covariance[axis, axis], 0, out=covariance[axis, axis])
    return mean, covariance


class Bof:
    """The exact filter on a lattice of velocities: what `Cmcdot` tends to as its particles grow in number.

    That holds up to the lattice's top speed and spacing: `Cmcdot` also follows what is faster.

    It has no randomness and no sampling error. The price is time and memory that grow with the number of velocities,
    in every cell, whether anything moves there or not. Its map scrolls under the vehicle as that of `Cmcdot` does.

    Parameters
    ----------
    spec : GridSpec
        The grid in which the filter hands out its beliefs, (H, W) cells.
    params : BofParams, optional
        The lattice of velocities, and what the filter assumes about the world and its sensor.

    Raises
    ------
    ArgumentError
        When the mass of all velocities in all cells doesn't fit into memory.

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
        self.map_spec = map_around(spec, yaw=0)
        self._pose = PlanarMotion()
        self._state = BofState.nothing_known(self.map_spec, self.params.lattice)

    def step(self, points_grid: NDArray, motion: PlanarMotion, dt: float) -> Belief:
        """Process one scan: move, predict, update.

        Parameters, result and errors are those of `Cmcdot.step`.
        """
        world = self.params.world
        shift, pose = scroll(self._pose.then(motion), self.spec.cell)
        map_spec = map_around(self.spec, pose.dyaw)
        scan = take_scan(world.sensor, points_grid)
        on_map = evidence_of(scan, map_spec, pose)
        in_grid = evidence_of(scan, self.spec, PlanarMotion())
        driven = self._pose.rotation @ (motion.dx, motion.dy)
        moved = bof_move(self._state, self.map_spec, shift, map_spec)
        predicted = bof_predict(moved, map_spec, self.params, dt, driven)
        self._state = bof_update(predicted, map_spec, on_map, self.params)
        self._pose = pose
        self.map_spec = map_spec
        velocity = bof_velocity(self._state)
        return local_belief(predicted.probability, velocity, in_grid, pose, map_spec, self.spec, world)


def _elsewhere(plane: NDArray, cells: NDArray[np.int64]) -> NDArray:
    """Return for each cell the value at a distance in cells along x and y, (H, W); 0 outside and for no distance.

    At no distance nothing has moved, so there is no other place to look at.
    """
    return shift_plane(plane, -cells) if cells.any() else np.zeros_like(plane)
