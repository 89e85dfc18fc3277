"""Train a network on a data set and write down how it was made (paper, section 4.1)."""

import math
import re
from collections.abc import Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.index import INDEX_FILE, load_index
from semgrid_edu.datasets.label_policies import POLICIES, LidarTruth
from semgrid_edu.datasets.training_set import Mixture
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.fast import TrainingSet, build_net, load_net
from semgrid_edu.fast.allocator import keep_freed_memory
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import WEIGHTS, Architecture, SemanticGridNet, build_segmenter, load_imagenet, save_net
from semgrid_edu.networks.build import with_mean_scores
from semgrid_edu.networks.imagenet import imagenet_file
from semgrid_edu.networks.semantic_grid import MOST_SEGMENTERS
from semgrid_edu.networks.weights import read_architecture
from semgrid_edu.storage.files import sha256
from semgrid_edu.storage.provenance import write_provenance
from semgrid_edu.training.checkpoint import CHECKPOINT, check_folder
from semgrid_edu.training.devices import open_fabric
from semgrid_edu.training.loop import train
from semgrid_edu.training.params import TrainingParams
from semgrid_edu.workshop.flaws import TruthFlaws

PAPER_IMAGE = (375, 1242)
"""Height and width of KITTI's images, pixels; the paper's networks see them at this size."""


def architecture(
    segmenter: str,
    preset: str = "compact",
    uses_return_heights: bool = False,
    image_size: tuple[int, int] | None = None,
) -> Architecture:
    """Return the architecture of a preset, with its image size and its grid.

    Parameters
    ----------
    segmenter : str
        Name of the image network, a key of `SEGMENTERS`.
    preset : str
        "compact" for the CPU; "paper" for the published networks, KITTI's images at full size, and 0.2 m cells.
    uses_return_heights : bool
        Whether the fusion network sees the heights of returns, see `Architecture`.
    image_size : (int, int), optional
        Height and width of the images, pixels; the preset's when left out.

    Returns
    -------
    Architecture
        What `build_net` takes.
    """
    if preset == "compact":
        usual = Architecture(segmenter)
    elif preset == "paper":
        usual = Architecture(segmenter, preset, image_size=PAPER_IMAGE, grid=GridSpec.paper())
    else:
        raise ArgumentError("--preset", "compact or paper", repr(preset))
    return replace(usual, uses_return_heights=uses_return_heights, image_size=image_size or usual.image_size)


def chosen_size(text: str | None) -> tuple[int, int] | None:
    """Return the height and the width of images that an option names, or None.

    Parameters
    ----------
    text : str or None
        Such as "192x640".

    Examples
    --------
    >>> chosen_size("192x640")
    (192, 640)
    """
    if text is None:
        return None
    if not (found := re.fullmatch(r"(\d{1,18})x(\d{1,18})", text, re.ASCII)):
        raise ArgumentError("--image-size", "height x width in pixels, such as 192x640", repr(text))
    return int(found[1]), int(found[2])


def training_params(
    preset: str, iterations: int, end_to_end: bool = True, from_imagenet: bool = False, tint: float = 0.0
) -> TrainingParams:
    """Return the training parameters of a preset.

    Parameters
    ----------
    preset : str
        "compact" for the defaults; "paper" for section 4.1: a learning rate of 1e-3, and class weights without a
        limit.
    iterations : int
        Number of steps of each stage.
    end_to_end : bool
        Whether the loss on the grid teaches the image network too.
    from_imagenet : bool
        Whether the image network starts from ImageNet weights. At the published size, training end to end then needs
        no first stage. The compact network learns by AdamW in both, its encoder at a tenth of the rate.
    tint : float
        How far each colour varies, see `TrainingParams`.

    Returns
    -------
    TrainingParams
        What `train` takes.
    """
    params = TrainingParams(iterations, iterations, end_to_end=end_to_end, tint=tint)
    if preset == "compact":
        from_weights = {"optimiser": "adamw", "learning_rate": 3e-3, "encoder_rate": 0.1}
        return replace(params, **from_weights) if from_imagenet else params
    image_iterations = 0 if from_imagenet and end_to_end else iterations
    return replace(params, image_iterations=image_iterations, learning_rate=1e-3, weight_limit=math.inf)


def chosen_truth(name: str) -> LidarTruth | None:
    """Return how the truth to learn from is made.

    Parameters
    ----------
    name : str
        "true" for what the data set says of its cells; a key of `POLICIES`, such as "lidar", for grids made from its
        image labels and scans after these got errors like those of real data (`TruthFlaws`).

    Returns
    -------
    LidarTruth or None
        What `TrainingSet` takes; None for "true".
    """
    if name != "true" and name not in POLICIES:
        raise ArgumentError("--truth", f"one of true, {', '.join(POLICIES)}", repr(name))
    return None if name == "true" else LidarTruth(POLICIES[name], TruthFlaws())


