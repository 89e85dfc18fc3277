"""The steps of the BOF, occupancy times velocity on a lattice, each a pure function (Coue et al., IJRR 2006)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.evidence import Evidence
from semgrid_edu.occupancy.motion import PlanarMotion
from semgrid_edu.occupancy.moving_map import look_up
from semgrid_edu.occupancy.params import CmcdotParams, transition_matrix
from semgrid_edu.occupancy.particles import slow_down
from semgrid_edu.occupancy.state import FilterState, Particles, State
from semgrid_edu.occupancy.steps import CERTAIN, update
from semgrid_edu.occupancy.velocity_lattice import VelocityLattice

FREE, STATIC, DYNAMIC, UNKNOWN = State
MOST_BYTES = 2e9
"""Memory that the occupied mass may take: a step needs twice as much, which a student's computer has."""


@dataclass(frozen=True)
class BofParams:
    """What the BOF assumes: the model of CMCDOT, with a lattice of velocities in place of particles.

    Parameters
    ----------
    lattice : VelocityLattice
        The velocities it tells apart.
    world : CmcdotParams
        Sensor and world. What it says of particles doesn't matter here: their number, births, acceleration, and
        `max_speed`, for which the lattice has its own.
    """

    lattice: VelocityLattice = field(default_factory=VelocityLattice)
    world: CmcdotParams = field(default_factory=CmcdotParams)


@dataclass(frozen=True, eq=False)
class BofState:
    """What the BOF carries from step to step: a distribution over free, unknown and V velocities in each cell.

    Each velocity's mass is shifted by whole cells, and the rest of its displacement is kept beside: so no
    mass is ever spread by interpolation, and slow things move too, a cell every few steps. Nor does
    the lattice turn with the map; its velocities are expressed in the map's axes.

    Parameters
    ----------
    free, unknown : (H, W) float32
        P(FREE) and P(UNKNOWN).
    occupied : (V, H, W) float32
        P(occupied, velocity). The first velocity is zero: its mass is STATIC, that of all others DYNAMIC.
    velocity : (V, 2) float64
        The lattice in the axes of the map, m/s.
    remainder : (V, 2) float64
        How far, beyond whole cells, each velocity has moved its mass, metres along the axes of the map.
    """

    free: NDArray[np.float32]
    unknown: NDArray[np.float32]
    occupied: NDArray[np.float32]
    velocity: NDArray[np.float64]
    remainder: NDArray[np.float64]

    @classmethod
    def nothing_known(cls, spec: GridSpec, lattice: VelocityLattice) -> "BofState":
        """Return the state of one who has seen nothing: UNKNOWN everywhere.

        Raises
        ------
        ArgumentError
            When lattice times grid is too much for memory.
        """
        shape = (len(lattice), *spec.shape)
        if (size := 4 * float(np.prod(shape, dtype=float))) > MOST_BYTES:
            expected = f"velocities x cells that take at most {MOST_BYTES / 1e9:g} GB"
            raise ArgumentError("lattice", expected, "{} x {} x {}, ".format(*shape) + f"{size / 1e9:.1f} GB")
        free, unknown = np.zeros(spec.shape, np.float32), np.ones(spec.shape, np.float32)
        return cls(free, unknown, np.zeros(shape, np.float32), lattice.velocities, np.zeros((len(lattice), 2)))

    @property
    def probability(self) -> NDArray[np.floating]:
        """(4, H, W): P(FREE), P(STATIC), P(DYNAMIC), P(UNKNOWN)."""
        return np.stack([self.free, self.occupied[0], self.occupied[1:].sum(axis=0), self.unknown])


