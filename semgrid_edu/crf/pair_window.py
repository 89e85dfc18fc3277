"""Both kernels of eq. (4) in torch, with gradients: sums over the pairs of cells of a window, and over all pairs."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from semgrid_edu.crf.kernel import gaussian


@dataclass(frozen=True)
class PairWindow:
    """All pairs of cells of a grid that are at most `radius` rows and `radius` columns apart, each pair once.

    The pairs are sorted by their offset (rows, columns): P offsets, and for each of them one number per cell, which
    belongs to that cell and the one an offset further on. In memory, each row is followed by as many empty columns as
    the largest offset has. So the cells of the whole grid form one long line of L numbers, on which an offset is a
    shift, and a cell that is shifted beyond the end of its row meets an empty cell.

    Parameters
    ----------
    height, width : int
        H and W, the number of rows and columns of the grid.
    radius : int
        The largest distance of two cells, in rows and in columns.
    """

    height: int
    width: int
    radius: int

    @property
    def margin(self) -> int:
        """Number of empty columns behind each row."""
        return min(self.radius, self.width - 1)

    @property
    def offsets(self) -> list[tuple[int, int]]:
        """Rows and columns from the first cell of a pair to the second, (P, 2)."""
        rows = range(min(self.radius, self.height - 1) + 1)
        columns = range(-self.margin, self.margin + 1)
        return [(r, c) for r in rows for c in columns if r > 0 or c > 0]

    @property
    def shifts(self) -> list[int]:
        """The same steps along the line, (P,)."""
        return [r * (self.width + self.margin) + c for r, c in self.offsets]

    def line(self, grid: Tensor) -> Tensor:
        """Lay grids out as lines.

        Parameters
        ----------
        grid : (B, K, H, W) float
            K numbers for each cell; in the lines, (B, K, L), zeros stand in the empty columns: L = H (W + margin).
        """
        return F.pad(grid, (0, self.margin)).flatten(2)

    def grid(self, line: Tensor) -> Tensor:
        """Undo `line`, and drop what stands in the empty columns.

        Parameters
        ----------
        line : (B, K, L) float
            Becomes (B, K, H, W).
        """
        return line.unflatten(2, (self.height, self.width + self.margin))[..., : self.width]

    @torch.no_grad()
    def squared_distances(self, features: Tensor) -> Tensor:
        """Return the squared distance between the features of the two cells of each pair.

        Parameters
        ----------
        features : (B, K, H, W) float
            A vector of K numbers for each cell.

        Returns
        -------
        (B, P, L) float
            Without a gradient; meaningless for a pair whose second cell doesn't exist.
        """
        line = self.line(features)
        distances = line.new_zeros(len(line), len(self.shifts), line.shape[2])
        for k, shift in enumerate(self.shifts):
            first, second = line[..., :-shift], line[..., shift:]
            torch.sum((first - second) ** 2, dim=1, out=distances[:, k, :-shift])
        return distances


class PairSum(torch.autograd.Function):
    """y_i = sum over the cells j that form a pair with i of k_ij x_j, with gradients for k and x (eq. (4)).

    `PairSum.apply(pairs, x, window)` takes the weights (B, P, L) of a window's pairs and values (B, K, H, W), and
    returns sums (B, K, H, W). Automatic differentiation would keep several arrays for each of the P offsets; written
    out, the gradient is two sums of the same kind:

        dE/dx_j = sum_i k_ij dE/dy_i,        dE/dk_ij = sum over the K values of (dE/dy_i x_j + dE/dy_j x_i)
    """

    @staticmethod
    def forward(ctx: torch.autograd.function.FunctionCtx, pairs: Tensor, x: Tensor, window: PairWindow) -> Tensor:
        """Return y, (B, K, H, W).

        Parameters
        ----------
        ctx : FunctionCtx
            Keeps what the gradient needs.
        pairs : (B, P, L) float
            k_ij, in the order of the window's pairs.
        x : (B, K, H, W) float
            K values for each cell.
        window : PairWindow
            Which cells form pairs.
        """
        ctx.save_for_backward(pairs, x)
        ctx.window = window
        return window.grid(_sums(pairs, window.line(x), window.shifts))

    @staticmethod
    def backward(ctx: torch.autograd.function.FunctionCtx, grad: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        """Return dE/dk (B, P, L) and dE/dx (B, K, H, W), each None when nothing asks for it, and None for the window.

        Parameters
        ----------
        ctx : FunctionCtx
            What `forward` kept.
        grad : (B, K, H, W) float
            dE/dy.
        """
        (pairs, x), window = ctx.saved_tensors, ctx.window
        grad = window.line(grad)
        of_pairs = _products(grad, window.line(x), window.shifts) if ctx.needs_input_grad[0] else None
        of_x = window.grid(_sums(pairs, grad, window.shifts)) if ctx.needs_input_grad[1] else None
        return of_pairs, of_x, None


def _sums(pairs: Tensor, x: Tensor, shifts: list[int]) -> Tensor:
    """Give both cells of each pair the other one's value, times the weight; values and sums are lines (B, K, L)."""
    sums = torch.zeros_like(x)
    for k, shift in enumerate(shifts):
        weight = pairs[:, k : k + 1, :-shift]
        sums[..., :-shift].addcmul_(weight, x[..., shift:])
        sums[..., shift:].addcmul_(weight, x[..., :-shift])
    return sums


