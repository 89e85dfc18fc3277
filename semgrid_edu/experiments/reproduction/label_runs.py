"""Runs that count how wrong the labels are that networks learn from (section 4)."""

from dataclasses import dataclass
from pathlib import Path

from semgrid_edu.experiments.reproduction.counting import CountingRun, GridCounts
from semgrid_edu.experiments.reproduction.data_runs import ArraysRun
from semgrid_edu.experiments.reproduction.runs import Run

LABELS = "labels"
"""The method: the labels themselves, counted like the grids of a network."""


@dataclass(frozen=True)
class LabelsRun(CountingRun):
    """Count the labels of a split against the true ones, and against those that are made in the usual way.

    Parameters
    ----------
    labels : ArraysRun
        The labels to count.
    usual : ArraysRun
        The same frames with the usual labels, made with the LIDAR.
    """

    labels: ArraysRun
    usual: ArraysRun

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"labels-{self.labels.name.removeprefix('arrays-')}"

    @property
    def needs(self) -> tuple[Run, ...]:
        """Both kinds of labels."""
        return self.labels, self.usual

    @property
    def steps(self) -> int:
        """Number of labelled frames."""
        return self.labels.n_labelled

    @property
    def pace(self) -> str:
        """It depends on the size of the grid."""
        return f"labels {self.labels.preset}"

    def probe(self) -> float:
        """Return the seconds that a frame took on one core when this was written."""
        return 0.01 if self.labels.preset == "compact" else 0.1

    def work(self, root: Path, device: str) -> None:
        """Count them. Parameters are those of `Run.work`."""
        labels, usual = self.labels.frames(root), self.usual.frames(root)
        counted = GridCounts(usual)
        for k in range(len(usual)):
            counted.add(LABELS, k, labels.arrays["truth"][k])
        counted.write(self.folder(root))
