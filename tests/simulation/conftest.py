"""Fixtures of the simulator's tests: drives that are simulated once."""

import pytest

from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.street.plan import Wishes

BUSY = Wishes(layout="junction", styles=("suburb", "town"), density=0.9, speed=8.0)


@pytest.fixture(scope="session")
def junction_drive() -> SimulatedDrive:
    """A drive of ten frames towards a busy junction with houses and gardens."""
    return SimulatedDrive(5, 10, BUSY)


@pytest.fixture(scope="session")
def crowded_drives() -> list[SimulatedDrive]:
    """Three drives through crowded towns."""
    return [SimulatedDrive(seed, 10, Wishes(density=1.0, styles=("town", "town"))) for seed in range(3)]


@pytest.fixture(scope="session")
def last_frame(junction_drive):
    """The last frame of `junction_drive`, with bird's-eye truth."""
    return junction_drive.frame(9, labelled=True)
