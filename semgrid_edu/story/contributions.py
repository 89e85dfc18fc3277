"""Which inputs of the fusion network made a class's score in one cell: gradient times input (paper, section 3.4)."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import SemanticGridNet


@dataclass(frozen=True, eq=False)
class Contributions:
    """A score as a sum of parts: score = planes + occupancy + rest.

    A part is the gradient of the score with respect to an input, times that input. Inputs of many cells count: all that
    the convolutions carry to this one. In evaluation mode the fusion network consists of convolutions, shifts, ReLUs
    and maxima, so near its present input it is linear plus a constant. The parts are the linear share, without any
    approximation. The constant, `rest`, comes from the biases and from the shifts of the batch normalisations: it is
    what the network says whatever the input, as long as the same ReLUs are open.

    A part isn't what would change if its input were missing: then other ReLUs would be open. Parts of opposite signs
    can be much larger than the score that they sum to, and then say little about causes.

    Parameters
    ----------
    score : float
        The score: a class's logit in a cell, or the difference of two.
    planes : (C, D) float64
        The part of each class's scores on each plane; plane 0 is the lowest.
    occupancy : (4,) float64
        The parts of FREE, STATIC, DYNAMIC and UNKNOWN.
    rest : float
        What remains of the score: the part of the biases.
    """

    score: float
    planes: NDArray[np.float64]
    occupancy: NDArray[np.float64]
    rest: float

    def minus(self, other: "Contributions") -> "Contributions":
        """Return the parts of the difference of two scores.

        The difference of two classes' logits is the logarithm of the ratio of their probabilities, so its parts say why
        a cell gets the one class rather than the other.

        Parameters
        ----------
        other : Contributions
            The parts of the score to subtract.

        Returns
        -------
        Contributions
            The differences of all parts, which sum to the difference of the scores.
        """
        parts = self.planes - other.planes, self.occupancy - other.occupancy, self.rest - other.rest
        return Contributions(self.score - other.score, *parts)


def cell_contributions(
    net: SemanticGridNet, scores: NDArray, occupancy: NDArray, cell: tuple[int, int], label: int
) -> Contributions:
    """Split one class's logit in one cell into the parts of planes and occupancy.

    Parameters
    ----------
    net : SemanticGridNet
        The network, in evaluation mode.
    scores : (C, h, w) float32
        s, the image network's scores.
    occupancy : (4, H, W) float32
        o, the probabilities of the four states.
    cell : (int, int)
        Row and column of the cell.
    label : int
        The class.

    Returns
    -------
    Contributions
        Parts that sum to the logit.

    Raises
    ------
    ArgumentError
        When the network is in training mode.
    """
    planes, o = fusion_inputs(net, scores, occupancy)
    planes.requires_grad_()
    o.requires_grad_()
    score = net.fusion(planes, o)[0, label, *cell]
    gradients = torch.autograd.grad(score, (planes, o), materialize_grads=True)
    of_planes, of_occupancy = (
        (g * x.detach())[0].sum(dim=(-2, -1), dtype=torch.float64).numpy()
        for g, x in zip(gradients, (planes, o), strict=True)
    )
    rest = score.item() - of_planes.sum() - of_occupancy.sum()
    return Contributions(score.item(), of_planes, of_occupancy, float(rest))


def fusion_inputs(net: SemanticGridNet, scores: NDArray, occupancy: NDArray) -> tuple[Tensor, Tensor]:
    """Return what the fusion network was given in a frame.

    Parameters
    ----------
    net, scores, occupancy
        As for `cell_contributions`.

    Returns
    -------
    planes : (1, C, D, H, W) float32
        p, the scores on the planes.
    occupancy : (1, 4, H, W) float32
        o.

    Raises
    ------
    ArgumentError
        When the network is in training mode, in which each batch is normalised by itself.
    """
    if net.training:
        raise ArgumentError("net", "a network in evaluation mode, see `net.eval()`", "one in training mode")
    with torch.no_grad():
        planes = net.sampler(torch.tensor(np.asarray(scores, np.float32))[None])
    return planes, torch.tensor(np.asarray(occupancy, np.float32))[None]
