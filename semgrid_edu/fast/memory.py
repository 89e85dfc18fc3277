"""The compiled memory of classes: the same names as in `semgrid_edu.memory`, in single precision."""

from collections.abc import Iterable, Iterator
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu import memory as book
from semgrid_edu.errors import check_shape
from semgrid_edu.fast.occupancy.cells import look_up
from semgrid_edu.grid import GridSpec
from semgrid_edu.memory import Look, MemoryParams, MemoryState, View
from semgrid_edu.memory.state import FAINT, check_look, something_there
from semgrid_edu.occupancy import N_STATES, State


def look_at(grid: NDArray, occupancy: NDArray, spec: GridSpec, params: MemoryParams) -> Look:
    """Read one frame's semantic grid as evidence. Parameters, result and errors are those of `look_at`."""
    check_look(grid, occupancy, spec, params)
    classes, log_class, sees = _seen_classes(np.ascontiguousarray(grid, np.float32), len(grid) - N_STATES)
    e = _exponents(spec, params)
    exponent = e + (1 - e) * classes[list(params.movable)].sum(axis=0)
    return Look(classes, log_class, sees, exponent, np.clip(occupancy[State.DYNAMIC], 0, 1))


@lru_cache(maxsize=8)
def _exponents(spec: GridSpec, params: MemoryParams) -> NDArray[np.float32]:
    """Return the exponent of one more frame in each cell, (H, W)."""
    return params.exponent(spec.distances()).astype(np.float32)


@njit(cache=True, nogil=True, error_model="numpy")
def _seen_classes(grid, n):
    """Divide the semantic classes by their sum; numpy would need five passes over the grid."""
    height, width = grid.shape[1:]
    classes = np.zeros((n, height, width), np.float32)
    log_class = np.zeros((n, height, width), np.float32)
    sees = np.zeros((height, width), np.float32)
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


def recall_classes(
    memory: MemoryState, places: NDArray, occupancy: NDArray, look: Look, params: MemoryParams
) -> NDArray[np.float32]:
    """Combine memory and frame into a semantic grid. Parameters and result are those of `recall_classes`."""
    check_shape("occupancy", occupancy, (N_STATES, *look.sees.shape))
    check_shape("places", places, look.sees.shape)
    n = len(look.log_class)
    recalled = np.zeros((n + N_STATES, *look.sees.shape), np.float32)
    flat = memory.evidence.reshape(2, n, -1), memory.weight.reshape(2, -1), memory.seen.reshape(2, -1)
    movable = np.isin(np.arange(n), params.movable)
    beam = np.log(something_there(occupancy)).astype(np.float32)
    _recall(*flat, places, occupancy, *look[:-1], np.float32(params.max_weight), movable, beam, recalled)
    return recalled


@njit(cache=True, nogil=True, error_model="numpy")
def _recall(evidence, weight, seen, places, o, classes, log_class, sees, exponent, most, movable, laser, recalled):
    """Work row by row, without branches in the inner loops, so that the compiler vectorises over cells."""
    n, height, width = log_class.shape
    recalled[:n] = 0
    old, new, mass, alone = np.empty((4, width), np.float32)
    for r in range(height):
        alone[:] = 0
        for layer in range(2):
            first = width
            last = 0
            for c in range(width):
                p = places[r, c]
                moving = o[2, r, c]
                unknown = (1 - seen[layer, p]) * (1 - sees[r, c])
                mass[c] = (moving if layer == 1 else 1 - moving) * (1 - unknown)
                old[c], new[c] = _parts(weight[layer, p], sees[r, c], exponent[r, c], most)
                for state in range(4):
                    if (state == 2) == (layer == 1):
                        recalled[n + state, r, c] = o[state, r, c] * unknown
                if old[c] == 0:  # the frame alone
                    alone[c] += mass[c]
                    mass[c] = 0
                else:
                    first = min(first, c)
                    last = c + 1
            here = r, first, last
            scores = _scores(evidence[layer], places, log_class, old[first:last], new[first:last], movable, laser, here)
            _add_beliefs(scores, mass[first:last], classes, sees, movable, recalled, here)
        for k in range(n):
            recalled[k, r] += alone * classes[k, r]