def _products(a: Tensor, b: Tensor, shifts: list[int]) -> Tensor:
    """Return a_i . b_j + a_j . b_i for each pair (i, j), (B, P, L); a and b are lines (B, K, L)."""
    products = a.new_zeros(len(a), len(shifts), a.shape[2])
    for k, shift in enumerate(shifts):
        both = a[..., :-shift] * b[..., shift:]
        both.addcmul_(a[..., shift:], b[..., :-shift])
        torch.sum(both, dim=1, out=products[:, k, :-shift])
    return products


class Pairs(NamedTuple):
    """A kernel between the cells of a batch of grids.

    Parameters
    ----------
    sums : callable
        x (B, K, H, W) -> y (B, K, H, W), y_i = sum_{j != i} k_ij x_j.
    own : (B or 1, 1, H, W) float
        k_ii.
    """

    sums: Callable[[Tensor], Tensor]
    own: Tensor

    def normalised(self, occupancy: Tensor) -> "Pairs":
        """Return D^-1/2 K D^-1/2 with D the row sums of the kernel K, its diagonal included.

        Parameters
        ----------
        occupancy : (B, 4, H, W) float
            Any array of the batch: it gives shape and type.
        """
        root = (self.own + self.sums(torch.ones_like(occupancy[:, :1]))).sqrt()
        return Pairs(lambda x: self.sums(x / root) / root, self.own / root**2)


def bilateral_pairs(occupancy: Tensor, radius: int, sigma_alpha: Tensor, sigma_beta: Tensor) -> Pairs:
    """Return the first kernel of eq. (4), on place and occupancy, for the pairs of a window.

    Parameters
    ----------
    occupancy : (B, 4, H, W) float
        o, the probabilities of the four states.
    radius : int
        Half the side of the window, cells.
    sigma_alpha, sigma_beta : () float
        The widths in space, cells, and in state probability.

    Returns
    -------
    Pairs
        Without weight and normalisation.
    """
    window = PairWindow(*occupancy.shape[2:], radius)
    places = torch.tensor(window.offsets).reshape(-1, 2).to(occupancy).square().sum(dim=1, keepdim=True)
    states = window.squared_distances(occupancy)
    weights = gaussian(places / sigma_alpha**2 + states / sigma_beta**2, torch.exp)
    return Pairs(lambda x: PairSum.apply(weights, x, window), torch.ones_like(occupancy[:, :1]))


def spatial_pairs(occupancy: Tensor, sigma_gamma: Tensor) -> Pairs:
    """Return the second kernel of eq. (4), on place alone: the product of a Gaussian of rows and one of columns.

    Parameters
    ----------
    occupancy : (B, 4, H, W) float
        It gives shape and type.
    sigma_gamma : () float
        The width, cells.

    Returns
    -------
    Pairs
        Without weight and normalisation, for all pairs of cells of the grid.
    """
    axes = (torch.arange(size).to(occupancy) for size in occupancy.shape[2:])
    rows, columns = (gaussian(((axis[:, None] - axis) / sigma_gamma) ** 2, torch.exp) for axis in axes)
    return Pairs(lambda x: rows @ x @ columns - x, torch.ones_like(occupancy[:, :1]))
