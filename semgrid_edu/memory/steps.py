"""The steps of the memory: carry what moves, recall what is known of a cell, learn from a frame (section 3)."""

from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, check_shape
from semgrid_edu.grid import GridSpec
from semgrid_edu.memory.state import MOVES, STAYS, ClassMemory, Look, MemoryParams, standing
from semgrid_edu.occupancy import N_STATES, State

FAINT = 1e-3
"""Probability below which the camera doesn't see a cell: no evidence is computed there."""


def look_at(grid: NDArray, occupancy: NDArray, spec: GridSpec, params: MemoryParams) -> Look:
    """Read one frame's semantic grid as evidence.

    Parameters
    ----------
    grid : (C, H, W) float32
        g: probabilities of the semantic classes, then of the four unknown ones. They sum to 1 in each cell.
    occupancy : (4, H, W) float32
        o, the occupancy grid of the same frame.
    spec : GridSpec
        Their cells, around the vehicle.
    params : MemoryParams
        How much the frame is worth at which distance.
    """
    check_shape("occupancy", occupancy, (N_STATES, *spec.shape))
    if np.ndim(grid) != 3 or grid.shape[1:] != spec.shape or len(grid) <= N_STATES:
        wanted = f"shape (C, {spec.shape[0]}, {spec.shape[1]}), the last {N_STATES} classes unknown"
        raise ArgumentError("grid", wanted, f"shape {np.shape(grid)}")
    classes, log_class, sees = _seen_classes(np.ascontiguousarray(grid, np.float32), len(grid) - N_STATES)
    e, movable = _exponents(spec, params), list(params.movable)
    if movable and not 0 <= min(movable) <= max(movable) < len(classes):
        raise ArgumentError("movable", f"numbers of semantic classes, 0 to {len(classes) - 1}", params.movable)
    exponent = e + (1 - e) * classes[movable].sum(axis=0)
    return Look(classes, log_class, sees, exponent, np.clip(occupancy[State.DYNAMIC], 0, 1))


@lru_cache(maxsize=8)
def _exponents(spec: GridSpec, params: MemoryParams) -> NDArray[np.float32]:
    """Return what one more frame is worth in each cell, (H, W)."""
    return params.exponent(np.hypot(*np.moveaxis(spec.centers(), -1, 0))).astype(np.float32)


@njit(cache=True, nogil=True, error_model="numpy")
def _seen_classes(grid, n):
    """Divide the semantic classes by their sum; numpy would need five passes over the grid."""
    height, width = grid.shape[1:]
    classes, sees = np.zeros((n, height, width), np.float32), np.zeros((height, width), np.float32)
    log_class = np.zeros((n, height, width), np.float32)
    for r in range(height):
        for k in range(n):
            for c in range(width):
                sees[r, c] += grid[k, r, c]
        for k in range(n):
            for c in range(width):
                if sees[r, c] >= np.float32(FAINT):
                    classes[k, r, c] = grid[k, r, c] / sees[r, c]
                    log_class[k, r, c] = np.log(max(classes[k, r, c], np.float32(1e-6)))
        for c in range(width):
            sees[r, c] = min(sees[r, c], np.float32(1)) if sees[r, c] >= np.float32(FAINT) else np.float32(0)
    return classes, log_class, sees


def carry_classes(
    memory: ClassMemory, moving: NDArray, velocity: NDArray, cell: float, dt: float, params: MemoryParams
) -> ClassMemory:
    """Predict: what moves takes its class along by the velocity field, and both layers forget.

    A cell that holds something moving asks the cell that it came from what it was. Whole cells are copied, nothing is
    interpolated; what remains of the way stays in `ClassMemory.offset`. Where nothing moves any more, the moving layer
    forgets at once.

    Parameters
    ----------
    memory : ClassMemory
        The memory at the previous frame, over the map's cells, (H, W).
    moving : (H, W) float32
        P(DYNAMIC) of these cells now.
    velocity : (2, H, W) float32
        Velocity along the axes of the map, m/s; NaN, where it isn't known, counts as 0.
    cell : float
        Side of a cell, metres.
    dt : float
        Seconds since the previous frame.
    params : MemoryParams
        How fast classes are forgotten, and what counts as moving.
    """
    check_shape("moving", moving, memory.weight.shape[1:])
    check_shape("velocity", velocity, (2, *moving.shape))
    carried = ClassMemory(np.zeros_like(memory.planes))
    for name in ("evidence", "weight", "seen"):
        getattr(carried, name)[STAYS] = getattr(memory, name)[STAYS]
    way = (np.nan_to_num(velocity) * dt).astype(np.float32)
    _carry(
        _moving_planes(memory), moving, way, np.float32(cell), np.float32(params.least_moving), _moving_planes(carried)
    )
    kept = params.kept(dt).astype(np.float32)[:, None, None]
    carried.weight[:] *= kept
    carried.seen[:] *= kept
    return carried


