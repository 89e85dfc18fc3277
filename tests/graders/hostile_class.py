"""Grade a class in which most students attack: `python tests/graders/hostile_class.py FOLDER`.

It says which grades aren't as they should be, and what the grader held of disk, memory and processes before, at most
and after.
"""

import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path

import psutil

sys.path.append(str(Path(__file__).parents[1]))  # as pytest does

import test_sound as sound
import tries
from class_of import NAME, POINTS, REFERENCE, handed_in, inside

from semgrid_edu.workshop.course.nbgrader.autograde import GradeSettings, place
from semgrid_edu.workshop.course.nbgrader.build import build_course
from semgrid_edu.workshop.course.nbgrader.grade_class import grade_course
from semgrid_edu.workshop.course.notebooks.build import write_notebook

HONEST = 8
"""Students who hand in right answers."""

WORKERS, MEMORY = 2, 2000
"""Submissions at the same time, and megabytes for each."""


def students():
    """Each student's notebook, and the least and the most points that it may earn.

    Who stops her own answers may lose more than they are worth, because threads and processes that she leaves behind
    stand in the way of her others.
    """
    found = {f"right-{k}": (handed_in(), 15, 15) for k in range(HONEST)} | {"untouched": (handed_in({}), 0, 0)}
    returned, stops = [*tries.RETURNED.values()], [*tries.STOPS.values()]
    for k in range(0, len(returned), len(sound.FUNCTIONS)):
        pairs = zip(sound.FUNCTIONS, returned[k:], strict=False)
        code = "\n".join([sound.EASY, *(f"{attack}\n{name} = attack" for name, attack in pairs)])
        found[f"returns-{k}"] = handed_in(sound.EASIER, first=code), 0, 0
    for k in range(0, len(stops), 3):
        lines = dict(zip(sound.FUNCTIONS, stops[k : k + 3], strict=False))
        answers = {name: inside(name, line)[name] for name, line in lines.items()}
        found[f"stops-{k}"] = handed_in(REFERENCE | answers), 0, 15 - sum(POINTS[name] for name in answers)
    for kind, code in (sound.ATTACKS | tries.IN_THE_WAY).items():
        found[f"attacks {kind}"] = handed_in(sound.EASIER, first=f"{sound.EASY}\n{code}"), 0, 0
    return found | {f"takes {kind}": (handed_in(first=code), 15, 15) for kind, code in tries.TAKES.items()}


def ours():
    """This process and all that it has started, and what else works in a folder for answers."""
    found = {one.pid: one for one in [psutil.Process(), *psutil.Process().children(recursive=True)]}
    for one in psutil.process_iter():
        with suppress(psutil.Error, OSError):  # a folder may be deeper than a path can say
            if one.cwd().startswith(tempfile.gettempdir()):
                found[one.pid] = one
    return list(found.values())


def held(folder):
    """Megabytes of files and of memory, and the number of processes."""
    memory = 0
    for one in ours():
        with suppress(psutil.Error):
            memory += one.memory_info().rss / 1e6
    return disk(Path(tempfile.gettempdir())) + disk(folder), memory, len(ours())


def disk(folder):
    """Megabytes of files in a folder."""
    # Unlike Python's own ways, du goes as deep as students dare; what is deleted meanwhile counts as nothing.
    said = subprocess.run(["du", "-sk", folder], capture_output=True, text=True, check=False).stdout
    return int(said.split()[0]) * 1024 / 1e6


def fits(result, wanted):
    """Whether a student has what she should have."""
    _, least, most = wanted[result.student]
    return least <= result.score <= most


def main(folder):
    """Print what came out."""
    tempfile.tempdir = str(folder / "temporary")
    Path(tempfile.tempdir).mkdir(parents=True)
    course = folder / "course"
    build_course(course)
    wanted = students()
    for student, (notebook, *_) in wanted.items():
        write_notebook(notebook, place(course, "submitted", student, NAME))
    before, seen, began = held(course), [held(course)], time.monotonic()
    ended = threading.Event()
    watch = threading.Thread(target=lambda: [seen.append(held(course)) for _ in iter(lambda: ended.wait(5), True)])
    watch.start()
    results = {}
    for one in grade_course(course, GradeSettings(timeout=30, memory=MEMORY), workers=WORKERS):
        results[one.student] = one
        print(f"{one.student}: {one.score:g}{'' if fits(one, wanted) else ', wrong'}", one.note, flush=True)
    ended.set()
    watch.join()
    wrong = [name for name in wanted if name not in results or not fits(results[name], wanted)]
    print(f"{len(wanted)} students, {len(wrong)} grades wrong: {wrong}; {time.monotonic() - began:.0f} s")
    for says, (files, memory, processes) in (
        ("before", before),
        ("most", [max(column) for column in zip(*seen, strict=True)]),
        ("after", held(course)),
    ):
        print(f"{says}: {files:.0f} MB of files, {memory:.0f} MB of memory, {processes} processes")
    print("running after:", [one.name() for one in ours()])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
