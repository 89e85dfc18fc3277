"""Runs that score: a trained network on the frames of a test split, drive by drive and by distance (section 4.2)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams, at_temperature, mean_field, unary_from_log_probability
from semgrid_edu.workshop.scoring.learned_grids import learned_log_g
from semgrid_edu.workshop.paper.runs.variants import EXACT, CalibrationError
from semgrid_edu.workshop.paper.runs.counting import CountingRun, GridCounts
from semgrid_edu.workshop.paper.runs.data_runs import ArraysRun
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.paper.runs.training_runs import GridStageRun
from semgrid_edu.networks import WEIGHTS, load_net

NETWORK, WITH_CRF, WITH_SEARCHED = "network", "network + CRF", "network + searched CRF"
"""The methods: the network's own grid, refined with the CRF's default parameters, and with those that were searched."""

SEARCHED = {
    "segnet": (1.1622, (1.82, 3.42, 1.79, 0.0756, 0.536)),
    "fcn": (1.2057, (0.947, 1.64, 26.9, 0.868, 1.27)),
    "deeplab": (1.2656, (1.32, 2.36, 18.7, 0.873, 0.957)),
}
"""For each image network the temperature and the CRF's five parameters that `semgrid-edu search-crf` chose for pixel
accuracy on validation drives, with the shipped network of that kind (docs/results/crf_search*.json)."""


@dataclass(frozen=True)
class ScoreRun(CountingRun):
    """Score a network on the frames of a split.

    Parameters
    ----------
    network : GridStageRun
        The run that trains the network.
    frames : ArraysRun
        The frames; with labels made with the LIDAR, they are scored against these and against the true ones.
    crf : bool
        Whether the CRF refines the grids as well, with default and with searched parameters.
    calibration : CalibrationError
        What the network believes wrongly about where the camera stands.
    """

    network: GridStageRun
    frames: ArraysRun
    crf: bool = True
    calibration: CalibrationError = EXACT

    @property
    def name(self) -> str:
        """The name of its folder."""
        where = self.frames.name.removeprefix("arrays-")
        return f"score-{self.network.name.removeprefix('grid-')}-on-{where}{self.calibration.name}" + "-crf" * self.crf

    @property
    def needs(self) -> tuple[Run, ...]:
        """The network and the frames."""
        return self.network, self.frames

    @property
    def steps(self) -> int:
        """Number of frames that are scored."""
        return self.frames.n_labelled

    @property
    def pace(self) -> str:
        """It depends on the network, and the CRF takes the most time."""
        return f"score {self.network.image_stage.segmenter} {self.frames.preset}" + " with CRF" * self.crf

    def probe(self) -> float:
        """Return the seconds that a frame took on one core when this was written."""
        return (0.8 if self.crf else 0.15) * (1 if self.frames.preset == "compact" else 10)

    def work(self, root: Path, device: str) -> None:
        """Score the network. Parameters are those of `Run.work`."""
        frames = self.frames.frames(root)
        net = load_net(self.network.folder(root) / WEIGHTS, self.calibration.applied_to(frames.camera))
        refinements = self._refinements(frames.spec.cell) if self.crf else {}
        counted = GridCounts(frames)
        for k in tqdm(range(len(frames)), desc="score", unit="frame"):
            sample = frames[k]
            log_g, o = learned_log_g(net, sample), sample.occupancy.numpy()
            counted.add_probability(NETWORK, k, np.exp(log_g))
            for method, refine in refinements.items():
                counted.add_probability(method, k, refine(log_g, o))
        counted.write(self.folder(root))

    def _refinements(self, cell: float) -> dict[str, Callable]:
        temperature, searched = SEARCHED[self.network.image_stage.segmenter]
        return {
            WITH_CRF: partial(_refined, CrfParams.for_cells(cell), 1.0),
            WITH_SEARCHED: partial(_refined, CrfParams(*searched), temperature),
        }


def _refined(params: CrfParams, temperature: float, log_g: NDArray, o: NDArray) -> NDArray:
    """Refine a grid by the CRF, after its log-probabilities were divided by a temperature."""
    return mean_field(unary_from_log_probability(at_temperature(log_g, temperature)), o, params)
