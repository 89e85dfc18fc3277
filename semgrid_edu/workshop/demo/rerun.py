"""What `semgrid-edu demo --rerun` writes: a recording of a drive for the Rerun viewer."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import ModuleType
from uuid import uuid4

import numpy as np

from semgrid_edu.camera import Camera, invert_rigid
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.errors import needed
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LabelSet
from semgrid_edu.pipeline import FrameResult
from semgrid_edu.plotting import depth_colours, occupancy_colours
from semgrid_edu.storage.files import atomic_path

APPLICATION = "semgrid_edu demo"
"""The name of our recordings; each file contains it."""

CAMERA = "world/lidar/camera"
"""The camera's place in the tree of the recording; its image is below it."""


@contextmanager
def rerun_recording(
    path: str | Path, spec: GridSpec, label_set: LabelSet, camera: Camera
) -> Iterator[Callable[[FrameResult], None]]:
    """Open a recording, which is written when the block ends without an error.

    Parameters
    ----------
    path : path-like
        The file to write, which ends in .rrd.
    spec : GridSpec
        The grid of the results.
    label_set : LabelSet
        Their classes.
    camera : Camera
        The camera of the drive, for its lens and size; its pose is that of each frame.

    Yields
    ------
    callable
        Takes the result of the next frame.

    Raises
    ------
    MissingExtraError
        When rerun-sdk isn't installed.
    """
    rr = needed("rerun")
    with atomic_path(path) as temporary:
        stream = rr.RecordingStream(APPLICATION, recording_id=uuid4())
        stream.save(temporary)
        try:
            _log_once(rr, stream, camera, label_set)
            yield partial(_log_frame, rr, stream, spec)
        finally:
            stream.disconnect()


def _log_once(rr: ModuleType, stream: object, camera: Camera, label_set: LabelSet) -> None:
    """Log what holds for the whole drive: axes, the camera's lens, names and colours of classes."""
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    K = camera.K.copy()
    K[:2, 2] += 0.5  # Rerun's pixels begin at (0, 0), ours have their centre there
    stream.log(f"{CAMERA}/image", rr.Pinhole(image_from_camera=K, resolution=camera.size[::-1]), static=True)
    entries = [*zip(range(len(label_set)), label_set.names, label_set.rgb, strict=True)]
    stream.log("maps", rr.AnnotationContext([*entries, (IGNORE, "left out", (255, 255, 255))]), static=True)


def _log_frame(rr: ModuleType, stream: object, spec: GridSpec, result: FrameResult) -> None:
    """Log a frame at its time. What isn't known is cleared: the viewer would go on showing the last one."""
    frame = result.frame
    belief = result.belief
    stream.set_time("time", duration=frame.time)
    stream.log("world/lidar", _transform(rr, frame.T_world_from_lidar))
    stream.log(CAMERA, _transform(rr, invert_rigid(frame.camera.T_camera_from_lidar)))
    xyz = frame.points[:, :3]
    stream.log("world/lidar/points", rr.Points3D(xyz, colors=depth_colours(np.linalg.norm(xyz, axis=1))))
    stream.log(f"{CAMERA}/image", rr.Image(frame.image).compress())
    stream.log("maps/occupancy", rr.Image(occupancy_colours(belief.probability)))
    stream.log("maps/classes", rr.SegmentationImage(result.refined.argmax(axis=0).astype(np.uint8)))
    truth = rr.Clear(recursive=False)
    if frame.labels is not None:
        truth = rr.SegmentationImage(grid_truth(frame.labels, belief.probability, spec))
    stream.log("maps/truth", truth)


def _transform(rr: ModuleType, T: np.ndarray) -> object:
    return rr.Transform3D(translation=T[:3, 3], mat3x3=T[:3, :3])