def bof_move(state: BofState, spec: GridSpec, motion: PlanarMotion) -> BofState:
    """Express the belief in a new frame, as `move` does for CMCDOT: what enters is UNKNOWN.

    Parameters
    ----------
    state : BofState
        In the old frame.
    spec : GridSpec
        The cells, the same in both frames.
    motion : PlanarMotion
        The new frame, in the old one.

    Returns
    -------
    BofState
        In the new frame.
    """
    if motion == PlanarMotion():
        return state
    height, width = spec.shape
    indices = np.indices(spec.shape, dtype=np.float32)
    row, col = look_up(indices, np.full(2, -1, np.float32), spec, spec, motion).astype(np.intp)
    inside, source = row >= 0, row * width + col
    planes = [state.free, state.unknown, *state.occupied]
    moved = np.empty((len(planes), height, width), np.float32)
    for plane, target in zip(planes, moved, strict=True):
        np.take(plane, source, out=target, mode="clip")
        target *= inside
    moved[1] += ~inside
    velocity, remainder = state.velocity @ motion.rotation, state.remainder @ motion.rotation
    return BofState(moved[0], moved[1], moved[2:], velocity, remainder)


def bof_predict(state: BofState, spec: GridSpec, params: BofParams, dt: float) -> BofState:
    """Predict: every velocity shifts its mass by its own displacement; the rest is the model of `predict`.

    Each cell mixes by the transition matrix, slow mass becomes STATIC, what leaves leaves FREE behind, and where
    mass arrives, "something arrives" and "a standing thing is here" can't both be right. What
    the matrix makes DYNAMIC takes the lattice's prior velocities, and flies from the next step on.

    Parameters
    ----------
    state : BofState
        At the previous instant.
    spec : GridSpec
        The cells.
    params : BofParams
        Lattice, rates, stopping.
    dt : float
        Seconds, not negative.

    Returns
    -------
    BofState
        At the present instant, before its scan.
    """
    M = transition_matrix(params.world, dt).astype(np.float32)
    kept, prior = going_on(state, params, dt), params.lattice.prior.astype(np.float32)
    cells, remainder = whole_cells(state, spec, dt)
    flown = np.empty_like(state.occupied)
    going, stays, arrives = np.zeros((3, *spec.shape), np.float32)
    for k in range(1, len(flown)):
        mass = kept[k] * state.occupied[k]
        going += mass
        _shift(mass, cells[k], out=flown[k])
        total = arrives if cells[k].any() else stays
        total += flown[k]

    before = state.probability
    own = np.einsum("ij,ihw->jhw", M, before)
    own[STATIC] += np.maximum(M[DYNAMIC, DYNAMIC] * before[DYNAMIC] - going, 0)
    before[DYNAMIC] = 0
    newborn = np.einsum("i,ihw->hw", M[:, DYNAMIC], before)
    own[FREE] += going - stays

    claim = np.minimum(arrives, CERTAIN)
    consistent = 1 - claim * own[STATIC]
    own_factor = (1 - claim) / consistent
    arrival_factor = _ratio(claim, arrives) * (1 - own[STATIC]) / consistent
    newborn *= own_factor
    flown[0] = own[STATIC] * own_factor
    for k in range(1, len(flown)):
        flown[k] *= arrival_factor if cells[k].any() else own_factor
        flown[k] += prior[k] * newborn
    return BofState(own[FREE] * own_factor, own[UNKNOWN] * own_factor, flown, state.velocity, remainder)


def bof_predict_literal(state: BofState, spec: GridSpec, params: BofParams, dt: float) -> BofState:
    """Predict cell by cell and velocity by velocity, in double precision: the literal twin of `bof_predict`."""
    M = transition_matrix(params.world, dt)
    kept, (cells, remainder) = going_on(state, params, dt), whole_cells(state, spec, dt)
    own, newborn = np.zeros((4, *spec.shape)), np.zeros(spec.shape)
    stays, arrives = np.zeros((2, *state.occupied.shape))
    for row, col in np.ndindex(spec.shape):
        before = state.probability[:, row, col].astype(np.float64)
        own[:, row, col] += before @ M
        newborn[row, col] = before[[FREE, STATIC, UNKNOWN]] @ M[[FREE, STATIC, UNKNOWN], DYNAMIC]
        for k in range(1, len(cells)):
            mass = M[DYNAMIC, DYNAMIC] * state.occupied[k, row, col]
            own[STATIC, row, col] += mass * (1 - kept[k])
            to_row, to_col = row - cells[k, 0], col - cells[k, 1]
            if (to_row, to_col) == (row, col):
                stays[k, row, col] += mass * kept[k]
                continue
            own[FREE, row, col] += mass * kept[k]
            if 0 <= to_row < spec.shape[0] and 0 <= to_col < spec.shape[1]:
                arrives[k, to_row, to_col] += mass * kept[k]

    occupied = np.zeros(state.occupied.shape)
    for row, col in np.ndindex(spec.shape):
        arrival, static = arrives[:, row, col].sum(), own[STATIC, row, col]
        claim = min(arrival, CERTAIN)
        consistent = 1 - claim * static
        own[:, row, col] *= (1 - claim) / consistent
        here = stays[:, row, col] + params.lattice.prior * newborn[row, col]
        occupied[:, row, col] = here * (1 - claim) / consistent
        if arrival > 0:
            occupied[:, row, col] += arrives[:, row, col] * (claim / arrival) * (1 - static) / consistent
        occupied[0, row, col] = own[STATIC, row, col]
    return BofState(own[FREE], own[UNKNOWN], occupied, state.velocity, remainder)


