"""Which inputs of the fusion network made a class's score, in one cell or all: gradient times input (section 3.4)."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.networks.conv_deconv import ConvDeconv
from semgrid_edu.occupancy import N_STATES

AT_ONCE = 8
"""How many passes are made together: more would take more memory, and as much time."""


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


@dataclass(frozen=True, eq=False)
class ContributionMaps:
    """The parts of the score of each class l in each cell: the sums of `Contributions`, as maps.

    Parameters
    ----------
    score : (L, H, W) float32
        The logits.
    by_plane : (D, L, H, W) float32
        The part of each plane, all classes of its scores together.
    by_class : (C, L, H, W) float32
        The part of each class's scores, all planes together. Its sum is that of `by_plane`.
    occupancy : (4, L, H, W) float32
        The parts of FREE, STATIC, DYNAMIC and UNKNOWN.
    """

    score: NDArray[np.float32]
    by_plane: NDArray[np.float32]
    by_class: NDArray[np.float32]
    occupancy: NDArray[np.float32]

    @property
    def rest(self) -> NDArray[np.float32]:
        """(L, H, W): what remains of each score, the part of the biases."""
        return self.score - self.by_plane.sum(axis=0) - self.occupancy.sum(axis=0)


@torch.no_grad()
def contribution_maps(net: SemanticGridNet, scores: NDArray, occupancy: NDArray) -> ContributionMaps:
    """Compute `cell_contributions`, summed by plane and by class, for all cells and classes of a frame.

    The gradient of one score takes a pass backward, and there are L H W scores. A pass forward carries a change of the
    inputs to all scores. With a group of inputs as their own change, and the other inputs unchanged, it gives each
    score's sum of gradient times input over the group. So D + C + 4 passes are enough.

    Parameters
    ----------
    net : SemanticGridNet
        The network, in evaluation mode.
    scores : (C, h, w) float32
        s, the image network's scores.
    occupancy : (4, H, W) float32
        o, the probabilities of the four states.

    Returns
    -------
    ContributionMaps
        The parts of all scores.

    Raises
    ------
    ArgumentError
        When the network is in training mode.
    """
    planes, o = fusion_inputs(net, scores, occupancy)
    n_scores, n_planes = planes.shape[1:3]
    groups = [(2, d) for d in range(n_planes)] + [(1, c) for c in range(n_scores)]
    reduced, changes = _follow(net.fusion.reduce, planes, (_only(planes, *group) for group in groups))
    changes = [change.squeeze(2) for change in [*changes, *[torch.zeros_like(reduced)] * N_STATES]]
    of_o = [torch.zeros_like(o)] * len(groups) + [_only(o, 1, s) * net.fusion.uses_occupancy for s in range(N_STATES)]
    inputs = net.fusion.joined(reduced, o)
    change = torch.cat([torch.cat(changes), torch.cat(of_o)], dim=1)
    batches = change.contiguous(memory_format=torch.channels_last).split(AT_ONCE)
    parts = np.concatenate([_through(net.fusion.conv_deconv, inputs, batch).numpy() for batch in batches])
    by_plane, by_class, by_state = np.split(parts, [n_planes, n_planes + n_scores])
    return ContributionMaps(net.fusion.conv_deconv(inputs)[0].numpy(), by_plane, by_class, by_state)


def _only(inputs: Tensor, axis: int, index: int) -> Tensor:
    """Return the inputs with all but one index of an axis set to zero."""
    part = torch.zeros_like(inputs)
    part.select(axis, index).copy_(inputs.select(axis, index))
    return part


def _through(network: ConvDeconv, x: Tensor, change: Tensor) -> Tensor:
    """Send changes of an input through the network: the derivative of `ConvDeconv.forward`."""
    seen = []
    for encode in network.encoder:
        before, (kept,) = _follow(encode, x, [change])
        x, indices = F.max_pool2d(before, 2, return_indices=True)
        indices = indices.expand(len(kept), *x.shape[1:])
        change = kept.flatten(2).gather(2, indices.flatten(2)).view(indices.shape)  # a maximum changes with its winner
        seen.append((before, kept, indices))
    for decode, (before, kept, indices) in zip(reversed(network.decoder), reversed(seen), strict=True):
        x = F.max_unpool2d(x, indices[:1], 2, output_size=before.shape[2:])
        change = F.max_unpool2d(change, indices, 2, output_size=before.shape[2:])
        if network.skips:
            x, change = torch.cat([x, before], dim=1), torch.cat([change, kept], dim=1)
        x, (change,) = _follow(decode, x, [change])
    return change


def _follow(layers: nn.Sequential, x: Tensor, changes: Iterable[Tensor]) -> tuple[Tensor, Iterable[Tensor]]:
    """Send an input and changes of it through layers, each of which is a ReLU or linear plus a constant."""
    for layer in layers:
        if isinstance(layer, nn.Sequential):
            x, changes = _follow(layer, x, changes)
        elif isinstance(layer, nn.ReLU):
            x, changes = x.clamp(min=0), [change * (x > 0) for change in changes]
        else:
            constant = layer(torch.zeros_like(x))
            x, changes = layer(x), [layer(change) - constant for change in changes]
    return x, changes
