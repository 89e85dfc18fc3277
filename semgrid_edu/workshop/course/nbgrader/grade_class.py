"""A whole class: every collected submission, graded by nbgrader on several cores."""

import tempfile
import warnings
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from glob import has_magic
from multiprocessing import get_all_start_methods, get_context
from pathlib import Path

import nbformat
from nbformat.v4 import new_markdown_cell
from nbformat.warnings import DuplicateCellId
from tqdm import tqdm

from semgrid_edu.workshop.course.nbgrader import gradebook as book
from semgrid_edu.workshop.course.nbgrader.autograde import (
    GradeSettings,
    UnfitError,
    UngradedError,
    autograde_one,
    place,
)
from semgrid_edu.workshop.course.nbgrader.build import one_line
from semgrid_edu.workshop.course.nbgrader.gradebook import Graded, submissions
from semgrid_edu.workshop.course.nbgrader.preprocessors import CRASHED
from semgrid_edu.workshop.course.notebooks.build import write_notebook
from semgrid_edu.workshop.course.sandbox.limits import Limits, limit_grader
from semgrid_edu.workshop.course.sandbox.process import StudentProcess
from semgrid_edu.workshop.course.sandbox.resources import delete_folder

KILLED = "the file can't be graded: twice it ended the process that grades, perhaps for want of memory or time"
"""The note on a submission that ended the grader twice: among others, and alone."""

UNREADABLE = "unreadable"
"""The folder of notebooks that replace files that can't be read."""


def grade_course(
    course: Path, settings: GradeSettings, assignments: Sequence[str] = (), again: bool = False, workers: int = 1
) -> Iterator[Graded]:
    """Grade the submissions that aren't graded yet; after an interruption, a second call continues.

    Parameters
    ----------
    course : Path
        A course that `build_course` wrote.
    settings : GradeSettings
        How it is graded.
    assignments : sequence of str
        Only these; all when empty.
    again : bool
        Whether to grade again what is graded already.
    workers : int
        How many submissions are graded at the same time.

    Yields
    ------
    Graded
        The submissions in the order in which they are finished.

    Raises
    ------
    DataError
        When the folder isn't a course.
    ArgumentError
        When there is no such assignment.
    UngradedError
        At the end, if submissions stay ungraded for a reason that isn't theirs. It lists them, one per line.
    """
    course = course.resolve()
    failed = {}
    wanted = submissions(course, assignments) if again else book.ungraded(course, assignments)
    yield from _in_pools(course, wanted, settings, workers, failed)
    if failed:
        raise UngradedError("\n".join(f"{which}: {message}" for which, message in failed.items()))


def _in_pools(course: Path, wanted: list, settings: GradeSettings, workers: int, failed: dict) -> Iterator[Graded]:
    """Yield results; if a process died, grade its submissions again one by one, to find the culprit."""
    with _pool(workers) as pool:
        waiting = {pool.submit(grade_one, course, *one, settings): one for one in wanted}
        left = yield from _as_they_end(course, waiting, failed)
    begun = [one for one in left if book.has_begun(course, *one)]
    if begun and len(wanted) == 1:
        yield _grade_stand_in(course, *begun[0], settings, f"{CRASHED}{KILLED}")
    elif begun:
        for one in begun:
            yield from _in_pools(course, [one], settings, 1, failed)
        yield from _in_pools(course, [one for one in left if one not in begun], settings, workers, failed)
    else:
        failed |= {_which(one): "the process that grades was ended" for one in left}


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Start processes that grade, with temporary files in a folder that is always deleted at the end.

    They are forked from a process that has loaded what they need, where the system can fork.
    """
    context = get_context("forkserver" if "forkserver" in get_all_start_methods() else "spawn")
    context.set_forkserver_preload([__name__])
    with ExitStack() as stack:
        folder = tempfile.mkdtemp(prefix="semgrid-grading-")
        stack.callback(delete_folder, Path(folder))
        pool = ProcessPoolExecutor(workers, context, _begin, (folder,))
        stack.callback(pool.shutdown, cancel_futures=True)
        try:
            yield pool
        except BaseException:  # above all Ctrl-C: what is begun isn't waited for, and is graded again
            for process in list((pool._processes or {}).values()):
                process.terminate()
            raise


def _begin(folder: str) -> None:
    """Prepare a process that grades."""
    tempfile.tempdir = folder
    limit_grader(Limits.memory)


def _as_they_end(course: Path, waiting: dict[Future, tuple[str, str]], failed: dict[str, str]) -> Generator:
    """Yield results and note failures; return the submissions that have no result because a process died."""
    left = []
    for done in tqdm(as_completed(waiting), "submissions", len(waiting)):
        try:
            yield done.result()
        except BrokenProcessPool:
            left.append(waiting[done])
        except Exception as error:
            book.delete_unfinished(course, *waiting[done])
            failed[_which(waiting[done])] = one_line(error)
    return left


def _which(submission: tuple[str, str]) -> str:
    """Return the name of a submission."""
    return ", ".join(reversed(submission))


def missing_limits() -> list[str]:
    """Start a process as for a student's code, and return which of `limits.PARTS` can't be limited.

    Raises
    ------
    OSError
        When the process doesn't start.
    """
    process = StudentProcess(Limits())
    process.stop()
    return process.unlimited


def grade_one(course: Path, assignment: str, student: str, settings: GradeSettings) -> Graded:
    """Grade one submission; a file that can't be read is graded as an empty one, with a note.

    Parameters
    ----------
    course : Path
        The course.
    assignment, student : str
        Whose submission.
    settings : GradeSettings
        How it is graded.

    Raises
    ------
    UngradedError
        When grading fails for a reason that isn't the submission's, which then has no grade.
    """
    if has_magic(student):
        note = f"{CRASHED}nbgrader takes * ? [ in a student's name for a pattern: rename the folder"
        return Graded(student, assignment, 0, 0, 0, note)
    try:
        # A cell that was copied may keep its id, which is said once a cell.
        with book.unfinished(course, assignment, student), warnings.catch_warnings():
            warnings.simplefilter("ignore", DuplicateCellId)
            path = place(course, "submitted", student, assignment)
            book.check_time(path)
            try:
                book.check_file(path)
                autograde_one(course, assignment, student, settings)
            except UnfitError as error:
                note = f"{CRASHED}the file can't be graded: {error}"
                return _grade_stand_in(course, assignment, student, settings, note)
            with book.open_gradebook(course) as gradebook:
                return book.result_of(gradebook, assignment, student)
    except Exception as error:
        raise UngradedError(one_line(error)) from error


def _grade_stand_in(course: Path, assignment: str, student: str, settings: GradeSettings, note: str) -> Graded:
    """Grade the empty exercise in place of a file that can't be graded, with a note in it and in the gradebook."""
    notebook = nbformat.read(course / "release" / assignment / f"{assignment}.ipynb", as_version=4)
    notebook.cells.insert(0, new_markdown_cell(f"**{note}**"))
    write_notebook(notebook, place(course, UNREADABLE, student, assignment))
    with book.unfinished(course, assignment, student):
        autograde_one(course, assignment, student, settings, UNREADABLE)
        with book.open_gradebook(course) as gradebook:
            for comment in gradebook.find_submission_notebook(assignment, assignment, student).comments:
                comment.auto_comment = note
            gradebook.db.commit()
            return book.result_of(gradebook, assignment, student)
