"""The commands of `semgrid-edu reproduce`: the experiments of the paper, and a check of their results."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

import semgrid_edu.workshop.paper
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.commands.arguments import Commands

reproduce = typer.Typer(cls=Commands, no_args_is_help=True, help="Run the experiments of the paper.")
"""What `semgrid-edu` adds to its commands."""


Runs = Annotated[Path, typer.Option(help="Takes one folder per run; the same command goes on.")]


@reproduce.command()
def check(
    folder: Annotated[Path, typer.Argument(help="Results of the paper's experiments, such as docs/results/reduced.")],
) -> None:
    """Compute results again from their counts; say what differs."""
    from semgrid_edu.workshop.paper.recompute import check_results

    if not check_results(folder, typer.echo):
        raise typer.Exit(1)


PAPER = {name: row["help"] for name, row in table_beside(semgrid_edu.workshop.paper.__file__, "experiments").items()}
PAPER["all"] = "All of these."
"""The experiments of the paper, and their commands' help."""


def _command(experiment: str) -> Callable[..., None]:
    """Return the command of an experiment."""

    def command(
        runs: Runs,
        out: Annotated[Path, typer.Option(help="Takes the results: JSON and Markdown.")],
        scale: Annotated[
            str,
            typer.Option(
                help="quick (minutes), reduced (hours), long or paper (GPU); quick+unet adds U-Net to Table 1."
            ),
        ] = "quick",
        seeds: Annotated[int | None, typer.Option(min=1, max=1000, help="Seeds; by default the scale's own.")] = None,
        workers: Annotated[int | None, typer.Option(help="Runs at a time; one per core by default.")] = None,
        device: Annotated[str, typer.Option(help="auto (a GPU if there is one), cpu, cuda or cuda:N.")] = "cpu",
        plan: Annotated[bool, typer.Option("--plan", help="Only show the runs and how long they will take.")] = False,
    ) -> None:
        from semgrid_edu.workshop.paper.reproduce import Request, reproduce

        places = {"runs": runs, "out": out, "workers": workers, "device": device}
        request = Request(experiment=experiment, scale=scale, seeds=seeds, **places)
        if problems := reproduce(request, typer.echo, plan):
            typer.echo(problems, err=True)
            raise typer.Exit(1)

    return command


for _name, _help in PAPER.items():
    reproduce.command(_name, help=f"{_help} Runs that have ended aren't repeated.")(_command(_name))
