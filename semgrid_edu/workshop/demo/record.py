"""What the demo records during a drive: encoded frames, confusion matrices and times."""

from dataclasses import astuple, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LabelSet
from semgrid_edu.metrics import METRICS, confusion_matrix, semantic_cells
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import PlanarMotion, State
from semgrid_edu.pipeline import REMEMBER, STAGES, FrameResult
from semgrid_edu.plotting import occupancy_colours
from semgrid_edu.plotting.images import visible_points
from semgrid_edu.workshop.demo import pictures
from semgrid_edu.workshop.demo.details import frame_details
from semgrid_edu.workshop.demo.stages_file import Comparison, pictures_of

YOURS = "your_"
"""Prefix of the names of pictures that are made with a student's stages."""

ESTIMATES = {"grid": "semantic grid", "refined": "refined grid", "remembered": "grid with memory"}
"""The grids of a result that are compared with the truth, and what they are called; the last one only with memory."""


@dataclass(frozen=True)
class FrameView:
    """One frame as the page shows it.

    Parameters
    ----------
    clock : str
        Number and time of the frame, such as "frame 3, 0.3 s".
    images : dict of str to str
        Data URIs of photo, points, scores, occupancy, grid, refined, with memory remembered and, where it is known,
        truth. The names of those made with a student's stages begin with `YOURS`.
    texts : dict of str to str
        Alternative texts of the images, by the same names; the photo has none.
    arrows : dict of str to str
        Velocities as an SVG path, for each occupancy grid among the images.
    time : float
        Time of the frame, seconds.
    pose : (float, float, float)
        Where the vehicle is, seen from above: x, y (m) and yaw (rad) in the grid frame of the first shown frame.
    details : str
        `frame_details`, packed; empty for frames whose stories the page leaves out.
    scanned : bool
        Whether the frame has a scan; without one, the filter only predicts.
    """

    clock: str
    images: dict[str, str]
    texts: dict[str, str]
    arrows: dict[str, str]
    time: float = 0.0
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
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
        Numbers of the frames that the page shows; by default all. The first one is the first frame that is recorded.
    comparison : Comparison, optional
        Which stages come from a student's file. With it, each frame has two results, the package's and the student's.
    net : SemanticGridNet, optional
        The network of the package's results; without it, the page tells no stories of cells.
    stories : int
        The page tells the stories of one in this many shown frames.
    memory : bool
        Whether the results carry `remembered`.

    Attributes
    ----------
    views : list of FrameView
        The frames to show.
    labelled : int
        Number of frames with truth so far.
    liveliest : (FrameResult, FrameResult or None), or None
        The results of the shown frame with the most moving cells.
    layout : dict of str to list of int
        `StoryMaps.layout` of the views' details.
    stages : tuple of str
        The stages whose times are recorded, in their order.
    """

    def __init__(
        self,
        spec: GridSpec,
        label_set: LabelSet,
        shown: range | None = None,
        comparison: Comparison | None = None,
        net: SemanticGridNet | None = None,
        stories: int = 1,
        memory: bool = False,
    ) -> None:
        self.spec = spec
        self.label_set = label_set
        self.shown = shown
        self.comparison = comparison
        self.net = net
        self.stories = stories
        self.stages = tuple(STAGES | REMEMBER if memory else STAGES)
        self.views: list[FrameView] = []
        self.layout: dict[str, list[int]] = {}
        self.labelled = 0
        self.liveliest: tuple[FrameResult, FrameResult | None] | None = None
        self._number = shown[0] if shown else 0
        self._moving: list[int] = []
        self._first_pose: NDArray | None = None
        self._past: list[tuple[Frame, NDArray]] = []
        self._pictures = {"": pictures_of(memory), YOURS: comparison.changed if comparison else ()}
        self._rows = _rows(comparison, self._pictures[""])
        self._confusion = {name: np.zeros((len(label_set),) * 2, np.int64) for name in self._rows.values()}
        self._occurs = np.zeros(256, bool)
        self._seconds: dict[str, list[list[float]]] = {"": [], YOURS: []}

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
        runs = {"": package} if yours is None else {"": package, YOURS: yours}
        maps = {}
        for prefix, result in runs.items():
            self._seconds[prefix].append([result.seconds[stage] for stage in self.stages])
            names = [name for name in ESTIMATES if name in self._pictures[prefix]]
            maps |= {prefix + name: _best(getattr(result, name)) for name in names}
        labels = package.frame.labels
        if labels is not None:
            maps["truth"] = grid_truth(labels, package.belief.probability, self.spec)
            self.labelled += 1
            for name, confusion in self._confusion.items():
                confusion += confusion_matrix(maps["truth"], maps[name], len(self.label_set))
        if self.shown is None or self._number in self.shown:
            self._show(runs, maps)
        if package.remembered is not None:
            self._past.append((replace(package.frame, image=None, points=package.frame.points[:0]), maps["grid"]))
        self._number += 1

    def leave_out(self) -> None:
        """Count a frame that can't be read, so that the next one keeps its number."""
        self._number += 1

    def milliseconds(self, prefix: str = "") -> dict[str, float]:
        """Return the median time of each stage; a median, because the first frames also load compiled code.

        Parameters
        ----------
        prefix : str
            Whose stages: empty for the package's, `YOURS` for a student's. Without such a run nothing is returned.
        """
        if not self._seconds[prefix]:
            return {}
        medians = 1000 * np.median(self._seconds[prefix], axis=0)
        return dict(zip(self.stages, medians.tolist(), strict=True))

    def metrics(self) -> dict[str, dict[str, float]]:
        """Return each of `METRICS`, 0..1, by cells and estimate."""
        confusion = {row: self._confusion[name] for row, name in self._rows.items()}
        rows = {f"all cells, {row}": matrix for row, matrix in confusion.items()}
        rows |= {f"semantic cells, {row}": semantic_cells(m, self.label_set) for row, m in confusion.items()}
        return {metric: {row: of(matrix) for row, matrix in rows.items()} for metric, of in METRICS.items()}

    def classes(self) -> list[tuple[str, tuple[int, int, int]]]:
        """Return names and colours of the classes that occur in a shown picture."""
        entries = dict(enumerate(zip(self.label_set.names, self.label_set.rgb, strict=True)))
        entries[IGNORE] = "left out", (255, 255, 255)
        return [entry for number, entry in entries.items() if self._occurs[number]]

    @property
    def start(self) -> int:
        """The view with which the page begins: of those with stories, the one in which most cells move."""
        return max([k for k, view in enumerate(self.views) if view.details] or [0], key=self._moving.__getitem__)

    @property
    def gaps(self) -> bool:
        """Whether the truth leaves cells out."""
        return bool(self._occurs[IGNORE])

    def _show(self, runs: dict[str, FrameResult], maps: dict[str, NDArray]) -> None:
        package = runs[""]
        self._moving.append(_moving(package))
        if self.liveliest is None or self._moving[-1] > _moving(self.liveliest[0]):
            self.liveliest = package, runs.get(YOURS)
        view = self._view(package, self._details(package))
        for prefix, result in runs.items():
            self._draw(view, result, prefix)
        for name, labels in maps.items():
            self._occurs[np.unique(labels)] = True
            view.images[name] = pictures.classes_uri(labels, self.label_set)
            view.texts[name] = f"{self._whose(name)}Map of classes seen from above: {_shares(labels, self.label_set)}."
        self.views.append(view)

    def _view(self, result: FrameResult, details: str) -> FrameView:
        """Return a view with what the sensors gave, and none of the stages' pictures yet."""
        frame = result.frame
        scanned = len(frame.points) > 0
        clock = f"frame {self._number}, {frame.time:.1f} s" + ("" if scanned else ", no scan: predicted")
        images = {"photo": pictures.photo_uri(frame.image), "points": pictures.raster_uri(pictures.points_layer(frame))}
        returns = f"Camera image with the {len(visible_points(frame)[1])} LIDAR returns that the camera sees."
        if self._first_pose is None:
            self._first_pose = frame.T_world_from_lidar
        pose = astuple(PlanarMotion.from_poses(self._first_pose, frame.T_world_from_lidar))
        return FrameView(clock, images, {"points": returns}, {}, frame.time, pose, details, scanned)

    def _details(self, package: FrameResult) -> str:
        """Return the packed stories of the frame's cells, if the page tells them."""
        if self.net is None or len(self.views) % self.stories:
            return ""
        maps = frame_details(package, self.net, self._past)
        self.layout = maps.layout()
        return maps.packed()

    def _draw(self, view: FrameView, result: FrameResult, prefix: str) -> None:
        """Add the scores and the occupancy grid of a result to a view, if they can differ from the package's."""
        if "scores" in self._pictures[prefix]:
            name = f"{prefix}scores"
            best = _best(result.scores)
            self._occurs[np.unique(best)] = True
            view.images[name] = pictures.raster_uri(pictures.scores_layer(result.scores, self.label_set))
            shares = _shares(best, self.label_set)
            view.texts[name] = f"{self._whose(name)}Camera image painted with classes: {shares}."
        if "occupancy" in self._pictures[prefix]:
            name = f"{prefix}occupancy"
            belief = result.belief
            view.images[name] = pictures.raster_uri(occupancy_colours(belief.probability))
            view.texts[name] = f"{self._whose(name)}Occupancy grid seen from above: {_states(belief.probability)}."
            moments = belief.velocity, belief.velocity_covariance
            view.arrows[name] = pictures.arrows_path(self.spec, belief.probability, *moments)

    def _whose(self, name: str) -> str:
        return f"{self.comparison.file}: " if name.startswith(YOURS) else ""


def _rows(comparison: Comparison | None, pictures: tuple[str, ...]) -> dict[str, str]:
    """Return, for each row of the table of metrics, the name of the map that is compared with the truth."""
    made = [name for name in ESTIMATES if name in pictures]
    if comparison is None:
        words = {"grid": "network", "refined": "network + CRF", "remembered": "network + memory"}
        return {words[name]: name for name in made}
    yours = [name for name in made if name in comparison.changed]
    rows = {f"{ESTIMATES[name]}, the package's": name for name in made}
    return rows | {f"{ESTIMATES[name]}, {comparison.file}": YOURS + name for name in yours}


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
