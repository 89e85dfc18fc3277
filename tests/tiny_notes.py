"""Runs that only write a file: processes that do them load little besides torch."""

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from semgrid_edu.workshop.paper.run import Run


@dataclass(frozen=True)
class Note(Run):
    """Writes a line that depends on its own label and on the lines of those that it needs; counts how often."""

    label: str
    after: tuple["Note", ...] = ()
    fails_without: str = ""
    seconds_each: float = 0.0

    kind = pace = "note"
    steps, trial_seconds = 2, 30.0
    tag = property(lambda self: self.label)
    needs = property(lambda self: self.after)

    def work(self, root: Path, device: str) -> None:
        with (self.folder(root) / "started").open("a") as file:
            file.write("x")
        time.sleep(self.seconds_each)
        if self.fails_without and not (root / self.fails_without).exists():
            raise RuntimeError(f"no {self.fails_without}")
        lines = [self.label, *((run.folder(root) / "line").read_text() for run in self.after)]
        (self.folder(root) / "line").write_text(hashlib.sha256("\n".join(lines).encode()).hexdigest())


def wait_for(condition: Callable[[], bool], seconds: float = 120) -> None:
    """Wait until a condition holds; a hang fails."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)
