"""What the demo keeps of a drive while it runs: encoded frames, counts and times."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.truth import grid_truth
from semgrid_edu.demo.grids import arrows_path
from semgrid_edu.demo.page import FrameView
from semgrid_edu.demo.rasters import classes_uri, photo_uri, points_layer, raster_uri, scores_layer
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LabelSet
from semgrid_edu.metrics import METRICS, confusion_matrix, semantic_cells
from semgrid_edu.occupancy import State
from semgrid_edu.pipeline import STAGES, FrameResult
from semgrid_edu.plotting import occupancy_colours
from semgrid_edu.plotting.images import visible_points

ESTIMATES = {"network": "grid", "network + CRF": "refined"}
"""Which of a result's grids stands in which row of the page's table."""


class Record:
    """The drive as far as it has run.

    Parameters
    ----------
    spec : GridSpec
    label_set : LabelSet
        The network's classes.
    every : int
        Of so many frames one is shown.

    Attributes
    ----------
    views : list of FrameView
        The frames to show.
    labelled : int
        How many frames have had truth.
    liveliest : FrameResult or None
        The shown frame with the most moving cells.
    """

    def __init__(self, spec: GridSpec, label_set: LabelSet, every: int = 1) -> None:
        self.spec, self.label_set, self.every = spec, label_set, every
        self.views: list[FrameView] = []
        self.labelled = 0
        self.liveliest: FrameResult | None = None
        self._frames = 0
        self._confusion = {name: np.zeros((len(label_set),) * 2, np.int64) for name in ESTIMATES}
        self._occurs = np.zeros(256, bool)
        self._seconds: list[list[float]] = []

    def add(self, result: FrameResult) -> None:
        """Take in the next frame."""
        labels, belief = result.frame.labels, result.belief
        maps = {name: getattr(result, name).argmax(axis=0).astype(np.uint8) for name in ESTIMATES.values()}
        if labels is not None:
            maps["truth"] = grid_truth(labels, belief.probability, self.spec)
            self._count(maps)
        if self._frames % self.every == 0:
            self._show(result, maps)
        self._seconds.append([result.seconds[stage] for stage in STAGES])
        self._frames += 1

    def milliseconds(self) -> dict[str, float]:
        """Return the median time of each stage: the first frames also load compiled code."""
        medians = 1000 * np.median(self._seconds, axis=0)
        return dict(zip(STAGES, medians.tolist(), strict=True))

    def metrics(self) -> dict[str, dict[str, float]]:
        """Return each of `METRICS`, 0..1, by cells and estimate."""
        rows = {f"all cells, {name}": matrix for name, matrix in self._confusion.items()}
        rows |= {f"semantic cells, {name}": semantic_cells(m, self.label_set) for name, m in self._confusion.items()}
        return {metric: {row: of(matrix) for row, matrix in rows.items()} for metric, of in METRICS.items()}

    def classes(self) -> list[tuple[str, tuple[int, int, int]]]:
        """Return names and colours of the classes that any shown picture holds."""
        both = zip(self.label_set.names, self.label_set.rgb, strict=True)
        return [entry for entry, occurs in zip(both, self._occurs, strict=False) if occurs]

    def _count(self, maps: dict[str, NDArray]) -> None:
        self.labelled += 1
        for name, attribute in ESTIMATES.items():
            self._confusion[name] += confusion_matrix(maps["truth"], maps[attribute], len(self.label_set))

    def _show(self, result: FrameResult, maps: dict[str, NDArray]) -> None:
        frame, belief = result.frame, result.belief
        for labels in (*maps.values(), result.scores.argmax(axis=0)):
            self._occurs[np.unique(labels)] = True
        if self.liveliest is None or _moving(result) > _moving(self.liveliest):
            self.liveliest = result
        images = {
            "photo": photo_uri(frame.image),
            "points": raster_uri(points_layer(frame)),
            "scores": raster_uri(scores_layer(result.scores, self.label_set)),
            "occupancy": raster_uri(occupancy_colours(belief.probability)),
        } | {name: classes_uri(labels, self.label_set) for name, labels in maps.items()}
        arrows = arrows_path(self.spec, belief.probability, belief.velocity)
        clock = f"frame {self._frames}, {frame.time:.1f} s"
        self.views.append(FrameView(clock, images, _texts(result, maps, self.label_set), arrows))


def _moving(result: FrameResult) -> int:
    return int((result.belief.probability[State.DYNAMIC] > 0.5).sum())


def _texts(result: FrameResult, maps: dict[str, NDArray], label_set: LabelSet) -> dict[str, str]:
    """Say in words what the pictures of a frame show."""
    states = np.bincount(result.belief.probability.argmax(axis=0).ravel(), minlength=4) / maps["grid"].size
    occupancy = ", ".join(f"{share:.1%} {state.name.lower()}" for state, share in zip(State, states, strict=True))
    texts = {
        "points": f"Camera image with the {len(visible_points(result.frame)[1])} LIDAR returns that it sees.",
        "scores": f"Camera image painted with classes: {_shares(result.scores.argmax(axis=0), label_set)}.",
        "occupancy": f"Occupancy grid seen from above: {occupancy}.",
    }
    return texts | {name: f"Map of classes seen from above: {_shares(m, label_set)}." for name, m in maps.items()}


def _shares(labels: NDArray, label_set: LabelSet) -> str:
    """Name the four most frequent classes."""
    counts = np.bincount(labels.ravel(), minlength=256)[: len(label_set)]
    largest = [c for c in np.argsort(-counts, kind="stable")[:4] if counts[c]]
    return ", ".join(f"{counts[c] / labels.size:.0%} {label_set.names[c]}" for c in largest)
