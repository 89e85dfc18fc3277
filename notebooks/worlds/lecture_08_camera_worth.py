"""What the camera is worth on a real street: networks beside baselines without one, scored by camera (section 4).

The unit of an interval is a camera: the vehicle moves two metres, so the frames of one camera show the same view.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
import typer
from numpy.typing import NDArray

from semgrid_edu.datasets.pandaset import PandasetScene
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.fast import load_net
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import IMAGE_STAGE, WEIGHTS, SemanticGridNet, unit_image
from semgrid_edu.networks.weights import read_architecture
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.storage.files import sha256, write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.training.loss import median_frequency_weights
from semgrid_edu.training.params import TrainingParams
from semgrid_edu.workshop.scoring.grids import crf_refinement, learned_log_g
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, shown
from worlds.lecture_08_counts import Counts, add_counts, as_text, camera_of, camera_scores
from worlds.lecture_08_heights import (
    HeightFusion,
    forest_grids,
    height_channels,
    height_rule,
    learn_fusion,
    scan_heights,
    scores_of_returns,
)
from worlds.lecture_08_real_streets import Part, image_size_of, open_views, splits

FUSION_STEPS = 200
"""Number of steps of each fusion network that is compared with and without heights."""

ROAD, TABLE, RULE = "always road", "table of occupancy states", "height rule"
FOREST, FOREST_WITH_IMAGE = "forest on heights and o", "forest on heights, o and image scores"

FUSIONS = {
    "fusion of o": (False, False),
    "fusion of o and heights": (False, True),
    "fusion of image and o": (True, False),
    "fusion of image, o and heights": (True, True),
}
"""The fusion networks by name: whether they see the image's scores, and heights beside o."""

FORBIDDEN = ", unknown forbidden"
"""Ends the name of a network's map in which each cell has its best semantic class: no scored cell is unknown."""


class Cells(NamedTuple):
    """The cells of some frames, frame by frame.

    Parameters
    ----------
    o : (N, 4, H, W) float32
        The occupancy grid.
    heights : (N, 2, H, W) float
        From `scan_heights`.
    learned, true : (N, H, W) uint8
        The classes that networks learn from, and those that are scored: of labelled returns of the frame's own scan.
    """

    o: NDArray
    heights: NDArray
    learned: NDArray
    true: NDArray


def without_networks(learned: Cells, tested: Cells) -> dict[str, NDArray[np.uint8]]:
    """Return the maps of the baselines that have neither network nor image, (N, H, W) by name.

    Parameters
    ----------
    learned, tested : Cells
        What is fitted to, and what is classified.
    """
    states = learned.o.argmax(axis=1)
    table = [_most_frequent(learned.true[states == state]) for state in range(N_STATES)]
    features = [_features(cells) for cells in (learned, tested)]
    return {
        ROAD: np.full_like(tested.true, KITTI_14.index("road")),
        TABLE: np.array(table, np.uint8)[tested.o.argmax(axis=1)],
        RULE: height_rule(tested.heights),
        FOREST: forest_grids([features[0]], learned.true, [features[1]]),
    }


def _most_frequent(classes: NDArray) -> int:
    """Return the most frequent semantic class; road if there is none."""
    return int(np.bincount(classes[classes < KITTI_14.n_semantic], minlength=1).argmax())


def _features(cells: Cells) -> NDArray[np.float32]:
    """Return what a forest sees of each cell, (N, 3 + 4, H, W)."""
    return np.concatenate([height_channels(cells.heights), cells.o], axis=1)


