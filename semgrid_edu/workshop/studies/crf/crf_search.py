"""A search for the CRF's parameters on drives that neither training nor test has seen (section 3.5, claim of 4.3)."""

from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams, fit_temperature
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.errors import check_whole
from semgrid_edu.labels import LabelSet
from semgrid_edu.networks import load_net
from semgrid_edu.storage.files import sha256, write_json
from semgrid_edu.storage.provenance import PROVENANCE, made_by, short_path
from semgrid_edu.storage.reading import read_json, resumable_json
from semgrid_edu.workshop.scoring.evaluate import scores, scores_table
from semgrid_edu.workshop.studies.crf import crf_scores
from semgrid_edu.workshop.studies.crf.search_point import FACTORS, next_point, params_at, pareto_front, point_of

OBJECTIVES = ("pixel accuracy", "class accuracy", "pixel accuracy, class accuracy kept")
"""What a CRF is chosen for, over all labelled cells. The last asks for the best pixel accuracy among the CRFs whose
class accuracy is at least that of the network without one."""

Trial = dict[str, object]
"""One trial: "params" by name, "scores" by cells and metric as in `Scores`, and the "seconds" that it took."""


def run_trial(calibrated: crf_scores.GridOutputs, params: CrfParams | None, label_set: LabelSet) -> Trial:
    """Refine every grid with these parameters, and score the result.

    Parameters
    ----------
    calibrated : GridOutputs
        The network's grids.
    params : CrfParams or None
        Parameters of the CRF; None for no CRF.
    label_set : LabelSet
        The classes.
    """
    began = perf_counter()
    confusion = crf_scores.refined_confusions(calibrated, crf_scores.refined_grids(calibrated, params)).sum(axis=0)
    found = scores({"refined": confusion}, label_set)["refined"]
    tried = {name: getattr(params, name) for name in FACTORS} if params else {}
    return {"params": tried, "scores": found, "seconds": round(perf_counter() - began, 2)}


def next_params(trials: Sequence[Trial], unrefined: dict, cell: float, seed: int) -> CrfParams:
    """Return the parameters to try next: the defaults first, then those at the `next_point`.

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
    """
    if not trials:
        return CrfParams.for_cells(cell)
    points = [point_of(CrfParams(**trial["params"]), cell) for trial in trials]
    return params_at(next_point(points, objective_values(trials, unrefined), seed), cell)


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


