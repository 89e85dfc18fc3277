"""The CRF as a layer of a network: mean field unrolled in torch, with weights, widths and label costs that learn.

A trained layer is kept in a safetensors file whose header says how to build it again.
"""

import json
import math
from pathlib import Path

import torch
from torch import Tensor, nn

from semgrid_edu.crf.naive import NEVER, mean_field_update
from semgrid_edu.crf.pair_window import Pairs, bilateral_pairs, spatial_pairs
from semgrid_edu.crf.params import CrfParams, check_stop
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.networks.weights import check_tensors
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.storage.reading import parse_json
from semgrid_edu.storage.tensors import read_tensors, write_tensors

REACH = 4
"""Half the side of the window in sigma_alpha, by default: a pair beyond has at most exp(-8) = 0.0003 of the
weight of neighbours."""


class CrfLayer(nn.Module):
    """Refine semantic grids by a fixed number of mean field updates, each of which is differentiable (eq. (3), (4)).

    Learnable are the logarithms of w1 and w2 and of the three widths, so that these stay positive, and, if asked for,
    mu(l, m), the cost of the labels l and m in two cells, times the pair weight of eq. (4). At first mu is that of the
    paper, 0 for equal labels and 1 for different ones, the Potts model. This is the network of Zheng et al. 2015
    ("Conditional random fields as recurrent neural networks") with widths that learn too.

    The update is that of `mean_field_naive`, and equals it when the window covers the grid. Its damping, adapted to mu
    in `step_size`, makes sure that no update raises the free energy, whatever mu has been learnt. This guarantee has
    two limits. It is exact only for a window that covers the grid, because a Gaussian that is cut off may have small
    negative eigenvalues; what is cut off is small (`REACH`). And a lower free energy means a better approximation of
    the CRF's distribution; whether the map is better is another question.

    Parameters
    ----------
    params : CrfParams
        Weights, widths and normalisation to start from. A weight of 0 stays 0.
    n_classes : int
        C, the number of classes.
    radius : int, optional
        Half the side of the window of the bilateral kernel, cells; `REACH` times sigma_alpha when left out. The window
        stays as it is when sigma_alpha learns. The spatial kernel needs none.
    iterations : int
        How often all cells are updated.
    learn_compatibility : bool
        Whether mu learns. If not, it stays the Potts model, and `params` describes the whole layer.

    Raises
    ------
    ArgumentError
        When a number is impossible.

    Examples
    --------
    >>> layer = CrfLayer(CrfParams.for_cells(0.5), n_classes=14)
    >>> log_g, o = torch.zeros(1, 14, 8, 6), torch.full((1, 4, 8, 6), 0.25)
    >>> layer(log_g, o).exp().sum(dim=1).allclose(torch.ones(1, 8, 6))
    True
    """

    def __init__(
        self,
        params: CrfParams,
        n_classes: int,
        radius: int | None = None,
        iterations: int = 10,
        learn_compatibility: bool = False,
    ) -> None:
        super().__init__()
        check_stop(iterations)
        radius = math.ceil(REACH * params.sigma_alpha) if radius is None else radius
        for name, number in (("n_classes", n_classes), ("radius", radius)):
            if number < 1:
                raise ArgumentError(name, "at least 1", number)
        self.normalization, self.radius, self.iterations = params.normalization, radius, iterations
        weights = torch.tensor([params.w_bilateral, params.w_spatial], dtype=torch.float64)
        sigmas = torch.tensor([params.sigma_alpha, params.sigma_beta, params.sigma_gamma], dtype=torch.float64)
        self.log_weights = nn.Parameter(weights.log().to(torch.get_default_dtype()))
        self.log_sigmas = nn.Parameter(sigmas.log().to(torch.get_default_dtype()))
        self.label_costs = nn.Parameter(1 - torch.eye(n_classes), requires_grad=learn_compatibility)

    @property
    def compatibility(self) -> Tensor:
        """mu, (C, C): symmetric, since a pair of cells has no first and second one."""
        return (self.label_costs + self.label_costs.T) / 2

    @property
    def n_classes(self) -> int:
        """C, the number of classes."""
        return len(self.label_costs)

    def description(self) -> dict[str, object]:
        """Return what `load_crf` needs, for JSON: the normalisation and all arguments but `params`, by name."""
        names = ("normalization", "n_classes", "radius", "iterations")
        return {name: getattr(self, name) for name in names} | {"learn_compatibility": self.label_costs.requires_grad}

    def params(self) -> CrfParams:
        """Return the weights and widths as they are now, for `mean_field` and all else that takes parameters.

        Returns
        -------
        CrfParams
            With float32's precision.

        Raises
        ------
        ArgumentError
            When mu has learnt, since no other function of the package has one.
        """
        if not torch.equal(self.label_costs.detach().cpu(), 1 - torch.eye(self.n_classes)):
            raise ArgumentError("compatibility", "the Potts model; only the layer itself has another", "a learnt one")
        return CrfParams(*self.log_weights.exp().tolist(), *self.log_sigmas.exp().tolist(), self.normalization)

    def forward(self, log_g: Tensor, occupancy: Tensor) -> Tensor:
        """Refine a batch of semantic grids.

        Parameters
        ----------
        log_g : (B, C, H, W) float
            Logarithms of the network's probabilities, or its logits; -inf for an impossible class.
        occupancy : (B, 4, H, W) float
            Probability of FREE, STATIC, DYNAMIC, UNKNOWN; they sum to 1 in each cell. It gets no gradient.

        Returns
        -------
        (B, C, H, W) float
            log Q, natural logarithms of the refined probabilities.

        Raises
        ------
        ArgumentError
            When the shapes don't fit, or a cell holds no distribution.
        """
        self._check(log_g, occupancy)
        phi = (log_g.amax(dim=1, keepdim=True) - log_g).clamp(max=NEVER)
        pairs, mu = self.pairs(occupancy), self.compatibility
        step = step_size(pairs, mu)
        log_Q = (-phi).log_softmax(dim=1)
        for _ in range(self.iterations):
            cost = torch.einsum("lm,bmhw->blhw", mu, pairs.sums(log_Q.exp()))
            log_Q = mean_field_update(log_Q, phi, cost, step).log_softmax(dim=1)
        return log_Q

    def pairs(self, occupancy: Tensor) -> Pairs:
        """Return the bracket of eq. (4), both kernels together, for all pairs of cells of a batch.

        Parameters
        ----------
        occupancy : (B, 4, H, W) float
            o, the probabilities of the four states.
        """
        (w1, w2), (sigma_alpha, sigma_beta, sigma_gamma) = self.log_weights.exp(), self.log_sigmas.exp()
        bilateral = bilateral_pairs(occupancy, self.radius, sigma_alpha, sigma_beta)
        both = [bilateral, spatial_pairs(occupancy, sigma_gamma)]
        if self.normalization == "symmetric":
            both = [kernel.normalised(occupancy) for kernel in both]
        first, second = both
        return Pairs(lambda x: w1 * first.sums(x) + w2 * second.sums(x), w1 * first.own + w2 * second.own)

    def _check(self, log_g: Tensor, occupancy: Tensor) -> None:
        """Refuse what `mean_field` refuses."""
        if log_g.ndim != 4 or log_g.shape[1] != self.n_classes:
            raise ArgumentError("log_g", f"shape (B, {self.n_classes}, H, W)", tuple(log_g.shape))
        expected = (len(log_g), N_STATES, *log_g.shape[2:])
        if tuple(occupancy.shape) != expected:
            raise ArgumentError("occupancy", f"shape {expected}", tuple(occupancy.shape))
        if not log_g.amax(dim=1).isfinite().all():
            raise ArgumentError("log_g", "numbers, and a possible class in each cell", "NaN, inf or a cell without any")
        if not (occupancy.sum(dim=1) - 1).abs().le(1e-3).all():
            raise ArgumentError("occupancy", "four probabilities that sum to 1 in each cell", "a cell where they don't")