def going_on(state: BofState, params: BofParams, dt: float) -> NDArray[np.float32]:
    """Return what part of each velocity's mass goes on moving, (V,): to `slow_down` each is a particle of weight 1."""
    velocity = state.velocity.astype(np.float32)
    particles = Particles(np.zeros_like(velocity), velocity, np.ones(len(velocity), np.float32))
    return slow_down(particles, params.world.stop_rate, params.world.stop_speed, dt).weight


def whole_cells(state: BofState, spec: GridSpec, dt: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return by how many whole cells each velocity shifts its mass, (V, 2) along x and y, and the new remainders."""
    displacement = state.remainder + state.velocity * dt
    cells = np.rint(displacement / spec.cell).astype(np.int64)
    return cells, displacement - cells * spec.cell


def bof_update(state: BofState, spec: GridSpec, evidence: Evidence, params: BofParams) -> BofState:
    """Update by Bayes' rule: that of `update`, for a scan knows nothing of velocities.

    All moving mass of a cell shares P(z | occupied), so it is scaled by one factor; of UNKNOWN cells that are seen for
    the first time, the dynamic part takes the lattice's prior velocities.

    Parameters
    ----------
    state : BofState
        Predicted.
    spec : GridSpec
        The cells.
    evidence : Evidence
        Of the scan.
    params : BofParams

    Returns
    -------
    BofState
        Given the scan.
    """
    before = state.probability
    given = update(FilterState(before, Particles.none(), np.zeros_like(before[0])), spec, evidence, params.world)
    factor = _ratio(np.maximum(given.probability[DYNAMIC] - given.newborn, 0), before[DYNAMIC])
    occupied = np.empty_like(state.occupied)
    occupied[0] = given.probability[STATIC]
    for k in range(1, len(occupied)):
        np.multiply(state.occupied[k], factor, out=occupied[k])
        occupied[k] += np.float32(params.lattice.prior[k]) * given.newborn
    free, unknown = given.probability[[FREE, UNKNOWN]]
    return BofState(free, unknown, occupied, state.velocity, state.remainder)


def bof_velocity(state: BofState) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return mean and covariance of the velocity of what moves in each cell.

    Parameters
    ----------
    state : BofState

    Returns
    -------
    mean : (2, H, W) float32
        Along the axes of the map, m/s; NaN where nothing moves.
    covariance : (2, 2, H, W) float32
        m^2/s^2; NaN likewise.
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


def _shift(plane: NDArray, cells: NDArray[np.int64], out: NDArray) -> None:
    """Move a plane by whole cells along x and y, which is up and left; nothing comes in from outside."""
    up, left = np.clip(cells, np.negative(plane.shape), plane.shape)
    height, width = plane.shape
    out[...] = 0
    source = plane[max(up, 0) : height + min(up, 0), max(left, 0) : width + min(left, 0)]
    out[max(-up, 0) : height - max(up, 0), max(-left, 0) : width - max(left, 0)] = source


def _ratio(part: NDArray, whole: NDArray) -> NDArray:
    """Divide, with 0 where the whole is 0."""
    return np.divide(part, whole, out=np.zeros_like(whole), where=whole > 0)
