"""The description of a whole network, small enough to stand in the header of its weights file (sections 3.1, 3.4)."""

from dataclasses import dataclass, field

from semgrid_edu.errors import ArgumentError, types_named
from semgrid_edu.grid import GridSpec
from semgrid_edu.planes import plane_heights

MOST_PIXELS, MOST_POINTS = 2**22, 2**24
"""Pixels of an image, and points of all planes together: nine and fifteen times as many as at the published size. What
asks for more is a mistake, or a damaged file, and would take all memory."""


@dataclass(frozen=True)
class Architecture:
    """Everything that decides the shapes of a network's weights and where its planes lie.

    The camera isn't part of it: one trained network serves every calibration, because only its planes move.

    Parameters
    ----------
    segmenter : str
        Name of the image network, a key of `SEGMENTERS`.
    preset : str
        Size of the image network: "compact" for the CPU, "paper" for the published size.
    label_set : str
        Name of the label set, a key of `LABEL_SETS`, whose classes both the scores and the grid have.
    image_size : (int, int)
        Height h and width w that every image is scaled to, pixels. (96, 320) keeps the aspect of KITTI's images at
        a fifteenth of their pixels.
    grid : GridSpec
        The cells of the semantic grid, (H, W) of them.
    heights : (D,) float
        delta_i, the heights of the planes above the ground, metres.
    uses_occupancy : bool
        Whether the fusion network sees the occupancy grid. Without, each cell is UNKNOWN to it, whatever grid it is
        given: so all else, also the initial weights, is that of the network with occupancy, and the two can be
        compared.
    reduces : bool
        Whether the 1x1 convolution reduces the planes. Without, all D x C of them go into the conv-deconv network.
    """

    segmenter: str = "segnet"
    preset: str = "compact"
    label_set: str = "KITTI-14"
    image_size: tuple[int, int] = (96, 320)
    grid: GridSpec = field(default_factory=GridSpec.compact)
    heights: tuple[float, ...] = tuple(plane_heights().tolist())
    uses_occupancy: bool = True
    reduces: bool = True

    @types_named
    def __post_init__(self) -> None:
        """Refuse sizes that no computer has the memory for."""
        height, width = self.image_size
        if not (height >= 1 and width >= 1 and height * width <= MOST_PIXELS):
            raise ArgumentError("image_size", f"two whole numbers, 1 to {MOST_PIXELS} pixels", self.image_size)
        rows, columns = self.grid.shape
        if rows * columns * len(self.heights) > MOST_POINTS:
            found = f"{rows} x {columns} cells on {len(self.heights)} planes"
            raise ArgumentError("grid, heights", f"at most {MOST_POINTS} points of planes", found)
