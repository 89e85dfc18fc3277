"""One instant of a simulated drive: what its sensors take, and what is true."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.workshop.simulation.sensors.camera import Picture
from semgrid_edu.workshop.simulation.sensors.truth import BirdseyeTruth


@dataclass(frozen=True, eq=False)
class SimulatedFrame:
    """One instant of a simulated drive.

    Parameters
    ----------
    time : float
        Seconds since the drive began.
    T_world_from_lidar : (4, 4) float64
        Pose of the LIDAR, metres.
    picture : Picture
        What the camera takes, and what each of its pixels shows.
    points : (N, 4) float32
        LIDAR returns: x, y, z in the LIDAR frame, metres, and reflectance 0..1.
    truth : BirdseyeTruth or None
        What every cell holds; None for a frame that isn't labelled.
    objects : list of dict
        Cars, pedestrians and bicycles in the bird's-eye grid, from `SimulatedDrive.objects`.
    """

    time: float
    T_world_from_lidar: NDArray[np.float64]
    picture: Picture
    points: NDArray[np.float32]
    truth: BirdseyeTruth | None
    objects: list[dict]
