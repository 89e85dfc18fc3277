"""What ImageNet weights bring on a real street, by the number of labelled frames (paper, section 4.1).

One network, EfficientNet-Lite0 with a feature pyramid, learns from a few labelled images of four cameras and is scored
on two cameras that were left out. Its encoder starts from ImageNet, from fresh weights, or from ImageNet's weights in
another order within each tensor, which have the same sizes but know nothing.
"""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
import typer
from numpy.typing import NDArray
from torch import Tensor, nn
from tqdm.auto import tqdm

from semgrid_edu.datasets.pandaset import CAMERAS, PandasetScene
from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.frame import resize_image
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import METRICS, confusion_matrix
from semgrid_edu.networks import Segmenter, build_segmenter, load_imagenet
from semgrid_edu.networks.imagenet import INSTALLED, PACKAGE_SHA256
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.training.batches import draw_batch
from semgrid_edu.workshop.scoring.score_with_interval import on_cells
from semgrid_edu.workshop.scoring.statistics import drive_interval, paired_interval
from worlds.lecture_08_counts import as_text, named

SIZE = (96, 320)
"""Height and width of the images, pixels: what the compact networks see."""

LEFT_OUT = (
    ("front_right_camera", "right_camera"),
    ("front_left_camera", "left_camera"),
    ("front_camera", "back_camera"),
)
"""The cameras of each round that are scored, as in lecture 08; the four others are learned from."""

RATE, ENCODER_SHARE = 1e-3, 0.3
"""The learning rate of fresh weights, and the share of it that ImageNet's weights get."""

BATCH_SIZE = 2
"""Images of a step: the smallest number of labelled frames that is tried."""

OWN = "pixel accuracy on its own frames"
"""What a network reaches on the frames that it has learned from."""

FRESH, IMAGENET, SHUFFLED = "fresh", "ImageNet", "ImageNet shuffled"


class Run(NamedTuple):
    """One way to learn.

    Parameters
    ----------
    start : str
        What the encoder starts from: `FRESH`, `IMAGENET` or `SHUFFLED`.
    frames : int
        Number of labelled frames.
    steps : int
        Number of steps of gradient descent.
    normalised : bool
        Whether each map of the encoder is normalised (batch normalisation) before the pyramid adds it.
    seeds : int
        Number of networks of each round.
    """

    start: str
    frames: int
    steps: int
    normalised: bool = False
    seeds: int = 2

    @property
    def name(self) -> str:
        """What the run is called in the results."""
        return f"{self.start}, {self.frames} frames, {self.steps} steps" + ", normalised" * self.normalised


RUNS = (
    *(Run(start, frames, 100) for frames in (2, 8, 24) for start in (IMAGENET, FRESH)),
    Run(SHUFFLED, 24, 100),
    Run(FRESH, 24, 300),
    *(Run(start, 24, 100, normalised=True, seeds=1) for start in (IMAGENET, FRESH, SHUFFLED)),
)
"""What is compared. Controls: the same sizes of weights without the knowledge, three times the steps, and maps of equal
size. ImageNet's maps are three to seven times as large as fresh ones, and the pyramid adds them as they are."""


class Images(NamedTuple):
    """All frames of a camera.

    Parameters
    ----------
    image : (N, 3, h, w) uint8
        The images.
    labels : (N, h, w) int64
        Classes of the pixels with a labelled return of the frame's own scan, else 255.
    """

    image: Tensor
    labels: Tensor


def read_images(root: str | Path, scene: str, camera: str) -> Images:
    """Read a camera's frames at the size that the networks see.

    Parameters
    ----------
    root, scene, camera
        As `PandasetScene` takes them.
    """
    drive = PandasetScene(root, scene, camera)
    images = [resize_image(drive.without_labels(k).image, SIZE) for k in range(len(drive))]
    labels = [drive.image_labels(k, SIZE) for k in range(len(drive))]
    return Images(torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2), torch.from_numpy(np.stack(labels)).long())


