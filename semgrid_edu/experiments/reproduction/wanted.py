"""What each command of `semgrid-edu reproduce` needs: its runs, the most urgent first (section 4)."""

from collections.abc import Callable

from semgrid_edu.experiments.reproduction.runs import Run
from semgrid_edu.experiments.reproduction.scales import Scale
from semgrid_edu.experiments.reproduction.training_runs import GridStageRun

TABLE_1 = ("segnet", "fcn", "deeplab")
"""The image networks of Table 1, in its order."""


def table1_networks(scale: Scale, seeds: int) -> list[list[GridStageRun]]:
    """Return the trainings of Table 1, which learn from labels made with the LIDAR, as in the paper.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds.

    Returns
    -------
    list of list of GridStageRun
        For each seed one per network of `TABLE_1`.
    """
    return [[scale.grid_stage(scale.kitti, segmenter, seed) for segmenter in TABLE_1] for seed in range(seeds)]


def table2_networks(scale: Scale, seeds: int) -> list[GridStageRun]:
    """Return the trainings of Table 2: SegNet on routes, of which those of the test were never driven.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds.

    Returns
    -------
    list of GridStageRun
        One per seed.
    """
    return [scale.grid_stage(scale.chroma, "segnet", seed) for seed in range(seeds)]


def table3_networks(scale: Scale, seeds: int) -> list[GridStageRun]:
    """Return the trainings of Table 3: SegNet on data without any error, as SYNTHIA's.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds.

    Returns
    -------
    list of GridStageRun
        One per seed.
    """
    return [scale.grid_stage(scale.synthia, "segnet", seed, truth="true") for seed in range(seeds)]


def _table1(scale: Scale, seeds: int | None) -> list[Run]:
    return [run for networks in table1_networks(scale, seeds or scale.table1_seeds) for run in networks]


def _table2(scale: Scale, seeds: int | None) -> list[Run]:
    return table2_networks(scale, seeds or scale.seeds)


def _table3(scale: Scale, seeds: int | None) -> list[Run]:
    return table3_networks(scale, seeds or scale.seeds)


EXPERIMENTS: dict[str, Callable[[Scale, int | None], list[Run]]] = {
    "table1": _table1,
    "table2": _table2,
    "table3": _table3,
}
"""For each experiment (scale, number of seeds or None for the scale's own) -> its runs."""