def train_network(
    data: str | Path | Sequence[str | Path],
    folder: str | Path,
    segmenter: str,
    params: TrainingParams,
    seed: int = 0,
    resume: bool = False,
    *,
    preset: str = "compact",
    imagenet: str | Path | None = None,
    device: str = "cpu",
    truth: LidarTruth | None = None,
    start: str | Path | Sequence[str | Path] = (),
    half: bool = False,
    uses_return_heights: bool = False,
    image_size: tuple[int, int] | None = None,
    fill_gaps: bool = False,
) -> None:
    """Train a network on the split "train" of data sets; under torchrun, in all of its processes.

    Parameters
    ----------
    data : path-like or sequence of path-like
        The folder of the data set, such as data/minikitti; or of several, which take turns (see `Mixture`).
    folder : path-like
        Where to write the files of `train`, and `provenance.json`, which names the data by the SHA-256 of their index.
    segmenter : str
        Name of the image network, a key of `SEGMENTERS`.
    params : TrainingParams
        Numbers of iterations, rates and the like.
    seed : int
        Seed for the initial weights, and for the order and the jitter of the frames.
    resume : bool
        Whether to go on with a run that was interrupted, if there is one.
    preset : str
        "compact" or "paper", see `architecture`.
    imagenet : path-like, optional
        ImageNet weights for the image network, a file or "installed": see `load_imagenet`.
    device : str
        "cpu", "cuda", "cuda:N" or "auto", see `choose_device`.
    truth : LidarTruth, optional
        How to make the truth from image labels and LIDAR; the data sets' own truth when left out.
    start : path-like or sequence of path-like
        A trained network of the same architecture to start from, in place of `imagenet`. Of several the image networks'
        mean scores are fused, see `with_mean_scores`; they don't learn, so there is no first stage. Without any, the
        weights are fresh.
    half : bool
        Whether the trained network's convolutions are written in 16 bits, see `save_net`.
    uses_return_heights, image_size
        As `architecture` takes them.
    fill_gaps : bool
        Whether cells far from any label are learned as unknown, see `TrainingSet.with_gaps_filled`.

    Raises
    ------
    ArgumentError
        When there is no such image network, preset or device, both `imagenet` and `start` are given, training end to
        end would start from several, or as `train` raises it.
    DataError
        When a file is missing or damaged, `start` has another architecture, or the folder holds a run that would be
        overwritten.
    """
    starts = [start] if isinstance(start, str | Path) else list(start)
    folders = [data] if isinstance(data, str | Path) else list(data)
    folder = Path(folder)
    began = datetime.now(UTC)
    description = architecture(segmenter, preset, uses_return_heights, image_size)
    if len(starts) > 1:
        params = replace(params, image_iterations=0)
    # All that can be wrong is found before the data are prepared, which takes minutes.
    _check_starts(starts, imagenet, description, params.end_to_end)
    check_folder(folder, resume)
    resumed = (folder / CHECKPOINT).exists()
    segmenter_alike = build_segmenter(segmenter, n_classes=1, preset=preset)
    if imagenet:
        load_imagenet(segmenter_alike, imagenet)
    for one in folders:
        _check_frames(one, params.batch_size, fill_gaps)

    keep_freed_memory()
    fabric = open_fabric(device)
    with fabric.rank_zero_first():  # the others find the arrays that it makes
        dataset = _open(folders, description, truth, fill_gaps)
    description = replace(description, label_set=dataset.label_set.name)
    camera = dataset.camera
    net = _starts_as(starts, description, camera) if starts else build_net(description, camera, seed)
    if imagenet:
        load_imagenet(net.segmenter, imagenet)
    train(net, dataset, folder, params, seed, resume, fabric)

    if fabric.is_global_zero:
        if half:
            save_net(net, folder / WEIGHTS, half=True)
        hashes = [sha256(Path(folder) / INDEX_FILE) for folder in folders]
        details = {
            "date": f"{began:%Y-%m-%d}",
            "minutes": round((datetime.now(UTC) - began).total_seconds() / 60, 1),
            "resumed": resumed,
            "device": fabric.device.type,
            "processes": fabric.world_size,
            # JSON has no infinity.
            "params": {name: str(value) if value == math.inf else value for name, value in asdict(params).items()},
            "dataset": hashes[0] if len(hashes) == 1 else hashes,
        }
        if imagenet:
            details["imagenet"] = sha256(imagenet_file(imagenet))
        if starts:
            details["from"] = [sha256(path) for path in starts]
        if truth:
            details["truth"] = asdict(truth)
        command = _command(folders, folder, description, imagenet, starts, seed, params, truth)
        command += " --fill-gaps" if fill_gaps else ""
        command += " --half" if half else ""
        write_provenance(folder, command, seed, ("torch", "numpy", "safetensors"), **details)


