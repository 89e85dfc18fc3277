"""The simulator: streets, what sensors take of them, and what is true. `simulate` is its door.

Shapes come from trimesh and rays are cast by embreex, the optional extra `simulation`; what a simulated drive has
written is read without them.
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
    """Simulate a drive, the same for the same arguments.

    Parameters
    ----------
    seed : int or numpy.random.SeedSequence
        Seed for everything that is drawn: the street, who is in it, and the noise of the sensors.
    n_frames : int
        Number of frames, ten a second.
    street : str or Wishes, optional
        A street that is hard for occupancy filters, one of `named_streets.TEST_STREETS`; or what isn't left to chance.
        Everything is drawn when left out.
    rig : Rig, optional
        The sensors on the recording car. When left out, those of the simulated data sets, and `named_streets.KITTI_RIG`
        in a street with a name.

    Returns
    -------
    SimulatedDrive
        Its frames, scans and truth are computed when they are asked for.

    Raises
    ------
    ArgumentError
        When there is no such street.
    MissingExtraError
        When trimesh or embreex isn't installed.
    """
    from semgrid_edu.workshop.simulation import drive, named_streets
    from semgrid_edu.workshop.simulation.street.plan import ANY

    if isinstance(street, str):
        return named_streets.named_street(street, seed, n_frames, rig or named_streets.KITTI_RIG)
    return drive.SimulatedDrive(seed, n_frames, street or ANY, rig)