def _moving_planes(memory: ClassMemory) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    return memory.evidence[MOVES], memory.weight[MOVES], memory.seen[MOVES], memory.offset


@njit(cache=True, nogil=True, error_model="numpy")
def _carry(before, moving, way, cell, least, after):
    """Few cells hold something that moves, so each looks back by itself."""
    evidence, weight, seen, offset = before
    to_evidence, to_weight, to_seen, to_offset = after
    height, width = moving.shape
    for r in range(height):
        for c in range(width):
            if moving[r, c] >= least:
                x, y = way[0, r, c], way[1, r, c]
                r0, c0 = _behind(r, c, x, y, cell, height, width)
                r0, c0 = _behind(r, c, x + offset[0, r0, c0], y + offset[1, r0, c0], cell, height, width)
                for k in range(len(evidence)):
                    to_evidence[k, r, c] = evidence[k, r0, c0]
                to_weight[r, c], to_seen[r, c] = weight[r0, c0], seen[r0, c0]
                x, y = x + offset[0, r0, c0] - (r0 - r) * cell, y + offset[1, r0, c0] - (c0 - c) * cell
                to_offset[0, r, c] = min(max(x, -cell / 2), cell / 2)
                to_offset[1, r, c] = min(max(y, -cell / 2), cell / 2)


@njit(cache=True, nogil=True, error_model="numpy")
def _behind(r, c, x, y, cell, height, width):
    """Return the cell that something came from: x points to row 0, y to column 0."""
    r0, c0 = r + int(np.rint(x / cell)), c + int(np.rint(y / cell))
    return min(max(r0, 0), height - 1), min(max(c0, 0), width - 1)


def recall_classes(
    memory: ClassMemory, places: NDArray, occupancy: NDArray, look: Look, params: MemoryParams
) -> NDArray[np.float32]:
    """Join memory and frame into a semantic grid; the memory stays as it is.

    The classes of what stays count with P(not DYNAMIC), those of what moves with P(DYNAMIC). Where nothing was ever
    seen of a layer, the mass goes to the unknown classes of the occupancy states. Whether something movable is there,
    the frame says where the camera sees; elsewhere the memory does, and the laser as a second witness (`standing`).

    Parameters
    ----------
    memory : ClassMemory
        The memory before the frame, over the map's cells.
    places : (H, W) int32
        For each of the vehicle's cells the map's cell that it lies in, row by row from 0.
    occupancy : (4, H, W) float32
        o, the occupancy grid of the frame.
    look : Look
        What the frame says of the vehicle's cells.
    params : MemoryParams
        What all frames together may be worth, and which classes are movable.

    Returns
    -------
    (C, H, W) float32
        Probabilities of the semantic and of the unknown classes, which sum to 1 in each cell.
    """
    check_shape("occupancy", occupancy, (N_STATES, *look.sees.shape))
    check_shape("places", places, look.sees.shape)
    n = len(look.log_class)
    recalled = np.zeros((n + N_STATES, *look.sees.shape), np.float32)
    flat = memory.evidence.reshape(2, n, -1), memory.weight.reshape(2, -1), memory.seen.reshape(2, -1)
    movable = np.isin(np.arange(n), params.movable)
    laser = np.log(standing(occupancy)).astype(np.float32)
    _recall(*flat, places, occupancy, *look[:-1], np.float32(params.most), movable, laser, recalled)
    return recalled


@njit(cache=True, nogil=True, error_model="numpy")
def _recall(
    evidence, weight, seen, places, occupancy, classes, log_class, sees, exponent, most, movable, laser, recalled
):
    """Row by row, with a class in the inner loops, so that memory is read in order."""
    n, height, width = log_class.shape
    scores = np.zeros((n, width), np.float32)
    for r in range(height):
        for layer in range(2):
            mass = np.zeros(width, np.float32)
            old, new = np.zeros(width, np.float32), np.zeros(width, np.float32)
            for c in range(width):
                p = places[r, c]
                share = occupancy[2, r, c] if layer == 1 else 1 - occupancy[2, r, c]
                known = 1 - (1 - seen[layer, p]) * (1 - sees[r, c])
                old[c], new[c] = _parts(weight[layer, p], sees[r, c], exponent[r, c], most)
                mass[c] = share * known
                for state in range(4):
                    if (state == 2) == (layer == 1):
                        recalled[n + state, r, c] = occupancy[state, r, c] * (1 - known)
            for c in range(width):
                if old[c] == 0 and mass[c] > 0:  # the frame alone
                    for k in range(n):
                        recalled[k, r, c] += mass[c] * classes[k, r, c]
                    mass[c] = 0
            if not mass.any():
                continue
            for k in range(n):
                for c in range(width):
                    if mass[c] > 0:
                        mean = evidence[layer, k, places[r, c]] + (laser[r, c] if movable[k] else np.float32(0))
                        if new[c] > 0:
                            mean = (old[c] * mean + new[c] * log_class[k, r, c]) / (old[c] + new[c])
                        scores[k, c] = mean * max(old[c] + new[c], np.float32(1))
            _add_beliefs(scores, mass, classes[:, r], sees[r], movable, recalled[:, r])


