"""What the chosen CRFs are worth on the test split, and how well calibrated the grids are (sections 3.5 and 4.2)."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf import CrfParams, expected_calibration_error, negative_log_likelihood, reliability
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.experiments.confusions import drive_confusions
from semgrid_edu.experiments.crf_outputs import GridOutputs, grid_outputs, outputs_at, refined_confusions, refined_grids
from semgrid_edu.experiments.evaluate import scores
from semgrid_edu.experiments.statistics import paired_interval
from semgrid_edu.metrics import METRICS
from semgrid_edu.networks import load_net


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


def compare_on_test(
    dataset_dir: str | Path, weights: str | Path, temperature: float, chosen: dict[str, CrfParams]
) -> dict[str, object]:
    """Score the network, the default CRF, and the chosen CRFs on the test split.

    Parameters
    ----------
    dataset_dir : path-like
        A data set with the split "test".
    weights : path-like
        The network.
    temperature : float
        T of the calibrated network.
    chosen : dict of str to CrfParams
        What was chosen, by objective.

    Returns
    -------
    dict
        "frames"; "calibration" "before" and "after"; by method "scores" (see `Scores`), "ECE" of the refined
        probabilities, "gains" over the network by metric (low, gain, high), and "confusion". JSON can hold it.
    """
    test = TrainingSet(dataset_dir, "test")
    network, default = grid_outputs(load_net(weights, test.camera), test), CrfParams.for_cells(test.spec.cell)
    calibrated = outputs_at(network, temperature)
    methods = {"network": (network, None), "CRF": (network, default), "calibrated, CRF": (calibrated, default)}
    methods |= {f"calibrated, CRF for {objective}": (calibrated, params) for objective, params in chosen.items()}
    per_drive, ece = {}, {}
    for method, (outputs, params) in methods.items():
        refined = refined_grids(outputs, params)
        ece[method] = expected_calibration_error(reliability(refined.swapaxes(0, 1), outputs.truth))
        per_drive[method] = drive_confusions(refined_confusions(outputs, refined), test.drives)
    confusions = {method: confusion.sum(axis=0) for method, confusion in per_drive.items()}
    return {
        "frames": len(test),
        "calibration": {"before": calibration(network), "after": calibration(calibrated)},
        "scores": scores(confusions, test.label_set),
        "ECE": ece,
        "gains": {
            method: gains_by_metric(confusion, per_drive["network"])
            for method, confusion in per_drive.items()
            if method != "network"
        },
        "confusion": {method: confusion.tolist() for method, confusion in confusions.items()},
    }


def gains_by_metric(a: NDArray, b: NDArray) -> dict[str, list[float | None]]:
    """Return by how much one network's refined grids beat another one's on the same drives, by every metric.

    Parameters
    ----------
    a, b : (V, C, C) int
        Confusion matrices of the two, drive by drive.

    Returns
    -------
    dict of str to [low, gain, high]
        By metric, with the 95 % interval of `paired_interval`. There is one network, so the interval is for that one,
        on new drives. One drive alone gives no interval: then low and high are None.
    """
    if len(a) == 1:
        return {name: [None, metric(a[0]) - metric(b[0]), None] for name, metric in METRICS.items()}
    return {name: list(paired_interval(a[None], b[None], metric)) for name, metric in METRICS.items()}


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
