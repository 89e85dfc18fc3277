"""The runs that the claims are judged by; those of Table 1 are shared with it (section 4)."""

from dataclasses import dataclass, fields
from itertools import chain

from semgrid_edu.experiments.reproduction.baseline_runs import BaselineRun
from semgrid_edu.experiments.reproduction.calibration_errors import CalibrationError
from semgrid_edu.experiments.reproduction.overturned_runs import OverturnedRun
from semgrid_edu.experiments.reproduction.runs import Run
from semgrid_edu.experiments.reproduction.scales import Scale
from semgrid_edu.experiments.reproduction.score_runs import ScoreRun
from semgrid_edu.experiments.reproduction.table_runs import table1_runs
from semgrid_edu.experiments.reproduction.time_runs import TimeRun
from semgrid_edu.experiments.reproduction.variants import Variant

WRONG_CALIBRATION = CalibrationError(pitch=1.0)
"""The error of calibration that geometry and network are compared with."""


@dataclass(frozen=True)
class ClaimRuns:
    """All runs of the claims, one per seed in each list.

    Parameters
    ----------
    networks : dict of str to list of ScoreRun
        The networks of Table 1 by name.
    new_routes : list of ScoreRun
        Table 2's networks on routes that nobody has driven in training.
    perfect : list of ScoreRun
        Table 3's networks on such routes, with data without any error.
    overturned, overturned_blind : list of OverturnedRun
        Cars on their tops: the usual network, and one that doesn't see the occupancy grid.
    unreduced : list of ScoreRun
        Networks without the 1x1 reduction.
    times : TimeRun
        The time of the usual network and of one without reduction.
    baselines, baselines_off : list of BaselineRun
        What learns no fusion, with the right calibration and with the wrong one.
    usual_off : list of ScoreRun
        The usual network with the wrong calibration.
    """

    networks: dict[str, list[ScoreRun]]
    new_routes: list[ScoreRun]
    perfect: list[ScoreRun]
    overturned: list[OverturnedRun]
    overturned_blind: list[OverturnedRun]
    unreduced: list[ScoreRun]
    times: TimeRun
    baselines: list[BaselineRun]
    baselines_off: list[BaselineRun]
    usual_off: list[ScoreRun]

    @property
    def usual(self) -> list[ScoreRun]:
        """The usual network, SegNet of Table 1, with the seeds that the variants have."""
        return self.networks["segnet"][: len(self.unreduced)]

    def all(self) -> list[Run]:
        """Return all runs."""
        found = [getattr(self, field.name) for field in fields(self)]
        lists = [chain(*part.values()) if isinstance(part, dict) else part for part in found]
        return [run for part in lists for run in ([part] if isinstance(part, Run) else part)]


def runs_of_claims(scale: Scale, seeds: int) -> ClaimRuns:
    """Return the runs of the claims.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds. Claims about Table 1 alone have its number of seeds, when that is larger.

    Returns
    -------
    ClaimRuns
    """
    every, all_seeds = range(seeds), max(seeds, scale.table1_seeds if seeds == scale.seeds else seeds)
    networks = table1_runs(scale, all_seeds)
    usual = networks["segnet"][:seeds]
    blind, unreduced = (
        [scale.scored(scale.kitti, "segnet", seed, variant=variant, crf=False) for seed in every]
        for variant in (Variant(occupancy=False), Variant(reduces=False))
    )
    routes, perfect = (
        scale.arrays(scale.chroma_routes, "test", "lidar"),
        scale.arrays(scale.synthia_routes, "test", "true"),
    )
    lying = scale.arrays(scale.overturned, "test", "true")
    return ClaimRuns(
        networks=networks,
        new_routes=[ScoreRun(scale.grid_stage(scale.chroma, "segnet", seed), routes) for seed in every],
        perfect=[ScoreRun(scale.grid_stage(scale.synthia, "segnet", seed, "true"), perfect, False) for seed in every],
        overturned=[OverturnedRun(run.network, lying) for run in usual],
        overturned_blind=[OverturnedRun(run.network, lying) for run in blind],
        unreduced=unreduced,
        times=TimeRun(usual[0].network, unreduced[0].network, usual[0].frames),
        baselines=[BaselineRun(run.network, run.frames) for run in usual],
        baselines_off=[BaselineRun(run.network, run.frames, WRONG_CALIBRATION) for run in usual],
        usual_off=[ScoreRun(run.network, run.frames, False, WRONG_CALIBRATION) for run in usual],
    )
