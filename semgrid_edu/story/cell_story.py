"""The story of one cell: what each stage did to it, from returns and pixels to its class (paper, Fig. 2)."""

import operator
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf import CrfParams
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.errors import ArgumentError, check_shape
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LABEL_SETS
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import SensorModel
from semgrid_edu.pipeline import FrameResult, Stages
from semgrid_edu.planes import plane_pixels
from semgrid_edu.story.cell_evidence import CellMemory, CellScan, cell_memory, cell_scan, classes_at, place_history
from semgrid_edu.story.contributions import Contributions, cell_contributions
from semgrid_edu.story.crf_messages import NeighbourPull, neighbour_pull
from semgrid_edu.story.what_if import what_if
from semgrid_edu.story.words import FAULTS, faults, story_text

FRAMES = 10
"""How many frames a history goes back, the present one included."""

TOLERANCE = 1e-3
"""The most by which the network's probabilities may differ from those of the result that it is to explain."""


@dataclass(frozen=True, eq=False)
class CellStory:
    """What each stage did to one cell.

    Parameters
    ----------
    cell : (int, int)
        Row and column.
    xy : (float, float)
        Its centre in the grid frame, metres.
    scan : CellScan
        What the frame's scan says of it.
    steps : dict of str to (4,) float32
        Its four states after "move", "predict", "update" and "resample", on the filter's map, and "shown", in the grid
        that the filter hands out. That one is the prediction updated with the returns of exactly this cell, while the
        map's cell lies up to half a cell beside it. Each sums to 1. Only "shown" when the filter wasn't asked to keep
        its steps.
    times, history : (T,) float64, (4, T) float32
        What was believed of the place in the last frames (`place_history`).
    heights : (D,) float64
        The heights of the planes above the cell, metres.
    pixels, visible : (D, 2) float64, (D,) bool
        Where eq. (1) finds the points of the planes in the frame's image, and whether the camera sees them.
    pixel_classes, pixel_truth : (D,) int64
        What the image network calls the pixels at these points, and what they show (`classes_at`).
    label, rival : int
        The class of the semantic grid, and the one that it is compared with: the truth where that is another class,
        otherwise the second most probable one.
    for_label, for_rival : Contributions
        The parts of both logits. `for_label.minus(for_rival)` says why the cell got the one and not the other.
    pull : NeighbourPull
        What the CRF did.
    truth : int or None
        The true class, where it is known.
    otherwise : dict of str to int
        What the cell is called before the CRF when an input is true or gone, see `what_if`.
    names, flat : tuple of str
        The names of the classes, and of those that lie on the ground.
    memory : CellMemory or None
        What it is called with memory, if the result has one, and when a frame last named its place.

    Examples
    --------
    >>> print(story)                                                                        # doctest: +SKIP
    Cell (101, 31), 20.2 m ahead and 0.2 m to the left.
    Called road (71 %), but it is car.
    The mistake comes from the occupancy filter: it takes this cell for FREE. With the true state in ...
    """

    cell: tuple[int, int]
    xy: tuple[float, float]
    scan: CellScan
    steps: dict[str, NDArray[np.float32]]
    times: NDArray[np.float64]
    history: NDArray[np.float32]
    heights: NDArray[np.float64]
    pixels: NDArray[np.float64]
    visible: NDArray[np.bool_]
    pixel_classes: NDArray[np.int64]
    pixel_truth: NDArray[np.int64]
    label: int
    rival: int
    for_label: Contributions
    for_rival: Contributions
    pull: NeighbourPull
    truth: int | None
    otherwise: dict[str, int]
    names: tuple[str, ...]
    flat: tuple[str, ...]
    memory: CellMemory | None = None

    @property
    def refined(self) -> int:
        """The class after the CRF."""
        return int(self.pull.after.argmax())

    @property
    def fault(self) -> str:
        """Which stage went wrong, one of `words.FAULTS`, see `words.faults`."""
        truth = IGNORE if self.truth is None else self.truth
        return FAULTS[faults(self.label, self.refined, truth, self.otherwise)]

    def __str__(self) -> str:
        """Tell the story in sentences."""
        return story_text(self)


