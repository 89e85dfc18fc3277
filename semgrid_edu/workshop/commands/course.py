"""The commands `semgrid-edu course ...`: they parse and call, nothing else."""

import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from semgrid_edu.workshop.commands.data import report

course = typer.Typer(no_args_is_help=True, help="Build the notebooks and the exercises, and grade them.")


@course.callback()
def needs_tools() -> None:
    """Build the notebooks and the exercises, and grade them."""
    missing = [name for name in ("jupytext", "nbgrader") if find_spec(name) is None]
    if missing:
        sys.exit(f"semgrid-edu: {' and '.join(missing)} are needed for this: pip install 'semgrid_edu[course]'")


@course.command()
def notebooks(
    names: Annotated[list[str] | None, typer.Argument(help="Such as 00_tour; all by default.")] = None,
) -> None:
    """Build lectures, companions and exercises from their sources."""
    from semgrid_edu.workshop.course.nbgrader.build import build_exercise, exercise_sources
    from semgrid_edu.workshop.course.notebooks import build as lectures

    sources = [*exercise_sources(), *lectures.lecture_sources(), *lectures.companion_sources()]
    for source in lectures.named(sources, names):
        build = build_exercise if source in exercise_sources() else lectures.build_lecture
        typer.echo(f"{lectures.notebook_name(source)}: {build(source)}")


@course.command()
def minutes(names: Annotated[list[str] | None, typer.Argument(help="Such as 00_tour; all by default.")] = None) -> None:
    """Show how many minutes each notebook takes a student.

    It also says what takes them, and for one notebook section by section.
    """
    from semgrid_edu.workshop.course.notebooks.build import companion_sources, lecture_sources, named
    from semgrid_edu.workshop.course.notebooks.minutes import minutes_table

    typer.echo(minutes_table(named([*lecture_sources(), *companion_sources()], names)))


@course.command()
def check() -> None:
    """Check that notebooks are run, and agree with their sources."""
    from semgrid_edu.workshop.course.checks import course_problems

    report(course_problems(), "every notebook agrees with its source")


@course.command()
def build(
    folder: Annotated[Path, typer.Argument(help="A missing or empty folder, or a course built before.")],
    lectures: Annotated[str | None, typer.Option(help="Address or path where students find 00_tour.ipynb.")] = None,
) -> None:
    """Lay out a complete nbgrader course for an instructor."""
    from semgrid_edu.workshop.course.nbgrader.build import build_course

    built = build_course(folder, lectures=lectures)
    names = built.assignments
    typer.echo(f"{folder}: {len(names)} assignments, {', '.join(names)}; read {folder / 'README.md'}")
    for name in built.kept:
        typer.echo(f"you changed {name}, so it stays; this version of semgrid_edu has another one", err=True)


@course.command()
def grade(
    folder: Annotated[Path, typer.Argument(help="A course that `course build` wrote, with what was handed in.")],
    assignments: Annotated[list[str] | None, typer.Argument(help="Such as 01_bayes; all by default.")] = None,
    again: Annotated[bool, typer.Option("--again", help="Grade what is graded already, too.")] = False,
    workers: Annotated[int, typer.Option(min=1, max=64, help="Submissions at the same time.")] = os.cpu_count() or 1,
    timeout: Annotated[int, typer.Option(min=1, help="Seconds for a cell, or for all calls of a test.")] = 30,
    memory: Annotated[int, typer.Option(min=100, help="Megabytes of memory for a student's code.")] = 4000,
    seed_by_student: Annotated[bool, typer.Option("--seed-by-student", help="Draw hidden inputs per student.")] = False,
) -> None:
    """Grade a class with nbgrader.

    Students' code runs in separate processes, apart from tests and gradebook.
    """
    from semgrid_edu.workshop.course.nbgrader.autograde import GradeSettings, UngradedError
    from semgrid_edu.workshop.course.nbgrader.grade_class import grade_course, missing_limits
    from semgrid_edu.workshop.course.nbgrader.gradebook import misplaced, write_graded

    settings = GradeSettings(timeout, memory, seed_by_student)
    for path in misplaced(folder):
        typer.echo(f"not graded: expected submitted/STUDENT/EXERCISE/EXERCISE.ipynb, found {path}", err=True)
    if missing := missing_limits():
        typer.echo(f"this system can't limit for students' code: {', '.join(missing)}; the guide says more", err=True)
    ungraded = ""
    try:
        for one in grade_course(folder, settings, assignments or (), again, workers):
            if one.note:
                typer.echo(f"{one.student}, {one.assignment}: {one.note}", err=True)
    except KeyboardInterrupt:
        sys.exit(f"semgrid-edu: interrupted; the same command {'begins again' if again else 'goes on'}")
    except UngradedError as error:
        ungraded = str(error)
    typer.echo(f"all scores so far: {write_graded(folder)}")
    if ungraded:
        told = "these stay ungraded, through no fault of the students; repeat the command without --again"
        sys.exit(f"semgrid-edu: {told}:\n{ungraded}")
