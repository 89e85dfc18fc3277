"""A search for the CRF's parameters: which to try next, and which of those that were tried are best (section 3.5)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf.params import CrfParams
from semgrid_edu.errors import ArgumentError
from semgrid_edu.storage.files import table_beside

FACTORS: dict[str, tuple[float, float]] = table_beside(__file__)
"""The parameters that are searched, the axes of a point, and the ends of each axis as factors of the default; between
them an axis is logarithmic. Weights of a fiftieth leave a grid nearly as it is. So do kernels narrower than a cell, but
they take the permutohedral lattice much longer."""

EXPLORED = 64
"""After this number of trials, three of four refine what is best so far."""

FIRST_STEP, SHRINK = 0.2, 0.98
"""Standard deviation of the first refining steps, as a part of the box's side, and its factor from trial to trial."""


def params_at(point: ArrayLike, cell: float) -> CrfParams:
    """Return the parameters that a point of the unit cube stands for.

    Parameters
    ----------
    point : (5,) float
        One number for each of `FACTORS`: 0 and 1 are the ends of its axis.
    cell : float
        Side of a cell, metres; the factors multiply the defaults of `CrfParams.for_cells`.

    Returns
    -------
    CrfParams
        Rounded to three digits, so that what is written down is exactly what was used.

    Raises
    ------
    ArgumentError
        When the point isn't one of the unit cube.

    Examples
    --------
    >>> params_at([0.5, 0.5, 0.5, 0.0, 1.0], cell=0.2).sigma_beta
    0.05
    """
    point = np.asarray(point, dtype=float)
    if point.shape != (len(FACTORS),) or not ((point >= 0) & (point <= 1)).all():
        raise ArgumentError("point", f"{len(FACTORS)} numbers from 0 to 1", point)
    low, high = _ends(cell)
    values = np.exp(low + point * (high - low))
    return CrfParams(**{name: float(f"{value:.3g}") for name, value in zip(FACTORS, values, strict=True)})


def point_of(params: CrfParams, cell: float) -> NDArray[np.float64]:
    """Return the point of the unit cube that stands for parameters: the inverse of `params_at`.

    Parameters
    ----------
    params : CrfParams
        Parameters with positive weights.
    cell : float
        Side of a cell, metres.

    Returns
    -------
    (5,) float64
        Between 0 and 1 for parameters that the search reaches.
    """
    low, high = _ends(cell)
    return (np.log([getattr(params, name) for name in FACTORS]) - low) / (high - low)


def next_point(points: ArrayLike, values: ArrayLike, seed: int) -> NDArray[np.float64]:
    """Return the point to try next.

    At first the points of a scrambled Halton sequence fill the cube evenly. After `EXPLORED` trials only each fourth
    goes on with the sequence. The others make a Gaussian step from the point that is best so far by one of the
    objectives, each in turn, and the steps become shorter from trial to trial.

    A trial depends on the seed and on the trials before it alone, not on how many there will be. So a search can be
    interrupted, resumed, and later prolonged, and ends as if it had never stopped.

    Parameters
    ----------
    points : (n, 5) float
        The points that were tried, in this order.
    values : (n, K) float
        What each of K objectives gave there: the higher, the better.
    seed : int
        Seed for the sequence and for the steps; not negative.

    Returns
    -------
    (5,) float64
        Numbers from 0 to 1.
    """
    points, values = np.asarray(points, dtype=float), np.asarray(values, dtype=float)
    n, refined = len(points), len(points) - EXPLORED
    if refined < 0 or refined % 4 == 0:
        return _halton(n if refined < 0 else EXPLORED + refined // 4, seed)
    best = points[values[:, n % values.shape[1]].argmax()]
    step = FIRST_STEP * SHRINK**refined * np.random.default_rng([seed, n]).normal(size=len(best))
    return np.clip(best + step, 0, 1)


def pareto_front(values: ArrayLike) -> NDArray[np.int64]:
    """Return the trials that no other trial beats in one objective without losing in another.

    Parameters
    ----------
    values : (n, K) float
        What each of K objectives gave in each trial: the higher, the better.

    Returns
    -------
    (m,) int64
        Their numbers, by falling value of the first objective; of equal trials the first one only.

    Examples
    --------
    >>> pareto_front([[0.8, 0.5], [0.7, 0.6], [0.7, 0.5], [0.8, 0.5]])
    array([0, 1])
    """
    values = np.asarray(values, dtype=float)
    as_good = (values[:, None] >= values).all(axis=2)
    better = as_good & (values[:, None] > values).any(axis=2)
    earlier_twin = np.triu(as_good & as_good.T, k=1)
    front = np.flatnonzero(~(better | earlier_twin).any(axis=0))
    return front[np.argsort(-values[front, 0], kind="stable")]


def _ends(cell: float) -> NDArray[np.float64]:
    """Return the logarithms of the lowest and of the highest value of each parameter."""
    defaults = np.array([getattr(CrfParams.for_cells(cell), name) for name in FACTORS])
    return np.log(defaults * np.transpose(list(FACTORS.values())))


def _halton(index: int, seed: int) -> NDArray[np.float64]:
    """Return one point of the scrambled sequence."""
    # It takes half a second, and most who refine a map never search.
    from scipy.stats import qmc

    sequence = qmc.Halton(len(FACTORS), scramble=True, seed=seed)
    return sequence.fast_forward(index).random(1)[0]
