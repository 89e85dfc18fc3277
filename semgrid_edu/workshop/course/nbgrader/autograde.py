"""One submission, graded by nbgrader, which writes score and messages to the course's gradebook and folders."""

import hashlib
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path

from nbgrader.api import InvalidEntry
from sqlalchemy.exc import SAWarning

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.course.nbgrader import build

TRIES = 10
"""How often to try a submission while another process blocks the gradebook."""


class UnfitError(Exception):
    """A file can't be graded, whatever its answers are. The message is shown to the student, so it quotes nothing."""


class UngradedError(Exception):
    """Grading failed, but not because of the submission: it has no grade, and can be graded again later."""


@dataclass(frozen=True)
class GradeSettings:
    """How a class is graded.

    Parameters
    ----------
    timeout : int
        Seconds for a cell.
    memory : int
        Megabytes of memory for a student's code.
    seed_by_student : bool
        Whether the hidden tests draw other inputs for each student.
    """

    timeout: int = 30
    memory: int = 4000
    seed_by_student: bool = False


def autograde_one(
    course: Path, assignment: str, student: str, settings: GradeSettings, submitted: str = "submitted"
) -> None:
    """Let nbgrader grade one submission.

    Parameters
    ----------
    course : Path
        The folder of a course that `build_course` wrote.
    assignment, student : str
        Whose submission.
    settings : GradeSettings
        How it is graded.
    submitted : str
        The folder in the course from which it is taken.

    Raises
    ------
    UnfitError
        When this file can't be graded; the 0 in the gradebook is then not a score.
    UngradedError
        When nbgrader failed in any other way, such as a full disk or a gradebook that stays locked.
    """
    with build.course_api(course) as api, warnings.catch_warnings():
        # nbgrader 0.9.6 builds a submission outside its database session.
        warnings.filterwarnings("ignore", "Object of type <Submitted", SAWarning)
        api.config.ExecuteApart.merge(asdict(settings))
        api.coursedir.submitted_directory = submitted
        for _ in range(TRIES):
            with build.caught_errors(api.log) as errors:
                result = api.autograde(assignment, student)
            if result["success"] or not any(map(_may_pass, errors)):
                break
    if not result["success"]:
        if errors and isinstance(errors[-1], UnfitError):
            raise errors[-1]
        raise UngradedError(build.failure_reason(result, errors))


def _may_pass(error: BaseException) -> bool:
    """Return whether another process interfered: it held the gradebook, or entered the same student first."""
    return isinstance(error, InvalidEntry) or "database is locked" in str(error)


def place(course: Path, step: str, student: str, assignment: str) -> Path:
    """Return the path of a student's notebook in one of nbgrader's folders.

    Parameters
    ----------
    course : Path
        The folder of the course.
    step : str
        The folder, such as "submitted".
    student, assignment : str
        Whose notebook.
    """
    return course / step / student / assignment / f"{assignment}.ipynb"


def student_variant(course: Path, student: str) -> int:
    """Return the number that chooses the inputs of a student's hidden tests: always the same, and secret like the salt.

    Parameters
    ----------
    course : Path
        A course that `build_course` wrote, with its salt.
    student : str
        The student.

    Raises
    ------
    DataError
        When the course has no salt.
    """
    marker = course / build.MARKER
    salt = read_json(marker).get("salt")
    if not salt:
        raise DataError(marker, "a salt, which `semgrid-edu course build` adds", "none")
    return int.from_bytes(hashlib.sha256(f"{salt} {student}".encode()).digest()[:8], "big")
