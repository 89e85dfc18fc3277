"""Errors of calibration: the camera stands and looks a little differently from what the network is told (3.3)."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import Camera, rigid_transform


@dataclass(frozen=True)
class CalibrationError:
    """By how much the calibration that the network is given differs from the true one.

    Parameters
    ----------
    pitch : float
        Degrees that the camera is believed to look further down.
    yaw : float
        Degrees that it is believed to look further to the left.
    height : float
        Metres that it is believed to stand higher.
    """

    pitch: float = 0.0
    yaw: float = 0.0
    height: float = 0.0

    @property
    def name(self) -> str:
        """What is wrong, each part after a hyphen; empty when nothing is."""
        parts = (("pitch", self.pitch, ""), ("yaw", self.yaw, ""), ("height", self.height, "m"))
        return "".join(f"-{what}{size:+g}{unit}" for what, size, unit in parts if size)

    def applied_to(self, camera: Camera) -> Camera:
        """Return the camera that the network believes in.

        Parameters
        ----------
        camera : Camera
            The true one.
        """
        # The camera's axes: x right, y down, z ahead. To believe that it looks down and left is to see the world
        # turned up and right, and to believe that it stands higher is to see the world lower, at larger y.
        turn = Rotation.from_euler("xy", [self.pitch, self.yaw], degrees=True).as_matrix()
        moved = rigid_transform(turn, np.array([0.0, self.height, 0.0]))
        return replace(camera, T_camera_from_lidar=moved @ camera.T_camera_from_lidar)


EXACT = CalibrationError()
"""No error."""
