"""What the CRF makes of a network's grids: kept in memory, refined with any parameters, and scored (3.5, 4.2)."""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams, mean_field, unary_from_log_probability
from semgrid_edu.crf.temperature import at_temperature, expected_calibration_error, negative_log_likelihood, reliability
from semgrid_edu.datasets.index import INDEX_FILE, DatasetIndex, load_index
from semgrid_edu.datasets.kitti_raw import drive_folder
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.errors import DataError
from semgrid_edu.metrics import METRICS, confusion_matrix
from semgrid_edu.networks import SemanticGridNet, load_net
from semgrid_edu.storage.files import sha256
from semgrid_edu.workshop.scoring.confusions import drive_confusions
from semgrid_edu.workshop.scoring.evaluate import scores
from semgrid_edu.workshop.scoring.grids import learned_log_g
from semgrid_edu.workshop.scoring.score_with_interval import compared


class GridOutputs(NamedTuple):
    """A network's semantic grids of N frames, and what the CRF and the metrics need beside them.

    Parameters
    ----------
    log_g : (N, C, H, W) float32
        Logarithms of the network's distribution over the classes.
    occupancy : (N, 4, H, W) float32
        o, the probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    truth : (N, H, W) uint8
        The class of each cell; 255 where unlabelled.
    """

    log_g: NDArray[np.float32]
    occupancy: NDArray[np.float32]
    truth: NDArray[np.uint8]

    @property
    def columns(self) -> NDArray[np.float32]:
        """The same logarithms with the classes first, (C, N, H, W), as the functions of `semgrid_edu.crf` take them."""
        return self.log_g.swapaxes(0, 1)

    def at(self, temperature: float) -> "GridOutputs":
        """Return the same grids with log g at another temperature. Parameters are those of `at_temperature`."""
        return self._replace(log_g=at_temperature(self.columns, temperature).swapaxes(0, 1))


def grid_outputs(net: SemanticGridNet, frames: TrainingSet) -> GridOutputs:
    """Run the network once over every frame of a split.

    Parameters
    ----------
    net : SemanticGridNet
        The network, for the sizes of the frames.
    frames : TrainingSet
        The split.

    Returns
    -------
    GridOutputs
        In the order of the frames.
    """
    shown = tqdm(range(len(frames)), desc="network", unit="frame")
    log_g = np.stack([learned_log_g(net, frames[k]) for k in shown])
    return GridOutputs(log_g, frames.arrays["occupancy"], frames.arrays["truth"])


def refined_grids(outputs: GridOutputs, params: CrfParams | None) -> NDArray[np.float32]:
    """Refine every grid by the CRF, ten iterations of mean field.

    Parameters
    ----------
    outputs : GridOutputs
        The network's grids.
    params : CrfParams or None
        Parameters of the CRF; None for the network's own distributions.

    Returns
    -------
    (N, C, H, W) float32
        Q, the distribution over the classes in each cell.
    """
    if params is None:
        return np.exp(outputs.log_g)
    frames = zip(outputs.log_g, outputs.occupancy, strict=True)
    return np.stack([mean_field(unary_from_log_probability(log_g), o, params) for log_g, o in frames])


def refined_confusions(outputs: GridOutputs, refined: NDArray) -> NDArray[np.int64]:
    """Compare the most probable classes with the truth, frame by frame.

    Parameters
    ----------
    outputs : GridOutputs
        For the truth.
    refined : (N, C, H, W) float
        Distributions over the classes, from `refined_grids`.

    Returns
    -------
    (N, C, C) int64
        Number of labelled cells of each frame: one row per true class, one column per predicted class.
    """
    pairs = zip(outputs.truth, refined.argmax(axis=1), strict=True)
    return np.stack([confusion_matrix(truth, predicted, refined.shape[1]) for truth, predicted in pairs])


def scores_by_method(grids: Iterable[tuple[str, NDArray]], outputs: GridOutputs, frames: TrainingSet) -> dict:
    """Score what several methods make of the same frames.

    Parameters
    ----------
    grids : iterable of (str, (N, C, H, W) float)
        Each method and its distributions over the classes; the first is the network without CRF.
    outputs : GridOutputs
        For the truth.
    frames : TrainingSet
        For drives and classes.

    Returns
    -------
    dict
        "frames"; by method "scores" (see `Scores`), "ECE" (expected calibration error), "gains" over the first method
        by metric (low, gain, high: see `gains_by_metric`), and "confusion". JSON can hold it.
    """
    per_drive, ece = {}, {}
    for method, refined in grids:
        ece[method] = expected_calibration_error(reliability(refined.swapaxes(0, 1), outputs.truth))
        per_drive[method] = drive_confusions(refined_confusions(outputs, refined), frames.drives)
    confusions = {method: drives.sum(axis=0) for method, drives in per_drive.items()}
    first, *others = per_drive
    return {
        "frames": len(frames),
        "scores": scores(confusions, frames.label_set),
        "ECE": ece,
        "gains": {method: gains_by_metric(per_drive[method], per_drive[first]) for method in others},
        "confusion": {method: confusion.tolist() for method, confusion in confusions.items()},
    }


