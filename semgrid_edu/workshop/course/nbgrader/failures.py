"""What kept nbgrader from its work, and whether a file is to blame: nbgrader itself tells it in pages of words."""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from nbgrader.api import InvalidEntry
from sqlalchemy.exc import DatabaseError

from semgrid_edu.errors import DataError

NOT_THE_FILE = (DataError, DatabaseError, InvalidEntry, KeyboardInterrupt, MemoryError, OSError)
"""Errors of the machine, the gradebook, the reference answers and whoever interrupts: no submission makes them."""


GRADEBOOK = logging.getLogger("tornado.application")
"""Where nbgrader's gradebook writes a page of traceback whenever it is locked."""


class UngradedError(Exception):
    """Grading failed for a reason that isn't the submission's: it has no grade, and can be graded another time."""


class _Causes(logging.Handler):
    """Keeps the errors that are being handled while something is written to a log."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.found: list[BaseException] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the error, if there is one.

        Parameters
        ----------
        record : LogRecord
            What is written, which isn't looked at.
        """
        if (error := sys.exc_info()[1]) is not None:
            self.found.append(error)


@contextmanager
def causes(log: logging.Logger) -> Iterator[list[BaseException]]:
    """Find the errors that nbgrader catches: it writes each to its log, and raises another that doesn't name it.

    Meanwhile its gradebook keeps silent.

    Parameters
    ----------
    log : Logger
        nbgrader's log.

    Yields
    ------
    list of BaseException
        Takes the errors while the block runs.
    """
    handler = _Causes()
    log.addHandler(handler)
    was_silent, GRADEBOOK.disabled = GRADEBOOK.disabled, True
    try:
        yield handler.found
    finally:
        GRADEBOOK.disabled = was_silent
        log.removeHandler(handler)


def why(result: dict, found: list[BaseException]) -> str:
    """Say in one line why nbgrader failed.

    Parameters
    ----------
    result : dict
        What nbgrader's API returned.
    found : list of BaseException
        What `causes` found meanwhile.

    Returns
    -------
    str
        The last error that was found; without one, what stands last in nbgrader's own words.
    """
    said = result.get("error") or result.get("log") or "no reason"
    return in_one_line(found[-1]) if found else said.strip().splitlines()[-1]


def will_pass(error: BaseException) -> bool:
    """Return whether another process was in the way: it held the gradebook, or entered the same student first.

    Parameters
    ----------
    error : BaseException
        What stopped nbgrader.
    """
    return isinstance(error, InvalidEntry) or "database is locked" in str(error)


def in_one_line(error: BaseException) -> str:
    """Return what an error says, as far as it goes on one line.

    Parameters
    ----------
    error : BaseException
        The error.

    Returns
    -------
    str
        Its kind, unless that is one of this package, and its first line.
    """
    says = [*str(error).splitlines(), ""][0][:300]
    ours = isinstance(error, DataError | UngradedError)
    return says if ours else f"{type(error).__name__}: {says}".removesuffix(": ")
