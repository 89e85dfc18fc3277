"""What the demo records while a drive runs: encoded frames, confusion matrices and times."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LabelSet
from semgrid_edu.metrics import METRICS, confusion_matrix, semantic_cells
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import State
from semgrid_edu.pipeline import STAGES, FrameResult
from semgrid_edu.plotting import occupancy_colours
from semgrid_edu.plotting.images import visible_points
from semgrid_edu.workshop.demo.comparison import MADE_BY, Comparison
from semgrid_edu.workshop.demo.details import frame_details, packed
from semgrid_edu.workshop.demo.grids import arrows_path
from semgrid_edu.workshop.demo.rasters import classes_uri, photo_uri, points_layer, raster_uri, scores_layer

YOURS = "your_"
"""Prefix of the names of pictures that are made with a student's stages."""

ESTIMATES = ("grid", "refined")
"""The grids of a result that are compared with the truth."""


@dataclass(frozen=True)
class FrameView:
    """One frame as the page shows it.

    Parameters
    ----------
    clock : str
        Number and time of the frame, such as "frame 3, 0.3 s".
    images : dict of str to str
        Data URIs of photo, points, scores, occupancy, grid, refined and, where it is known, truth. The names of those
        made with a student's stages begin with `YOURS`.
    texts : dict of str to str
        Alternative texts of the images, by the same names; the photo has none.
    arrows : dict of str to str
        Velocities as an SVG path, for each occupancy grid among the images.
    time : float
        Time of the frame, seconds.
    pose : list of float
        T_world_from_lidar, row by row.
    details : str
        What the story of a cell is told from (`demo.details`); empty for frames whose stories the page leaves out.
    scanned : bool
        Whether the frame has a scan; without one, the filter only predicts.
    """

    clock: str
    images: dict[str, str]
    texts: dict[str, str]
    arrows: dict[str, str]
    time: float = 0.0
    pose: list[float] = field(default_factory=list)
    details: str = ""
    scanned: bool = True


