"""The commands of `semgrid-edu reproduce`: the lectures' experiments one by one, and those of the paper (`PAPER`)."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from semgrid_edu.storage.files import check_ours, table_beside, write_json
from semgrid_edu.workshop.commands.arguments import Commands
from semgrid_edu.workshop.paper import reports

reproduce = typer.Typer(cls=Commands, no_args_is_help=True, help="Run the experiments of the lectures.")
"""What `semgrid-edu` adds to its commands."""


Runs = Annotated[Path, typer.Option(help="Takes one folder per run; the same command goes on.")]


@reproduce.command()
def occupancy(
    seed: Annotated[int, typer.Option(min=0, help="Seed for the simulated drives and the particles.")] = 0,
    drives: Annotated[int, typer.Option(min=1, max=1000, help="Number of drives, of three seconds each.")] = 20,
    grid: Annotated[str | None, typer.Option(help="paper or compact; both by default.")] = None,
    out: Annotated[Path, typer.Option(help="Where to write the scores.")] = Path("occupancy.json"),
) -> None:
    """Score log-odds grid, BOF and CMCDOT on simulated drives (lecture 04)."""
    from semgrid_edu.workshop.studies.filter.occupancy import GRIDS, compare_filters, occupancy_tables

    keep_result(out, lambda: compare_filters(seed, drives, (grid,) if grid else tuple(GRIDS)), occupancy_tables)


@reproduce.command()
def streets(
    seed: Annotated[int, typer.Option(min=0, help="Seed for the simulated drives and the particles.")] = 0,
    drives: Annotated[int, typer.Option(min=1, max=1000, help="Number of drives through each street.")] = 6,
    grid: Annotated[str | None, typer.Option(help="paper or compact; both by default.")] = None,
    out: Annotated[Path, typer.Option(help="Where to write the scores.")] = Path("streets.json"),
) -> None:
    """Score CMCDOT on streets with wire mesh, hedges, glass, walls that come into view, convoys (lecture 04)."""
    from semgrid_edu.workshop.studies.filter.streets import GRIDS, measure_streets, streets_tables

    keep_result(out, lambda: measure_streets(seed, drives, (grid,) if grid else tuple(GRIDS)), streets_tables)


@reproduce.command()
def overfit(
    seed: Annotated[int, typer.Option(min=0, help="Seed for the initial weights.")] = 0,
    out: Annotated[Path, typer.Option(help="Where to write the scores.")] = Path("overfit.json"),
) -> None:
    """Overfit four frames with each image network: learn them by heart (lecture 08)."""
    from semgrid_edu.workshop.studies.training.overfit import overfit, overfit_table

    keep_result(out, lambda: overfit(seed), lambda result: overfit_table(result["networks"]))


@reproduce.command()
def truth_policies(
    seed: Annotated[int, typer.Option(min=0, help="Seed for the simulated drives, the errors, the particles.")] = 0,
    drives: Annotated[int, typer.Option(min=1, max=1000, help="Number of drives, of two seconds each.")] = 20,
    grid: Annotated[str, typer.Option(help="compact or paper.")] = "compact",
    lidar: Annotated[str, typer.Option(help="HDL-64E, KITTI's, or coarse, with a fifth of its columns.")] = "coarse",
    out: Annotated[Path, typer.Option(help="Takes each drive; the same command goes on.")] = Path("truth.json"),
) -> None:
    """Measure how wrong each way of making ground truth from LIDAR is, by class and distance (lecture 09)."""
    from semgrid_edu.workshop.studies.ground_truth.counts import truth_tables
    from semgrid_edu.workshop.studies.ground_truth.laboratory import truth_policies

    keep_result(out, lambda: truth_policies(out, seed, drives, grid, lidar), truth_tables, goes_on=True)


@reproduce.command()
def point_labels(
    seed: Annotated[int, typer.Option(min=0, help="Seed for the simulated drives.")] = 0,
    drives: Annotated[int, typer.Option(min=1, max=1000, help="Number of drives, of two seconds each.")] = 20,
    grid: Annotated[str, typer.Option(help="compact or paper.")] = "compact",
    lidar: Annotated[str, typer.Option(help="HDL-64E, KITTI's, or coarse, with a fifth of its columns.")] = "HDL-64E",
    out: Annotated[Path, typer.Option(help="Where to write the counts.")] = Path("point_labels.json"),
) -> None:
    """Measure how wrong the truth from labelled returns and cuboids is, such as PandaSet's (lecture 09)."""
    from semgrid_edu.workshop.studies.ground_truth.counts import truth_tables
    from semgrid_edu.workshop.studies.ground_truth.point_labels import point_labels

    keep_result(out, lambda: point_labels(seed, drives, grid, lidar), truth_tables)