def search_crf(
    validation_dir: Path, dataset_dir: Path, weights: Path, log: Path, *, seed: int = 0, n_trials: int = 200
) -> dict[str, object]:
    """Calibrate a network, search the CRF's parameters, and score what was chosen on the test split.

    Temperature and parameters are chosen on drives of their own. On the drives that it was trained on, a network is
    more confident and more often right than anywhere else: a temperature fitted there would be too low, and a CRF
    chosen there would have little to repair. Holding drives back would mean training each network again on fewer
    drives. New drives of the same simulator cost minutes (`semgrid-edu data make validation`) and leave the networks,
    and all scores in docs/results, as they are. A data set that has a split "validation" of its own serves as well.

    The temperature comes first, by likelihood alone (`fit_temperature`), and stays. Then the two weights and three
    widths are searched (`next_point`). Test frames are looked at once, at the end.

    Parameters
    ----------
    validation_dir : Path
        A data set with the split "validation".
    dataset_dir : Path
        The data set that the network was trained on, such as data/minikitti, with the splits "train" and "test".
    weights : Path
        A network trained on the split "train".
    log : Path
        Takes every trial as soon as it has ended, as JSON. If the file holds trials of the same search, they aren't
        repeated.
    seed : int
        Seed for the parameters that are tried; not negative.
    n_trials : int
        Number of trials in all, at least one.

    Returns
    -------
    dict
        "temperature", "calibration", "unrefined" (validation scores without CRF), "chosen" (a trial for each of
        `OBJECTIVES`), "pareto" (numbers of the trials that no other one beats in both accuracies), "test" (from
        `compare_on_test`), "trials", and data, weights, command and versions. JSON can hold it.

    Raises
    ------
    ArgumentError
        When a split is missing, there is no trial, or the seed is negative.
    DataError
        When a file is missing or damaged, a drive of "validation" is one of "train" or "test", or the log is that of
        another search.
    """
    check_whole(seed=seed)
    check_whole(1, n_trials=n_trials)
    crf_scores.refuse_known_drives(validation_dir, dataset_dir)
    validation = TrainingSet(validation_dir, "validation")
    identity = _identity(validation_dir, dataset_dir, weights, seed)
    trials = resumable_json(log, identity, "trials", listed=True)
    network = crf_scores.grid_outputs(load_net(weights, validation.camera), validation)
    temperature = fit_temperature(network.columns, network.truth)
    calibrated, cell = network.at(temperature), validation.spec.cell
    unrefined = run_trial(calibrated, None, validation.label_set)["scores"]
    for _ in tqdm(range(len(trials), n_trials), total=n_trials, initial=len(trials), desc="search", unit="trial"):
        params = next_params(trials, unrefined, cell, seed)
        trials.append(run_trial(calibrated, params, validation.label_set))
        write_json(log, identity | {"trials": trials})
    values = objective_values(trials, unrefined)
    data, test = (identity[name]["name"] for name in ("validation", "dataset"))
    command = f"semgrid-edu search-crf --data {data} --test {test} --weights {short_path(weights)}"
    chosen = {name: int(k) for name, k in zip(OBJECTIVES, values.argmax(axis=0), strict=True)}
    params = {name: CrfParams(**trials[k]["params"]) for name, k in chosen.items()}
    return identity | {
        "temperature": temperature,
        "cell": cell,
        "frames": len(validation),
        "calibration": {"before": crf_scores.calibration(network), "after": crf_scores.calibration(calibrated)},
        "unrefined": unrefined,
        "chosen": {name: {"trial": k, **trials[k]} for name, k in chosen.items()},
        "pareto": pareto_front(values[:, :2]).tolist(),
        "test": crf_scores.compare_on_test(dataset_dir, weights, temperature, params),
        **made_by(f"{command} --seed {seed} --trials {n_trials}", "numpy", "torch", "numba", "scipy"),
        "minutes": round(sum(trial["seconds"] for trial in trials) / 60, 1),
        "trials": trials,
    }


UNCHANGED = 0.0005
"""By less than this, a CRF hardly changes a score: 0.05 points."""


def search_table(result: dict) -> str:
    """Return the temperature, what was chosen, and the scores on the test split as text to print.

    Parameters
    ----------
    result : dict
        From `search_crf`.

    Returns
    -------
    str
        Scores in per cent; gains over the network without CRF in points, with their 95 % intervals over test drives.
    """
    before, after = (result["calibration"][when]["ECE"] for when in ("before", "after"))
    lines = [f"temperature {result['temperature']:.3f}: calibration error {before:.1%} before, {after:.1%} after", ""]
    for objective, trial in result["chosen"].items():
        params = ", ".join(f"{name} {value:g}" for name, value in trial["params"].items())
        pairs = {name: (trial["scores"]["all"][name], result["unrefined"]["all"][name]) for name in OBJECTIVES[:2]}
        accuracies = (f"{name} {100 * crf:.2f} ({100 * net:.2f} without CRF)" for name, (crf, net) in pairs.items())
        crf, net = pairs["class accuracy"]
        warning = "; none of the trials kept class accuracy" if objective == OBJECTIVES[2] and crf < net else ""
        changed = max(abs(refined - alone) for refined, alone in pairs.values())
        warning += "; the CRF is as good as switched off" if changed < UNCHANGED else ""
        lines.append(f"best {objective}: trial {trial['trial']}, {params}{warning}")
        lines.append(f"    on the validation drives {', '.join(accuracies)}")
    lines += ["", scores_table(result["test"]["scores"]), "", crf_scores.gains_text(result["test"]["gains"])]
    return "\n".join(lines)


def _identity(validation_dir: Path, dataset_dir: Path, weights: Path, seed: int) -> dict:
    """Return what makes the search: data by the SHA-256 of their index, weights, seed."""
    data = {"validation": crf_scores.named_data(validation_dir), "dataset": crf_scores.named_data(dataset_dir)}
    record = weights.with_name(PROVENANCE)
    trained_on = read_json(record).get("dataset") if record.exists() else None
    used = {"file": short_path(weights), "sha256": sha256(weights), "trained on": trained_on}
    return data | {"weights": used, "seed": seed}