class Record:
    """What has been recorded of a drive so far.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    label_set : LabelSet
        The network's classes.
    shown : range, optional
        Numbers of the frames that the page shows. The first is that of the first frame to be recorded; all are shown
        when left out.
    comparison : Comparison, optional
        Which stages come from a student's file. With it, each frame has two results, the package's and the student's.
    net : SemanticGridNet, optional
        The network of the package's results; without it, the page tells no stories of cells.
    stories : int
        One shown frame in this many has the stories of its cells.

    Attributes
    ----------
    views : list of FrameView
        The frames to show.
    labelled : int
        Number of frames with truth so far.
    liveliest : (FrameResult, FrameResult or None), or None
        The results of the shown frame with the most moving cells.
    layout : dict of str to int
        Names of the maps in `FrameView.details`, in their order, and how many there are of each.
    """

    def __init__(
        self,
        spec: GridSpec,
        label_set: LabelSet,
        shown: range | None = None,
        comparison: Comparison | None = None,
        net: SemanticGridNet | None = None,
        stories: int = 1,
    ) -> None:
        self.net, self.stories, self.layout = net, stories, {}
        self.spec, self.label_set, self.shown, self.comparison = spec, label_set, shown, comparison
        self.views: list[FrameView] = []
        self.labelled = 0
        self.liveliest: tuple[FrameResult, FrameResult | None] | None = None
        self._number = shown[0] if shown else 0
        self._rows = _rows(comparison)
        self._confusion = {name: np.zeros((len(label_set),) * 2, np.int64) for name in self._rows.values()}
        self._occurs = np.zeros(256, bool)
        self._seconds: list[list[float]] = []
        self._your_seconds: list[list[float]] = []

    def add(self, package: FrameResult, yours: FrameResult | None = None) -> None:
        """Record the next frame.

        Parameters
        ----------
        package : FrameResult
            The frame's result with the package's own stages. Its occupancy grid names the unknown cells of the truth,
            for both results.
        yours : FrameResult, optional
            Its result with a student's stages.
        """
        maps = {name: _best(getattr(package, name)) for name in ESTIMATES}
        self._seconds.append([package.seconds[stage] for stage in STAGES])
        if yours is not None:
            maps |= {YOURS + name: _best(getattr(yours, name)) for name in ESTIMATES if name in self.comparison.changed}
            self._your_seconds.append([yours.seconds[stage] for stage in STAGES])
        if package.frame.labels is not None:
            maps["truth"] = grid_truth(package.frame.labels, package.belief.probability, self.spec)
            self._count(maps)
        if self.shown is None or self._number in self.shown:
            self._show(package, yours, maps)
        self._number += 1

    def milliseconds(self) -> dict[str, float]:
        """Return the median time of each of the package's own stages; the first frames also load compiled code."""
        return _medians(self._seconds)

    def your_milliseconds(self) -> dict[str, float]:
        """Return the median time of each stage with a student's stages; empty when there are none."""
        return _medians(self._your_seconds) if self._your_seconds else {}

    def metrics(self) -> dict[str, dict[str, float]]:
        """Return each of `METRICS`, 0..1, by cells and estimate."""
        confusion = {row: self._confusion[name] for row, name in self._rows.items()}
        rows = {f"all cells, {row}": matrix for row, matrix in confusion.items()}
        rows |= {f"semantic cells, {row}": semantic_cells(m, self.label_set) for row, m in confusion.items()}
        return {metric: {row: of(matrix) for row, matrix in rows.items()} for metric, of in METRICS.items()}

    def classes(self) -> list[tuple[str, tuple[int, int, int]]]:
        """Return names and colours of the classes that occur in a shown picture."""
        both = zip(self.label_set.names, self.label_set.rgb, strict=True)
        return [entry for entry, occurs in zip(both, self._occurs, strict=False) if occurs]

    def _count(self, maps: dict[str, NDArray]) -> None:
        self.labelled += 1
        for name, confusion in self._confusion.items():
            confusion += confusion_matrix(maps["truth"], maps[name], len(self.label_set))

    def _show(self, package: FrameResult, yours: FrameResult | None, maps: dict[str, NDArray]) -> None:
        frame = package.frame
        if self.liveliest is None or _moving(package) > _moving(self.liveliest[0]):
            self.liveliest = package, yours
        returns = f"Camera image with the {len(visible_points(frame)[1])} LIDAR returns that the camera sees."
        images = {"photo": photo_uri(frame.image), "points": raster_uri(points_layer(frame))}
        pose, details = frame.T_world_from_lidar.ravel().tolist(), self._details(package, maps.get("truth"))
        scanned = len(frame.points) > 0
        clock = f"frame {self._number}, {frame.time:.1f} s" + ("" if scanned else ", no scan: predicted")
        view = FrameView(clock, images, {"points": returns}, {}, frame.time, pose, details, scanned)
        self._draw(view, package, tuple(MADE_BY))
        if yours is not None:
            self._draw(view, yours, self.comparison.changed, YOURS)
        for name, labels in maps.items():
            self._occurs[np.unique(labels)] = True
            view.images[name] = classes_uri(labels, self.label_set)
            view.texts[name] = f"{self._whose(name)}Map of classes seen from above: {_shares(labels, self.label_set)}."
        self.views.append(view)

    def _details(self, package: FrameResult, truth: NDArray | None) -> str:
        """Return what the stories of the frame's cells are told from, if the page tells them."""
        if self.net is None or len(self.views) % self.stories:
            return ""
        maps = frame_details(package, self.net, truth)
        self.layout = {name: len(part) for name, part in maps.items()}
        return packed(maps)

    def _draw(self, view: FrameView, result: FrameResult, wanted: tuple[str, ...], prefix: str = "") -> None:
        """Add scores and occupancy grid of a result to a view."""
        if "scores" in wanted:
            name, best = f"{prefix}scores", _best(result.scores)
            self._occurs[np.unique(best)] = True
            view.images[name] = raster_uri(scores_layer(result.scores, self.label_set))
            shares = _shares(best, self.label_set)
            view.texts[name] = f"{self._whose(name)}Camera image painted with classes: {shares}."
        if "occupancy" in wanted:
            name, belief = f"{prefix}occupancy", result.belief
            view.images[name] = raster_uri(occupancy_colours(belief.probability))
            view.texts[name] = f"{self._whose(name)}Occupancy grid seen from above: {_states(belief.probability)}."
            view.arrows[name] = arrows_path(self.spec, belief.probability, belief.velocity)

    def _whose(self, name: str) -> str:
        return f"{self.comparison.file}: " if name.startswith(YOURS) else ""


def _rows(comparison: Comparison | None) -> dict[str, str]:
    """Return, for each row of the table of metrics, the name of the map that is compared with the truth."""
    if comparison is None:
        return {"network": "grid", "network + CRF": "refined"}
    words = {"grid": "semantic grid", "refined": "refined grid"}
    rows = {f"{words[name]}, the package's": name for name in ESTIMATES}
    return rows | {
        f"{words[name]}, {comparison.file}": YOURS + name for name in ESTIMATES if name in comparison.changed
    }


def _medians(seconds: list[list[float]]) -> dict[str, float]:
    medians = 1000 * np.median(seconds, axis=0)
    return dict(zip(STAGES, medians.tolist(), strict=True))


def _best(values: NDArray) -> NDArray[np.uint8]:
    """Return the class of the largest value in each place of (C, ...)."""
    return values.argmax(axis=0).astype(np.uint8)


def _moving(result: FrameResult) -> int:
    return int((result.belief.probability[State.DYNAMIC] > 0.5).sum())


def _states(probability: NDArray) -> str:
    """Say in words how many cells are most probably in each state."""
    best = probability.argmax(axis=0)
    shares = np.bincount(best.ravel(), minlength=len(State)) / best.size
    return ", ".join(f"{share:.1%} {state.name.lower()}" for state, share in zip(State, shares, strict=True))


def _shares(labels: NDArray, label_set: LabelSet) -> str:
    """Name the four most frequent classes."""
    counts = np.bincount(labels.ravel(), minlength=256)[: len(label_set)]
    largest = [c for c in np.argsort(-counts, kind="stable")[:4] if counts[c]]
    return ", ".join(f"{counts[c] / labels.size:.0%} {label_set.names[c]}" for c in largest)
