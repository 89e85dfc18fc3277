"""The runs of Tables 1 to 3, which the claims and the ablations share (sections 4.2 to 4.4)."""

from semgrid_edu.experiments.reproduction.baseline_runs import BaselineRun
from semgrid_edu.experiments.reproduction.paper import NETWORKS
from semgrid_edu.experiments.reproduction.scales import Scale
from semgrid_edu.experiments.reproduction.score_runs import ScoreRun


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
