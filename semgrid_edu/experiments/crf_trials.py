"""Trials of the search for the CRF's parameters: made, valued by each objective, and kept on disk (section 3.5)."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf import CrfParams, next_point, params_at, point_of
from semgrid_edu.crf.search import FACTORS
from semgrid_edu.errors import DataError
from semgrid_edu.experiments.crf_outputs import GridOutputs, refined_confusions, refined_grids
from semgrid_edu.experiments.evaluate import scores
from semgrid_edu.labels import LabelSet
from semgrid_edu.storage.reading import read_json

OBJECTIVES = ("pixel accuracy", "class accuracy", "pixel accuracy, class accuracy kept")
"""What a CRF is chosen for, over all labelled cells. The last asks for the best pixel accuracy among the CRFs whose
class accuracy is at least that of the network without one."""

Trial = dict[str, object]
"""One trial: "params" by name, "scores" by cells and metric as in `Scores`, and the "seconds" that it took."""


def next_params(trials: Sequence[Trial], unrefined: dict, cell: float, seed: int) -> CrfParams:
    """Return the parameters to try next: the defaults first, then those of `next_point`.

    Parameters
    ----------
    trials : sequence of dict
        The trials so far.
    unrefined : dict
        Scores of the network without CRF.
    cell : float
        Side of a cell, metres.
    seed : int
        Seed of the search.

    Returns
    -------
    CrfParams
    """
    if not trials:
        return CrfParams.for_cells(cell)
    points = [point_of(CrfParams(**trial["params"]), cell) for trial in trials]
    return params_at(next_point(points, objective_values(trials, unrefined), seed), cell)


def run_trial(calibrated: GridOutputs, params: CrfParams, label_set: LabelSet) -> Trial:
    """Refine every grid with these parameters, and score the result.

    Parameters
    ----------
    calibrated : GridOutputs
        The network's grids.
    params : CrfParams
        Parameters of the CRF.
    label_set : LabelSet
        The classes.

    Returns
    -------
    dict
        A trial.
    """
    began = perf_counter()
    found = validation_scores(calibrated, params, label_set)
    chosen = {name: value for name, value in asdict(params).items() if name in FACTORS}
    return {"params": chosen, "scores": found, "seconds": round(perf_counter() - began, 2)}


def validation_scores(outputs: GridOutputs, params: CrfParams | None, label_set: LabelSet) -> dict[str, dict]:
    """Return the metrics of the refined grids.

    Parameters
    ----------
    outputs : GridOutputs
        The network's grids.
    params : CrfParams or None
        Parameters of the CRF; None for no CRF.
    label_set : LabelSet
        The classes.

    Returns
    -------
    dict of str to dict
        Values from 0 to 1, by cells ("all" or "semantic") and metric.
    """
    confusion = refined_confusions(outputs, refined_grids(outputs, params)).sum(axis=0)
    return scores({"refined": confusion}, label_set)["refined"]


def objective_values(trials: Sequence[Trial], unrefined: dict) -> NDArray[np.float64]:
    """Return what each trial is worth by each objective: the higher, the better.

    Parameters
    ----------
    trials : sequence of dict
        The trials.
    unrefined : dict
        Scores of the network without CRF.

    Returns
    -------
    (n, 3) float64
        In the order of `OBJECTIVES`. A trial that loses class accuracy is worth less than 0 by the last one: what it
        loses.
    """
    pixel, by_class = (np.array([trial["scores"]["all"][name] for trial in trials]) for name in OBJECTIVES[:2])
    lost = by_class - unrefined["all"]["class accuracy"]
    return np.stack([pixel, by_class, np.where(lost >= 0, pixel, lost)], axis=1)


def read_trials(log: str | Path, identity: dict) -> list[Trial]:
    """Return the trials of a search that was begun, or an empty list.

    Parameters
    ----------
    log : path-like
        The file that `search_crf` writes, which may be missing.
    identity : dict
        What makes the search: its data, weights and seed.

    Returns
    -------
    list of dict

    Raises
    ------
    DataError
        When the file is something else, or the log of another search.
    """
    path = Path(log)
    if not path.exists():
        return []
    content = read_json(path)
    try:
        found, trials = {name: content[name] for name in identity}, content["trials"]
        for trial in trials:
            CrfParams(**trial["params"])
            _ = [float(trial["scores"]["all"][name]) for name in OBJECTIVES[:2]], float(trial["seconds"])
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(path, "the trials of a search, or no file", f"something else: {error!r}") from error
    if found != identity:
        raise DataError(path, f"trials of the search {identity}", f"{found}: choose another file")
    return trials
