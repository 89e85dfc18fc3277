"""Approximate against exact inference in the dense CRF on tiny grids, as the coupling grows (eq. (3), (4)).

The coupling is the weight w1 of the bilateral kernel; the weight w2 of the spatial kernel is three quarters of it, as
by default. So 4 stands for the default parameters, and 0 for no pairs at all.
"""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams, mean_field, mean_field_naive, unary_from_probability
from semgrid_edu.storage.provenance import made_by
from worlds.lecture_10_crf import coupled
from worlds.lecture_11_other_ways import potts_messages, visit_labellings

COUPLINGS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)
"""From no pairs to the default weights."""
GRIDS = ((3, 3), (4, 4))
"""Rows and columns."""
CLASSES = (2, 3)
"""Numbers of classes."""
Inference = Callable[[NDArray, NDArray, CrfParams], NDArray]
"""Takes unary, values and params, and returns a distribution over the classes in each cell, (C, H, W)."""


WAYS: Mapping[str, Inference] = {
    "mean field, 10 updates": mean_field_naive,
    "mean field, converged": partial(mean_field_naive, iterations=10_000, tolerance=1e-9),
    "fast mean field, 10 updates": mean_field,
    "loopy sum-product": potts_messages,
    "loopy max-product": partial(potts_messages, best=True),
}
"""The methods that are compared with exact inference."""
ONLY_LABELS = ("loopy max-product",)
"""Methods that don't give probabilities, so that only their labels are compared."""


def random_crf(shape: tuple[int, int, int], seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw a unary term and occupancy values.

    Parameters
    ----------
    shape : (int, int, int)
        C, H, W.
    seed : int
        Seed for both.

    Returns
    -------
    unary : (C, H, W) float64
        Of soft-maxes of normally distributed scores.
    values : (4, H, W) float64
        Drawn from a Dirichlet distribution whose parameters are all 1/2: most cells lean towards one state.
    """
    rng = np.random.default_rng((seed, *shape))
    unary = unary_from_probability(softmax(rng.normal(size=shape), axis=0))
    return unary, np.moveaxis(rng.dirichlet(np.full(4, 0.5), shape[1:]), -1, 0)


def measure_coupling(
    shape: tuple[int, int, int], couplings: Sequence[float], draws: int, seed: int = 0, name: str = ""
) -> dict:
    """Compare every way with exact inference on random CRFs of one size.

    Parameters
    ----------
    shape : (int, int, int)
        C, H, W.
    couplings : sequence of float
        Weights w1.
    draws : int
        Number of random CRFs, with seeds from `seed` up.
    seed : int
        Seed for the first.
    name : str
        The text of the progress bar.

    Returns
    -------
    dict
        "variation": for each way of `WAYS` but `ONLY_LABELS` (couplings, draws), the mean total variation of a cell's
        distribution from the exact one, 0..1. "labels": for each way, and for "exact marginals", (couplings, draws),
        the share of the cells whose most probable class is another than in the most likely labelling.
    """
    variation: dict[str, list] = {way: [] for way in WAYS if way not in ONLY_LABELS}
    labels: dict[str, list] = {way: [] for way in ("exact marginals", *WAYS)}
    for coupling, draw in tqdm(list(product(couplings, range(draws))), desc=name, unit="CRF"):
        crf = *random_crf(shape, seed + draw), coupled(coupling)
        exact, best = visit_labellings(*crf)
        found = {"exact marginals": exact} | {way: infer(*crf) for way, infer in WAYS.items()}
        for way, Q in found.items():
            labels[way].append(float((Q.argmax(axis=0) != best).mean()))
        for way, errors in variation.items():
            errors.append(float(np.abs(found[way] - exact).sum(axis=0).mean() / 2))
    return {
        part: {way: np.reshape(errors, (-1, draws)).tolist() for way, errors in by_way.items()}
        for part, by_way in (("variation", variation), ("labels", labels))
    }


def main(out: Path, seed: int = 0, draws: int = 20) -> None:
    """Measure every size, and write the result.

    Parameters
    ----------
    out : Path
        A JSON file.
    seed : int
        Seed for the first random CRF of each size.
    draws : int
        Number of random CRFs of each size.
    """
    cases = {}
    for (height, width), n in product(GRIDS, CLASSES):
        name = f"{height} x {width} cells, {n} classes"
        cases[name] = measure_coupling((n, height, width), COUPLINGS, draws, seed, name)
    made = made_by("python notebooks/worlds/lecture_11_coupling.py", "numpy", "scipy")
    found = {"seed": seed, "draws": draws, "couplings": list(COUPLINGS), "cases": cases, **made}
    out.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
