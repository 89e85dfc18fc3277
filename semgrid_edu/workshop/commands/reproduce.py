"""The commands `semgrid-edu reproduce table1`, `table2`, ... `all`: plan, do the runs, write the results."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

HELP = {
    "table1": "Table 1: SegNet, FCN and DeepLab, with and without the CRF.",
    "table2": "Table 2: SegNet on routes that were never driven in training.",
    "table3": "Table 3: SegNet's confusion matrix on data without any error.",
    "claims": "The paper's nine claims, each with a verdict.",
    "ablations": "What the paper leaves open: planes, occupancy, reduction, balancing, calibration, frames, distance.",
    "truth-costs": "What training costs on truth made in other ways: clean-up, mask, de-skew, scans added up.",
    "figures": "Figures 6 and 7: a few test frames with their labels and grids.",
    "all": "All of these.",
}
"""The experiments of the paper, and what their commands say of themselves."""


def add_commands(app: typer.Typer) -> None:
    """Add one command per experiment of the paper.

    Parameters
    ----------
    app : typer.Typer
        Takes the commands.
    """
    for experiment, text in HELP.items():
        app.command(experiment, help=f"{text} Runs that have ended aren't repeated.")(_command(experiment))


def _command(experiment: str) -> Callable[..., None]:
    """Return the command of an experiment."""

    def command(
        runs: Annotated[Path, typer.Option(help="Takes one folder per run; the same command goes on.")],
        out: Annotated[Path, typer.Option(help="Takes the results: JSON, Markdown and pictures.")],
        scale: Annotated[str, typer.Option(help="quick (minutes), reduced (hours) or paper (needs a GPU).")] = "quick",
        seeds: Annotated[
            int | None, typer.Option(min=1, max=1000, help="Number of seeds; the scale's own by default.")
        ] = None,
        workers: Annotated[int | None, typer.Option(help="Runs at a time; one per core by default.")] = None,
        scheduler: Annotated[
            str | None, typer.Option(help="tcp://HOST:PORT of a dask.distributed cluster that does the runs.")
        ] = None,
        device: Annotated[str, typer.Option(help="auto (a GPU if there is one), cpu, cuda or cuda:N.")] = "cpu",
        processes: Annotated[
            int,
            typer.Option(min=1, max=256, help="Processes of each training run, by torchrun; on cuda a GPU for each."),
        ] = 1,
        plan: Annotated[bool, typer.Option("--plan", help="Only tell the runs and how long they will take.")] = False,
    ) -> None:
        from semgrid_edu.workshop.paper.reports.reproduce import Request, reproduce

        request = Request(
            experiment=experiment,
            scale=scale,
            runs=runs,
            out=out,
            seeds=seeds,
            workers=workers,
            scheduler=scheduler,
            device=device,
            processes=processes,
        )
        problems = reproduce(request, typer.echo, plan)
        if problems:
            typer.echo(problems, err=True)
            raise typer.Exit(1)

    return command