def cell_story(
    result: FrameResult,
    cell: tuple[int, int],
    net: SemanticGridNet,
    past: Sequence[FrameResult] = (),
    sensor: SensorModel | None = None,
    crf: CrfParams | None = None,
) -> CellStory:
    """Explain what each stage did to one cell of a frame.

    Parameters
    ----------
    result : FrameResult
        The frame's result from the package's own stages. Made with `Stages.of(net, keep_steps=True)`, it also has the
        filter's steps.
    cell : (int, int)
        Row and column of the cell.
    net : SemanticGridNet
        The network that made the result, in evaluation mode.
    past : sequence of FrameResult
        The results of earlier frames in the order of time; the history shows the last nine of them, and what is said
        of the memory looks through all.
    sensor : SensorModel, optional
        The filter's sensor model, when it wasn't the default one.
    crf : CrfParams, optional
        The parameters of the refinement, when they weren't those of `CrfParams.for_cells`.

    Returns
    -------
    CellStory
        What each stage did, from the scan to the CRF.

    Raises
    ------
    ArgumentError
        When there is no such cell, the network is in training mode, or another network made the result.

    Examples
    --------
    >>> results = list(run_pipeline(drive[:10], Stages.of(net, keep_steps=True)))           # doctest: +SKIP
    >>> story = cell_story(results[-1], (101, 31), net, past=results[:-1])                  # doctest: +SKIP
    >>> why = story.for_label.minus(story.for_rival)                                        # doctest: +SKIP
    >>> why.planes.sum() + why.occupancy.sum() + why.rest == why.score                      # doctest: +SKIP
    """
    architecture = net.need_architecture()
    spec, label_set = architecture.grid, LABEL_SETS[architecture.label_set]
    cell, o = _checked(cell, spec), result.belief.probability
    _check_net(Stages.of(net), result)
    truth = _truth(result, spec, cell)
    label, rival = map(int, label_and_rival(result.grid[:, *cell], IGNORE if truth is None else truth))
    times, history = place_history([*past[max(0, len(past) - FRAMES + 1) :], result], spec, cell)
    pixels, visible = plane_pixels(spec, architecture.heights, result.frame.camera)
    pixel_classes, pixel_truth = classes_at(result, pixels, visible)
    parts = [cell_contributions(net, result.scores, o, cell, c) for c in (label, rival)]
    params = crf or CrfParams.for_cells(spec.cell)
    return CellStory(
        cell=cell,
        xy=tuple(spec.centers()[cell].tolist()),
        scan=cell_scan(result.frame.points_grid, spec, cell, sensor or SensorModel()),
        steps={name: states[:, *cell] for name, states in {**result.belief.steps, "shown": o}.items()},
        times=times,
        history=history,
        heights=np.array(architecture.heights),
        pixels=pixels[:, *cell],
        visible=visible[:, *cell],
        pixel_classes=pixel_classes[:, *cell],
        pixel_truth=pixel_truth[:, *cell],
        label=label,
        rival=rival,
        for_label=parts[0],
        for_rival=parts[1],
        pull=neighbour_pull(result.grid, result.refined, o, cell, params),
        truth=truth,
        otherwise={change: int(classes[cell]) for change, classes in what_if(result, net).items()},
        names=label_set.names,
        flat=label_set.flat,
        memory=cell_memory([*past, result], spec, cell, label_set.n_semantic),
    )


def label_and_rival(probability: NDArray, truth: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the most probable class of each cell, and the one that it is compared with.

    Parameters
    ----------
    probability : (C, ...) float
        The distribution of each cell, or of one.
    truth : (...) int
        The true class; `IGNORE` where it isn't known.

    Returns
    -------
    label, rival : (...) int64
        The rival is the truth where that is another class of the distribution, otherwise the second most probable one.
    """
    label, second = np.argsort(-probability, axis=0, kind="stable")[:2]
    return label, np.where((truth != label) & (truth < len(probability)), truth, second)


def _checked(cell: tuple[int, int], spec: GridSpec) -> tuple[int, int]:
    try:
        row, col = (range(n).index(operator.index(k)) for n, k in zip(spec.shape, cell, strict=True))
    except (TypeError, ValueError):
        raise ArgumentError("cell", f"row and column in a grid of {spec.shape} cells", cell) from None
    return row, col


def _check_net(own: Stages, result: FrameResult) -> None:
    """Refuse a network that makes other probabilities of the frame's scores."""
    check_shape("scores", result.scores, (len(result.grid), *own.architecture.image_size))
    check_shape("grid", result.grid, (len(result.scores), *own.architecture.grid.shape))
    given = np.exp(own.fuse(own.sample(result.scores), result.belief.probability))
    if not (apart := np.abs(given - result.grid).max()) <= TOLERANCE:
        raise ArgumentError("net", "the network that made the result", f"one whose probabilities are {apart:.3f} apart")


def _truth(result: FrameResult, spec: GridSpec, cell: tuple[int, int]) -> int | None:
    if result.frame.labels is None:
        return None
    return int(grid_truth(result.frame.labels, result.belief.probability, spec)[cell])
