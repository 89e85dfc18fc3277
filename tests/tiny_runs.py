"""Training runs of seconds on hand-made data, which processes import."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from tiny_drive import write_tiny_dataset

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
        n_drives = Counter(route.split for route in data_runs.RECIPE_OF[self.data].routes)
        write_tiny_dataset(self.dataset_dir(root), n_frames=2, name=self.data, **n_drives)


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
