"""A search for the CRF's weights and widths, on drives that neither training nor test has seen (section 3.5).

    PYTHONPATH=.:notebooks python notebooks/worlds/lecture_11_search.py DIR/validation WEIGHTS

`semgrid-edu data make validation DIR` makes the drives. A longer search of this kind, with a third objective, found
docs/results/crf_search*.json; the package keeps its parameters in workshop/paper/runs/score_runs.toml. To score a CRF
on test frames, call `evaluate(data, weights, refine=...)` of semgrid_edu.workshop.scoring.evaluate.
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import log_softmax
from scipy.stats import qmc
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams
from semgrid_edu.fast import TrainingSet, mean_field
from semgrid_edu.labels import IGNORE
from semgrid_edu.metrics import class_accuracy, confusion_matrix, pixel_accuracy
from semgrid_edu.networks import load_net
from semgrid_edu.workshop.scoring.grids import learned_log_g

FACTORS = {
    "w_bilateral": (0.02, 10.0),
    "w_spatial": (0.02, 10.0),
    "sigma_alpha": (0.25, 10.0),
    "sigma_beta": (0.25, 10.0),
    "sigma_gamma": (0.25, 10.0),
}
"""What is searched, and the ends of each axis as factors of the default; between them an axis is logarithmic."""

EXPLORED, FIRST_STEP, SHRINK = 64, 0.2, 0.98
"""After this number of trials three of four refine the best so far, by Gaussian steps that shrink from trial to trial;
the first has this standard deviation, in sides of the box."""


def params_at(point: NDArray, cell: float) -> CrfParams:
    """Return the parameters that a point of the unit cube means, rounded to three digits.

    Parameters
    ----------
    point : (5,) float
        One number for each of `FACTORS`: 0 and 1 are the ends of its axis.
    cell : float
        Side of a cell, metres; the factors multiply the defaults of `CrfParams.for_cells`.
    """
    defaults = np.array([getattr(CrfParams.for_cells(cell), name) for name in FACTORS])
    low, high = np.log(defaults * np.transpose(list(FACTORS.values())))
    values = np.exp(low + point * (high - low))
    return CrfParams(**{name: float(f"{value:.3g}") for name, value in zip(FACTORS, values, strict=True)})


def next_point(points: list[NDArray], values: list[NDArray], seed: int) -> NDArray[np.float64]:
    """Return the point to try next: of a Halton sequence, which fills the cube evenly, or near the best so far.

    Parameters
    ----------
    points : list of (5,) float
        The points that were tried.
    values : list of (K,) float
        What each of K objectives gave there: the higher, the better. They take turns.
    seed : int
        Seed for the sequence and for the steps.
    """
    n = len(points)
    refined = len(points) - EXPLORED
    if refined < 0 or refined % 4 == 0:
        sequence = qmc.Halton(len(FACTORS), scramble=True, seed=seed)
        return sequence.fast_forward(n if refined < 0 else EXPLORED + refined // 4).random(1)[0]
    objective = np.array(values)[:, n % len(values[0])]
    step = FIRST_STEP * SHRINK**refined * np.random.default_rng([seed, n]).normal(size=len(FACTORS))
    return np.clip(points[objective.argmax()] + step, 0, 1)


def fit_temperature(log_p: NDArray, truth: NDArray) -> float:
    """Return the temperature T that makes the truth most likely, "temperature scaling" (Guo et al. 2017).

    Parameters
    ----------
    log_p : (C, ...) float
        Natural logarithms of the classes' probabilities; those of log p / T are compared with the truth.
    truth : (...) int
        The class of each cell; 255 where unlabelled.
    """
    labelled = truth != IGNORE
    log_p, classes = log_p[:, labelled].astype(np.float64), truth[labelled].astype(np.int64)

    def loss(log_T: float) -> float:
        scaled = log_softmax(log_p / np.exp(log_T), axis=0)
        return -np.take_along_axis(scaled, classes[None], axis=0).mean()

    return float(np.exp(minimize_scalar(loss, bounds=(np.log(0.01), np.log(100)), method="bounded").x))


def main(data: Path, weights: Path, trials: int = 120, seed: int = 0) -> None:
    """Calibrate the network, try parameters, and print those that are best for each metric.

    Parameters
    ----------
    data : Path
        A data set with the split "validation".
    weights : Path
        A trained network.
    trials : int
        Number of parameters to try.
    seed : int
        Seed of the search.
    """
    frames = TrainingSet(data, "validation")
    net = load_net(weights, frames.camera)
    o = frames.arrays["occupancy"]
    truth = frames.arrays["truth"]
    log_g = np.stack([learned_log_g(net, frames[k]) for k in range(len(frames))], axis=1)  # (C, N, H, W)
    temperature = fit_temperature(log_g, truth)
    log_g = log_softmax(log_g / temperature, axis=0)
    points = []
    values = []
    for _ in tqdm(range(trials), unit="trial"):
        points.append(next_point(points, values, seed))
        params = params_at(points[-1], frames.spec.cell)
        labels = [mean_field(-log_g[:, k], o[k], params).argmax(0) for k in range(len(frames))]
        confusion = confusion_matrix(truth, np.array(labels), len(log_g))
        values.append(np.array([pixel_accuracy(confusion), class_accuracy(confusion)]))
    print(f"temperature {temperature:.3f}")
    for metric, best in zip(("pixel accuracy", "class accuracy"), np.argmax(values, axis=0), strict=True):
        print(f"best {metric}: {values[best]}, {params_at(points[best], frames.spec.cell)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
