"""Every exercise is graded with its catalogue of answers (`entries`); one test class per exercise.

The catalogue is graded in a warm session (`warm`), because nbgrader would need minutes; `test_warm` shows that both
give the same points and messages. nbgrader grades the reference and the stub.
"""

import re
from itertools import chain, repeat
from unittest import mock

import pytest
from answers_in_disguise import HONEST, POINTLESS, disguise
from entries import Entry, entries_of, exercises, kind, pack, source_of
from nbgrader_scores import autograde, tasks
from submissions import reference_answers, submission
from warm import grade_warm, passed_unseen, warm_processes

from semgrid_edu.workshop.course.nbgrader import preprocessors
from semgrid_edu.workshop.course.sandbox.process import StudentProcess

TIMEOUT = {"answer": 30, "endless loop": 1}
"""Seconds that a cell may take: plenty for an answer on a busy machine, little for a loop that uses all of it."""


class Checks:
    """The reference gets full marks, the stub none, and each entry loses its points in its own task only."""

    exercise: str
    entries: list[Entry]
    packs: list[dict[str, Entry]]
    """The entries, several to a student."""

    @pytest.fixture(scope="class")
    @classmethod
    def source(cls):
        return source_of(cls.exercise)

    @pytest.fixture(scope="class")
    @classmethod
    def reference(cls, source):
        """The right answers, by task."""
        return reference_answers(source)

    @pytest.fixture(scope="class")
    @classmethod
    def disguised(cls, source, reference):
        """The right answers with the code that changes their results on demand."""
        coded = [task for task, names in tasks(source).items() if names != (task,)]
        return reference | {task: disguise(reference[task]) for task in coded}

    @pytest.fixture(scope="class")
    @classmethod
    def students(cls, reference):
        """The answers of the students that have entries."""
        return [reference | {task: entry.code(reference) for task, entry in pack.items()} for pack in cls.packs]

    @pytest.fixture(scope="class")
    @classmethod
    def course(cls, new_course):
        return new_course(cls.exercise)

    @pytest.fixture(scope="class")
    @classmethod
    def start(cls, nursery, source, course):
        """A function that starts a warm process."""
        with warm_processes(nursery, source, course / "prepared" / cls.exercise) as start:
            yield start

    @pytest.fixture(scope="class")
    @classmethod
    def graded(cls, source, students, disguised, start):
        """(score, points, message) of each student and task, from one warm session.

        A student comes first whose functions overwrite their arguments, which must not affect anyone after her. To
        save time, only the tests of a student's entries run, but for one student, for whom all run.
        """
        grade_warm(source, disguised, start, TIMEOUT["answer"], first="_kind = 'spoil'")
        tested = [None if n == cls.incomplete() else pack for n, pack in enumerate(cls.packs)]
        return [
            cls.by_task(source, grade_warm(source, answers, start, TIMEOUT[kind(pack)], tasks_of_pack))
            for answers, pack, tasks_of_pack in zip(students, cls.packs, tested, strict=True)
        ]

    @classmethod
    def incomplete(cls):
        """Return the first student who has the reference's answer to some task, and no endless loop."""
        everything = {entry.task for entry in cls.entries}
        return next(n for n, pack in enumerate(cls.packs) if pack.keys() < everything and kind(pack) == "answer")

    @pytest.fixture(scope="class")
    @classmethod
    def graded_by_nbgrader(cls, source, reference, course, start):
        """The same for the reference and the stub, graded by nbgrader.

        The first process is a fresh one, as in a class, with what `start` has compiled; the others are forked.
        """
        (course / "prepared" / f"{cls.exercise}.passed").touch()
        processes = chain([StudentProcess], repeat(lambda *_, **__: start()))
        notebooks = {"reference": submission(source, reference), "stub": submission(source, {})}
        with mock.patch.object(preprocessors, "StudentProcess", side_effect=lambda *a, **k: next(processes)(*a, **k)):
            scores = autograde(course, cls.exercise, notebooks, TIMEOUT["answer"])
        return {student: cls.by_task(source, cells) for student, cells in scores.items()}

    @staticmethod
    def by_task(source, cells):
        """Add up the test cells of each task, except for written answers that wait for a person."""
        return {
            task: (
                sum(cells[name].score for name in names),
                sum(cells[name].points for name in names),
                "\n".join(cells[name].message for name in names),
            )
            for task, names in tasks(source).items()
            if all(name in cells and cells[name].score is not None for name in names)
        }

    def test_reference_earns_full_marks(self, graded_by_nbgrader):
        for task, (score, points, message) in graded_by_nbgrader["reference"].items():
            assert score == points, f"{task}: {message}"

    def test_untouched_stub_earns_nothing(self, graded_by_nbgrader, source):
        scores = {task: score for task, (score, _, _) in graded_by_nbgrader["stub"].items()}
        assert scores == dict.fromkeys(tasks(source), 0)

    def test_entry(self, graded, entry):
        student = next(n for n, pack in enumerate(self.packs) if pack.get(entry.task) is entry)
        score, points, message = graded[student][entry.task]
        assert points - score == entry.loses, message or "no test noticed"
        assert re.sub(r"\s+", " ", entry.says) in re.sub(r"\s+", " ", message)

    def test_other_tasks_keep_their_points(self, graded):
        student = self.incomplete()
        others = {task: result for task, result in graded[student].items() if task not in self.packs[student]}
        assert others
        assert {task: message for task, (score, points, message) in others.items() if score < points} == {}

    def test_known_inputs_alone_earn_nothing(self, source, disguised, start):
        """And no answer that spoils its arguments affects the next one."""
        passed = passed_unseen(source, disguised, ("spoil", *POINTLESS, "right"), start, TIMEOUT["answer"])
        del passed["spoil"]
        coded = {name for task, names in tasks(source).items() for name in names if name != task}
        assert set(passed.pop("right")) == coded
        assert passed == {kind: [] for kind in POINTLESS}

    @pytest.mark.parametrize("kind", HONEST)
    def test_other_types_of_numbers_cost_nothing(self, source, disguised, start, kind):
        cells = grade_warm(source, disguised, start, TIMEOUT["answer"], first=f"_kind = {kind!r}")
        scores = self.by_task(source, cells)
        assert {task: message for task, (score, points, message) in scores.items() if score < points} == {}

    def test_catalogue_is_complete(self, source):
        """Each task of code has another right way, a mistake for its visible tests and one for its hidden ones.

        Endless loops are in exercise 00 alone: how they end is the session's affair, not the exercise's.
        """
        for task, names in tasks(source).items():
            entries = [entry for entry in self.entries if entry.task == task]
            if names == (task,):
                assert not entries, f"{task}: a person reads the answer"
                continue
            hidden = ["on inputs you haven't seen" in entry.says for entry in entries if entry.loses]
            assert 1 <= len(entries) - len(hidden) <= 2, f"{task}: one or two other right ways"
            assert {False, True} == {*hidden}, f"{task}: a mistake that visible tests find, and one for hidden ones"
            assert len(hidden) <= 5, f"{task}: at most five mistakes"


for exercise in exercises():
    globals()[f"Test_{exercise}"] = type(
        f"Test_{exercise}",
        (Checks,),
        {"exercise": exercise, "entries": (found := entries_of(exercise)), "packs": pack(found)},
    )


def test_a_wrong_jackknife_costs_nothing_in_task_4():
    """A right answer to task 4 of exercise 12 that builds on task 3 is graded beside a wrong answer to task 3."""
    packs = [own for own in pack(entries_of("12_experiments")) if "paired" in own]  # the last ones lack some tasks
    beside = [own for own in packs if "jackknife that is wrong" in own["paired"].title]
    assert [own["towns"].loses > 0 for own in beside] == [True]
