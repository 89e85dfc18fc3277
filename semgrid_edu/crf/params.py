"""Parameters and input of the CRF that refines the semantic grid (paper, section 3.5)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError, check_fields, types_named

LARGEST_WEIGHT = 1e30
"""The largest weight of a kernel. `fast.mean_field` computes in float32, whose largest number is 3e38."""

NARROWEST = 0.15
"""The narrowest kernel that the filters compute, cells. At this width neighbours are 6.7 widths apart, out of the
lattice's reach, and the Gaussian is 2e-10. A narrower kernel doesn't couple cells either, so the filters use this
width."""

PAPER_CELL = 0.2
"""Side of a cell in the paper, metres (section 4.1)."""


@dataclass(frozen=True)
class CrfParams:
    """The parameters of eq. (4). The paper gives no values.

    Parameters
    ----------
    w_bilateral, w_spatial : float
        w1 and w2, the weights of the two kernels. The defaults are 4 and 3. Kraehenbuehl and Koltun's published code
        uses 10 and 3 for images; occupancy gets less weight here than colour does there, because many classes have the
        same state.
    sigma_alpha : float
        Width of the bilateral kernel in space, cells: 8 cells are 1.6 m in the paper's grid, the width of a car.
    sigma_beta : float
        Width of the bilateral kernel in state probability. Two cells that are certain of different states are sqrt(2)
        apart, seven times 0.2, so they hardly influence each other. A cell that is certainly free still influences one
        that is 90 % free.
    sigma_gamma : float
        Width of the spatial kernel, cells: 3, as in Kraehenbuehl and Koltun's published code, removes single wrong
        cells.
    normalization : {"symmetric", "none"}
        "symmetric" replaces each kernel K, its diagonal of ones included, by D^-1/2 K D^-1/2 with D its row sums, as
        Kraehenbuehl's code does by default. Every cell then receives about the same total weight, whatever the sigmas
        are and however common its state is. "none" is eq. (4) as printed: hundreds of neighbours count with full
        weight, which over-smooths.

    Raises
    ------
    ArgumentError
        When a weight is negative or above `LARGEST_WEIGHT`, a sigma isn't positive, or the normalisation is unknown.
    """

    w_bilateral: float = 4.0
    w_spatial: float = 3.0
    sigma_alpha: float = 8.0
    sigma_beta: float = 0.2
    sigma_gamma: float = 3.0
    normalization: Literal["symmetric", "none"] = "symmetric"

    @classmethod
    def for_cells(cls, cell: float) -> "CrfParams":
        """Return the defaults for cells of another size: the kernels reach 1.6 m and 0.6 m in any grid.

        Parameters
        ----------
        cell : float
            Side of a cell, metres; the plain defaults are for the paper's 0.2.

        Examples
        --------
        >>> CrfParams.for_cells(0.5).sigma_alpha
        3.2
        """
        if not 0 < cell < np.inf:
            raise ArgumentError("cell", "a positive number of metres", cell)
        scale = PAPER_CELL / cell
        return cls(sigma_alpha=cls.sigma_alpha * scale, sigma_gamma=cls.sigma_gamma * scale)

    @types_named
    def __post_init__(self) -> None:
        """Raise an error for numbers that make no sense in eq. (4)."""
        weights = f"a weight of at least 0 and at most {LARGEST_WEIGHT:g}"
        check_fields(self, weights, lambda weight: 0 <= weight <= LARGEST_WEIGHT, "w_bilateral", "w_spatial")
        widths = "sigma_alpha", "sigma_beta", "sigma_gamma"
        check_fields(self, "a positive width", lambda sigma: 0 < sigma < np.inf, *widths)
        if self.normalization not in ("symmetric", "none"):
            raise ArgumentError("normalization", '"symmetric" or "none"', repr(self.normalization))


def unary_from_probability(probability: ArrayLike) -> NDArray[np.float64]:
    """Turn the network's distribution into the unary term of eq. (3): phi_u(x_i) = -log p_i(x_i).

    Parameters
    ----------
    probability : (C, ...) float
        The distribution over the classes in each cell (the soft-max of the network's scores).

    Returns
    -------
    (C, ...) float64
        The unary term; infinite for a class of probability 0, which the CRF then never chooses.

    Raises
    ------
    ArgumentError
        When the columns aren't distributions.

    Examples
    --------
    >>> unary_from_probability([0.5, 0.5]).round(3)
    array([0.693, 0.693])
    """
    probability = np.asarray(probability, dtype=np.float64)
    if probability.ndim == 0 or not (probability >= 0).all() or not np.allclose(probability.sum(axis=0), 1, atol=1e-3):
        raise ArgumentError("probability", "distributions along axis 0", f"an array of shape {probability.shape}")
    with np.errstate(divide="ignore"):
        return -np.log(probability)
