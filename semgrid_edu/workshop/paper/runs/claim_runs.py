"""The runs that the claims are judged by; those of Table 1 are shared with it (section 4).

The runs of Tables 1 to 3, which the claims and the ablations share (sections 4.2 to 4.4).
"""

from semgrid_edu.workshop.paper.runs.baseline_runs import BaselineRun
from semgrid_edu.workshop.paper.runs.paper import NETWORKS
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.paper.runs.score_runs import ScoreRun
from dataclasses import dataclass, fields
from itertools import chain
from semgrid_edu.workshop.paper.runs.baseline_runs import BaselineRun
from semgrid_edu.workshop.paper.runs.variants import CalibrationError
from semgrid_edu.workshop.paper.runs.overturned_runs import OverturnedRun
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.paper.runs.score_runs import ScoreRun
from semgrid_edu.workshop.paper.runs.time_runs import TimeRun
from semgrid_edu.workshop.paper.runs.variants import Variant

def table1_runs(scale: Scale, seeds: int) -> dict[str, list[ScoreRun]]:
    """Return the runs of Table 1.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds.

    Returns
    -------
    dict of str to list of ScoreRun
        By image network one per seed.
    """
    return {segmenter: [scale.scored(scale.kitti, segmenter, seed) for seed in range(seeds)] for segmenter in NETWORKS}


def table1_baselines(scale: Scale, seeds: int) -> list[BaselineRun]:
    """Return the runs of the baselines that Table 1's SegNet is compared with, one per seed.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds.

    Returns
    -------
    list of BaselineRun
    """
    return [BaselineRun(run.network, run.frames) for run in table1_runs(scale, seeds)["segnet"]]


def table2_runs(scale: Scale, seeds: int) -> dict[str, list[ScoreRun]]:
    """Return the runs of Table 2: routes that were never driven in training. Parameters are those of `table1_runs`.

    Returns
    -------
    dict of str to list of ScoreRun
        By image network, SegNet alone, one per seed.
    """
    return {"segnet": [scale.scored(scale.chroma, "segnet", seed) for seed in range(seeds)]}


def table3_runs(scale: Scale, seeds: int) -> list[ScoreRun]:
    """Return the runs of Table 3: SegNet on data without any error. Parameters are those of `table1_runs`.

    Returns
    -------
    list of ScoreRun
        One per seed.
    """
    return [scale.scored(scale.synthia, "segnet", seed, truth="true", crf=False) for seed in range(seeds)]


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
