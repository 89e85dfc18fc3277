"""The story of one cell, from returns and pixels to its class (paper, Fig. 2)."""

import operator
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LABEL_SETS
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.pipeline import FrameResult
from semgrid_edu.workshop.demo.all_cells import frame_story
from semgrid_edu.workshop.demo.contributions import Contributions
from semgrid_edu.workshop.demo.evidence import VERDICTS, ScanMaps, place_history
from semgrid_edu.workshop.demo.what_if import FAULTS

FRAMES = 10
"""How many frames a history goes back, the present one included."""


@dataclass(frozen=True, eq=False)
class CellStory:
    """What each stage did to one cell: its numbers in `FrameStory`, and more.

    Parameters
    ----------
    cell : (int, int)
        Row and column.
    xy : (float, float)
        Its centre in the grid frame, metres.
    scan : ScanMaps
        What the frame's scan says about it, as numbers.
    steps : dict of str to (4,) float32
        Its four states after each step of the filter.
    times, history : (T,) float64, (4, T) float32
        What was believed about the place in the last frames (`place_history`).
    heights : (D,) float64
        The heights of the planes above the cell, metres.
    pixels, visible, called, shown : (D, 2) float64, (D,) bool, (D,) int64, (D,) int64
        The points of the planes in the image, and what is seen there.
    label, rival, refined, truth : int
        Its classes; the truth is None where it isn't known.
    before, after : (C,) float32
        Its distribution in the semantic grid, and in the refined grid.
    why : Contributions
        The parts of the difference of the scores of `label` and `rival`.
    messages : (C,) float64
        What its neighbours add to the logarithm of each class's probability.
    otherwise : dict of str to int
        What it is called before the CRF if an input is true or removed.
    fault : str
        The stage that is to blame, one of `FAULTS`.
    names : tuple of str
        The names of all classes.
    """

    cell: tuple[int, int]
    xy: tuple[float, float]
    scan: ScanMaps
    steps: dict[str, NDArray[np.float32]]
    times: NDArray[np.float64]
    history: NDArray[np.float32]
    heights: NDArray[np.float64]
    pixels: NDArray[np.float64]
    visible: NDArray[np.bool_]
    called: NDArray[np.int64]
    shown: NDArray[np.int64]
    label: int
    rival: int
    refined: int
    truth: int | None
    before: NDArray[np.float32]
    after: NDArray[np.float32]
    why: Contributions
    messages: NDArray[np.float64]
    otherwise: dict[str, int]
    fault: str
    names: tuple[str, ...]


def cell_story(
    result: FrameResult, cell: tuple[int, int], net: SemanticGridNet, past: Sequence[FrameResult] = ()
) -> CellStory:
    """Explain what each stage did to one cell of a frame.

    Parameters
    ----------
    result : FrameResult
        The frame's result, as for `frame_story`.
    cell : (int, int)
        Row and column of the cell.
    net : SemanticGridNet
        The network that made the result, in evaluation mode.
    past : sequence of FrameResult
        The results of earlier frames in the order of time; the history shows the last nine of them.

    Raises
    ------
    ArgumentError
        When there is no such cell, the network is in training mode, or another network made the result.

    Examples
    --------
    >>> results = list(run_pipeline(drive[:10], Stages.of(net, keep_steps=True)))           # doctest: +SKIP
    >>> story = cell_story(results[-1], (101, 31), net, past=results[:-1])                  # doctest: +SKIP
    >>> draw_cell_story(story, results[-1].frame.image)                                     # doctest: +SKIP
    """
    architecture = net.need_architecture()
    spec = architecture.grid
    cell = _checked(cell, spec)
    maps = frame_story(result, net, [(one.frame, one.grid.argmax(axis=0)) for one in past])
    times, history = place_history([*past[max(0, len(past) - FRAMES + 1) :], result], spec, cell)
    scan = maps.scan._make(values[cell].item() for values in maps.scan)
    truth = int(maps.truth[cell])
    return CellStory(
        cell=cell,
        xy=tuple(spec.centers()[cell].tolist()),
        scan=scan._replace(verdict=VERDICTS[scan.verdict]),
        steps={name: states[:, *cell] for name, states in maps.states.items()},
        times=times,
        history=history,
        heights=np.array(architecture.heights),
        pixels=maps.pixels[:, *cell],
        visible=maps.visible[:, *cell],
        called=maps.called[:, *cell],
        shown=maps.shown[:, *cell],
        label=int(maps.label[cell]),
        rival=int(maps.rival[cell]),
        refined=int(maps.refined[cell]),
        truth=None if truth == IGNORE else truth,
        before=result.grid[:, *cell],
        after=result.refined[:, *cell],
        why=maps.why.at(cell),
        messages=maps.neighbours.messages[:, *cell],
        otherwise={change: int(classes[cell]) for change, classes in maps.otherwise.items()},
        fault=FAULTS[maps.fault[cell]],
        names=LABEL_SETS[architecture.label_set].names,
    )


def _checked(cell: tuple[int, int], spec: GridSpec) -> tuple[int, int]:
    """Return row and column of a cell of the grid as whole numbers."""
    try:
        row, col = (range(n).index(operator.index(k)) for n, k in zip(spec.shape, cell, strict=True))
    except (TypeError, ValueError):
        raise ArgumentError("cell", f"row and column in a grid of {spec.shape} cells", cell) from None
    return row, col
