"""The catalogue of an exercise: other right ways and real mistakes, read from `catalogue/NAME.toml`.

Each task has a list of rows. `[title, code]` is another right way. `[title, loses, says, code]` is a mistake, with the
points that it must lose and words of the message. Where the reference needs few changes, edits replace the code:
`[title, loses, says, old, new, old, new]`, each `old` exactly once in the reference.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path

from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS

CATALOGUE = Path(__file__).with_name("catalogue")

ENDLESS = ("before timeout", "does not come to an end")
"""What a visible test and a hidden one report of an endless loop."""


@dataclass(frozen=True)
class Entry:
    """An answer to one task, and what it must lose."""

    title: str
    task: str
    text: tuple[str, ...]
    loses: float = 0
    says: str = ""

    @property
    def kind(self) -> str:
        """Whether the answer comes to an end."""
        return "endless loop" if any(words in self.says for words in ENDLESS) else "answer"

    def code(self, reference: dict[str, str]) -> str:
        """Return the answer; `reference` has the right ones, by task."""
        if len(self.text) == 1:
            return self.text[0]
        code = reference[self.task]
        for old, new in zip(self.text[::2], self.text[1::2], strict=True):
            if (times := code.count(old)) != 1:
                raise ValueError(
                    f"{self.task}, {self.title!r}: expected {old!r} once in the reference, found it {times} times"
                )
            code = code.replace(old, new)
        return code


def exercises() -> list[str]:
    """Return the names of all exercises that have a catalogue."""
    return sorted(path.stem for path in CATALOGUE.glob("*.toml"))


def source_of(exercise: str) -> Path:
    """Return the source of an exercise."""
    return NOTEBOOKS / "src" / "exercises" / f"{exercise}.py"


def entries_of(exercise: str) -> list[Entry]:
    """Read the catalogue of an exercise."""
    tasks = tomllib.loads((CATALOGUE / f"{exercise}.toml").read_text(encoding="utf-8"))
    return [entry(task, *row) for task, rows in tasks.items() for row in rows]


def entry(task: str, title: str, *row: str | float) -> Entry:
    """Return the entry that a row of the catalogue describes."""
    if isinstance(row[0], str):
        return Entry(title, task, row)
    loses, says, *text = row
    return Entry(title, task, tuple(text), loses, says)


def pack(entries: list[Entry]) -> list[dict[str, Entry]]:
    """Share entries out to students: each answers a task with at most one entry, so that few runs try them all.

    Each task begins with another student, so that right ways stand beside mistakes in other tasks.
    """
    students = []
    for wanted in ("answer", "endless loop"):
        tasks: dict[str, list[Entry]] = {}
        for one in (one for one in entries if one.kind == wanted):
            tasks.setdefault(one.task, []).append(one)
        some: list[dict[str, Entry]] = [{} for _ in range(max(map(len, tasks.values()), default=0))]
        for first, (task, own) in enumerate(tasks.items()):
            for k, one in enumerate(own, start=first):
                some[k % len(some)][task] = one
        students += some
    return students


def kind(student: dict[str, Entry]) -> str:
    """Return the kind of all of a student's entries."""
    return next(iter(student.values())).kind
