"""The whole network and its description: image and occupancy grid -> semantic grid, end to end (paper, Fig. 2)."""

from dataclasses import dataclass, field

from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError, types_named
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks.fusion import N_REDUCED, FusionNet
from semgrid_edu.networks.returns_fusion import ReturnsFusion
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.planes import PlaneSampler, plane_heights

MOST_PIXELS, MOST_POINTS = 2**22, 2**24
"""Limits for the pixels of an image and for the points of all planes together: nine and fifteen times the published
sizes. Anything larger is a mistake or a damaged file, and would exhaust the memory."""

MOST_SEGMENTERS = 9
"""Limit for the number of image networks: nine of the published size take one gigabyte (SegNet) to five (FCN)."""


@dataclass(frozen=True)
class Architecture:
    """Everything that a trained network's weights depend on: its layers, their sizes, and what they see.

    The camera isn't part of it: one trained network fits every calibration, because only its planes move.

    Parameters
    ----------
    segmenter : str
        Name of the image network, a key of `SEGMENTERS`.
    preset : str
        Size of the image network: "compact" for the CPU, "paper" for the published size.
    label_set : str
        Name of the label set, a key of `LABEL_SETS`, whose classes both the scores and the grid have.
    image_size : (int, int)
        Height h and width w that every image is scaled to, pixels. (96, 320) has the aspect ratio of KITTI's images and
        a fifteenth of their pixels.
    grid : GridSpec
        The cells of the semantic grid, (H, W) of them.
    heights : (D,) float
        delta_i, the heights of the planes above the ground, metres.
    uses_occupancy : bool
        Whether the fusion network sees the occupancy grid. Otherwise it sees UNKNOWN in every cell. Everything else,
        including the initial weights, is the same as with occupancy, so that the two can be compared.
    reduces : bool
        Whether the 1x1 convolution reduces the planes. Otherwise the conv-deconv network takes all D x C of them.
    n_segmenters : int
        How many image networks score an image, 1 to 9; s is the mean of their scores, see `MeanSegmenter`.
    uses_return_heights : bool
        Whether the fusion network sees the heights of the scan's returns, and the scores at these heights alone, see
        `ReturnsFusion`. Its planes hold class probabilities, the soft-max of the scores: it must compare them between
        views, and raw scores have another size in each.
    """

    segmenter: str = "segnet"
    preset: str = "compact"
    label_set: str = "KITTI-14"
    image_size: tuple[int, int] = (96, 320)
    grid: GridSpec = field(default_factory=GridSpec.compact)
    heights: tuple[float, ...] = tuple(plane_heights().tolist())
    uses_occupancy: bool = True
    reduces: bool = True
    n_segmenters: int = 1
    uses_return_heights: bool = False

    @types_named
    def __post_init__(self) -> None:
        """Raise an `ArgumentError` for sizes that no computer has the memory for, and for options that don't fit."""
        height, width = self.image_size
        if not (height >= 1 and width >= 1 and height * width <= MOST_PIXELS):
            raise ArgumentError("image_size", f"two whole numbers, 1 to {MOST_PIXELS} pixels", self.image_size)
        if not 1 <= self.n_segmenters <= MOST_SEGMENTERS:
            raise ArgumentError("n_segmenters", f"1 to {MOST_SEGMENTERS}", self.n_segmenters)
        rows, columns = self.grid.shape
        if rows * columns * len(self.heights) > MOST_POINTS:
            found = f"{rows} x {columns} cells on {len(self.heights)} planes"
            raise ArgumentError("grid, heights", f"at most {MOST_POINTS} points of planes", found)
        if self.uses_return_heights and not self.reduces:
            raise ArgumentError("reduces", "True with uses_return_heights, which reduces the planes to two", False)
        if self.uses_return_heights and list(self.heights) != sorted(set(self.heights)):
            raise ArgumentError("heights", "planes from the lowest up, with uses_return_heights", self.heights)

    @property
    def layout(self) -> tuple[str, tuple[int, int], GridSpec, tuple[float, ...], bool]:
        """Label set, image size, grid, planes, and what these hold. Equal ones can exchange their stages."""
        return self.label_set, self.image_size, self.grid, self.heights, self.uses_return_heights