def _check_starts(
    starts: Sequence[str | Path], imagenet: str | Path | None, description: Architecture, end_to_end: bool
) -> None:
    """Check that training can start from these networks."""
    if imagenet and starts:
        raise ArgumentError("--from", "no network beside the ImageNet weights, which it would replace", str(starts[0]))
    if len(starts) > 1 and end_to_end:
        expected = "one network, or --two-stage beside several: their image networks don't learn"
        raise ArgumentError("--from", expected, f"{len(starts)} networks without --two-stage")
    kinds = [read_architecture(path) for path in starts]
    for path, kind in zip(starts, kinds, strict=True):
        _check_alike(path, replace(kind, label_set=description.label_set), description)
    if sum(kind.n_segmenters for kind in kinds) > MOST_SEGMENTERS:
        raise ArgumentError("--from", f"at most {MOST_SEGMENTERS} image networks together", f"{len(starts)} files")


def _check_frames(folder: str | Path, batch_size: int, fill_gaps: bool) -> None:
    """Check that a data set has a batch of frames to learn from, and unknown classes if gaps are to become unknown."""
    index = load_index(folder)
    found = len(index.splits.get("train", ()))
    if found < batch_size:
        raise ArgumentError("dataset", f"at least one batch of {batch_size} frames", f"{found} frames")
    if fill_gaps and index.label_set != KITTI_14:
        raise ArgumentError("fill_gaps", f"the classes of {KITTI_14.name}", index.label_set.name)


def _open(
    folders: Sequence[str | Path], description: Architecture, truth: LidarTruth | None, fill_gaps: bool
) -> TrainingSet | Mixture:
    """Open the frames to learn from: those of one camera, or a mixture."""
    chosen = {"spec": description.grid, "image_size": description.image_size, "truth": truth}
    data_sets = [TrainingSet.by_camera(folder, "train", **chosen) for folder in folders]
    if fill_gaps:
        data_sets = [[part.with_gaps_filled() for part in parts] for parts in data_sets]
    mixture = Mixture(data_sets)
    return mixture.parts[0] if len(mixture.parts) == 1 else mixture


def _starts_as(paths: Sequence[str | Path], description: Architecture, camera: Camera) -> SemanticGridNet:
    """Return the network of another training run, or the mean of several; all must have this architecture."""
    nets = [load_net(path, camera) for path in paths]
    for path, net in zip(paths, nets, strict=True):
        _check_alike(path, net.architecture, description)
    return with_mean_scores(nets)


def _check_alike(path: str | Path, found: Architecture, description: Architecture) -> None:
    """Check that a network has an architecture, whatever its number of image networks."""
    if replace(found, n_segmenters=1) != description:
        raise DataError(path, f"a network like the one to train, {description}", found)


def _command(
    folders: Sequence[str | Path],
    folder: str | Path,
    description: Architecture,
    imagenet: str | Path | None,
    start: Sequence[str | Path],
    seed: int,
    params: TrainingParams,
    truth: LidarTruth | None,
) -> str:
    """Return the command that repeats a training run, as far as a command can: not every policy has a name."""
    size = h, w = description.image_size
    named = (name for name, policy in POLICIES.items() if truth == LidarTruth(policy, TruthFlaws()))
    options = [
        *(f"--data {_name(data)}" for data in folders),
        f"--out {_name(folder)} --segmenter {description.segmenter}",
        f"--preset {description.preset}" if description.preset != Architecture.preset else "",
        "--return-heights" if description.uses_return_heights else "",
        "" if size == architecture(description.segmenter, description.preset).image_size else f"--image-size {h}x{w}",
        f"--imagenet {_name(imagenet)}" if imagenet else "",
        *(f"--from {_name(Path(path).parent)}/{_name(path)}" for path in start),
        f"--seed {seed} --iterations {params.grid_iterations}",
        f"--tint {params.tint:g}" if params.tint else "",
        "" if params.end_to_end else "--two-stage",
        f"--truth {next(named, 'lidar')}" if truth else "",
    ]
    return " ".join(["semgrid-edu train", *filter(None, options)])


def _name(path: str | Path) -> str:
    """Return the last part of a path, also for a path such as `.`."""
    return Path(path).resolve().name