def with_networks(learned: list[Part], tested: list[Part], cells: tuple[Cells, Cells], run: Path) -> dict[str, NDArray]:
    """Return the maps of a trained network, and of what uses the scores of its image stage, (N, H, W) by name.

    A network that sees the heights of returns is scored alone: there is nothing left to add to it.

    Parameters
    ----------
    learned, tested : list of Part
        The frames that the network has learned from, and those to classify.
    cells : (Cells, Cells)
        Their cells.
    run : Path
        The folder of the training run.
    """
    learned_cells, tested_cells = cells
    maps = network_maps(tested, run / WEIGHTS)
    if read_architecture(run / WEIGHTS).uses_return_heights:
        return maps
    seen = [_image_scores(parts, run / IMAGE_STAGE) for parts in (learned, tested)]
    features = [_features(some) for some in cells]
    maps[FOREST_WITH_IMAGE] = forest_grids(
        [features[0], seen[0].at_returns], learned_cells.true, [features[1], seen[1].at_returns]
    )
    weights = median_frequency_weights(learned_cells.learned, len(KITTI_14), TrainingParams.weight_limit)
    truth = torch.from_numpy(learned_cells.learned)
    for name, (uses_image, uses_heights) in FUSIONS.items():
        beside = [height_channels(some.heights) if uses_heights else some.o[:, :0] for some in cells]
        channels = [
            torch.from_numpy(np.concatenate(both, axis=1))
            for both in zip((learned_cells.o, tested_cells.o), beside, strict=True)
        ]
        planes = seen[0].planes
        net = HeightFusion(planes.shape[1], planes.shape[2], len(KITTI_14), beside[0].shape[1], uses_image)
        learn_fusion(net, planes, channels[0], truth, torch.from_numpy(weights).float(), FUSION_STEPS)
        maps |= _both_ways(name, _logits(net, seen[1].planes, channels[1]))
    return maps


class ImageScores(NamedTuple):
    """What the image says of some frames.

    Parameters
    ----------
    planes : (N, C, D, H, W) float16
        Scores on the planes.
    at_returns : (N, C, H, W) float32
        From `scores_of_returns`.
    """

    planes: torch.Tensor
    at_returns: NDArray


@torch.inference_mode()
def _image_scores(parts: list[Part], weights: Path) -> ImageScores:
    planes = []
    at_returns = []
    for frames, numbers in parts:
        net = load_net(weights, frames.camera)
        for k in numbers:
            scores = net.segment(unit_image(frames[k].image)[None])
            planes.append(net.sample(scores).half())
            probability = scores[0].softmax(dim=0).numpy()
            at_returns.append(scores_of_returns(probability, *frames.returns(k), frames.spec))
    return ImageScores(torch.cat(planes), np.stack(at_returns))


def network_maps(parts: list[Part], weights: Path) -> dict[str, NDArray]:
    """Return the maps of a whole network, refined too.

    Parameters
    ----------
    parts : list of Part
        The frames.
    weights : Path
        The network's file.
    """
    logs = []
    refined = []
    for frames, numbers in parts:
        net: SemanticGridNet = load_net(weights, frames.camera)
        refine = crf_refinement(frames.spec.cell)
        for k in numbers:
            logs.append(learned_log_g(net, frames[k]))
            refined.append(refine(logs[-1], frames[k].occupancy.numpy()))
    return _both_ways("network", np.stack(logs)) | _both_ways("network + CRF", np.stack(refined))


@torch.inference_mode()
def _logits(net: HeightFusion, planes: torch.Tensor, channels: torch.Tensor) -> NDArray:
    """Return the logits of frames one by one, (N, C, H, W)."""
    pairs = zip(planes.split(1), channels.split(1), strict=True)
    return torch.cat([net(one.float(), beside) for one, beside in pairs]).numpy()


def _both_ways(name: str, scores: NDArray) -> dict[str, NDArray]:
    """Return the class of each cell, (N, H, W), among all classes and among the semantic ones."""
    return {
        name: scores.argmax(axis=1).astype(np.uint8),
        name + FORBIDDEN: scores[:, : KITTI_14.n_semantic].argmax(axis=1).astype(np.uint8),
    }