@njit(cache=True, nogil=True, error_model="numpy")
def _scores(evidence, places, log_class, old, new, movable, laser, here):
    """Return the log of memory times frame for a row of cells, up to a constant in each cell."""
    r, first, last = here
    scores = np.empty((len(evidence), len(old)), np.float32)
    place = places[r][first:last]
    beam = laser[r][first:last]
    for c in range(len(old)):
        total = max(old[c] + new[c], np.float32(1e-12))
        old[c] *= max(1 / total, np.float32(1))
        new[c] *= max(1 / total, np.float32(1))
    for k in range(len(scores)):
        remembered = evidence[k]
        shown = log_class[k, r][first:last]
        score = scores[k]
        comes = np.float32(movable[k])
        for c in range(len(old)):
            score[c] = old[c] * (remembered[place[c]] + comes * beam[c]) + new[c] * shown[c]
    return scores


@njit(cache=True, nogil=True, error_model="numpy")
def _add_beliefs(scores, mass, classes, sees, movable, recalled, here):
    """Distribute the mass of each cell in a row; where the frame sees, it decides about `movable` classes."""
    n, width = scores.shape
    r, first, last = here
    top = np.full((2, width), np.float32(-1e30))  # of the others, and of the movable classes
    sums = np.zeros((2, width), np.float32)
    parts = np.empty((2, width), np.float32)
    look = sees[r][first:last]
    seen = np.zeros(width, np.float32)
    for k in range(n):
        of_group = top[int(movable[k])]
        score = scores[k]
        for c in range(width):
            of_group[c] = max(of_group[c], score[c])
    for k in range(n):
        of_group = top[int(movable[k])]
        total = sums[int(movable[k])]
        score = scores[k]
        comes = np.float32(movable[k])
        shown = classes[k, r][first:last]
        for c in range(width):
            score[c] = np.exp(score[c] - of_group[c])
            total[c] += score[c]
            seen[c] += comes * look[c] * shown[c]
    for c in range(width):
        most = max(top[0, c], top[1, c])
        others = sums[0, c] * np.exp(top[0, c] - most)
        movers = np.exp(top[1, c] - most)
        each = (1 - look[c]) * movers / (others + sums[1, c] * movers)  # scale of the movable classes
        there = seen[c] + each * sums[1, c]
        parts[0, c] = mass[c] * (1 - there) / max(sums[0, c], np.float32(1e-12))
        parts[1, c] = mass[c] * each
    for k in range(n):
        row = recalled[k, r][first:last]
        comes = np.float32(movable[k])
        row += parts[int(movable[k])] * scores[k] + comes * mass * look * classes[k, r][first:last]


@njit(cache=True, nogil=True, error_model="numpy")
def _parts(weight, sees, exponent, most):
    """Return the weights of the old and of the new evidence."""
    new = max(exponent * sees, sees - weight)
    return (min(weight, most - new), new) if new > 0 else (weight, np.float32(0))


def learn_classes(memory: MemoryState, places: NDArray, look: Look, params: MemoryParams) -> MemoryState:
    """Add a frame to the memory. Parameters and result are those of `learn_classes`."""
    check_shape("places", places, memory.weight.shape[1:])
    learnt = memory.copy()
    n = len(look.log_class)
    flat = look.log_class.reshape(n, -1), *(part.ravel() for part in look[2:])
    _learn(learnt.evidence, learnt.weight, learnt.seen, places, *flat, np.float32(params.max_weight))
    return learnt


@njit(cache=True, nogil=True, error_model="numpy")
def _learn(evidence, weight, seen, places, log_class, sees, exponent, moving, most):
    """Change the arrays in place where the camera sees something; the inner loops run over a row for one class."""
    height, width = places.shape
    old = np.zeros(width, np.float32)
    new = np.zeros(width, np.float32)
    for r in range(height):
        for layer in range(2):
            for c in range(width):
                p = places[r, c]
                part = (moving[p] if layer == 1 else 1 - moving[p]) * sees[p] if p >= 0 else np.float32(0)
                old[c] = np.float32(0)
                new[c] = np.float32(0)
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


class ClassMemory(book.ClassMemory):
    """A memory of classes with compiled steps. Parameters are those of `ClassMemory` in `semgrid_edu.memory`."""

    look_at = staticmethod(look_at)
    look_up = staticmethod(look_up)
    recall = staticmethod(recall_classes)
    learn = staticmethod(learn_classes)
    dtype = np.float32


def remember_drive(
    views: Iterable[View], spec: GridSpec, params: MemoryParams | None = None
) -> Iterator[NDArray[np.float32]]:
    """Remember the classes of a drive, frame after frame. Parameters and result are those of `remember_drive`."""
    memory = ClassMemory(spec, params)
    for view in views:
        yield memory.step(view)
