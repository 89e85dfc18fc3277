"""Every exercise is graded with its catalogue of answers (`entries`); one test class per exercise.

The catalogue is graded in a warm session (`warm`), because nbgrader would need minutes. nbgrader grades three of the
students, and must give them the same points and messages.
"""

import re
from unittest import mock

import pytest
from answers_in_disguise import HONEST, POINTLESS, disguise, spoil
from entries import Entry, entries_of, exercises, kind, pack, source_of
from nbgrader_scores import autograde, tasks
from submissions import reference_answers, submission
from warm import grade_warm, warm_processes

from semgrid_edu.workshop.course.nbgrader import preprocessors
from semgrid_edu.workshop.course.nbgrader.preprocessors import prepare, prepared_folder
from semgrid_edu.workshop.course.sandbox.limits import Limits

TIMEOUT = {"answer": 30, "endless loop": 1}
"""Seconds that a cell may take: plenty for an answer on a busy machine, little for a loop that uses all of it."""


def coded(source, answers):
    """Return the answers that are code."""
    return [answers[task] for task, names in tasks(source).items() if names != (task,)]


class Checks:
    """The reference gets full marks, the stub none, and each entry loses its points in its own task only."""

    exercise: str
    entries: list[Entry]

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
    def students(cls, reference):
        """Each student's answers by task: the reference, the stub, and the entries, several to a student."""
        packed = pack(cls.entries)
        codes = [{task: entry.code(reference) for task, entry in answers.items()} for answers in packed]
        return {"reference": reference, "stub": {}} | {f"student-{n}": reference | own for n, own in enumerate(codes)}

    @pytest.fixture(scope="class")
    @classmethod
    def course(cls, new_course):
        return new_course()

    @pytest.fixture(scope="class")
    @classmethod
    def start(cls, nursery, source, course):
        """A function that starts a warm process."""
        with warm_processes(nursery, source, prepared_folder(course, cls.exercise)) as start:
            yield start

    @pytest.fixture(scope="class")
    @classmethod
    def graded(cls, source, students, start):
        """(score, points, message) of each student and task, from one warm session.

        Two students come first whose functions overwrite their arguments, which must not affect anyone after them. To
        save time, only the tests of a student's entries run, but for one student, for whom all run.
        """
        spoilt = {code: spoil(code) for code in coded(source, students["reference"])}
        greedy = {task: spoilt.get(code, code) for task, code in students["reference"].items()}
        grade_warm(source, greedy, start, TIMEOUT["answer"])
        grade_warm(source, students["reference"], start, TIMEOUT["answer"], unseen=spoilt)
        own = {f"student-{n}": answers for n, answers in enumerate(pack(cls.entries))}
        tested = own | {cls.incomplete(): None}

        def grade(name):
            timeout = TIMEOUT[kind(own[name]) if name in own else "answer"]
            return cls.by_task(source, grade_warm(source, students[name], start, timeout, tested=tested.get(name)))

        return {name: grade(name) for name in students}

    @classmethod
    def incomplete(cls):
        """Return the first student with entries who has the reference's answer to some task, and no endless loop."""
        everything = {entry.task for entry in cls.entries}
        packed = enumerate(pack(cls.entries))
        return next(f"student-{n}" for n, own in packed if own.keys() < everything and kind(own) == "answer")

    @pytest.fixture(scope="class")
    @classmethod
    def graded_by_nbgrader(cls, source, students, course, start):
        """The same for the first student with entries, the reference and the stub, graded by nbgrader.

        `prepare` runs the reference in fresh processes, as in a class; it uses what `start` has compiled. nbgrader then
        gets forked processes, since `test_warm` shows that they give the same results.
        """
        notebooks = {name: submission(source, students[name]) for name in ("student-0", "reference", "stub")}
        prepare(course, cls.exercise, Limits().memory)
        with mock.patch.object(preprocessors, "starter", return_value=lambda _: start()):
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

    def test_nbgrader_and_the_warm_session_agree(self, graded, graded_by_nbgrader):
        assert {student: graded[student] for student in graded_by_nbgrader} == graded_by_nbgrader

    def test_entry(self, graded, entry):
        student = next(n for n, answers in enumerate(pack(self.entries)) if answers.get(entry.task) is entry)
        score, points, message = graded[f"student-{student}"][entry.task]
        assert points - score == entry.loses, message or "no test noticed"
        assert re.sub(r"\s+", " ", entry.says) in re.sub(r"\s+", " ", message)

    def test_other_tasks_keep_their_points(self, graded):
        student = self.incomplete()
        own = pack(self.entries)[int(student.removeprefix("student-"))]
        others = {task: result for task, result in graded[student].items() if task not in own}
        assert others
        assert {task: message for task, (score, points, message) in others.items() if score < points} == {}

    @pytest.mark.parametrize("kind", POINTLESS)
    def test_known_inputs_alone_earn_nothing(self, source, reference, start, kind):
        unseen = {code: code + disguise(code, POINTLESS[kind], pointless=True) for code in coded(source, reference)}
        scores = self.by_task(source, grade_warm(source, reference, start, TIMEOUT["answer"], unseen))
        assert {task: score for task, (score, _, _) in scores.items() if score} == {}

    @pytest.mark.parametrize("kind", HONEST)
    def test_other_types_of_numbers_cost_nothing(self, source, reference, start, kind):
        answers = reference | {
            task: code + disguise(code, HONEST[kind], pointless=False)
            for task, code in reference.items()
            if code in coded(source, reference)
        }
        scores = self.by_task(source, grade_warm(source, answers, start, TIMEOUT["answer"]))
        assert {task: message for task, (score, points, message) in scores.items() if score < points} == {}

    def test_catalogue_is_complete(self, source):
        """Each task of code has another right way, a mistake for its visible tests and one for its hidden ones."""
        ways = {task: [] for task, names in tasks(source).items() if names != (task,)}
        for entry in self.entries:
            ways[entry.task].append(entry)
        for task, entries in ways.items():
            hidden = ["on inputs you haven't seen" in entry.says for entry in entries if entry.loses]
            assert 1 <= len(entries) - len(hidden) <= 2, f"{task}: one or two other right ways"
            assert {False, True} == {*hidden}, f"{task}: a mistake that visible tests find, and one for hidden ones"
            assert len(hidden) <= 4, f"{task}: at most four mistakes"
        assert any("before timeout" in entry.says for entry in self.entries), "an endless loop"


for exercise in exercises():
    globals()[f"Test_{exercise}"] = type(
        f"Test_{exercise}", (Checks,), {"exercise": exercise, "entries": entries_of(exercise)}
    )


def test_a_wrong_jackknife_costs_nothing_in_task_4():
    """A right answer to task 4 of exercise 12 that builds on task 3 is graded beside a wrong answer to task 3."""
    packs = [own for own in pack(entries_of("12_experiments")) if "paired" in own]  # the last ones lack some tasks
    beside = [own for own in packs if "jackknife that is wrong" in own["paired"].title]
    assert [own["towns"].loses > 0 for own in beside] == [True]
