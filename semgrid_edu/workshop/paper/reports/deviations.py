"""What differs from the paper at each scale: it stands below every table (section 4)."""

from collections.abc import Sequence

from semgrid_edu.crf import CrfParams
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.paper.runs.data_runs import RECIPE_OF
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.paper.runs.score_runs import WEIGHTS_FOR_CLASSES
from semgrid_edu.workshop.scoring.statistics import MIN_DRIVES
from semgrid_edu.workshop.simulation.datasets import FORMAT
from semgrid_edu.workshop.simulation.sensors.rig import KITTI_AHEAD
from semgrid_edu.workshop.training_run import PAPER_IMAGE, architecture

_TEXTS = table_beside(__file__)
CHOSEN_ON = 1
"""The version of the simulator on whose test streets the compact SegNet was chosen."""


def frame_counts(data: str) -> dict[str, tuple[int, int]]:
    """Return by split the numbers of labelled frames and of drives of a data set.

    Parameters
    ----------
    data : str
        A key of `RECIPE_OF`.
    """
    labelled: dict[str, list[int]] = {}
    for route in RECIPE_OF[data].routes:
        labelled.setdefault(route.split, []).append(len(route.labelled))
    return {split: (sum(frames), len(frames)) for split, frames in labelled.items()}


def deviations(scale: Scale, field: str, beside_gpu: Sequence[str] | None = None) -> list[str]:
    """Return in what an experiment differs from the paper's, one sentence each.

    Parameters
    ----------
    scale : Scale
        How large it is.
    field : str
        On which data: "kitti", "chroma" or "synthia".
    beside_gpu : sequence of str, optional
        The names of the training runs that were done on the CPU when others were done on a GPU; left out when all were
        done on the CPU.
    """
    labels = _TEXTS["labels"]["true" if field == "synthia" else "made"]
    return [
        _data(scale, field),
        *_scanner(scale, field),
        *labels,
        *_networks(scale),
        _training(scale),
        *_devices(beside_gpu),
        *_said_openly(scale, field),
    ]


def _devices(beside_gpu: Sequence[str] | None) -> list[str]:
    """Return what was trained on a GPU, and what beside it on the CPU, seeds not told apart."""
    if beside_gpu is None:
        return []
    texts, names = _TEXTS["training"], dict.fromkeys(name.rsplit("-seed", 1)[0] for name in beside_gpu)
    return [texts["gpu"] + texts["beside_gpu"].format(runs=", ".join(names)) * bool(names)]


def _said_openly(scale: Scale, field: str) -> list[str]:
    """Return what was chosen on which streets, and on how many drives the numbers rest."""
    texts, drives = _TEXTS["chosen"], frame_counts(getattr(scale, field))["test"][1]
    least = texts["interval"].format(least=MIN_DRIVES)
    if field != "kitti":
        return [least]
    fresh = texts["same" if FORMAT == CHOSEN_ON else "fresh"]
    chosen = [texts["network"].format(fresh=fresh)] if scale.preset == "compact" else []
    return [*chosen, _crf_search(texts), texts["runs"].format(drives=drives), least]


def _crf_search(texts: dict[str, str]) -> str:
    """Return what the search for class accuracy found; weights below a twentieth of the usual ones refine nothing."""
    weight, usual = max(max(row.values()) for row in WEIGHTS_FOR_CLASSES.values()), CrfParams().w_spatial
    return texts["crf"].format(weight=weight, usual=usual, off=texts["off"] * (weight < usual / 20))


def _data(scale: Scale, field: str) -> str:
    data, paper = getattr(scale, field), _TEXTS["frames"].get(field)
    counts = frame_counts(data).items()
    ours = " and ".join(f"{frames} to {split} in {drives} drives" for split, (frames, drives) in counts)
    theirs = f" ({paper[0]} to train and {paper[1]} to test in the paper)" if paper else ""
    return f"Simulated streets, {data}, in place of {_TEXTS['replaced'][field]}: labelled frames {ours}{theirs}."


def _scanner(scale: Scale, field: str) -> list[str]:
    """Return what the scanner is like, where there is one, and it isn't the coarse one of small data sets."""
    recipe = RECIPE_OF[getattr(scale, field)]
    return [_TEXTS["labels"]["scanner"]] * (recipe.rig == KITTI_AHEAD and not recipe.dense)


def _networks(scale: Scale) -> list[str]:
    if scale.preset == "paper":
        return []
    usual, paper = architecture("segnet", scale.preset), architecture("segnet", "paper")
    ours, theirs = (" x ".join(map(str, size)) for size in (usual.image_size, PAPER_IMAGE))
    cells = {"our_cell": usual.grid.cell, "their_cell": paper.grid.cell}
    return [_TEXTS["networks"]["compact"].format(our_size=ours, their_size=theirs, **cells)]


def _training(scale: Scale) -> str:
    text = _TEXTS["training"][scale.preset]
    return text.format(image_steps=scale.image_iterations, grid_steps=scale.grid_iterations)
