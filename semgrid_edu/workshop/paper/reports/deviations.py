"""What differs from the paper at each scale: it stands below every table (section 4)."""

from semgrid_edu.training.run import PAPER_IMAGE, architecture
from semgrid_edu.workshop.paper.runs.data_runs import RECIPE_OF
from semgrid_edu.workshop.paper.runs.scales import Scale

REPLACED = {"kitti": "KITTI", "chroma": "INRIA-Chroma", "synthia": "SYNTHIA"}
"""The paper's data set in whose place each simulated one stands."""

PAPER_FRAMES = {"kitti": (142, 110), "chroma": (146, 130), "synthia": None}
"""Labelled frames of the paper's data sets to learn from and to test; the paper doesn't say how many SYNTHIA has."""


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


def deviations(scale: Scale, field: str) -> list[str]:
    """Return in what an experiment differs from the paper's, one sentence each.

    Parameters
    ----------
    scale : Scale
        How large it is.
    field : str
        On which data: "kitti", "chroma" or "synthia".
    """
    return [_data(scale, field), *_labels(field), *_networks(scale), _training(scale)]


def _data(scale: Scale, field: str) -> str:
    data, paper = getattr(scale, field), PAPER_FRAMES[field]
    counts = frame_counts(data).items()
    ours = " and ".join(f"{frames} to {split} in {drives} drives" for split, (frames, drives) in counts)
    theirs = f" ({paper[0]} to train and {paper[1]} to test in the paper)" if paper else ""
    return f"Simulated streets, {data}, in place of {REPLACED[field]}: labelled frames {ours}{theirs}."


def _labels(field: str) -> list[str]:
    if field == "synthia":
        return ["Cells without a label are void; the paper doesn't say what they are."]
    return [
        "Labels are made with the LIDAR as in the paper, from image labels and a calibration with errors like those of "
        "real data; no human corrected them.",
        "The fourteen classes are our reading: ten semantic ones and four kinds of unknown by occupancy state.",
    ]


def _networks(scale: Scale) -> list[str]:
    if scale.preset == "paper":
        return []
    usual, paper = architecture("segnet", scale.preset), architecture("segnet", "paper")
    ours, theirs = (" x ".join(map(str, size)) for size in (usual.image_size, PAPER_IMAGE))
    return [
        f"Compact networks of less than a million parameters, images of {ours} pixels ({theirs} in the paper), "
        f"cells of {usual.grid.cell:g} m ({paper.grid.cell:g} m)."
    ]


def _training(scale: Scale) -> str:
    first = f"No ImageNet weights: the image network first learns from image labels, {scale.image_iterations} steps"
    if scale.preset != "compact":
        return f"{first}."
    return (
        f"{first}; then the whole network from grids, {scale.grid_iterations} steps (at most 2000 in the paper), with "
        "a learning rate of 0.05 that falls along a cosine (0.001), class weights between 1/4 and 4 (no limits), and "
        "jittered and mirrored images."
    )
