"""The steps of the memory: carry what moves, recall what is known of a cell, learn from a frame (section 3)."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.errors import check_shape
from semgrid_edu.memory.state import FAINT, MOVES, ClassMemory, Look, MemoryParams, standing
from semgrid_edu.occupancy import N_STATES


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
    carried = ClassMemory(memory.planes.copy())
    numbers = map(np.float32, (cell, dt, params.least_moving))
    _carry(_moving_planes(memory), moving, velocity, *numbers, _moving_planes(carried))
    kept = params.kept(dt).astype(np.float32)[:, None, None]
    carried.weight[:] *= kept
    carried.seen[:] *= kept
    return carried


def _moving_planes(memory: ClassMemory) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    return memory.evidence[MOVES], memory.weight[MOVES], memory.seen[MOVES], memory.offset


@njit(cache=True, nogil=True, error_model="numpy")
def _carry(before, moving, velocity, cell, dt, least, after):
    """Few cells hold something that moves, so each looks back by itself."""
    evidence, weight, seen, offset = before
    to_evidence, to_weight, to_seen, to_offset = after
    to_evidence[:], to_weight[:], to_seen[:], to_offset[:] = 0, 0, 0, 0
    height, width = moving.shape
    for r in range(height):
        for c in range(width):
            if moving[r, c] >= least:
                x, y = np.nan_to_num(velocity[0, r, c]) * dt, np.nan_to_num(velocity[1, r, c]) * dt
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
def _recall(evidence, weight, seen, places, o, classes, log_class, sees, exponent, most, movable, laser, recalled):
    """Row by row, without branches in the inner loops, so that the compiler takes several cells at once."""
    n, height, width = log_class.shape
    recalled[:n] = 0
    old, new, mass, alone = np.empty((4, width), np.float32)
    for r in range(height):
        alone[:] = 0
        for layer in range(2):
            first, last = width, 0
            for c in range(width):
                p, moving = places[r, c], o[2, r, c]
                unknown = (1 - seen[layer, p]) * (1 - sees[r, c])
                mass[c] = (moving if layer == 1 else 1 - moving) * (1 - unknown)
                old[c], new[c] = _parts(weight[layer, p], sees[r, c], exponent[r, c], most)
                for state in range(4):
                    if (state == 2) == (layer == 1):
                        recalled[n + state, r, c] = o[state, r, c] * unknown
                if old[c] == 0:  # the frame alone
                    alone[c], mass[c] = alone[c] + mass[c], 0
                else:
                    first, last = min(first, c), c + 1
            here = r, first, last
            scores = _scores(evidence[layer], places, log_class, old[first:last], new[first:last], movable, laser, here)
            _add_beliefs(scores, mass[first:last], classes, sees, movable, recalled, here)
        for k in range(n):
            recalled[k, r] += alone * classes[k, r]


@njit(cache=True, nogil=True, error_model="numpy")
def _scores(evidence, places, log_class, old, new, movable, laser, here):
    """Return the logarithm of what memory and frame say together of a row of cells, up to a number in each cell."""
    r, first, last = here
    scores, place, beam = np.empty((len(evidence), len(old)), np.float32), places[r][first:last], laser[r][first:last]
    for c in range(len(old)):
        total = max(old[c] + new[c], np.float32(1e-12))
        old[c], new[c] = old[c] * max(1 / total, np.float32(1)), new[c] * max(1 / total, np.float32(1))
    for k in range(len(scores)):
        was, says, score, comes = evidence[k], log_class[k, r][first:last], scores[k], np.float32(movable[k])
        for c in range(len(old)):
            score[c] = old[c] * (was[place[c]] + comes * beam[c]) + new[c] * says[c]
    return scores


@njit(cache=True, nogil=True, error_model="numpy")
def _add_beliefs(scores, mass, classes, sees, movable, recalled, here):
    """Share the mass of each cell of a row: the frame says, as far as it sees, what comes and goes (`movable`)."""
    (n, width), (r, first, last) = scores.shape, here
    top, sums = np.full((2, width), np.float32(-1e30)), np.zeros((2, width), np.float32)  # others, movable
    look, seen, parts = sees[r][first:last], np.zeros(width, np.float32), np.empty((2, width), np.float32)
    for k in range(n):
        of_group, score = top[int(movable[k])], scores[k]
        for c in range(width):
            of_group[c] = max(of_group[c], score[c])
    for k in range(n):
        of_group, total, score, comes = top[int(movable[k])], sums[int(movable[k])], scores[k], np.float32(movable[k])
        says = classes[k, r][first:last]
        for c in range(width):
            score[c] = np.exp(score[c] - of_group[c])
            total[c] += score[c]
            seen[c] += comes * look[c] * says[c]
    for c in range(width):
        most = max(top[0, c], top[1, c])
        others, movers = sums[0, c] * np.exp(top[0, c] - most), np.exp(top[1, c] - most)
        each = (1 - look[c]) * movers / (others + sums[1, c] * movers)  # what one unit of the movable ones is worth
        there = seen[c] + each * sums[1, c]
        parts[0, c], parts[1, c] = mass[c] * (1 - there) / max(sums[0, c], np.float32(1e-12)), mass[c] * each
    for k in range(n):
        row, comes, says = recalled[k, r][first:last], np.float32(movable[k]), classes[k, r][first:last]
        row += parts[int(movable[k])] * scores[k] + comes * mass * look * says


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
                if part >= np.float32(FAINT):
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
