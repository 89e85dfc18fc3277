"""The steps of the memory: carry what moves, recall what is known of a cell, learn from a frame (section 3)."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from semgrid_edu.errors import check_shape
from semgrid_edu.memory.state import FAINT, MOVES, STAYS, Look, MemoryParams, MemoryState, something_there
from semgrid_edu.occupancy import N_STATES, State


def carry_classes(
    memory: MemoryState, moving: NDArray, velocity: NDArray, cell: float, dt: float, params: MemoryParams
) -> MemoryState:
    """Predict: what moves takes its class along with the velocity field, and both layers forget.

    Each cell that holds something moving copies the class of the cell where this came from. Nothing is interpolated;
    the rest of the displacement stays in `MemoryState.offset`. Where nothing moves any more, the moving layer forgets
    at once.

    Parameters
    ----------
    memory : MemoryState
        The memory at the previous frame, over the map's cells, (H, W).
    moving : (H, W) float
        P(DYNAMIC) of these cells now.
    velocity : (2, H, W) float
        Velocity along the axes of the map, m/s; NaN, where it is unknown, counts as 0.
    cell : float
        Side of a cell, metres.
    dt : float
        Seconds since the previous frame.
    params : MemoryParams
        How fast classes are forgotten, and what counts as moving.
    """
    check_shape("moving", moving, memory.weight.shape[1:])
    check_shape("velocity", velocity, (2, *moving.shape))
    carried = memory.copy()
    for part in (carried.evidence[MOVES], carried.weight[MOVES], carried.seen[MOVES], carried.offset):
        part[:] = 0

    now = np.stack(np.nonzero(moving >= params.least_moving))  # rows and columns, (2, N)
    displacement = np.nan_to_num(velocity[:, *now]) * dt
    # Where in its cell a thing was is known only when that cell is found, so the search is done twice.
    guess = _cells_behind(now, displacement, cell, moving.shape)
    before = _cells_behind(now, displacement + memory.offset[:, *guess], cell, moving.shape)
    carried.evidence[MOVES][:, *now] = memory.evidence[MOVES][:, *before]
    carried.weight[MOVES][*now] = memory.weight[MOVES][*before]
    carried.seen[MOVES][*now] = memory.seen[MOVES][*before]
    rest = displacement + memory.offset[:, *before] - (before - now) * cell
    carried.offset[:, *now] = np.clip(rest, -cell / 2, cell / 2)

    kept = params.kept(dt)[:, None, None]
    carried.weight[:] *= kept
    carried.seen[:] *= kept
    return carried


def _cells_behind(cells: NDArray, displacement: NDArray, cell: float, shape: tuple[int, int]) -> NDArray[np.int64]:
    """Return the cells, (2, N), from which something moved to these. x points to row 0 and y to column 0."""
    behind = cells + np.rint(displacement / cell).astype(int)
    return np.clip(behind, 0, np.array(shape)[:, None] - 1)


def recall_classes(
    memory: MemoryState, places: NDArray, occupancy: NDArray, look: Look, params: MemoryParams
) -> NDArray[np.float64]:
    """Combine memory and frame into a semantic grid.

    The classes of what stays count with P(not DYNAMIC), those of what moves with P(DYNAMIC). Where a layer was never
    seen, its mass goes to the unknown classes of the occupancy states.

    Parameters
    ----------
    memory : MemoryState
        The memory before the frame, over the map's cells.
    places : (H, W) int
        For each of the vehicle's cells the number of the map's cell that it is in, row by row from 0.
    occupancy : (4, H, W) float
        o, the occupancy grid of the frame.
    look : Look
        What the frame shows of the vehicle's cells.
    params : MemoryParams
        How much all frames together may count, and which classes are movable.

    Returns
    -------
    (C, H, W) float
        Probabilities of the semantic and of the unknown classes, which sum to 1 in each cell.
    """
    check_shape("occupancy", occupancy, (N_STATES, *look.sees.shape))
    check_shape("places", places, look.sees.shape)
    here = memory.at(places)
    movable = np.isin(np.arange(len(look.classes)), params.movable)
    # A remembered car is believed only as far as the LIDAR, a second witness, finds something.
    here.evidence[:, movable] += np.log(something_there(occupancy))
    evidence, weight, seen = _joined(here, look, np.ones((2, 1, 1)), params)
    scores = np.maximum(weight, 1)[:, None] * evidence
    belief = np.where((here.weight > 0)[:, None], _come_and_gone(scores, look, movable), look.classes)

    moving = occupancy[State.DYNAMIC]
    classes = (1 - moving) * seen[STAYS] * belief[STAYS] + moving * seen[MOVES] * belief[MOVES]
    layers = [MOVES if state == State.DYNAMIC else STAYS for state in range(N_STATES)]
    unknown = occupancy * (1 - seen[layers])
    return np.concatenate([classes, unknown])


def _come_and_gone(scores: NDArray, look: Look, movable: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Let the frame alone decide, as far as it sees, on what comes and goes; the other classes share the rest."""
    movable = movable[:, None, None]
    decided = look.sees * look.classes + (1 - look.sees) * softmax(scores, axis=1)
    any_movable = np.where(movable, decided, 0).sum(axis=1, keepdims=True)
    others = softmax(np.where(movable, -np.inf, scores), axis=1)
    return np.where(movable, decided, (1 - any_movable) * others)


def learn_classes(memory: MemoryState, places: NDArray, look: Look, params: MemoryParams) -> MemoryState:
    """Add a frame to the memory, to each layer as far as the camera sees this layer.

    Parameters
    ----------
    memory : MemoryState
        The memory before the frame, over the map's cells, (H, W).
    places : (H, W) int
        For each of the map's cells the number of the vehicle's cell that it is in, row by row from 0; negative outside
        the vehicle's grid.
    look : Look
        What the frame shows of the vehicle's cells.
    params : MemoryParams
        How much all frames together may count.
    """
    check_shape("places", places, memory.weight.shape[1:])
    inside = places >= 0
    on_map = Look(*(part.reshape(*part.shape[:-2], -1)[..., places] * inside for part in look))
    share = np.stack([1 - on_map.moving, on_map.moving])  # of each layer in what the camera sees
    share = np.where(share * on_map.sees < FAINT, 0, share)
    learnt = memory.copy()
    learnt.evidence[:], learnt.weight[:], learnt.seen[:] = _joined(memory, on_map, share, params)
    return learnt


def _joined(memory: MemoryState, look: Look, share: NDArray, params: MemoryParams) -> tuple[NDArray, NDArray, NDArray]:
    """Return evidence, weight and seen with a frame added.

    The first view of a cell counts fully. Each further one adds its exponent, because frames make the same mistakes.
    All of them together count at most `params.most`: beyond this the old ones lose weight.
    """
    sees = share * look.sees
    new = np.maximum(look.exponent * sees, sees - memory.weight)
    old = np.minimum(memory.weight, params.most - new)
    total = np.maximum(old + new, 1e-12)[:, None]
    mean = (old[:, None] * memory.evidence + new[:, None] * look.log_class) / total
    evidence = np.where(new[:, None] > 0, mean, memory.evidence)
    weight = np.where(new > 0, old + new, memory.weight)
    return evidence, weight, 1 - (1 - memory.seen) * (1 - sees)
