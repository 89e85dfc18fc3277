"""What the neighbours of a cell add in the CRF's last mean-field update (eq. (3), (4)), by the CRF's own kernels."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf import CrfParams, unary_from_probability
from semgrid_edu.crf.kernel import gaussian
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import SeparableGaussian, mean_field
from semgrid_edu.fast.crf.windowed import RADIUS, WindowedGaussian


@dataclass(frozen=True, eq=False)
class NeighbourPull:
    """What the CRF's last update did to one cell i.

    Parameters
    ----------
    before, after : (C,) float64
        The cell's distribution in the semantic grid g, and in the refined grid.
    weights : (H, W) float64
        k_ij, the bracket of eq. (4), for each other cell j; 0 for the cell itself.
    neighbours : (C, H, W) float32
        Q_j before the last update.
    """

    before: NDArray[np.float64]
    after: NDArray[np.float64]
    weights: NDArray[np.float64]
    neighbours: NDArray[np.float32]

    @property
    def messages(self) -> NDArray[np.float64]:
        """(C,): sum_j k_ij Q_j(l), what all neighbours together add to the logarithm of each class's probability."""
        return np.einsum("hw,chw->c", self.weights, self.neighbours)

    def strongest(self, label: int, number: int = 5) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the neighbours that pull the cell most towards a class.

        Parameters
        ----------
        label : int
            The class, l.
        number : int
            How many neighbours.

        Returns
        -------
        cells : (number, 2) int64
            Their rows and columns, the strongest first.
        pull : (number,) float64
            k_ij Q_j(l) of each: its term of `messages[label]`.
        """
        terms = self.weights * self.neighbours[label]
        best = np.argsort(-terms, axis=None, kind="stable")[:number]
        return np.stack(np.unravel_index(best, terms.shape), axis=-1), terms.ravel()[best]


def neighbour_pull(
    g: NDArray, refined: NDArray, o: NDArray, cell: tuple[int, int], params: CrfParams, iterations: int = 10
) -> NeighbourPull:
    """Repeat the CRF up to its last update, and write out what one cell's neighbours add in that one.

    Parameters
    ----------
    g : (C, H, W) float
        The semantic grid: probabilities.
    refined : (C, H, W) float
        What `mean_field` made of it.
    o : (4, H, W) float
        The probabilities of the four states.
    cell : (int, int)
        Row and column of the cell i.
    params : CrfParams
        The parameters of the refinement.
    iterations : int
        The number of its updates, at least 1.

    Returns
    -------
    NeighbourPull
        The weights of all neighbours, what they believed, and the cell before and after.

    Raises
    ------
    ArgumentError
        When there is no update to explain, or an argument isn't what `mean_field` takes.
    """
    Q = beliefs_before_last_update(g, o, params, iterations)
    before, after = (np.asarray(grid[:, *cell], np.float64) for grid in (g, refined))
    return NeighbourPull(before, after, weights_of_cell(o, params, cell), Q)


def beliefs_before_last_update(g: NDArray, o: NDArray, params: CrfParams, iterations: int = 10) -> NDArray[np.float32]:
    """Return Q, (C, H, W), before the last of the CRF's updates. Parameters are those of `neighbour_pull`."""
    if iterations < 1:
        raise ArgumentError("iterations", "at least one update to explain", iterations)
    return mean_field(unary_from_probability(g), o, params, iterations - 1)


def weights_of_cell(o: NDArray, params: CrfParams, cell: tuple[int, int]) -> NDArray[np.float64]:
    """Return the bracket of eq. (4) between one cell and every other: one row of `pair_weights`, for any size of grid.

    The kernels are symmetric filters, so the row is what they make of a grid of zeros with a 1 in the cell.

    Parameters
    ----------
    o : (4, H, W) float
        o_i, the probabilities of the four states.
    params : CrfParams
        Weights, widths and normalisation.
    cell : (int, int)
        Row and column of the cell i.

    Returns
    -------
    (H, W) float64
        k_ij for each cell j; 0 for the cell itself, which is no pair with itself, and beyond the kernels' windows.
    """
    alone = np.zeros(o.shape[1:], np.float32)
    alone[cell] = 1
    weights = sum(kernel(alone.reshape(-1, 1)) for kernel in _kernels(o, params)).reshape(alone.shape)
    weights[cell] = 0
    return weights.astype(np.float64)


