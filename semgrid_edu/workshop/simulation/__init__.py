"""The simulator: streets, sensors that record them, and ground truth. Start with `simulate`.

trimesh makes the shapes and embreex casts the rays; both come with the optional extra `simulation`. Reading a drive
from disk needs neither.
"""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:  # the readers of a written drive don't build streets
    from semgrid_edu.workshop.simulation.drive import SimulatedDrive
    from semgrid_edu.workshop.simulation.sensors.rig import Rig
    from semgrid_edu.workshop.simulation.street.plan import Wishes


def simulate(
    seed: int | np.random.SeedSequence, n_frames: int, street: "str | Wishes | None" = None, rig: "Rig | None" = None
) -> "SimulatedDrive":
    """Simulate a drive. The same arguments give the same drive.

    The street is as long as the distance driven, so another number of frames gives another street.

    Parameters
    ----------
    seed : int or numpy.random.SeedSequence
        Seed for everything random: the street, its road users, and the sensor noise.
    n_frames : int
        Number of frames, ten a second.
    street : str or Wishes, optional
        A street that is hard for occupancy filters, one of `street.plan.TEST_STREETS`; or the properties to fix.
        By default the whole street is random.
    rig : Rig, optional
        The sensors on the recording car. By default the sensors of the simulated data sets, or `KITTI_RIG` on a named
        street.

    Returns
    -------
    SimulatedDrive
        Computes frames, scans and truth on demand.

    Raises
    ------
    ArgumentError
        When there is no such street.
    MissingExtraError
        When trimesh or embreex isn't installed.
    """
    from semgrid_edu.workshop.simulation.drive import SimulatedDrive
    from semgrid_edu.workshop.simulation.sensors.rig import KITTI_RIG
    from semgrid_edu.workshop.simulation.street.plan import RANDOM_STREET, draw_test_street

    if isinstance(street, str):
        seed, street = draw_test_street(street, seed)
        rig = rig or KITTI_RIG
    return SimulatedDrive(seed, n_frames, street or RANDOM_STREET, rig)