def step_size(pairs: Pairs, compatibility: Tensor) -> Tensor:
    """Return how far an update of all cells at once may go without raising the free energy, whatever the label costs.

    This is `damping` for any symmetric mu. For distributions, only how mu acts on differences of two distributions
    matters, which sum to 0. Let lambda+ be its largest eigenvalue there, and -lambda- its smallest (each 0 if it has
    the other sign). The part of mu with negative eigenvalues makes the pair term concave, up to the diagonal of the
    kernel, as in `damping`: it lies below its tangent plus lambda- k_ii / 2 |Q'_i - Q_i|^2. For the part with positive
    eigenvalues, |sum_ij k_ij D_i . D_j| <= sum_i r_i |D_i|^2, with r_i the row sum of all weights k_ij >= 0 of other
    cells. So with Pinsker's inequality the step

        p_i = 1 / (1 + (lambda- k_ii + lambda+ r_i) / 2)

    never raises the free energy. For the Potts model, lambda- = 1 and lambda+ = 0.

    Parameters
    ----------
    pairs : Pairs
        The kernel k.
    compatibility : (C, C) float
        mu, symmetric.

    Returns
    -------
    (B or 1, 1, H, W) float
        p_i, above 0 and at most 1.
    """
    n_classes = len(compatibility)
    differences = torch.eye(n_classes).to(compatibility) - 1 / n_classes  # subtracts the mean
    eigenvalues = torch.linalg.eigvalsh(differences @ compatibility @ differences)
    rows = pairs.sums(torch.ones_like(pairs.own))
    return 1 / (1 + (eigenvalues[0].neg().relu() * pairs.own + eigenvalues[-1].relu() * rows) / 2)


def save_crf(layer: CrfLayer, path: str | Path) -> None:
    """Write a layer's weights, widths and label costs, atomically.

    Parameters
    ----------
    layer : CrfLayer
        Trained or not.
    path : path-like
        The safetensors file to write.
    """
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in layer.state_dict().items()}
    write_tensors(path, tensors, {"crf": json.dumps(layer.description())})


def load_crf(path: str | Path) -> CrfLayer:
    """Read a trained CRF.

    Parameters
    ----------
    path : path-like
        A file that `save_crf` wrote.

    Raises
    ------
    DataError
        When the file is missing, damaged or of another program.
    """
    header, tensors = read_tensors(path)
    try:
        description = parse_json(path, header["crf"])
        layer = CrfLayer(CrfParams(normalization=description.pop("normalization")), **description)
    except (KeyError, TypeError, ValueError, OverflowError, RuntimeError) as error:
        raise DataError(path, "the description of a CRF in the header", f"{header}: {error}") from error
    check_tensors(path, tensors, layer.state_dict())
    layer.load_state_dict(tensors)
    return layer
