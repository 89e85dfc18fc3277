"""Which inputs of the fusion network made the score of a class: gradient times input (section 3.4)."""

import warnings
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.func import jvp, vmap

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import N_STATES

CHUNK = 8
"""How many groups of inputs pass through the network together: more would take more memory and no less time."""


@dataclass(frozen=True, eq=False)
class Contributions:
    """Scores as sums of parts: score = sum of planes + sum of occupancy + rest.

    A part is the gradient of the score with respect to a group of inputs, times these inputs. The inputs of all cells
    that the convolutions carry to this one are included. In evaluation mode the fusion network consists of
    convolutions, shifts, ReLUs and maxima, so near its present input it is linear plus a constant. The parts are the
    linear share, without any approximation. The constant, `rest`, comes from the biases and the batch normalisations:
    it is what the network says whatever the input, as long as the same ReLUs are active. Of a network with
    `uses_return_heights`, `rest` also has their part.

    A part isn't the change that follows if its input is removed, because then other ReLUs would be active. Parts of
    opposite signs can be much larger than the score that they sum to. Then they say little about causes.

    Parameters
    ----------
    score : (...) float32
        The scores: the logit of each class in each cell, (C, H, W), or the difference of two classes.
    planes : (D, ...) float32
        The part of each plane, from the lowest up, with the scores of all classes on it.
    classes : (C, ...) float32
        The same sum split by class: the part of each class's image scores on all planes.
    occupancy : (4, ...) float32
        The parts of FREE, STATIC, DYNAMIC and UNKNOWN.
    """

    score: NDArray[np.float32]
    planes: NDArray[np.float32]
    classes: NDArray[np.float32]
    occupancy: NDArray[np.float32]

    @property
    def rest(self) -> NDArray[np.float32]:
        """What remains of each score: the part of the constants."""
        return self.score - self.planes.sum(axis=0) - self.occupancy.sum(axis=0)

    def versus(self, label: NDArray, rival: NDArray) -> "Contributions":
        """Return the parts of the difference of two classes' scores in each cell.

        The difference of two logits is the logarithm of the ratio of the two probabilities, so its parts explain why
        the cell gets one class rather than the other.

        Parameters
        ----------
        label, rival : (H, W) int
            The two classes.
        """

        def difference(part: NDArray) -> NDArray:
            of_label = np.take_along_axis(part, _as_index(label, part.ndim), axis=-3)
            of_rival = np.take_along_axis(part, _as_index(rival, part.ndim), axis=-3)
            return (of_label - of_rival)[..., 0, :, :]

        return Contributions(*map(difference, (self.score, self.planes, self.classes, self.occupancy)))

    def at(self, cell: tuple[int, int]) -> "Contributions":
        """Return the parts in one cell.

        Parameters
        ----------
        cell : (int, int)
            Row and column of the cell.
        """
        return Contributions(*(part[..., *cell] for part in (self.score, self.planes, self.classes, self.occupancy)))


def contributions(
    net: SemanticGridNet, scores: NDArray, occupancy: NDArray, return_heights: NDArray | None = None
) -> Contributions:
    """Split the logit of every class in every cell into the parts of planes, image classes and occupancy.

    A backward pass would give the gradient of a single logit, and there are C H W of them. Forward-mode differentiation
    (`torch.func.jvp`) takes a change of the inputs, and returns the change of all logits. If the change is a group of
    inputs itself, the result is the sum of gradient times input over that group. So D + C + 4 passes are enough.

    Parameters
    ----------
    net : SemanticGridNet
        The network, in evaluation mode.
    scores : (C, h, w) float32
        s, the image network's scores.
    occupancy : (4, H, W) float32
        o, the probabilities of the four states.
    return_heights : (2, H, W) float32, optional
        The lowest and the highest return of each cell, for a network with `uses_return_heights`.

    Returns
    -------
    Contributions
        The parts of all logits, each (..., C, H, W).

    Raises
    ------
    ArgumentError
        When the network is in training mode, in which each batch is normalised by itself, or needs return heights.
    """
    if net.training:
        raise ArgumentError("net", "a network in evaluation mode, see `net.eval()`", "one in training mode")
    planes, o, *scan = fusion_inputs(net, scores, occupancy, return_heights)
    last_layers = net.fusion.conv_deconv

    def reduce(planes: Tensor) -> Tensor:
        return net.fusion.reduce(planes, *scan)

    def joined(reduced: Tensor, o: Tensor) -> Tensor:
        return net.fusion.joined(reduced, o, *scan)

    def change_of_reduced(group: Tensor) -> Tensor:
        return jvp(reduce, (planes,), (planes * group[..., None, None],))[1]

    def change_of_logits(change: Tensor) -> Tensor:
        return jvp(last_layers, (inputs,), (change,))[1][0]

    with torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch warns about max_unpool2d under vmap, and about its own code
        reduced = reduce(planes)
        inputs = joined(reduced, o).contiguous(memory_format=torch.channels_last)
        of_planes = vmap(change_of_reduced, chunk_size=CHUNK)(_plane_groups(*planes.shape[1:3]))
        changes = [(change, torch.zeros_like(o)) for change in of_planes]
        changes += [(torch.zeros_like(reduced), _only(o, state)) for state in range(N_STATES)]
        changes = torch.cat([jvp(joined, (reduced, o), change)[1] for change in changes])
        changes = changes.contiguous(memory_format=torch.channels_last)  # vmap can't change the layout itself
        parts = vmap(change_of_logits, chunk_size=CHUNK)(changes[:, None]).numpy()
        logits = last_layers(inputs)[0].numpy()
    n_scores, n_planes = planes.shape[1:3]
    return Contributions(logits, *np.split(parts, [n_planes, n_planes + n_scores]))


def fusion_inputs(
    net: SemanticGridNet, scores: NDArray, occupancy: NDArray, return_heights: NDArray | None = None
) -> tuple[Tensor, ...]:
    """Return what the fusion network is given in a frame. Parameters are those of `contributions`.

    Returns
    -------
    planes : (1, C, D, H, W) float32
        p, the scores on the planes.
    occupancy : (1, 4, H, W) float32
        o.
    return_heights : (1, 2, H, W) float32
        Only for a network with `uses_return_heights`.
    """
    given = (scores, occupancy, return_heights) if net.uses_return_heights else (scores, occupancy)
    scores, *scan = (None if part is None else torch.tensor(np.asarray(part, np.float32))[None] for part in given)
    if net.uses_return_heights:
        net.check_return_heights(scan[1], 1)
    with torch.no_grad():
        return net.sample(scores), *scan


def _plane_groups(n_scores: int, n_planes: int) -> Tensor:
    """Return a 1 for each class and plane of a group, (D + C, C, D): each of the planes, then each of the classes."""
    by_plane = torch.eye(n_planes)[:, None].expand(-1, n_scores, -1)
    by_class = torch.eye(n_scores)[:, :, None].expand(-1, -1, n_planes)
    return torch.cat([by_plane, by_class])


def _only(o: Tensor, state: int) -> Tensor:
    """Return the occupancy with all but one state set to zero."""
    part = torch.zeros_like(o)
    part[:, state] = o[:, state]
    return part


def _as_index(label: NDArray, ndim: int) -> NDArray:
    """Reshape (H, W) class numbers so that they index axis -3 of an array of `ndim` axes."""
    return label.reshape((1,) * (ndim - 2) + label.shape)
