"""Approximate against exact inference in the dense CRF on tiny grids, as the coupling grows (eq. (3), (4)).

The coupling is the weight w1 of the bilateral kernel; the weight w2 of the spatial kernel is three quarters of it, as
by default. So 4 stands for the default parameters, and 0 for no pairs at all.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams, mean_field, mean_field_naive, unary_from_probability
from semgrid_edu.errors import check_whole
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.storage.reading import resumable_json
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table
from semgrid_edu.workshop.studies.crf.other_ways import potts_messages, visit_labellings

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
"""What is compared with exact inference."""
ONLY_LABELS = ("loopy max-product",)
"""Ways that don't say how probable a class is, so that only their labels are compared."""


def crf_coupling(log: str | Path, seed: int = 0, draws: int = 20) -> dict:
    """Compare every way with exact inference on random tiny grids, coupling by coupling.

    Parameters
    ----------
    log : path-like
        Takes each size as soon as it is done. If the file exists, sizes that it holds aren't measured again.
    seed : int
        Seed for the random CRFs.
    draws : int
        Number of random CRFs of each size, at least one.

    Returns
    -------
    dict
        "cases": by name from `measure_coupling`; with seed, command and versions. JSON can hold it.

    Raises
    ------
    ArgumentError
        When the seed is negative, or nothing is to be drawn.
    DataError
        When the log is something else, or was begun with another seed or other numbers.
    """
    check_whole(seed=seed)
    check_whole(1, draws=draws)
    identity = {"seed": seed, "draws": draws, "couplings": list(COUPLINGS)}
    command = f"semgrid-edu reproduce crf-coupling --seed {seed} --draws {draws}"
    done = resumable_json(log, identity, "cases")
    for (height, width), n in product(GRIDS, CLASSES):
        name = f"{height} x {width} cells, {n} classes"
        if name not in done:
            done[name] = measure_coupling((n, height, width), COUPLINGS, draws, seed, name)
            write_json(log, identity | {"cases": done})
    return identity | {"cases": done, **made_by(command, "numpy", "scipy", "numba")}


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
        What the progress bar says.

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
        crf = *random_crf(shape, seed + draw), CrfParams(w_bilateral=coupling, w_spatial=0.75 * coupling)
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


def crf_coupling_tables(result: dict) -> str:
    """Return the means over the draws, one table per size.

    Parameters
    ----------
    result : dict
        From `crf_coupling`, or from the JSON file that it was written to.

    Returns
    -------
    str
        Mean total variation and share of wrong labels, per cent.
    """
    titles = {"variation": "mean total variation", "labels": "labels unlike the most likely labelling"}
    head, tables = ["coupling", *(f"{coupling:g}" for coupling in result["couplings"])], []
    for (name, case), (part, title) in product(result["cases"].items(), titles.items()):
        rows = [[way, *(f"{100 * np.mean(e):.1f}" for e in errors)] for way, errors in case[part].items()]
        tables.append(f"{name}, {title}, per cent\n\n{markdown_table([head, *rows])}")
    return "\n\n".join(tables)