class SemanticGridNet(nn.Module):
    """Segment the image, sample its scores on the planes, fuse them with the occupancy grid.

    Every step is differentiable, so the image network also learns from the loss on the grid.

    Parameters
    ----------
    segmenter : Module
        The image network, i -> s: (B, 3, h, w) RGB in 0..1 -> (B, C, h, w) scores. Its `n_classes`, if it has this
        attribute, is the C of the scores; otherwise they have the classes of the grid.
    sampler : PlaneSampler
        s -> p, for one calibration: the book's, or `fast.PlaneSampler`.
    n_classes : int
        C, the number of classes of the semantic grid.
    seed : int
        Seed for the initial weights of the fusion network.
    architecture : Architecture, optional
        The description that the parts were built from; `build_net` passes it. A network without one can be used, but
        not saved or trained, because it couldn't be rebuilt.
    fusion : Module, optional
        The fusion network, (p, o) -> g; by default a fresh one for the architecture.
    """

    def __init__(
        self,
        segmenter: nn.Module,
        sampler: PlaneSampler,
        n_classes: int,
        seed: int = 0,
        *,
        architecture: Architecture | None = None,
        fusion: nn.Module | None = None,
    ) -> None:
        super().__init__()
        self.segmenter = segmenter
        self.sampler = sampler
        self.n_classes = n_classes
        self.architecture = architecture
        options = architecture or Architecture()
        self.uses_return_heights = options.uses_return_heights
        n_planes = sampler.planes_shape[0]
        if self.uses_return_heights and n_planes != len(options.heights):
            raise ArgumentError("sampler", f"{len(options.heights)} planes", n_planes)
        n_scores = getattr(segmenter, "n_classes", n_classes)
        self.fusion = _fresh_fusion(n_scores, n_planes, n_classes, options, seed) if fusion is None else fusion

    def need_architecture(self) -> Architecture:
        """Return the architecture, or raise an `ArgumentError`: without it a network can't be saved or trained."""
        if self.architecture is None:
            expected = "a network of build_net, which records its architecture"
            raise ArgumentError("net", expected, "one made by hand, without an architecture")
        return self.architecture

    def forward(self, image: Tensor, occupancy: Tensor, return_heights: Tensor | None = None) -> Tensor:
        """Return the logits of the semantic grid: segment, sample, fuse.

        Parameters
        ----------
        image : (B, 3, h, w) float
            RGB, 0..1.
        occupancy : (B, 4, H, W) float
            Probability of FREE, STATIC, DYNAMIC, UNKNOWN; they sum to 1 in each cell.
        return_heights : (B, 2, H, W) float, optional
            The lowest and the highest return of each cell, from `cell_heights`. A network with
            `uses_return_heights` needs them; others don't look.

        Returns
        -------
        (B, C, H, W) float
            g before the soft-max.

        Raises
        ------
        ArgumentError
            When a shape is wrong, or return heights are missing.
        """
        _check("image", image, (3, *self.sampler.image_size))
        _check("occupancy", occupancy, (N_STATES, *self.sampler.planes_shape[1:]))
        if len(image) != len(occupancy):
            raise ArgumentError("occupancy", f"one for each of the {len(image)} images", len(occupancy))
        if self.uses_return_heights:
            self.check_return_heights(return_heights, len(image))  # before the image network, which takes longest
        return self.fuse(self.sample(self.segment(image)), occupancy, return_heights)

    def segment(self, image: Tensor) -> Tensor:
        """Return s, the image network's scores. Parameters are those of `SemanticGridNet.forward`.

        Returns
        -------
        (B, C, h, w) float
            One score per class and pixel, before any soft-max.
        """
        return self.segmenter(image)

    def sample(self, scores: Tensor, sampler: PlaneSampler | None = None) -> Tensor:
        """Return p, the scores on the planes; with `uses_return_heights` the class probabilities, see `Architecture`.

        Parameters
        ----------
        scores : (B, C, h, w) float
            s, before any soft-max.
        sampler : PlaneSampler, optional
            s -> p for the camera that took these images; the network's own sampler when left out.

        Returns
        -------
        (B, C, D, H, W) float
        """
        if self.uses_return_heights:
            scores = scores.softmax(dim=1)
        return (sampler or self.sampler)(scores)

    def fuse(self, planes: Tensor, occupancy: Tensor, return_heights: Tensor | None = None) -> Tensor:
        """Return the logits of the semantic grid from the sampled planes: (p, o) -> g.

        The other Parameters are those of `SemanticGridNet.forward`.

        Parameters
        ----------
        planes : (B, C, D, H, W) float
            p, the scores on the planes.

        Returns
        -------
        (B, C, H, W) float
            g before the soft-max.
        """
        if self.uses_return_heights:
            return self.fusion(planes, occupancy, self.check_return_heights(return_heights, len(planes)))
        return self.fusion(planes, occupancy)

    def check_return_heights(self, return_heights: Tensor | None, n_frames: int) -> Tensor:
        """Return them in single precision, or raise an `ArgumentError` if they are missing or don't fit.

        Parameters
        ----------
        return_heights : (B, 2, H, W) float, or None
            What was given to a network with `uses_return_heights`.
        n_frames : int
            B, the number of frames.
        """
        expected = (n_frames, 2, *self.sampler.planes_shape[1:])
        if return_heights is None or tuple(return_heights.shape) != expected:
            found = "none" if return_heights is None else tuple(return_heights.shape)
            raise ArgumentError("return_heights", f"shape {expected}: the network uses return heights", found)
        return return_heights.float()


def _fresh_fusion(n_scores: int, n_planes: int, n_classes: int, options: Architecture, seed: int) -> nn.Module:
    """Return the fusion network of an architecture with fresh weights."""
    if options.uses_return_heights:
        sizes = n_scores, options.heights, options.grid.cell, n_classes
        return ReturnsFusion(*sizes, seed=seed, uses_occupancy=options.uses_occupancy)
    n_reduced = N_REDUCED if options.reduces else None
    return FusionNet(n_scores, n_planes, n_classes, n_reduced, seed, options.uses_occupancy)


def _check(name: str, batch: Tensor, shape: tuple[int, ...]) -> None:
    """Raise an `ArgumentError` unless a batch holds floats of shape (B, *shape)."""
    if batch.ndim != 4 or tuple(batch.shape[1:]) != shape:
        raise ArgumentError(name, f"shape (B, {', '.join(map(str, shape))})", tuple(batch.shape))
    if not batch.is_floating_point():
        raise ArgumentError(name, "floats in 0..1", batch.dtype)
