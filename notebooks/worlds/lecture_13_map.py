"""Maps of a real street that lecture 13 judges: trivial ones, the network's, and the network's after a lesson."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor, nn

from semgrid_edu.camera import Camera, project, transform_points
from semgrid_edu.fast import PlaneSampler, track_drive
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.networks.build import plane_sampler
from semgrid_edu.pipeline import network_image
from semgrid_edu.planes import cell_heights
from semgrid_edu.workshop.course.street import best_table
from worlds.lecture_08_heights import height_rule, scan_heights


@torch.no_grad()
def fusion_inputs(net: SemanticGridNet, frames: Sequence[Frame], beliefs: Sequence[NDArray]) -> tuple[Tensor, ...]:
    """Return what the fusion network sees of some frames: p (N, C, D, H, W) and o (N, 4, H, W).

    A network with `uses_return_heights` also sees these, (N, 2, H, W).

    Parameters
    ----------
    net : SemanticGridNet
        The network, whose image stage scores the images.
    frames : sequence of Frame
        The frames; each is read with its own camera.
    beliefs : sequence of (4, H, W) float
        Their occupancy grids.
    """
    size = net.architecture.image_size
    spec = net.architecture.grid
    planes = []
    camera = None
    beside = [np.stack(beliefs)]
    if net.uses_return_heights:
        beside.append(np.stack([cell_heights(frame.points_grid, spec) for frame in frames]))
    for frame in frames:
        if frame.camera is not camera:
            camera = frame.camera
            sampler = plane_sampler(net.architecture, camera, PlaneSampler)
        planes.append(net.sample(net.segment(torch.from_numpy(network_image(frame, size))[None]), sampler))
    return torch.cat(planes), *(torch.from_numpy(part.astype(np.float32)) for part in beside)


@torch.no_grad()
def semantic_grids(fusion: nn.Module, inputs: Sequence[Tensor]) -> NDArray[np.float32]:
    """Return the class probabilities of each cell, (N, C, H, W).

    Parameters
    ----------
    fusion : Module
        A fusion network; it is in evaluation mode afterwards.
    inputs : sequence of Tensor
        What it sees, from `fusion_inputs`.
    """
    fusion.eval()
    of_frames = zip(*(part.split(1) for part in inputs), strict=True)
    return torch.cat([torch.softmax(fusion(*seen), dim=1) for seen in of_frames]).numpy()


def without_unknown(grids: NDArray) -> NDArray[np.float32]:
    """Return the probabilities of the semantic classes, given that the class isn't unknown, (N, 10, H, W).

    Parameters
    ----------
    grids : (N, 14, H, W) float
        The semantic grids.
    """
    named = grids[:, : KITTI_14.n_semantic]
    return named / named.sum(axis=1, keepdims=True)


def occupancy_grids(frames: Sequence[Frame], spec: GridSpec) -> list[NDArray[np.float32]]:
    """Return the occupancy grid of each frame, (4, H, W).

    Parameters
    ----------
    frames : sequence of Frame
        Successive frames.
    spec : GridSpec
        The grid.
    """
    return [belief.probability for belief in track_drive(frames, spec)]


def trivial_maps(
    frames: Sequence[Frame], truths: NDArray, beliefs: Sequence[NDArray], spec: GridSpec
) -> dict[str, NDArray]:
    """Return the maps of three rules that never look at the image, (N, H, W) by name.

    Parameters
    ----------
    frames : sequence of Frame
        The frames.
    truths : (N, H, W) int
        True classes, 255 where a cell doesn't count: the table is counted on them.
    beliefs : sequence of (4, H, W) float
        The occupancy grids.
    spec : GridSpec
        The grid.
    """
    return {
        "always road": np.full(truths.shape, KITTI_14.index("road")),
        "table of o": best_table(truths, beliefs),
        "height rule": np.stack([height_rule(scan_heights(frame.points_grid, spec)) for frame in frames]),
    }


def with_rows(frame: Frame, rows: int, above: bool = False, content: ArrayLike | None = None) -> Frame:
    """Return a frame whose image is taller or less tall, with a calibration that knows.

    Parameters
    ----------
    frame : Frame
        A frame with an image.
    rows : int
        How many copies of the outermost row are added below; a negative number cuts rows off.
    above : bool
        Whether this is done above the image, not below.
    content : (rows, w, 3) int or what broadcasts to it, optional
        What added rows show, 0..255, in place of copies.
    """
    image = frame.need_image()
    K = frame.camera.K.copy()
    if above:
        image = image[::-1]
        K[1, 2] = K[1, 2] + rows
    image = image[:rows] if rows < 0 else np.concatenate([image, np.repeat(image[-1:], rows, axis=0)])
    if content is not None and rows > 0:
        image[-rows:] = content
    image = np.ascontiguousarray(image[::-1]) if above else image
    return replace(frame, image=image, camera=replace(frame.camera, K=K, size=image.shape[:2]))


def brighter(frame: Frame, by: int) -> Frame:
    """Return a frame with a brighter image.

    Parameters
    ----------
    frame : Frame
        A frame with an image.
    by : int
        How much is added to each of red, green and blue, 0..255.
    """
    return replace(frame, image=np.clip(frame.need_image().astype(int) + by, 0, 255).astype(np.uint8))


def ground_begins(camera: Camera, spec: GridSpec) -> float:
    """Return how far ahead the nearest ground in the image is, metres.

    Parameters
    ----------
    camera : Camera
        The calibration.
    spec : GridSpec
        The grid: the distance is that of one of its cells, straight ahead.
    """
    x = np.sort(spec.centers()[:, 0, 0])
    ahead = np.column_stack([x, 0 * x, 0 * x - camera.lidar_height])
    return float(x[project(transform_points(camera.T_camera_from_lidar, ahead), camera)[1]].min())
