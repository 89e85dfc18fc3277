"""The whole network from its description and a camera; the operators of the last calibrations are kept (section 3)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from semgrid_edu.camera import Camera
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.networks.architecture import Architecture
from semgrid_edu.networks.backbones.registry import build_segmenter
from semgrid_edu.networks.semantic_grid import SemanticGridNet
from semgrid_edu.planes import PlaneOperator, PlaneSampler, plane_pixels
from semgrid_edu.planes.pixels import check_heights


def build_net(architecture: Architecture, camera: Camera, seed: int = 0) -> SemanticGridNet:
    """Return the whole network for one camera, with fresh weights.

    Networks of the same calibration share one `PlaneOperator`, which is worked out when the first of them is built.

    Parameters
    ----------
    architecture : Architecture
        What to build.
    camera : Camera
        The camera as it took its images; the network sees them at `architecture.image_size`.
    seed : int
        Seed for the initial weights.

    Returns
    -------
    SemanticGridNet
        The network, in training mode, as PyTorch's modules are when they are new.

    Raises
    ------
    ArgumentError
        When there is no such label set, image network or preset, or the heights aren't finite numbers.
    """
    if architecture.label_set not in LABEL_SETS:
        raise ArgumentError("label_set", f"one of {', '.join(LABEL_SETS)}", repr(architecture.label_set))
    n_classes = len(LABEL_SETS[architecture.label_set])
    resized = camera.resized(architecture.image_size)
    operator = plane_operator(Calibration.of(architecture.grid, architecture.heights, resized))
    segmenter = build_segmenter(architecture.segmenter, n_classes, architecture.preset, seed)
    sampler = PlaneSampler.from_operator(operator)
    return SemanticGridNet(segmenter, sampler, n_classes, seed, architecture=architecture)


@dataclass(frozen=True)
class Calibration:
    """Everything that decides where the points of the planes fall in the image, as numbers that can be compared.

    Parameters
    ----------
    grid : GridSpec
        The cells, (H, W) of them.
    heights : (D,) tuple of float
        delta_i, metres above the ground.
    K : (9,) tuple of float
        The camera's intrinsic matrix row by row, pixels.
    T_camera_from_lidar : (16,) tuple of float
        The rigid transform row by row; its last column is in metres.
    image_size : (int, int)
        Height h and width w of the image, pixels.
    lidar_height : float
        Metres from the ground to the LIDAR.
    """

    grid: GridSpec
    heights: tuple[float, ...]
    K: tuple[float, ...]
    T_camera_from_lidar: tuple[float, ...]
    image_size: tuple[int, int]
    lidar_height: float

    @classmethod
    def of(cls, grid: GridSpec, heights: ArrayLike, camera: Camera) -> "Calibration":
        """Return the calibration of a grid, its planes and a camera.

        Parameters
        ----------
        grid : GridSpec
            The cells, (H, W) of them.
        heights : (D,) float
            delta_i, metres above the ground.
        camera : Camera
            The camera at the size of the image that the network sees, see `Camera.resized`.

        Returns
        -------
        Calibration
            The grid, the heights and the camera as plain numbers.

        Raises
        ------
        ArgumentError
            When `heights` isn't a list of one or more finite numbers.
        """
        K, T = (np.ravel(matrix).astype(np.float64) for matrix in (camera.K, camera.T_camera_from_lidar))
        numbers = (tuple(part.tolist()) for part in (check_heights(heights), K, T))
        return cls(grid, *numbers, tuple(camera.size), camera.lidar_height)

    def camera(self) -> Camera:
        """Return the camera that these numbers describe."""
        K, T = np.reshape(self.K, (3, 3)), np.reshape(self.T_camera_from_lidar, (4, 4))
        return Camera(K, T, self.image_size, self.lidar_height)


# Four calibrations: an operator at the paper's scale holds 67 MB.
@lru_cache(maxsize=4)
def plane_operator(calibration: Calibration) -> PlaneOperator:
    """Return the operator of a calibration, equations (1) and (2); the last four are remembered.

    Parameters
    ----------
    calibration : Calibration
        The grid, the heights of the planes, and the camera.

    Returns
    -------
    PlaneOperator
        The operator for one image; it is shared by all that ask for the same calibration.
    """
    pixels, visible = plane_pixels(calibration.grid, calibration.heights, calibration.camera())
    return PlaneOperator.build(pixels, visible, calibration.image_size)
