"""Runs that score cars lying on their tops: images that no network has seen in training (section 4.4)."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.datasets.index import load_index
from semgrid_edu.datasets.readers.kitti_raw import drive_folder
from semgrid_edu.workshop.scoring.confusions import FrameConfusions, load_confusions, save_confusions
from semgrid_edu.workshop.scoring.learned_grids import learned_log_g
from semgrid_edu.workshop.paper.runs.counting import CONFUSIONS, CountingRun
from semgrid_edu.workshop.paper.runs.data_runs import ArraysRun
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.paper.runs.training_runs import GridStageRun
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.networks import WEIGHTS, load_net
from semgrid_edu.storage.reading import read_json

OVERTURNED, UPRIGHT = "overturned cars", "other cars"
"""Whose cells are counted."""


@dataclass(frozen=True)
class OverturnedRun(CountingRun):
    """Count what a network calls the cells of overturned cars, and of the other cars beside them.

    Parameters
    ----------
    network : GridStageRun
        The run that trains the network.
    frames : ArraysRun
        The frames.
    """

    network: GridStageRun
    frames: ArraysRun

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"overturned-{self.network.name.removeprefix('grid-')}-on-{self.frames.name.removeprefix('arrays-')}"

    @property
    def needs(self) -> tuple[Run, ...]:
        """The network and the frames."""
        return self.network, self.frames

    @property
    def steps(self) -> int:
        """Number of frames."""
        return self.frames.n_labelled

    @property
    def pace(self) -> str:
        """It depends on the size of the network."""
        return f"overturned {self.frames.preset}"

    def probe(self) -> float:
        """Return the seconds that a frame took on one core when this was written."""
        return 0.15

    def work(self, root: Path, device: str) -> None:
        """Count. Parameters are those of `Run.work`."""
        frames = self.frames.frames(root)
        net = load_net(self.network.folder(root) / WEIGHTS, frames.camera)
        counts: dict[str, list[NDArray]] = {OVERTURNED: [], UPRIGHT: []}
        for k, objects in enumerate(tqdm(self._objects(root), total=len(frames), unit="frame")):
            called = learned_log_g(net, frames[k]).argmax(axis=0)
            for whose, wanted in ((OVERTURNED, True), (UPRIGHT, False)):
                cars = [one for one in objects if one["class"] == "car" and one.get("overturned", False) == wanted]
                truth = np.where(boxes_on(frames.spec, cars), frames.arrays["true"][k], IGNORE)
                truth = np.where(truth == KITTI_14.index("car"), truth, IGNORE)
                counts[whose].append(confusion_matrix(truth, called, len(KITTI_14)))
        stacked = {whose: np.stack(matrices) for whose, matrices in counts.items()}
        save_confusions(self.folder(root) / CONFUSIONS, FrameConfusions(frames.drives, stacked))

    def _objects(self, root: Path) -> Iterator[list[dict]]:
        """Yield the road users of each frame."""
        index = load_index(self.frames.data.dataset_dir(root))
        for (date, drive), numbers in index.frames_by_drive(self.frames.split).items():
            objects = read_json(drive_folder(index.root, date, drive) / "labels" / "objects.json")
            yield from (objects[f"{number:010d}"] for number in numbers)

    def confusions(self, root: str | Path, method: str, truth: str, band: str | None = None) -> FrameConfusions:
        """Return the counts of `OVERTURNED` or `UPRIGHT` cars. Parameters are those of `CountingRun.confusions`."""
        found = load_confusions(self.folder(root) / CONFUSIONS)
        return FrameConfusions(found.drives, {method: found.counts[method]})


def boxes_on(spec: GridSpec, objects: list[dict], margin: float = 0.25) -> NDArray[np.bool_]:
    """Return which cells lie in the boxes of road users.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    objects : list of dict
        With "centre", "size" and "yaw" in the grid frame, as a simulated drive's labels hold them.
    margin : float
        By how much each side is moved outwards, metres: a cell counts when a part of it is covered.

    Returns
    -------
    (H, W) bool
    """
    inside = np.zeros(spec.shape, bool)
    for one in objects:
        x, y = np.moveaxis(spec.centers() - np.array(one["centre"][:2]), -1, 0)
        c, s = np.cos(one["yaw"]), np.sin(one["yaw"])
        ahead, left = c * x + s * y, c * y - s * x
        inside |= (np.abs(ahead) <= one["size"][0] / 2 + margin) & (np.abs(left) <= one["size"][1] / 2 + margin)
    return inside
