"""What grading must do with every exercise, one class an exercise, with its catalogue of answers.

nbgrader grades three students of each exercise. The whole catalogue is graded in a warm session (`warm`), which must
give these three the same points and messages.
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
"""Seconds for a cell: enough for any answer on a busy machine; what each call of an endless loop costs."""


def coded(source, answers):
    """The texts of the answers that are code."""
    return [answers[task] for task, names in tasks(source).items() if names != (task,)]


class Checks:
    """The reference earns all, the stub nothing, and each entry loses what it should; tasks don't touch each other."""

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
        """Answers to each task, by student: the reference, the stub, and all entries packed."""
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
        """A function that returns a warm process."""
        with warm_processes(nursery, source, prepared_folder(course, cls.exercise)) as start:
            yield start

    @pytest.fixture(scope="class")
    @classmethod
    def graded(cls, source, students, start):
        """Every student's (score, points, message) by student and task, from one warm session.

        Before them all comes a student who spoils what tests call her functions with: nobody may miss it. Of a packed
        student the tests of the entries alone are run; of one who leaves a task to the reference, all.
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
        """The first packed student without an endless loop who leaves a task to the reference."""
        everything = {entry.task for entry in cls.entries}
        packed = enumerate(pack(cls.entries))
        return next(f"student-{n}" for n, own in packed if own.keys() < everything and kind(own) == "answer")

    @pytest.fixture(scope="class")
    @classmethod
    def graded_by_nbgrader(cls, source, students, course, start):
        """The same of the first packed student, the reference and the stub, graded by nbgrader.

        `start` comes first, because nbgrader then needn't compile again what the warm session has compiled. The
        reference passes once in processes of its own, as in a class (`prepare`). What nbgrader makes of answers is seen
        in forked ones; `test_warm` compares the two.
        """
        notebooks = {name: submission(source, students[name]) for name in ("student-0", "reference", "stub")}
        prepare(course, cls.exercise, Limits().memory)
        with mock.patch.object(preprocessors, "starter", return_value=lambda _: start()):
            scores = autograde(course, cls.exercise, notebooks, TIMEOUT["answer"])
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


def test_the_reference_jackknife_is_not_needed_to_pass_task_4():
    """A right answer to task 4 of exercise 12 that builds on task 3 is graded beside a wrong answer to task 3."""
    beside = [own for own in pack(entries_of("12_experiments")) if "jackknife that is wrong" in own["paired"].title]
    assert [own["towns"].loses > 0 for own in beside] == [True]
