"""Maps of a real street without a camera: heights of returns, a rule on them, a forest, and channels beside o.

The four numbers of o say whether something occupies a cell, not how high it is. What a network gains from the image
should be measured against what heights alone give.
"""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.networks import FusionNet
from semgrid_edu.networks.conv_deconv import ConvDeconv
from semgrid_edu.networks.segmenter import fresh_weights
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.planes import above_ground, cell_heights

ROAD_BELOW, CAR_BELOW = 0.25, 2.2
"""Heights above the ground up to which a cell is called road, and car, metres; above, it is called building."""

TREES = 100
"""Number of trees in a forest."""


def scan_heights(points: NDArray, spec: GridSpec) -> NDArray[np.float64]:
    """Return each cell's lowest and highest return `above_ground`, (2, H, W) metres; NaN in a cell without any.

    Parameters are those of `cell_heights`.
    """
    return above_ground(torch.from_numpy(cell_heights(points, spec)), spec.cell).numpy()


def height_rule(heights: NDArray) -> NDArray[np.uint8]:
    """Call each cell road, car or building by the height of its highest return; road where there is none.

    Parameters
    ----------
    heights : (..., 2, H, W) float
        From `scan_heights`.
    """
    highest = heights[..., 1, :, :]
    classes = np.full(highest.shape, KITTI_14.index("building"), np.uint8)
    classes[highest <= CAR_BELOW] = KITTI_14.index("car")
    classes[~(highest > ROAD_BELOW)] = KITTI_14.index("road")
    return classes


def height_channels(heights: NDArray) -> NDArray[np.float32]:
    """Return heights as a network or a forest takes them, (..., 3, H, W): both clipped, and whether there is a return.

    Parameters
    ----------
    heights : (..., 2, H, W) float
        From `scan_heights`, metres.
    """
    returned = ~np.isnan(heights[..., :1, :, :])
    highest_first = heights[..., ::-1, :, :]  # the order of the channels in docs/results/camera_worth.json
    clipped = np.clip(np.nan_to_num(highest_first), 0, 5) / 2.5
    return np.concatenate([clipped, returned], axis=-3).astype(np.float32)


def forest_grids(
    learned: Sequence[NDArray], truths: NDArray, tested: Sequence[NDArray], seed: int = 0
) -> NDArray[np.uint8]:
    """Fit a random forest to labelled cells, and return the classes of other frames' cells, (M, H, W).

    Parameters
    ----------
    learned : sequence of (N, K, H, W) float
        Features of the cells, frame by frame: each array has features of its own.
    truths : (N, H, W) uint8
        Their classes; only cells with a semantic class are learned from.
    tested : sequence of (M, K, H, W) float
        The same features of the frames to classify.
    seed : int
        Seed for the forest.
    """
    from sklearn.ensemble import RandomForestClassifier

    features, asked = (np.moveaxis(np.concatenate(some, axis=1), 1, -1) for some in (learned, tested))
    labelled = truths < KITTI_14.n_semantic
    forest = RandomForestClassifier(TREES, min_samples_leaf=5, random_state=seed)
    forest.fit(features[labelled], truths[labelled])
    return forest.predict(asked.reshape(-1, asked.shape[-1])).reshape(asked.shape[:-1])


def scores_of_returns(probability: NDArray, pixels: NDArray, cells: NDArray, spec: GridSpec) -> NDArray[np.float32]:
    """Average the image's class probabilities over the returns of each cell, (C, H, W); 0 in a cell without any.

    Parameters
    ----------
    probability : (C, h, w) float
        Soft-max of the image's scores.
    pixels, cells : (N,) int
        Pixel and cell of each return that the camera sees, from `TrainingSet.returns`.
    spec : GridSpec
        The grid.
    """
    n_cells = spec.shape[0] * spec.shape[1]
    n_returns = np.bincount(cells, minlength=n_cells)
    seen = probability.reshape(len(probability), -1)[:, pixels]
    sums = np.stack([np.bincount(cells, weights=of_class, minlength=n_cells) for of_class in seen])
    return (sums / np.maximum(n_returns, 1)).reshape(-1, *spec.shape).astype(np.float32)


class HeightFusion(FusionNet):
    """The fusion network with further channels beside o, and with or without the image.

    Parameters
    ----------
    n_scores, n_planes : int
        Classes and planes of the image's scores.
    n_classes : int
        C, the number of classes of the semantic grid.
    n_beside : int
        Number of channels beside o.
    uses_image : bool
        Whether the network sees the planes; otherwise it sees zeros.
    seed : int
        Seed for the initial weights.
    """

    def __init__(
        self, n_scores: int, n_planes: int, n_classes: int, n_beside: int, uses_image: bool, seed: int = 0
    ) -> None:
        super().__init__(n_scores, n_planes, n_classes, seed=seed)
        self.uses_image = uses_image
        n_reduced = self.reduce[0].out_channels
        with fresh_weights(self, seed):
            self.conv_deconv = ConvDeconv(
                n_reduced + N_STATES + n_beside, n_classes, self.WIDTHS, self.DEPTHS, skips=True
            )

    def forward(self, planes: Tensor, occupancy: Tensor) -> Tensor:
        """Return the logits of the semantic grid.

        Parameters
        ----------
        planes : (B, C, D, H, W) float
            p, the image's scores on the planes.
        occupancy : (B, 4 + n_beside, H, W) float
            o, and what is beside it.

        Returns
        -------
        (B, C, H, W) float
            g before the soft-max.
        """
        reduced = self.reduce(planes) if self.uses_image else planes.new_zeros(self._reduced_shape(planes))
        return self.fuse(reduced, occupancy)

    def _reduced_shape(self, planes: Tensor) -> tuple[int, ...]:
        """Return the shape that the planes have after the reduction."""
        return len(planes), self.reduce[0].out_channels, 1, *planes.shape[-2:]


def learn_fusion(
    net: nn.Module, planes: Tensor, channels: Tensor, truth: Tensor, alpha: Tensor, steps: int, seed: int = 0
) -> None:
    """Train a fusion network on planes that don't change, by AdamW; half of the batches are mirrored.

    Parameters
    ----------
    net : Module
        A `HeightFusion`, changed in place; afterwards it is in evaluation mode.
    planes : (N, C, D, H, W) float
        The image's scores on the planes, frame by frame.
    channels : (N, K, H, W) float
        o, and what is beside it.
    truth : (N, H, W) uint8
        The class of each cell; 255 where unlabelled.
    alpha : (C,) float
        The weight of each class.
    steps : int
        Number of steps.
    seed : int
        Seed for the order of the frames and for the mirroring.
    """
    rng = np.random.default_rng(seed)
    optimiser = torch.optim.AdamW(net.parameters(), lr=3e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    net.train()
    for _ in range(steps):
        chosen = torch.from_numpy(rng.permutation(len(truth))[:6])
        batch = [part[chosen] for part in (planes, channels, truth)]
        if rng.random() < 0.5:
            batch = [part.flip(-1) for part in batch]
        logits = net(batch[0].float(), batch[1])
        loss = nn.functional.cross_entropy(logits, batch[2].long(), weight=alpha, ignore_index=IGNORE)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    net.eval()
