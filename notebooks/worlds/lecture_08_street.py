"""The streets of lecture 08, ready for a training that takes seconds: the nearest 32 m of each map."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from torch import Tensor

from semgrid_edu.camera import Camera, rigid_transform
from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.samples import sample_frames
from semgrid_edu.fast import PlaneSampler, track_drive
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import class_accuracy, confusion_matrix, pixel_accuracy
from semgrid_edu.networks import SemanticGridNet, unit_image
from semgrid_edu.pipeline import network_image
from semgrid_edu.planes import plane_heights, plane_pixels

SPEC = GridSpec.compact()
"""The grid of the shipped networks."""

NEAR = replace(SPEC, x_max=SPEC.x_min + 32)
"""The nearest 32 m of it."""

ROWS = slice(SPEC.shape[0] - NEAR.shape[0], None)
"""The rows of a map of `SPEC` that `NEAR` has."""


class Streets(NamedTuple):
    """Some frames, as the fusion network takes them.

    Parameters
    ----------
    image : (N, 3, h, w) float32
        The images, in 0..1.
    scores : (N, C, h, w) float32
        The image network's scores.
    planes : (N, C, D, H, W) float32
        The scores on the planes, of the nearest 32 m.
    o : (N, 4, H, W) float32
        The occupancy grid of the nearest 32 m.
    truth : (N, H, W) int64
        The class of each cell.
    """

    image: Tensor
    scores: Tensor
    planes: Tensor
    o: Tensor
    truth: Tensor


@torch.no_grad()
def streets(net: SemanticGridNet, camera: Camera, image: Tensor, o: Tensor, truth: Tensor) -> Streets:
    """Return frames with the scores of a network; o and truth are those of the whole grid.

    Parameters
    ----------
    net : SemanticGridNet
        The network whose image stage scores the images.
    camera : Camera
        The camera that took them.
    image, o, truth : Tensor
        As in `Streets`.
    """
    scores = torch.cat([net.segmenter(one[None]) for one in image])
    return Streets(image, scores, planes_of(scores, camera), o[..., ROWS, :], truth[..., ROWS, :].long())


@torch.no_grad()
def planes_of(scores: Tensor, camera: Camera) -> Tensor:
    """Return the planes of some frames, (N, C, D, H, W), of the nearest 32 m.

    Parameters
    ----------
    scores : (N, C, h, w) float
        The image network's scores.
    camera : Camera
        The calibration to read them with.
    """
    size = tuple(scores.shape[2:])
    sampler = PlaneSampler(*plane_pixels(NEAR, plane_heights(), camera.resized(size)), size)
    return torch.cat([sampler(one[None]) for one in scores])


@torch.no_grad()
def rescored(net: SemanticGridNet, camera: Camera, some: Streets) -> Streets:
    """Return the same frames with the scores of another network's image stage. Parameters are those of `streets`."""
    scores = torch.cat([net.segmenter(one[None]) for one in some.image])
    return some._replace(scores=scores, planes=planes_of(scores, camera))


def training_streets(net: SemanticGridNet, camera: Camera) -> Streets:
    """Return the six shipped training frames. Parameters are those of `streets`."""
    frames = sample_frames()
    image, o, truth = (torch.stack([getattr(one, name) for one in frames]) for name in ("image", "occupancy", "truth"))
    return streets(net, camera, unit_image(image), o, truth)


def new_streets(net: SemanticGridNet, camera: Camera, frames: Sequence[Frame]) -> Streets:
    """Return every second frame of a drive, and its occupancy grids.

    Parameters
    ----------
    net, camera
        As in `streets`.
    frames : sequence of Frame
        The drive.
    """
    beliefs = [belief.probability for belief in track_drive(frames, SPEC)][1::2]
    truth = [grid_truth(frame.labels, o, SPEC) for frame, o in zip(frames[1::2], beliefs, strict=True)]
    image = [network_image(frame, net.architecture.image_size) for frame in frames[1::2]]
    return streets(net, camera, *(torch.from_numpy(np.stack(part)) for part in (image, beliefs, truth)))


def pixel_labels(frames: Sequence[Frame], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the true classes of the pixels of every second frame, (N, h, w).

    Parameters
    ----------
    frames : sequence of Frame
        The drive.
    size : (int, int)
        h and w, the size of the network's images.
    """
    return np.stack([resize_labels(frame.labels.image, size) for frame in frames[1::2]])


def turned(camera: Camera, pitch: float = 0.0, yaw: float = 0.0) -> Camera:
    """Return a calibration from which the camera deviates: it points higher, or farther to the left, by some degrees.

    Parameters
    ----------
    camera : Camera
        The right calibration.
    pitch, yaw : float
        The deviation, degrees.
    """
    turn = Rotation.from_euler("xy", [pitch, yaw], degrees=True).as_matrix()
    return replace(camera, T_camera_from_lidar=rigid_transform(turn, np.zeros(3)) @ camera.T_camera_from_lidar)


def ground_labels(scores: Tensor, camera: Camera) -> NDArray[np.intp]:
    """Return the class that each cell reads on the ground plane, (N, H, W); 255 where the camera doesn't see it.

    Parameters
    ----------
    scores : (N, C, h, w) float
        The image network's scores.
    camera : Camera
        The drive's camera.
    """
    labels = scores.argmax(dim=1).numpy()
    (pixels,), (visible,) = plane_pixels(NEAR, plane_heights()[:1], camera.resized(labels.shape[1:]))
    u, v = np.rint(np.where(visible[..., None], pixels, 0)).astype(int).transpose(2, 0, 1)
    return np.where(visible, labels[:, v, u], IGNORE)


@torch.no_grad()
def named(fusion: torch.nn.Module, some: Streets) -> NDArray[np.intp]:
    """Return the class that a fusion network gives each cell, *unknown* forbidden, (N, H, W).

    Parameters
    ----------
    fusion : Module
        A network like `FusionNet`; afterwards it is in evaluation mode.
    some : Streets
        The frames.
    """
    fusion.eval()
    logits = [fusion(p[None], o[None])[0] for p, o in zip(some.planes, some.o, strict=True)]
    return torch.stack(logits)[:, : KITTI_14.n_semantic].argmax(dim=1).numpy()


def confusions(called: NDArray, truth: Tensor) -> NDArray[np.int64]:
    """Return the counts of each frame's cells with a real class, (N, 10, 10): true class, and the class called.

    Parameters
    ----------
    called : (N, H, W) int
        The classes that a method gives.
    truth : (N, H, W) int64
        The true ones.
    """
    n = KITTI_14.n_semantic
    true = truth.numpy()
    true = np.where(true < n, true, IGNORE)
    return np.stack([confusion_matrix(t, c, n) for t, c in zip(true, called, strict=True)])


def score(called: NDArray, truth: Tensor) -> tuple[float, float]:
    """Return accuracy and class accuracy over the cells with a real class, per cent. Parameters as in `confusions`."""
    counts = confusions(called, truth).sum(axis=0)
    return 100 * pixel_accuracy(counts), 100 * class_accuracy(counts)