def compare_on_test(dataset_dir: Path, weights: Path, temperature: float, chosen: dict[str, CrfParams]) -> dict:
    """Score the network, the default CRF, and the chosen CRFs on the test split.

    Parameters
    ----------
    dataset_dir : Path
        A data set with the split "test".
    weights : Path
        The network.
    temperature : float
        T of the calibrated network.
    chosen : dict of str to CrfParams
        What was chosen, by objective.

    Returns
    -------
    dict
        From `scores_by_method`, with the `calibration` "before" and "after". JSON can hold it.
    """
    test = TrainingSet(dataset_dir, "test")
    network, default = grid_outputs(load_net(weights, test.camera), test), CrfParams.for_cells(test.spec.cell)
    calibrated = network.at(temperature)
    methods = {"network": (network, None), "CRF": (network, default), "calibrated, CRF": (calibrated, default)}
    methods |= {f"calibrated, CRF for {objective}": (calibrated, params) for objective, params in chosen.items()}
    grids = ((name, refined_grids(outputs, params)) for name, (outputs, params) in methods.items())
    both = {"before": calibration(network), "after": calibration(calibrated)}
    return scores_by_method(grids, network, test) | {"calibration": both}


def calibration(outputs: GridOutputs) -> dict[str, object]:
    """Return how far a network's probabilities can be believed.

    Parameters
    ----------
    outputs : GridOutputs
        The network's grids.

    Returns
    -------
    dict
        "NLL", nats per cell; "ECE", 0..1; and the columns of the reliability diagram.
    """
    diagram = reliability(np.exp(outputs.columns), outputs.truth)
    columns = {name: column.tolist() for name, column in diagram._asdict().items()}
    nll = negative_log_likelihood(outputs.columns, outputs.truth)
    return {"NLL": nll, "ECE": expected_calibration_error(diagram), "reliability": columns}


def named_data(folder: Path) -> dict[str, str]:
    """Return the "name" of a data set and the "sha256" of its index.

    Parameters
    ----------
    folder : Path
        The data set.
    """
    return {"name": load_index(folder).name, "sha256": sha256(folder / INDEX_FILE)}


def refuse_known_drives(validation_dir: Path, dataset_dir: Path) -> None:
    """Refuse validation drives that a network was trained on or will be tested on.

    Two drives are the same when their first scans are, byte for byte, whatever their numbers are.

    Parameters
    ----------
    validation_dir : Path
        A data set with the split "validation".
    dataset_dir : Path
        The data set with the splits "train" and "test".

    Raises
    ------
    ArgumentError
        When a split is missing.
    DataError
        When a drive of "validation" is one of "train" or "test"; the message names both.
    """
    known, validation = load_index(dataset_dir), load_index(validation_dir)
    of_scan = {
        scan: f"{date} {drive} of {split}"
        for split in ("train", "test")
        for (date, drive), scan in _first_scans(known, split).items()
    }
    expected = f"a drive that {known.name} doesn't use for training or testing"
    for name, scan in _first_scans(validation, "validation").items():
        if scan in of_scan:
            raise DataError(drive_folder(validation.root, *name), expected, of_scan[scan])


def _first_scans(index: DatasetIndex, split: str) -> dict[tuple[str, str], str]:
    """Return the SHA-256 of the first scan of each drive of a split, by date and drive."""
    first = {}
    for name in index.frames_by_drive(split):
        folder = drive_folder(index.root, *name) / "velodyne_points" / "data"
        scan = min(folder.glob("[!.]*.bin"), default=None)
        if scan is None:
            raise DataError(folder, "scans", "none")
        first[name] = sha256(scan)
    return first


def gains_by_metric(a: NDArray, b: NDArray) -> dict[str, list[float | None]]:
    """Return by how much one network's refined grids beat another one's on the same drives, by every metric.

    Parameters
    ----------
    a, b : (V, C, C) int
        Confusion matrices of the two, drive by drive.

    Returns
    -------
    dict of str to [low, gain, high]
        By metric, with the 95 % interval of `compared`. There is one network, so the interval is for that one,
        on new drives. One drive alone gives no interval: then low and high are None.
    """
    gains = {name: compared(a[None], b[None], metric) for name, metric in METRICS.items()}
    return {name: [gain["low"], gain["mean"], gain["high"]] for name, gain in gains.items()}


def gains_text(gains: dict[str, dict[str, list[float | None]]]) -> str:
    """Return gains as text to print, in points.

    Parameters
    ----------
    gains : dict of str to dict
        What `gains_by_metric` returns, by method.

    Returns
    -------
    str
        One line per method, with intervals in brackets where there are any.
    """
    lines = ["gain over the network without CRF, points, and its 95 % interval over test drives:"]
    for method, by_metric in gains.items():
        shown = []
        for name, (low, gain, high) in by_metric.items():
            interval = "" if low is None else f" ({100 * low:+.2f} to {100 * high:+.2f})"
            shown.append(f"{name} {100 * gain:+.2f}{interval}")
        lines.append(f"{method}: {', '.join(shown)}")
    return "\n".join(lines)
