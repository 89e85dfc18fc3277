"""Every exercise is graded with its catalogue of answers (`entries`); one test class per exercise.

Everything is graded in a warm session (`warm`), because nbgrader would need minutes; `test_class` shows that both give
the same points and messages. nbgrader's part knows cells, points and errors, nothing of what an exercise is about.
"""

import re

import pytest
from answers_in_disguise import HONEST, POINTLESS, disguise
from entries import Entry, entries_of, exercises, kind, pack, source_of
from nbgrader_scores import tasks
from submissions import reference_answers
from warm import grade_disguised, grade_warm, warm_processes

from semgrid_edu.workshop.course.nbgrader.preprocessors import use_instructor
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS

TIMEOUT = {"answer": 30, "endless loop": 1}
"""Seconds that a cell may take: plenty for an answer on a busy machine, little for a loop that uses all of it."""


class Checks:
    """Right answers get full marks, the stub none, and each entry loses its points in its own task only."""

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
    def start(cls, nursery, source, disguised):
        """A function that starts a warm process.

        A student comes first whose functions overwrite their arguments, which must not affect anyone after her.
        """
        with warm_processes(nursery, source) as start:
            grade_warm(source, disguised, start, TIMEOUT["answer"], first="_kind = 'spoil'")
            yield start

    @pytest.fixture(scope="class")
    @classmethod
    def graded(cls, source, reference, start):
        """(score, points, message) of each student and task; only the tests of a student's entries run."""
        answers = [reference | {task: entry.code(reference) for task, entry in pack.items()} for pack in cls.packs]
        return [
            cls.by_task(source, grade_warm(source, own, start, TIMEOUT[kind(pack)], pack))
            for own, pack in zip(answers, cls.packs, strict=True)
        ]

    @pytest.fixture(scope="class")
    @classmethod
    def errors(cls, source, disguised, start):
        """The errors of the right answers in disguise, by kind and test cell.

        The hidden inputs are others than the published ones, on which the catalogue is graded.
        """
        use_instructor(NOTEBOOKS / "instructor", 2027)
        try:
            return grade_disguised(source, disguised, HONEST, POINTLESS, start, TIMEOUT["answer"])
        finally:
            use_instructor(NOTEBOOKS / "instructor")

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

    def test_untouched_stub_earns_nothing(self, source, start):
        scores = self.by_task(source, grade_warm(source, {}, start, TIMEOUT["answer"]))
        assert {task: score for task, (score, _, _) in scores.items()} == dict.fromkeys(tasks(source), 0)

    def test_entry(self, graded, entry):
        student = next(n for n, pack in enumerate(self.packs) if pack.get(entry.task) is entry)
        score, points, message = graded[student][entry.task]
        assert points - score == entry.loses, message or "no test noticed"
        assert re.sub(r"\s+", " ", entry.says) in re.sub(r"\s+", " ", message)

    def test_known_inputs_alone_earn_nothing(self, source, errors):
        coded = {name for task, names in tasks(source).items() for name in names if name != task}
        for guess in POINTLESS:
            assert {name for name in coded if not errors[guess][name]} == set(), guess

    @pytest.mark.parametrize("kind", HONEST)
    def test_right_answers_in_other_types_cost_nothing(self, errors, kind):
        assert {name: found for name, found in errors[kind].items() if found} == {}

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
            assert len(hidden) <= 4, f"{task}: at most four mistakes"

    def test_a_right_way_stands_beside_mistakes_in_other_tasks(self):
        """So `test_entry` shows that a mistake costs nothing in other tasks."""
        for own in self.packs:
            assert any(entry.loses for entry in own.values()), [entry.title for entry in own.values()]


for exercise in exercises():
    globals()[f"Test_{exercise}"] = type(
        f"Test_{exercise}",
        (Checks,),
        {"exercise": exercise, "entries": (found := entries_of(exercise)), "packs": pack(found)},
    )


def test_a_wrong_jackknife_costs_nothing_in_task_4():
    """A right answer to task 4 of exercise 12 that builds on task 3 is graded beside a wrong answer to task 3."""
    packs = [own for own in pack(entries_of("12_experiments")) if {"towns", "paired"} <= own.keys()]
    beside = [own for own in packs if "jackknife that is wrong" in own["paired"].title]
    assert [own["towns"].loses > 0 for own in beside] == [True]