def draw_frames(cameras: list[Images], n: int, seed: int) -> list[Sample]:
    """Draw labelled frames, as equally many of each camera as possible.

    Parameters
    ----------
    cameras : list of Images
        The cameras to learn from.
    n : int
        Number of frames.
    seed : int
        Seed for the choice.
    """
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(cameras))
    times = [rng.permutation(len(camera.image)) for camera in cameras]
    chosen = [(order[k % len(cameras)], k // len(cameras)) for k in range(n)]
    nothing = torch.empty(0)
    pairs = [(cameras[camera], int(times[camera][turn])) for camera, turn in chosen]
    return [Sample(images.image[k], images.labels[k], nothing, nothing) for images, k in pairs]


def start_from(start: str, seed: int, normalised: bool = False) -> Segmenter:
    """Return the network before it learns.

    Parameters
    ----------
    start : str
        `FRESH`, `IMAGENET` or `SHUFFLED`.
    seed : int
        Seed for fresh weights, and for the order of shuffled ones.
    normalised : bool
        Whether each map is normalised before the pyramid adds it, as the package's network does.
    """
    net = build_segmenter("efficientnet", len(KITTI_14), "compact", seed)
    if not normalised:
        net.lateral = nn.ModuleList(convolution for convolution, _ in net.lateral)
        for layer in net.lateral:
            layer.bias = nn.Parameter(torch.zeros(layer.out_channels))  # which the normalisation would have taken away
    for layer in net.modules():
        if isinstance(layer, nn.BatchNorm2d):
            layer.momentum = 0.1  # the published 0.01 would need hundreds of steps to forget its first statistics
    if start != FRESH:
        load_imagenet(net, INSTALLED)
    if start == SHUFFLED:
        rng = np.random.default_rng(seed)
        for tensor in net.imagenet_tensors().values():
            tensor.copy_(tensor.flatten()[torch.from_numpy(rng.permutation(tensor.numel()))].reshape(tensor.shape))
    return net


def learn(run: Run, frames: list[Sample], seed: int) -> Segmenter:
    """Train a network on the labelled pixels of some frames by AdamW, and return it in evaluation mode.

    Parameters
    ----------
    run : Run
        Where it starts, and the number of steps.
    frames : list of Sample
        The frames, from `draw_frames`.
    seed : int
        Seed for everything that is drawn.
    """
    net = start_from(run.start, seed, run.normalised).train()
    taught = {tensor.data_ptr() for tensor in net.imagenet_tensors().values()}
    encoder = [weight for weight in net.parameters() if weight.data_ptr() in taught]
    others = [weight for weight in net.parameters() if weight.data_ptr() not in taught]
    share = 1.0 if run.start == FRESH else ENCODER_SHARE
    optimiser = torch.optim.AdamW([{"params": encoder, "lr": share * RATE}, {"params": others, "lr": RATE}])
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, run.steps)
    for step in range(run.steps):
        batch = draw_batch(frames, BATCH_SIZE, 0.2, step, seed)
        image = batch.frames.image
        labels = batch.frames.labels
        if batch.mirrored:
            image = image.flip(-1)
            labels = labels.flip(-1)
        optimiser.zero_grad()
        F.cross_entropy(net(image), labels, ignore_index=IGNORE).backward()
        optimiser.step()
        schedule.step()
    return net.eval()


@torch.inference_mode()
def _count(net: Segmenter, tested: Images) -> NDArray[np.int64]:
    """Return a camera's confusion matrix, (C, C)."""
    total = np.zeros((len(KITTI_14), len(KITTI_14)), np.int64)
    for image, labels in zip(*tested, strict=True):
        total += confusion_matrix(labels.numpy(), net(image[None] / 255)[0].argmax(dim=0).numpy(), len(KITTI_14))
    return total


def baselines(learned: list[Images], tested: Images) -> dict[str, NDArray[np.int64]]:
    """Return the confusion matrices of rules that look at no image, by name.

    Both are fitted to all frames of the cameras that are learned from.

    Parameters
    ----------
    learned : list of Images
        These cameras.
    tested : Images
        A camera to score.
    """
    labels = torch.cat([images.labels for images in learned]).numpy()
    by_row = [_most_frequent(labels[:, row]) for row in range(SIZE[0])]
    truth = tested.labels.numpy()
    called = {
        "always the most frequent class": np.full_like(truth, _most_frequent(labels)),
        "the most frequent class of each row": np.broadcast_to(np.array(by_row)[:, None], truth.shape),
    }
    return {name: confusion_matrix(truth, one, len(KITTI_14)) for name, one in called.items()}


def _most_frequent(labels: NDArray) -> int:
    """Return the most frequent class among labelled pixels."""
    return int(np.bincount(labels[labels != IGNORE], minlength=1).argmax())


def imagenet_worth(root: str | Path, scene: str, runs: str | Path) -> dict[str, object]:
    """Train in all ways of `RUNS` and score the cameras that were left out.

    Parameters
    ----------
    root, scene : path-like, str
        As `PandasetScene` takes them.
    runs : path-like
        Takes a file of counts for each training run. A run that has ended isn't repeated.

    Returns
    -------
    dict
        "scores" and "counts" by way, and what made them. An interval is over seeds and six cameras.
    """
    folder = Path(runs) / scene
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)  # the bits depend on the number of threads
    cameras = {camera: read_images(root, scene, camera) for camera in CAMERAS}
    most = max(run.seeds for run in RUNS)
    wanted = [(seed, run, pair) for seed in range(most) for run in RUNS for pair in LEFT_OUT if seed < run.seeds]
    counts: dict[str, dict[str, list[NDArray]]] = {}
    own: dict[str, list[NDArray]] = {}
    seconds = 0.0
    for seed, run, pair in tqdm(wanted, unit="run"):
        learned = [images for camera, images in cameras.items() if camera not in pair]

        def work(seed=seed, run=run, pair=pair, learned=learned) -> dict[str, NDArray]:
            frames = draw_frames(learned, run.frames, seed)
            net = learn(run, frames, seed)
            own = Images(*(torch.stack(field) for field in list(zip(*frames, strict=True))[:2]))
            return {OWN: _count(net, own)} | {camera: _count(net, cameras[camera]) for camera in pair}

        found, spent = _once(folder / f"{run.name}, {pair[0]}, {seed}.npz", work)
        seconds += spent
        own.setdefault(run.name, []).append(found.pop(OWN))
        for camera, matrix in found.items():
            counts.setdefault(run.name, {}).setdefault(camera, []).append(matrix)
    for pair in LEFT_OUT:
        learned = [images for camera, images in cameras.items() if camera not in pair]
        for camera in pair:
            for name, matrix in baselines(learned, cameras[camera]).items():
                counts.setdefault(name, {})[camera] = [matrix]
    command = f"python -m worlds.lecture_07_imagenet PANDASET RUNS OUT --scene {scene}"
    return {
        "scores": scores_of(counts),
        OWN: {name: float(METRICS["pixel accuracy"](sum(matrices))) for name, matrices in own.items()},
        "counts": {name: as_text({c: np.stack(m) for c, m in one.items()}) for name, one in counts.items()},
        "seeds": {run.name: run.seeds for run in RUNS},
        "CPU minutes": round(seconds / 60, 1),
        "ImageNet weights": PACKAGE_SHA256,
        **made_by(command, "numpy", "torch"),
    }