def neighbour_messages(Q: NDArray, o: NDArray, params: CrfParams) -> NDArray[np.float32]:
    """Return `NeighbourPull.messages` of every cell at once.

    Parameters
    ----------
    Q : (C, H, W) float32
        What every cell believed before the update.
    o, params
        As for `weights_of_cell`.

    Returns
    -------
    (C, H, W) float32
        sum_{j != i} k_ij Q_j(l).
    """
    rows = np.ascontiguousarray(Q.reshape(len(Q), -1).T)
    sums = sum(kernel(rows) - kernel.diagonal[:, None] * rows for kernel in _kernels(o, params))
    return sums.T.reshape(Q.shape)


def strongest_neighbours(
    Q: NDArray, labels: NDArray, o: NDArray, params: CrfParams, number: int = 5
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Return `NeighbourPull.strongest` of every cell at once, among the neighbours in the window of `WindowedGaussian`.

    Parameters
    ----------
    Q, o, params
        As for `neighbour_messages`.
    labels : (H, W) int
        The class l of each cell i towards which it is pulled.
    number : int
        How many neighbours.

    Returns
    -------
    steps : (2, number, H, W) int64
        Rows and columns from each cell to its neighbours, the strongest first; 0 where there are fewer.
    pull : (number, H, W) float32
        k_ij Q_j(l) of each.
    """
    place = np.indices(labels.shape, dtype=np.float32)
    features = np.concatenate([place / params.sigma_alpha, o / params.sigma_beta]), place / params.sigma_gamma
    # k_ij of a kernel is exp(-|f_i - f_j|^2 / 2) times a factor of i and one of j, whose squares are its diagonal.
    factors = [np.sqrt(kernel.diagonal).reshape(labels.shape) for kernel in _kernels(o, params)]
    reach = int(np.ceil(RADIUS * params.sigma_alpha))
    padded = [_padded(maps, reach) for maps in (*features, *factors, Q)]
    steps = sorted(product(range(-reach, reach + 1), repeat=2), key=np.linalg.norm)
    pull, which = np.zeros((number, *labels.shape), np.float32), np.zeros((number, *labels.shape), np.int64)
    for k, step in enumerate(steps[1:], start=1):
        *others, Q_j = (_shifted(maps, reach, step) for maps in padded)
        kernels = zip(features, others[:2], factors, others[2:], strict=True)
        weights = sum(a * a_j * gaussian(np.square(f - f_j).sum(axis=0)) for f, f_j, a, a_j in kernels)
        _insert(pull, which, weights * np.take_along_axis(Q_j, labels[None], axis=0)[0], k)
    return np.moveaxis(np.array(steps)[which], -1, 0), pull


def _kernels(o: NDArray, params: CrfParams) -> tuple[WindowedGaussian, SeparableGaussian]:
    """Return both kernels of eq. (4), pair by pair."""
    spatial = SeparableGaussian.build(o.shape[1:], params.sigma_gamma, params.w_spatial, params.normalization)
    return WindowedGaussian.build(o, params), spatial


def _padded(maps: NDArray, reach: int) -> NDArray:
    """Put zeros around maps (..., H, W): cells beyond the border have no weight."""
    return np.pad(maps, [(0, 0)] * (maps.ndim - 2) + [(reach, reach)] * 2)


def _shifted(padded: NDArray, reach: int, step: tuple[int, int]) -> NDArray:
    """Return padded maps shifted by `step`, rows and columns: each cell gets what lies that far further on."""
    rows, cols = (slice(reach + by, size - reach + by) for by, size in zip(step, padded.shape[-2:], strict=True))
    return padded[..., rows, cols]


def _insert(pull: NDArray, which: NDArray, term: NDArray, number: int) -> None:
    """Put a term of each cell, and its number, into the cell's list of its largest terms if it is one of them."""
    at = term > pull[-1]
    terms = np.concatenate([pull[:, at], term[None, at]])
    numbers = np.concatenate([which[:, at], np.full((1, at.sum()), number)])
    order = np.argsort(-terms, axis=0, kind="stable")[:-1]
    pull[:, at], which[:, at] = (np.take_along_axis(of, order, axis=0) for of in (terms, numbers))
