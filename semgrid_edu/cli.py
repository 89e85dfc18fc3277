"""The command line, `semgrid-edu`: parses and calls, nothing else."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from semgrid_edu.errors import ArgumentError, DataError

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)
data = typer.Typer(no_args_is_help=True, help="Make and check data.")
course = typer.Typer(no_args_is_help=True, help="Build the notebooks and the exercises.")
app.add_typer(data, name="data")
app.add_typer(course, name="course")


@app.callback()
def main() -> None:
    """Probabilistic bird's-eye semantic perception, taught notebook by notebook."""


@data.command()
def verify(
    folder: Annotated[Path | None, typer.Argument(help="A folder of samples; the shipped ones by default.")] = None,
) -> None:
    """Check the samples against the checksums in their provenance files."""
    from semgrid_edu.datasets.samples import samples_problems

    problems = samples_problems(folder)
    for problem in problems:
        typer.echo(problem, err=True)
    if problems:
        raise typer.Exit(1)
    typer.echo("every sample is as it was made")


@course.command()
def notebooks(
    names: Annotated[list[str] | None, typer.Argument(help="Such as 00_tour; all by default.")] = None,
) -> None:
    """Execute lectures and write the students' exercises, from their sources."""
    from semgrid_edu.course.exercises import build_exercise, exercise_sources
    from semgrid_edu.course.notebooks import build_lecture, lecture_sources, named

    for source in named(exercise_sources(), names):
        typer.echo(f"exercise {source.stem}: {build_exercise(source)}")
    for source in named(lecture_sources(), names):
        typer.echo(f"lecture {source.stem}: {build_lecture(source)}")


@course.command()
def check() -> None:
    """Check that every notebook is in step with its source, has run, and is fit to be shown."""
    from semgrid_edu.course.checks import course_problems

    problems = course_problems()
    for problem in problems:
        typer.echo(problem, err=True)
    if problems:
        raise typer.Exit(1)
    typer.echo("every notebook is in step with its source")


@course.command()
def build(folder: Annotated[Path, typer.Argument(help="Missing, empty, or a course built before.")]) -> None:
    """Lay out a complete nbgrader course for an instructor."""
    from semgrid_edu.course.exercises import build_course

    assignments = build_course(folder)
    typer.echo(f"{folder}: {len(assignments)} assignments, {', '.join(assignments)}; read {folder / 'README.md'}")


@app.command()
def evaluate(
    data: Annotated[Path, typer.Option(help="A data set with train and test frames, such as data/minikitti.")],
    weights: Annotated[Path, typer.Option(help="A network trained on its train frames.")],
    out: Annotated[Path, typer.Option(help="Where to write the scores.")] = Path("evaluation.json"),
) -> None:
    """Score a trained network and two simple baselines on the test frames."""
    from semgrid_edu.experiments.evaluate import evaluate, table
    from semgrid_edu.files import write_json

    result = evaluate(data, weights)
    write_json(out, result)
    typer.echo(f"{table(result['scores'])}\n\nwritten to {out}")


def run() -> None:
    """Run the command line; a mistake in the input ends in one line, not in a traceback."""
    try:
        app()
    except (ArgumentError, DataError) as error:
        sys.exit(f"semgrid-edu: {error}")
