"""Runs of seconds, which processes import: some that only write a file, and training runs on hand-made data."""

import hashlib
import json
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import torch
from tiny_drive import DATE, write_tiny_drive

from semgrid_edu.workshop.paper.runs import data_runs
from semgrid_edu.workshop.paper.runs.data_runs import ArraysRun, DataRun
from semgrid_edu.workshop.paper.runs.training_runs import GridStageRun, ImageStageRun
from semgrid_edu.workshop.paper.runs.variants import Variant
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.simulation.datasets import DatasetRecipe, Route

TRAIN, TEST = (Route(split, 2, False) for split in ("train", "test"))
data_runs.RECIPE_OF["tiny"] = DatasetRecipe("tiny", "KITTI-14", (TRAIN,) * 6)
data_runs.RECIPE_OF["tinytested"] = DatasetRecipe("tinytested", "KITTI-14", (TRAIN,) * 6 + (TEST,) * 2)


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


@dataclass(frozen=True)
class SharedNote(Note):
    """A note that several processes write together, line by line until its time is over."""

    is_training = True

    def work(self, root: Path, device: str) -> None:
        if self.fails_without and not (root / self.fails_without).exists():
            raise RuntimeError(f"no {self.fails_without}")
        rank, processes, end = os.environ["RANK"], os.environ["WORLD_SIZE"], time.monotonic() + self.seconds_each
        with (self.folder(root) / f"lines-{rank}").open("a") as file:
            while not file.tell() or time.monotonic() < end:
                file.write(f"{rank} of {processes}, {torch.get_num_threads()} thread\n")
                file.flush()
                time.sleep(0.05)


@dataclass(frozen=True)
class HandMadeData(DataRun):
    """The drives of a recipe written by hand, two frames each, the last one labelled: six of "tiny" to learn from."""

    data: str = "tiny"

    def work(self, root: Path, device: str) -> None:
        folder, splits = self.dataset_dir(root), {}
        folder.mkdir(exist_ok=True)
        for k, route in enumerate(data_runs.RECIPE_OF[self.data].routes, start=1):
            write_tiny_drive(folder, f"{k:04d}", n_frames=2, labelled=(1,))
            splits.setdefault(route.split, []).append({"date": DATE, "drive": f"{k:04d}", "frame": 1})
        index = {"name": self.data, "label_set": "KITTI-14", "splits": splits}
        (folder / "dataset.json").write_text(json.dumps(index))


def tiny_training_runs(iterations: int = 2) -> list[GridStageRun]:
    """Two networks that share an image stage."""
    arrays = ArraysRun(HandMadeData(), "train")
    image_stage = ImageStageRun(arrays, "segnet", seed=1, iterations=iterations)
    variants = Variant(), Variant(n_planes=2, balanced=False)
    return [GridStageRun(image_stage, arrays, iterations, variant) for variant in variants]


def results(root: Path) -> dict[str, bytes]:
    """The bytes of every result: all but what was printed, when it was, and how long it took."""
    told = ("output.txt", "ended.json", "started", "provenance.json")
    files = [path for path in root.rglob("*") if path.is_file() and path.name not in told]
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in sorted(files) if "cache" not in path.parts}


def wait_for(condition: Callable[[], bool], seconds: float = 120) -> None:
    """Wait until a condition holds; a hang fails."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)
