"""What every exercise must do when nbgrader grades it; one subclass an exercise, with its catalogue of answers."""

import re
from dataclasses import dataclass

import pytest

from semgrid_edu.workshop.course.nbgrader.autograde import autograde, reference_answers, submission, tasks
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS

TIMEOUT = {"answer": 12, "endless loop": 4}
"""Seconds for a cell: enough for any answer on a busy machine; what each call of an endless loop costs."""


@dataclass(frozen=True)
class Entry:
    """One answer to one task, and what it must lose."""

    title: str
    task: str
    code: str
    loses: float = 0
    says: str = ""

    @property
    def kind(self) -> str:
        """Whether the answer ends, as `TIMEOUT` names it."""
        return "endless loop" if "before timeout" in self.says else "answer"


def mistake(title: str, *, task: str, loses: float, says: str, code: str) -> Entry:
    """Catalogue a real mistake: the points it must lose, and words that must be in its message."""
    return Entry(title, task, code, loses, says)


def right(title: str, *, task: str, code: str) -> Entry:
    """Catalogue another right way, which must earn full marks."""
    return Entry(title, task, code)


def pack(entries) -> list[dict[str, Entry]]:
    """Share entries out to students: each answers every task with at most one entry, so that few runs try them all."""
    students: list[dict[str, Entry]] = []
    for entry in entries:
        free = next(
            (student for student in students if entry.task not in student and kind(student) == entry.kind), None
        )
        if free is None:
            students.append(free := {})
        free[entry.task] = entry
    return students


def kind(student: dict[str, Entry]) -> str:
    """The kind of all of a student's entries."""
    return next(iter(student.values())).kind


class GraderChecks:
    """The reference earns all, the stub nothing, and each entry loses what it should; tasks don't touch each other."""

    exercise: str
    entries: tuple[Entry, ...]

    @pytest.fixture(scope="class")
    @classmethod
    def source(cls):
        return NOTEBOOKS / "src" / "exercises" / f"{cls.exercise}.py"

    @pytest.fixture(scope="class")
    @classmethod
    def graded(cls, source, new_course):
        """Every student's score of every task: (score, points, message), by student and task."""
        reference = reference_answers(source)
        course, students = new_course(), {"answer": {"reference": reference, "stub": {}}, "endless loop": {}}
        for number, answers in enumerate(pack(cls.entries)):
            codes = {task: entry.code for task, entry in answers.items()}
            students[kind(answers)][f"student-{number}"] = reference | codes
        scores = {}
        for which, seconds in TIMEOUT.items():
            notebooks = {name: submission(source, answers) for name, answers in students[which].items()}
            scores |= autograde(course, cls.exercise, notebooks, timeout=seconds)
        return {student: cls.by_task(source, cells) for student, cells in scores.items()}

    @staticmethod
    def by_task(source, cells):
        """Add up test cells; a written answer waits for a person and is left out once it has been given."""
        return {
            task: (
                sum(cells[name].score for name in names),
                sum(cells[name].points for name in names),
                "\n".join(cells[name].message for name in names),
            )
            for task, names in tasks(source).items()
            if all(cells[name].score is not None for name in names)
        }

    def test_reference_earns_full_marks(self, graded):
        for task, (score, points, message) in graded["reference"].items():
            assert score == points, f"{task}: {message}"

    def test_untouched_stub_earns_nothing(self, graded, source):
        assert {task: score for task, (score, _, _) in graded["stub"].items()} == dict.fromkeys(tasks(source), 0)

    def test_entry(self, graded, entry):
        student = next(n for n, answers in enumerate(pack(self.entries)) if answers.get(entry.task) is entry)
        score, points, message = graded[f"student-{student}"][entry.task]
        assert points - score == entry.loses, message or "no test noticed"
        assert re.sub(r"\s+", " ", entry.says) in re.sub(r"\s+", " ", message)

    def test_other_tasks_keep_their_points(self, graded):
        for number, answers in enumerate(pack(self.entries)):
            for task, (score, points, message) in graded[f"student-{number}"].items():
                assert task in answers or score == points, f"student-{number}, {task}: {message}"

    def test_catalogue_is_complete(self, source):
        """For each task of code two other right ways, a mistake for its visible and one for its hidden tests."""
        coded = [task for task, names in tasks(source).items() if names != (task,)]
        for task in coded:
            ways = [entry for entry in self.entries if entry.task == task]
            assert sum(not entry.loses for entry in ways) >= 2, f"{task}: two other right ways"
            hints = [entry.says for entry in ways if entry.loses]
            assert any("on inputs you haven't seen" not in hint for hint in hints), (
                f"{task}: one that visible tests find"
            )
            assert any("on inputs you haven't seen" in hint for hint in hints), (
                f"{task}: one that only hidden tests find"
            )
        assert any("before timeout" in entry.says for entry in self.entries), "an endless loop"