def _once(path: Path, work: Callable[[], dict[str, NDArray]]) -> tuple[dict[str, NDArray], float]:
    """Return the counts by camera and the CPU seconds of a run, from its file if it has ended."""
    if not path.exists():
        start = time.process_time()
        found = work()
        partial = path.with_suffix(".partial.npz")
        np.savez_compressed(partial, seconds=time.process_time() - start, **found)
        partial.replace(path)
    with np.load(path) as file:
        return {name: file[name] for name in file.files if name != "seconds"}, float(file["seconds"])


def scores_of(counts: dict[str, dict[str, list[NDArray]]]) -> dict[str, dict]:
    """Return both accuracies of each way with intervals over seeds and cameras, and by how much ImageNet adds.

    Parameters
    ----------
    counts : dict
        By way and camera, a confusion matrix for each seed.
    """
    ours = {
        name: on_cells(np.stack([np.stack(one[camera]) for camera in CAMERAS], axis=1), "semantic", KITTI_14)
        for name, one in counts.items()
    }
    found: dict[str, dict] = {}
    for name, matrices in ours.items():
        fresh = name.replace(IMAGENET, FRESH)
        metrics = {metric: METRICS[metric] for metric in ("pixel accuracy", "class accuracy")}
        found[name] = {metric: named(drive_interval(matrices, of)) for metric, of in metrics.items()}
        if fresh != name and fresh in ours:
            pairs = {metric: named(paired_interval(matrices, ours[fresh], of)) for metric, of in metrics.items()}
            found[name]["above fresh weights"] = pairs
    return found


def main(pandaset: Path, runs: Path, out: Path, scene: str = "002") -> None:
    """Train and score everything, write the result and print its scores.

    Parameters
    ----------
    pandaset : Path
        The folder of PandaSet's scenes.
    runs, scene
        As `imagenet_worth` takes them.
    out : Path
        A JSON file.
    """
    result = imagenet_worth(pandaset, scene, runs)
    write_json(out, result)
    for name, scores in result["scores"].items():
        print(f"{name:<40}", json.dumps(scores))


if __name__ == "__main__":
    typer.run(main)