@njit(cache=True, nogil=True, error_model="numpy")
def _add_beliefs(scores, mass, classes, sees, movable, row):
    """Share the mass of each cell of a row: the frame says, as far as it sees, what comes and goes (`movable`)."""
    n, width = scores.shape
    top, sums = np.full((2, width), np.float32(-np.inf)), np.zeros((2, width), np.float32)  # others, movable
    there, here = np.zeros(width, np.float32), np.zeros(width, np.float32)
    for k in range(n):
        for c in range(width):
            top[int(movable[k]), c] = max(top[int(movable[k]), c], scores[k, c])
    for k in range(n):
        for c in range(width):
            if mass[c] > 0:
                scores[k, c] = np.exp(scores[k, c] - top[int(movable[k]), c])
                sums[int(movable[k]), c] += scores[k, c]
                there[c] += sees[c] * classes[k, c] if movable[k] else np.float32(0)
    for c in range(width):
        if mass[c] > 0:  # `here`: what one unit of the movable ones' exponentials is worth
            most = max(top[0, c], top[1, c])
            others, movers = sums[0, c] * np.exp(top[0, c] - most), np.exp(top[1, c] - most)
            here[c] = (1 - sees[c]) * movers / (others + sums[1, c] * movers)
            there[c] += here[c] * sums[1, c]
    for k in range(n):
        for c in range(width):
            if mass[c] > 0 and movable[k]:
                row[k, c] += mass[c] * (sees[c] * classes[k, c] + here[c] * scores[k, c])
            elif mass[c] > 0:
                row[k, c] += mass[c] * (1 - there[c]) * scores[k, c] / sums[0, c]


@njit(cache=True, nogil=True, error_model="numpy")
def _parts(weight, sees, exponent, most):
    """Return what the old evidence is worth now, and what the new is."""
    new = max(exponent * sees, sees - weight)
    return (min(weight, most - new), new) if new > 0 else (weight, np.float32(0))


def learn_classes(memory: ClassMemory, places: NDArray, look: Look, params: MemoryParams) -> ClassMemory:
    """Let the memory take in a frame, as far as each layer is what the camera sees.

    The first view of a cell counts fully. Each further one adds `look.exponent` times its evidence, because frames err
    together, and all of them are worth `MemoryParams.most` at most: then the old ones give way.

    Parameters
    ----------
    memory : ClassMemory
        The memory before the frame, over the map's cells, (H, W).
    places : (H, W) int32
        For each of the map's cells the vehicle's cell that it lies in, row by row from 0; negative where it lies
        outside the grid.
    look : Look
        What the frame says of the vehicle's cells.
    params : MemoryParams
        What all frames together may be worth.
    """
    check_shape("places", places, memory.weight.shape[1:])
    learnt, n = ClassMemory(memory.planes.copy()), len(look.log_class)
    flat = look.log_class.reshape(n, -1), *(part.ravel() for part in look[2:])
    _learn(learnt.evidence, learnt.weight, learnt.seen, places, *flat, np.float32(params.most))
    return learnt


@njit(cache=True, nogil=True, error_model="numpy")
def _learn(evidence, weight, seen, places, log_class, sees, exponent, moving, most):
    """Change the arrays in place where the camera sees something, with a class in the inner loops."""
    height, width = places.shape
    old, new = np.zeros(width, np.float32), np.zeros(width, np.float32)
    for r in range(height):
        for layer in range(2):
            for c in range(width):
                p = places[r, c]
                part = (moving[p] if layer == 1 else 1 - moving[p]) * sees[p] if p >= 0 else np.float32(0)
                old[c], new[c] = np.float32(0), np.float32(0)
                if part > 0:
                    old[c], new[c] = _parts(weight[layer, r, c], part, exponent[p], most)
                    seen[layer, r, c] = 1 - (1 - seen[layer, r, c]) * (1 - part)
                    if new[c] > 0:
                        weight[layer, r, c] = old[c] + new[c]
            if not new.any():
                continue
            for k in range(len(log_class)):
                for c in range(width):
                    if new[c] > 0:
                        mean = old[c] * evidence[layer, k, r, c] + new[c] * log_class[k, places[r, c]]
                        evidence[layer, k, r, c] = mean / (old[c] + new[c])
