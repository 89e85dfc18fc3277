"""Training runs of seconds on hand-made data, which processes import."""

import json
from dataclasses import dataclass
from pathlib import Path

from tiny_drive import DATE, write_tiny_drive

from semgrid_edu.workshop.paper import data_runs
from semgrid_edu.workshop.paper.data_runs import ArraysRun, DataRun
from semgrid_edu.workshop.paper.training_runs import GridStageRun, ImageStageRun
from semgrid_edu.workshop.paper.variants import Variant
from semgrid_edu.workshop.simulation.datasets import DatasetRecipe, Route

TRAIN, TEST = (Route(split, 2, every=2) for split in ("train", "test"))
data_runs.RECIPE_OF["tiny"] = DatasetRecipe("tiny", "KITTI-14", (TRAIN,) * 6)
data_runs.RECIPE_OF["tinytested"] = DatasetRecipe("tinytested", "KITTI-14", (TRAIN,) * 6 + (TEST,) * 2)


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