@reproduce.command()
def real_streets(
    pandaset: Annotated[Path, typer.Option(help="The folder that holds PandaSet's scenes.")],
    simulated: Annotated[Path, typer.Option(help="A data set of simulated streets, such as data/minikitti.")],
    runs: Runs,
    scene: Annotated[str, typer.Option(help="Number of the scene, such as 002.")] = "002",
    seed: Annotated[int, typer.Option(min=0, help="First seed for initial weights and the order of frames.")] = 0,
    device: Annotated[str, typer.Option(help="auto (a GPU if there is one), cpu, cuda or cuda:N.")] = "cpu",
    out: Annotated[Path, typer.Option(help="Where to write the scores.")] = Path("real_streets.json"),
) -> None:
    """Train for a real street in several ways, and score the networks on cameras and times that were kept apart."""
    from semgrid_edu.workshop.studies.training.real_streets import compare_real, real_streets_table

    keep_result(out, lambda: compare_real(pandaset, scene, simulated, runs, seed, device), real_streets_table)


@reproduce.command()
def real_drive(
    kitti: Annotated[list[Path], typer.Option(help="A folder of KITTI raw drives; again for another stretch.")],
    date: Annotated[str, typer.Option(help="Such as 2011_09_26.")] = "2011_09_26",
    drive: Annotated[str, typer.Option(help="Such as 0013.")] = "0013",
    out: Annotated[Path, typer.Option(help="Where to write the numbers.")] = Path("real_drive.json"),
) -> None:
    """Put a real drive through every check of new data, beside the shipped drive (lecture 13)."""
    from semgrid_edu.workshop.studies.new_drive.real_drive import compare_drives, real_drive_table

    keep_result(out, lambda: compare_drives(kitti, date, drive), real_drive_table)


@reproduce.command()
def memory(
    pandaset: Annotated[Path, typer.Option(help="The folder that holds PandaSet's scenes.")],
    scene: Annotated[str, typer.Option(help="Number of the scene, such as 002.")] = "002",
    seed: Annotated[int, typer.Option(min=0, help="Seed for the simulated drives.")] = 0,
    drives: Annotated[int, typer.Option(min=1, max=1000, help="Number of simulated drives, of two seconds each.")] = 20,
    out: Annotated[Path, typer.Option(help="Where to write the scores.")] = Path("memory.json"),
) -> None:
    """Score the memory of classes on fresh simulated streets and on a real scene (lecture 14)."""
    from semgrid_edu.workshop.studies.filter import memory_counts, memory_gain

    keep_result(out, lambda: memory_gain.measure_memory(pandaset, scene, seed, drives), memory_counts.memory_tables)


@reproduce.command()
def check(
    folder: Annotated[Path, typer.Argument(help="Results of the paper's experiments, such as docs/results/reduced.")],
) -> None:
    """Compute the paper's tables, claims and ablations again from the counts beside them, and name what differs."""
    from semgrid_edu.workshop.paper.reports.recompute import check_results

    if not check_results(folder, typer.echo):
        raise typer.Exit(1)


def keep_result(
    out: Path,
    compute: Callable[[], dict],
    table: Callable[[dict], str],
    goes_on: bool = False,
    force: bool | None = None,
) -> None:
    """Compute an experiment's result, once it is known that the file can be written; write it, and print its table.

    Parameters
    ----------
    out : Path
        The file to write, as JSON.
    compute : callable
        Returns the result.
    table : callable
        Turns the result into text to print.
    goes_on : bool
        Whether `compute` goes on from the file, and so refuses that of something else.
    force : bool, optional
        Whether to replace the file of something else, see `check_ours`.
    """
    check_ours("" if goes_on else f'"command": "{Commands.asked} ', out, force=force)
    result = compute()
    write_json(out, result)
    typer.echo(f"{table(result)}\n\nwritten to {out}")


PAPER = {name: row["help"] for name, row in table_beside(reports.__file__, "experiments").items()}
PAPER["all"] = "All of these."
"""The experiments of the paper, and their commands' help."""


def _command(experiment: str) -> Callable[..., None]:
    """Return the command of an experiment."""

    def command(
        runs: Runs,
        out: Annotated[Path, typer.Option(help="Takes the results: JSON, Markdown and pictures.")],
        scale: Annotated[
            str,
            typer.Option(
                help="quick (minutes), reduced (hours), long or paper (GPU); quick+unet adds U-Net to Table 1."
            ),
        ] = "quick",
        seeds: Annotated[int | None, typer.Option(min=1, max=1000, help="Seeds; by default the scale's own.")] = None,
        workers: Annotated[int | None, typer.Option(help="Runs at a time; one per core by default.")] = None,
        scheduler: Annotated[str | None, typer.Option(help="Instead, a dask cluster: tcp://HOST:PORT.")] = None,
        device: Annotated[str, typer.Option(help="auto (a GPU if there is one), cpu, cuda or cuda:N.")] = "cpu",
        processes: Annotated[int, typer.Option(min=1, max=256, help="Processes (GPUs) of each training run.")] = 1,
        plan: Annotated[bool, typer.Option("--plan", help="Only show the runs and how long they will take.")] = False,
    ) -> None:
        from semgrid_edu.workshop.paper.reports.reproduce import Request, reproduce

        places = {"runs": runs, "out": out, "workers": workers, "scheduler": scheduler, "device": device}
        request = Request(experiment=experiment, scale=scale, seeds=seeds, processes=processes, **places)
        if problems := reproduce(request, typer.echo, plan):
            typer.echo(problems, err=True)
            raise typer.Exit(1)

    return command


for _name, _help in PAPER.items():
    reproduce.command(_name, help=f"{_help} Runs that have ended aren't repeated.")(_command(_name))
