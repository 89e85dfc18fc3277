"""The story of a frame's cells: what each stage did to them, from returns and pixels to the class (paper, Fig. 2).

The demo's page tells it for every cell; `cell_story` picks one.
"""

import operator
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import softmax

from semgrid_edu.crf import CrfParams, unary_from_probability
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import mean_field, with_fast_sampler
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LABEL_SETS
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import SensorModel
from semgrid_edu.pipeline import FrameResult
from semgrid_edu.planes import cell_heights, plane_pixels
from semgrid_edu.workshop.demo.contributions import Contributions, contributions, fusion_inputs
from semgrid_edu.workshop.demo.evidence import (
    VERDICTS,
    ScanMaps,
    Sight,
    classes_at,
    last_sight,
    place_history,
    scan_maps,
)
from semgrid_edu.workshop.demo.neighbours import Neighbours, neighbour_pull
from semgrid_edu.workshop.demo.what_if import FAULTS, faults, what_if

FRAMES = 10
"""How many frames a history goes back, the present one included."""

UPDATES = 10  # of the CRF: the default of `mean_field`
TOLERANCE = 1e-3
"""How much the network's probabilities may differ from those of the result that it is to explain."""


@dataclass(frozen=True, eq=False)
class FrameStory:
    """What each stage did to every cell of a frame.

    Parameters
    ----------
    states : dict of str to (4, H, W) float32
        The four states after "move", "predict", "update" and "resample" on the filter's map, whose cells can be shifted
        by up to half a cell, and "shown", in the grid that the filter returns. Only "shown" without `keep_steps`.
    scan : ScanMaps
        What the frame's scan says.
    pixels, visible : (D, H, W, 2) float64, (D, H, W) bool
        Where eq. (1) finds the points of the planes in the frame's image, and whether the camera sees them.
    called, shown : (D, H, W) int64
        What the image network calls the pixels at these points, and what they show (`classes_at`).
    label, rival : (H, W) int64
        The class of the semantic grid, and the class that it is compared with: the truth where that is another class,
        otherwise the second most probable class.
    refined, truth : (H, W) int64
        The class after the CRF, and the true class; 255 where it isn't known.
    why : Contributions
        The parts of the difference of the scores of `label` and `rival`.
    neighbours : Neighbours
        What the neighbours add in the CRF's last update; the strongest ones pull towards `refined`.
    otherwise : dict of str to (H, W) int64
        What each cell is called before the CRF if an input is true or removed, see `what_if`.
    fault : (H, W) int64
        The stage that is to blame, as an index of `FAULTS`.
    sight : Sight or None
        When a frame last named each place; None for a result without memory.
    """

    states: dict[str, NDArray[np.float32]]
    scan: ScanMaps
    pixels: NDArray[np.float64]
    visible: NDArray[np.bool_]
    called: NDArray[np.int64]
    shown: NDArray[np.int64]
    label: NDArray[np.int64]
    rival: NDArray[np.int64]
    refined: NDArray[np.int64]
    truth: NDArray[np.int64]
    why: Contributions
    neighbours: Neighbours
    otherwise: dict[str, NDArray[np.int64]]
    fault: NDArray[np.int64]
    sight: Sight | None


def frame_story(result: FrameResult, net: SemanticGridNet, past: Sequence[tuple[Frame, NDArray]] = ()) -> FrameStory:
    """Explain what each stage did to every cell of a frame.

    Parameters
    ----------
    result : FrameResult
        The frame's result from the package's stages with their defaults, such as `Stages.fast(net, keep_steps=True)`.
    net : SemanticGridNet
        The network that made the result, in evaluation mode.
    past : sequence of (Frame, (H, W) int)
        For a result with memory: the earlier frames in order, each with the class of each cell by that frame alone.

    Raises
    ------
    ArgumentError
        When the network is in training mode, or another network made the result.
    """
    architecture = net.need_architecture()
    spec = architecture.grid
    o = result.belief.probability
    if net.training:
        raise ArgumentError("net", "a network in evaluation mode, see `net.eval()`", "one in training mode")
    net = with_fast_sampler(net)
    inputs = result.scores, o, cell_heights(result.frame.points_grid, spec)
    with torch.no_grad():
        logits = net.fusion(*fusion_inputs(net, *inputs))[0]
    apart = np.abs(softmax(logits.numpy(), axis=0) - result.grid).max()
    if apart > TOLERANCE:
        raise ArgumentError("net", "the network that made the result", f"one whose probabilities are {apart:.3f} apart")
    parts = contributions(net, *inputs)
    labels = result.frame.labels
    truth = np.full(spec.shape, IGNORE) if labels is None else grid_truth(labels, o, spec).astype(np.int64)
    label, second = np.argsort(-result.grid, axis=0, kind="stable")[:2]
    rival = np.where((truth != label) & (truth < len(result.grid)), truth, second)
    refined = result.refined.argmax(axis=0)
    pixels, visible = plane_pixels(spec, architecture.heights, result.frame.camera)
    called, shown = classes_at(result, pixels, visible)
    params = CrfParams.for_cells(spec.cell)
    before_last_update = mean_field(unary_from_probability(result.grid), o, params, UPDATES - 1)
    otherwise = what_if(result, net)
    n_semantic = LABEL_SETS[architecture.label_set].n_semantic
    labelled = np.where(truth < n_semantic, truth, IGNORE)  # the kinds of unknown are the filter's own states
    sight = None
    if result.remembered is not None:
        sight = last_sight([*past, (result.frame, label)], spec, n_semantic)
    return FrameStory(
        states={**result.belief.steps, "shown": o},
        scan=scan_maps(result.frame.points_grid, spec, SensorModel()),
        pixels=pixels,
        visible=visible,
        called=called,
        shown=shown,
        label=label,
        rival=rival,
        refined=refined,
        truth=truth,
        why=parts.versus(label, rival),
        neighbours=neighbour_pull(before_last_update, refined, o, params),
        otherwise=otherwise,
        fault=faults(label, refined, labelled, otherwise),
        sight=sight,
    )


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
        The planes' points in the image, and what is seen there.
    label, rival, refined, truth : int
        Its classes; the truth is None where unknown.
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
        The class names.
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
    >>> results = list(run_pipeline(drive[:10], Stages.fast(net, keep_steps=True)))         # doctest: +SKIP
    >>> story = cell_story(results[-1], (101, 31), net, past=results[:-1])                  # doctest: +SKIP
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
