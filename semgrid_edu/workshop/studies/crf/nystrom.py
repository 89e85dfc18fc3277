"""Mean field with a low-rank bilateral kernel: every cell is compared with a few landmarks only (Nystroem's method)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf import CrfParams, SeparableGaussian
from semgrid_edu.crf.accurate import filtered_updates
from semgrid_edu.crf.kernel import kernels
from semgrid_edu.crf.naive import settled
from semgrid_edu.crf.params import check_inputs, check_stop

_NEGLIGIBLE = 1e-10
"""Eigenvalues of the landmarks' kernel below this share of the largest are rounding errors and are left out."""


@dataclass(frozen=True)
class LowRankGaussian:
    """Sums over all cells, weighted by K_nm K_mm^-1 K_mn in place of the Gaussian K_nn, with m landmarks.

    Between landmarks it is exact. The weights of a cell that is far from every landmark vanish.

    Parameters
    ----------
    factor : (N, r) float32
        F, one row per cell: the kernel is F F^T, weight and normalisation included.
    """

    factor: NDArray[np.float32]

    @classmethod
    def build(cls, values: NDArray, params: CrfParams, landmarks: NDArray[np.integer]) -> "LowRankGaussian":
        """Factorise the bilateral kernel of eq. (4).

        Parameters
        ----------
        values : (4, H, W) float
            o_i, the occupancy probabilities of each cell.
        params : CrfParams
            Weight, widths and normalisation.
        landmarks : (m,) int
            The cells that are landmarks, counted row by row.

        Returns
        -------
        LowRankGaussian
            A kernel of rank m or less.
        """
        to_landmarks = kernels(values, params, landmarks)[0].T
        eigenvalues, vectors = np.linalg.eigh(to_landmarks[landmarks])
        kept = eigenvalues > _NEGLIGIBLE * eigenvalues[-1]
        factor = to_landmarks @ (vectors[:, kept] / np.sqrt(eigenvalues[kept]))
        degree = np.ones(len(factor))
        if params.normalization == "symmetric":
            degree = np.maximum(factor @ factor.sum(axis=0), 1)  # the exact row sums, with the cell itself, are no less
        return cls((factor * np.sqrt(params.w_bilateral / degree)[:, None]).astype(np.float32))

    @property
    def diagonal(self) -> NDArray[np.float32]:
        """k_ii, the share of its own value that each cell gets back, (N,)."""
        return np.square(self.factor).sum(axis=1)

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return sum_j k_ij values_j for values (N, K), one row per cell, the cell itself included."""
        return self.factor @ (self.factor.T @ values)


def mean_field_low_rank(
    unary: ArrayLike,
    values: ArrayLike,
    params: CrfParams,
    iterations: int = 10,
    tolerance: float = 0.0,
    rank: int = 256,
    seed: int = 0,
) -> NDArray[np.float32]:
    """Approximate the CRF's marginals by mean field with a low-rank bilateral kernel.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u, see `unary_from_probability`; inf where a class is impossible.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell: they sum to one.
    params : CrfParams
        Weights, widths and normalisation.
    iterations : int
        The largest number of updates of all cells.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.
    rank : int
        Number of landmarks, drawn from the cells; all of them when there are fewer.
    seed : int
        Seed for the landmarks.

    Returns
    -------
    (C, H, W) float32
        Q, the distribution over classes in each cell.

    Raises
    ------
    ArgumentError
        When shapes don't fit or numbers aren't what they should be.
    """
    unary, values = check_inputs(unary, values)
    check_stop(iterations, tolerance)
    cells = values[0].size
    landmarks = np.random.default_rng(seed).choice(cells, min(rank, cells), replace=False)
    spatial = SeparableGaussian.build(unary.shape[1:], params.sigma_gamma, params.w_spatial, params.normalization)
    kernels = LowRankGaussian.build(values, params, landmarks), spatial
    return settled(filtered_updates(unary, kernels), iterations, tolerance)
