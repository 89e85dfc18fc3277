"""The runs behind Tables 1 to 3, the figures and the claims (sections 4.2 to 4.4)."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from types import SimpleNamespace

from semgrid_edu.workshop.paper.other_runs import GRIDS, FigureRun, OverturnedRun, TimeRun
from semgrid_edu.workshop.paper.published import NETWORKS
from semgrid_edu.workshop.paper.run import Run
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import Scale
from semgrid_edu.workshop.paper.score_runs import BaselineRun, ScoreRun
from semgrid_edu.workshop.paper.variants import CalibrationError, Variant

WRONG_CALIBRATION = CalibrationError(pitch=1.0)
"""The error of calibration that geometry and network are compared with."""


def table1_runs(scale: Scale, seeds: int) -> dict[str, list[ScoreRun]]:
    """Return the runs of Table 1: by image network one per seed.

    Parameters
    ----------
    scale : Scale
        How large they are, and which image networks are compared.
    seeds : int
        Number of seeds.
    """
    return {name: scale.scored(scale.kitti, name, seeds) for name in scale.networks}


def baselines_of(runs: Sequence[ScoreRun]) -> list[BaselineRun]:
    """Return the runs of the baselines that networks are compared with: fitted to what these learn from.

    Parameters
    ----------
    runs : sequence of ScoreRun
        The networks, one per seed.
    """
    return [BaselineRun(run.network, run.frames) for run in runs]


def table2_runs(scale: Scale, seeds: int) -> dict[str, list[ScoreRun]]:
    """Return the runs of Table 2: SegNet on routes that were never driven in training.

    Parameters and result are those of `table1_runs`.
    """
    return {"segnet": scale.scored(scale.chroma, "segnet", seeds)}


def table3_runs(scale: Scale, seeds: int) -> list[ScoreRun]:
    """Return the runs of Table 3, one per seed: SegNet on data without any error.

    Parameters are those of `table1_runs`.
    """
    return scale.scored(scale.synthia, "segnet", seeds, "true", crf=False)


def figure_runs(scale: Scale, seeds: int) -> list[FigureRun]:
    """Return the runs of Figures 6 and 7: SegNet's first seed on the data of Tables 1, 2 and 3.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Not used: pictures are of one network.
    """
    data = {scale.kitti: "lidar", scale.chroma: "lidar", scale.synthia: "true"}
    scored = [scale.scored(name, "segnet", 1, truth) for name, truth in data.items()]
    return [FigureRun(run.network, run.frames) for (run,) in scored]


FIGURES = ("Figure 6", "Figure 6, INRIA-Chroma", "Figure 7")
"""The figures' parts, each on data of its own."""


def shown_frames(scale: Scale, seeds: int, counted: RunCounts) -> dict:
    """Return which frames the figures show, and where their grids are.

    Parameters
    ----------
    scale, seeds
        As `figure_runs` takes them.
    counted : RunCounts
        What is known about the runs.

    Returns
    -------
    dict
        "figures": by name the numbers of the "frames", and where the "grids" are, as a path in the folder of all runs.
    """
    runs = dict(zip(FIGURES, figure_runs(scale, seeds), strict=True))
    frames = {name: run.grids(counted)["frame"].tolist() for name, run in runs.items()}
    return {"figures": {name: {"frames": frames[name], "grids": f"{run.name}/{GRIDS}"} for name, run in runs.items()}}


def claims_plan(scale: Scale, seeds: int) -> list[Run]:
    """Return all runs of the claims. Parameters are those of `runs_of_claims`."""
    parts = vars(runs_of_claims(scale, seeds)).values()
    return [run for part in parts for run in (chain(*part.values()) if isinstance(part, dict) else part)]


def runs_of_claims(scale: Scale, seeds: int) -> SimpleNamespace:
    """Return the runs of the claims, one per seed in each list.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds. Claims about Table 1 alone have its number of seeds, when that is larger.

    Returns
    -------
    SimpleNamespace
        "networks", those of Table 1 by name, and of these the "usual" one, SegNet, with as many seeds as all others,
        and "usual_of_all_seeds"; "taught_true", SegNet that learns from true labels; "new_routes", Table 2's network on
        routes that nobody has driven in training; "table2" itself; "perfect", SegNet on data without any error, cells
        of 0.2 m; "overturned" and "overturned_blind", cars on their tops: the usual network, and one without the
        occupancy grid; "unreduced", without the 1x1 reduction; "times", of the usual network and of that one;
        "two_stages", "unbalanced" and "one_plane", trained so; "baselines", what learns no fusion; "baselines_off" and
        "usual_off", with the wrong calibration; "baselines_dense", with the depth of every pixel.
    """
    all_seeds = max(seeds, scale.table1_seeds if seeds == scale.seeds else seeds)
    networks = table1_runs(replace(scale, networks=tuple(NETWORKS)), all_seeds)
    usual = networks["segnet"][:seeds]
    return SimpleNamespace(
        networks=networks,
        usual=usual,
        usual_of_all_seeds=networks["segnet"],
        table2=table2_runs(scale, seeds)["segnet"],
        **vars(_trained_otherwise(scale, seeds, usual, all_seeds)),
        **vars(_on_other_frames(scale, seeds, usual)),
        baselines=baselines_of(usual),
        baselines_off=[BaselineRun(run.network, run.frames, WRONG_CALIBRATION) for run in usual],
        baselines_dense=[BaselineRun(run.network, run.frames, dense=True) for run in usual],
        usual_off=[ScoreRun(run.network, run.frames, crf=False, calibration=WRONG_CALIBRATION) for run in usual],
    )


def _trained_otherwise(scale: Scale, seeds: int, usual: list[ScoreRun], all_seeds: int) -> SimpleNamespace:
    """Return the runs of networks that differ in their training from the usual one, on the same test frames."""
    scored = partial(scale.scored, scale.kitti, "segnet", crf=False)
    unreduced = scored(all_seeds, variant=Variant(reduces=False))
    taught = (scale.grid_stage(scale.kitti, "segnet", seed, "true") for seed in range(seeds))
    return SimpleNamespace(
        taught_true=[ScoreRun(network, one.frames) for network, one in zip(taught, usual, strict=True)],
        unreduced=unreduced,
        times=[TimeRun(usual[0].network, unreduced[0].network, usual[0].frames)],
        two_stages=scored(seeds, variant=Variant(end_to_end=False)),
        unbalanced=scored(seeds, variant=Variant(balanced=False)),
        one_plane=scored(seeds, variant=Variant(n_planes=1)),
    )


def _on_other_frames(scale: Scale, seeds: int, usual: list[ScoreRun]) -> SimpleNamespace:
    """Return the runs on other frames than those of Table 1."""
    routes = scale.arrays(scale.chroma_routes, "test", "lidar")
    lying = scale.arrays(scale.overturned, "test", "true")
    blind = [scale.grid_stage(scale.kitti, "segnet", seed, variant=Variant(occupancy=False)) for seed in range(seeds)]
    return SimpleNamespace(
        new_routes=[ScoreRun(scale.grid_stage(scale.chroma, "segnet", seed), routes) for seed in range(seeds)],
        perfect=scale.fine.scored(scale.synthia_routes, "segnet", seeds, "true", crf=False),
        overturned=[OverturnedRun(run.network, lying) for run in usual],
        overturned_blind=[OverturnedRun(network, lying) for network in blind],
    )
