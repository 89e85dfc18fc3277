"""The steps of the memory in plain numpy, one term of the formula at a time: the literal twins of `steps`."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from semgrid_edu.memory.state import FAINT, MOVES, STAYS, ClassMemory, Look, MemoryParams, standing
from semgrid_edu.occupancy import N_STATES, State


def carry_classes_literal(
    memory: ClassMemory, moving: NDArray, velocity: NDArray, cell: float, dt: float, params: MemoryParams
) -> ClassMemory:
    """Predict: what moves takes its class along, and both layers forget. The literal twin of `carry_classes`.

    Parameters and result are those of `carry_classes`.
    """
    carried = ClassMemory(np.array(memory.planes, np.float64))
    displacement = np.nan_to_num(np.asarray(velocity, np.float64)) * dt
    for r, c in np.ndindex(moving.shape):
        carried.weight[MOVES, r, c] = carried.seen[MOVES, r, c] = 0
        carried.evidence[MOVES, :, r, c] = carried.offset[:, r, c] = 0
        if moving[r, c] >= params.least_moving:
            guess = _cell_behind(r, c, displacement[:, r, c], cell, moving.shape)
            way = displacement[:, r, c] + memory.offset[:, *guess]
            r0, c0 = _cell_behind(r, c, way, cell, moving.shape)
            carried.evidence[MOVES, :, r, c] = memory.evidence[MOVES, :, r0, c0]
            carried.weight[MOVES, r, c] = memory.weight[MOVES, r0, c0]
            carried.seen[MOVES, r, c] = memory.seen[MOVES, r0, c0]
            left = displacement[:, r, c] + memory.offset[:, r0, c0] - np.array([r0 - r, c0 - c]) * cell
            carried.offset[:, r, c] = np.clip(left, -cell / 2, cell / 2)
    kept = params.kept(dt)[:, None, None]
    carried.weight[:] *= kept
    carried.seen[:] *= kept
    return carried


def _cell_behind(r: int, c: int, way: NDArray, cell: float, shape: tuple[int, int]) -> tuple[int, int]:
    """Return the cell that something came from which has moved by `way`, (2,) m; x points to row 0, y to column 0."""
    behind = np.clip(np.array([r, c]) + np.rint(way / cell), 0, np.array(shape) - 1)
    return int(behind[0]), int(behind[1])


def recall_classes_literal(
    memory: ClassMemory, places: NDArray, occupancy: NDArray, look: Look, params: MemoryParams
) -> NDArray[np.float64]:
    """Join memory and frame into a semantic grid. The literal twin of `recall_classes`.

    Parameters and result are those of `recall_classes`.
    """
    here = ClassMemory(np.array(memory.planes.reshape(len(memory.planes), -1)[:, places], np.float64))
    movable = np.isin(np.arange(len(look.classes)), params.movable)
    here.evidence[:, movable] += np.log(standing(occupancy))
    evidence, weight, seen = _joined(here, look, np.ones((2, 1, 1)), params)
    scores = np.maximum(weight, 1)[:, None] * evidence
    belief = np.where((here.weight > 0)[:, None], _come_and_gone(scores, look, movable), look.classes)
    moving = occupancy[State.DYNAMIC]
    classes = (1 - moving) * seen[STAYS] * belief[STAYS] + moving * seen[MOVES] * belief[MOVES]
    never = np.stack([1 - seen[MOVES if state == State.DYNAMIC else STAYS] for state in range(N_STATES)])
    return np.concatenate([classes, occupancy * never])


def _come_and_gone(scores: NDArray, look: Look, movable: NDArray) -> NDArray[np.float64]:
    """Let the frame alone say, as far as it sees, what comes and goes; the other classes share what remains."""
    comes = movable[:, None, None]
    decided = look.sees * look.classes + (1 - look.sees) * softmax(scores, axis=1)
    there = np.where(comes, decided, 0).sum(axis=1, keepdims=True)
    return np.where(comes, decided, (1 - there) * softmax(np.where(comes, -np.inf, scores), axis=1))


def learn_classes_literal(memory: ClassMemory, places: NDArray, look: Look, params: MemoryParams) -> ClassMemory:
    """Let the memory take in a frame: the literal twin of `learn_classes`.

    Parameters and result are those of `learn_classes`.
    """
    in_grid = places >= 0
    on_map = Look(*(part.reshape(*part.shape[:-2], -1)[..., places] * in_grid for part in look))
    share = np.stack([1 - on_map.moving, on_map.moving]).astype(np.float64)
    share[share * on_map.sees < FAINT] = 0
    evidence, *others = _joined(memory, on_map, share, params)
    return ClassMemory(np.concatenate([evidence.reshape(-1, *in_grid.shape), *others, memory.offset]))


def _joined(memory: ClassMemory, look: Look, share: NDArray, params: MemoryParams) -> tuple[NDArray, NDArray, NDArray]:
    """Return evidence, weight and seen with a frame added: its exponent is 1 at first, then what one more is worth."""
    sees, old = share * look.sees, memory.weight.astype(np.float64)
    new = np.maximum(look.exponent * sees, sees - old)
    old = np.minimum(old, params.most - new)
    total = old + new
    evidence = old[:, None] * memory.evidence + new[:, None] * look.log_class
    evidence = np.where(new[:, None] > 0, evidence / np.maximum(total, 1e-12)[:, None], memory.evidence)
    return evidence, np.where(new > 0, total, memory.weight), 1 - (1 - memory.seen) * (1 - sees)