def camera_worth(root: str | Path, scene: str, runs: str | Path, way: str, seed: int = 0) -> dict[str, object]:
    """Score a way's networks and the baselines on cameras that were left out, and on later frames.

    Parameters
    ----------
    root, scene : path-like, str
        As `PandasetScene` takes them.
    runs : path-like
        The folder of training runs of `compare_real`.
    way : str
        One of its ways. A split without its runs gets the baselines without networks.
    seed : int
        Seed of its runs.

    Returns
    -------
    dict
        "scores" and "counts" by split and method, and what made them.
    """
    runs = Path(runs) / scene
    views = open_views(root, scene, runs, image_size_of(way))
    heights = {camera: heights_of(PandasetScene(root, scene, camera), one, runs) for camera, one in views.items()}
    scores = {}
    texts = {}
    weights = {}
    for split, rounds in splits(views).items():
        counts: Counts = {}
        folders = [runs / f"{split} {number}, {way}, {seed}" for number in range(len(rounds))]
        has_runs = all((folder / WEIGHTS).exists() for folder in folders)
        for folder, (learned, tested) in zip(folders, rounds, strict=True):
            cells = cells_of(learned, heights), cells_of(tested, heights)
            maps = without_networks(*cells)
            if has_runs:
                maps |= with_networks(learned, tested, cells, folder)
                weights |= {f"{folder.name}/{file}": sha256(folder / file) for file in (IMAGE_STAGE, WEIGHTS)}
            add_counts(counts, tested, maps)
        scores[split] = {method: camera_scores(counts, method, RULE) for method in counts}
        texts[split] = {method: as_text(by_camera) for method, by_camera in counts.items()}
    command = f"python -m worlds.lecture_08_camera_worth PANDASET RUNS OUT --scene {scene} --way {way!r} --seed {seed}"
    return {"scores": scores, "counts": texts, "weights": weights, **made_by(command, "numpy", "torch", "scikit-learn")}


def heights_of(drive: PandasetScene, frames: TrainingSet, folder: Path) -> NDArray:
    """Return the heights of all frames of a camera, (N, 2, H, W), from `scan_heights`.

    They are kept in a file, because scans are slow to read.

    Parameters
    ----------
    drive, frames : PandasetScene, TrainingSet
        The camera's drive, and its frames from `open_frames`.
    folder : Path
        Takes the file.
    """
    path = folder / f"lowest and highest, {drive.view.name}.npy"
    if not path.exists():
        scans = (drive.without_labels(k).points_grid for k in range(len(drive)))
        np.save(path, np.stack([scan_heights(points, frames.spec) for points in scans]))
    return np.load(path)


def cells_of(parts: list[Part], heights: dict[str, NDArray]) -> Cells:
    """Put the cells of all frames of a part together.

    Parameters
    ----------
    parts : list of Part
        The frames.
    heights : dict of str to (N, 2, H, W) float
        From `heights_of`, by camera.
    """
    o, learned, true = (
        np.concatenate([frames.arrays[name][ks] for frames, ks in parts]) for name in ("occupancy", "truth", "true")
    )
    return Cells(o, np.concatenate([heights[camera_of(frames)][ks] for frames, ks in parts]), learned, true)


def camera_worth_table(result: dict[str, object]) -> str:
    """Return every split as a Markdown table, per cent.

    Parameters
    ----------
    result : dict
        From `camera_worth`.
    """
    return "\n\n".join(_table(split, methods) for split, methods in result["scores"].items())


def _table(split: str, methods: dict[str, dict]) -> str:
    metrics = ("pixel accuracy", "class accuracy")
    columns = [*metrics, *(f"{name} above the {RULE}" for name in metrics)]
    rows = [[split, *columns]]
    rows += [[method, *(shown(scores[column]) for column in columns)] for method, scores in methods.items()]
    return markdown_table(rows)


def main(
    pandaset: Path, runs: Path, out: Path, scene: str = "002", way: str = "ImageNet, then real", seed: int = 0
) -> None:
    """Score everything, write the result and print its tables.

    Parameters
    ----------
    pandaset : Path
        The folder of PandaSet's scenes.
    runs, scene, way, seed
        As `camera_worth` takes them.
    out : Path
        A JSON file.
    """
    result = camera_worth(pandaset, scene, runs, way, seed)
    write_json(out, result)
    print(camera_worth_table(result))


if __name__ == "__main__":
    typer.run(main)
