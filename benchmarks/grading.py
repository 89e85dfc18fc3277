"""Measure how long a class takes to grade: `python benchmarks/grading.py FOLDER`.

A third of the submissions are right, a third untouched, and a third have one right answer in two. The time of the
first submission of each exercise, in which the reference is graded and compiled, is told apart.
"""

import sys
import time
from contextlib import suppress
from itertools import cycle, islice
from pathlib import Path

import psutil
from submissions import reference_answers, submission

from semgrid_edu.workshop.course.nbgrader.autograde import GradeSettings, place
from semgrid_edu.workshop.course.nbgrader.build import build_course, exercise_sources
from semgrid_edu.workshop.course.nbgrader.grade_class import grade_course
from semgrid_edu.workshop.course.notebooks.build import write_notebook

EXERCISES, STUDENTS, WORKERS = 9, 7, 2
CLASS = 200


def hand_in(course: Path, student: str, source: Path, kind: str) -> None:
    """Write one submission of a student."""
    answers = reference_answers(source) if kind != "untouched" else {}
    kept = dict(islice(answers.items(), 0, None, 2 if kind == "half" else 1))
    write_notebook(submission(source, kept), place(course, "submitted", student, source.stem))


def megabytes(folder: Path) -> float:
    """Return the size of all files in a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6


def most_memory() -> float:
    """Return how much memory this program and all that it has started hold now, megabytes."""
    me = psutil.Process()
    held = 0
    for process in (me, *me.children(recursive=True)):
        with suppress(psutil.NoSuchProcess):
            held += process.memory_info().rss
    return held / 1e6


def grade(course: Path) -> tuple[float, int, float]:
    """Grade what is handed in; return seconds, how many submissions, and the most memory that was seen."""
    start = time.perf_counter()
    held = [most_memory() for _ in grade_course(course, GradeSettings(), workers=WORKERS)]
    return time.perf_counter() - start, len(held), max(held)


def main(course: Path) -> None:
    """Print times, memory and disk."""
    build_course(course)
    sources = exercise_sources()[:EXERCISES]
    for source in sources:
        hand_in(course, "first", source, "right")
    seconds, count, _ = grade(course)
    print(f"{count} exercises for the first time, with the reference: {seconds:.0f} s")
    for number, kind in zip(range(STUDENTS), cycle(("right", "half", "untouched")), strict=False):
        for source in sources:
            hand_in(course, f"student-{number}", source, kind)
    before = megabytes(course)
    seconds, count, memory = grade(course)
    disk = (megabytes(course) - before) / count
    print(f"{count} submissions, {WORKERS} at a time: {seconds:.0f} s, {seconds / count:.2f} s each")
    print(f"most memory of all processes: {memory:.0f} MB; disk: {disk:.2f} MB for each")
    all_of_them = CLASS * EXERCISES
    minutes = all_of_them * seconds / count / 60
    print(f"{CLASS} students x {EXERCISES} exercises: {minutes:.0f} minutes, {all_of_them * disk:.0f} MB")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
