"""A toy street for the whole system: two cells on one ray, which a LIDAR beam and a camera pixel share.

An object in the near cell hides the far cell from the camera, and from the LIDAR if it reflects the beam. If neither
cell has an object, the pixel sees the ground of the far cell.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import FilterState, State, WorldModel, predict, transition_matrix, update
from semgrid_edu.occupancy.sensor import likelihoods
from worlds.lecture_02_beam import BeamWorld, reflection

CLASSES = ("road", "sidewalk", "car", "building")
"""The labels of the semantic grid."""

CONTENTS = ("road", "sidewalk", "parked car", "moving car", "building")
"""What can be in a cell."""

CLASS_OF = np.eye(4)[[0, 1, 2, 2, 3]]
"""(5, 4): the class of each content; parked and moving cars look alike."""

STATE_OF = np.array([State.FREE, State.FREE, State.STATIC, State.DYNAMIC, State.STATIC])
"""The occupancy state of each content."""

STREET = (0.5, 0.2, 0.1, 0.1, 0.1)
"""Share of the street's cells with each content."""

RATES = (
    # to FREE, STATIC, DYNAMIC, UNKNOWN, 1/s: as in lecture 01, where a moving thing leaves its cell within a second
    (0.0, 0.02, 0.2, 0.2),
    (0.02, 0.0, 0.02, 0.1),
    (1.0, 0.1, 0.0, 0.5),
    (0.0, 0.0, 0.0, 0.0),
)

PARAMS = WorldModel(rates=RATES, first_sight=(0.7, 0.2, 0.1))
"""The filter's assumptions, which are true of this street: the rates, and the frequencies of the states."""


@dataclass(frozen=True)
class SystemWorld:
    """Two cells on a ray over a few instants, and how well the sensors see them.

    Parameters
    ----------
    steps : int
        Number of instants, 1 to 3; each has a scan and an image.
    dt : float
        Time from one instant to the next, seconds.
    range_error : float
        Probability that a return from one of the cells is measured in the other.
    pixel_right : float
        Probability that the segmentation network predicts the class that the pixel sees. Its errors are spread evenly
        over the other classes.
    params : WorldModel
        Rates of the street and of the filter, first sight, and p_hit of the scanner.
    """

    steps: int = 2
    dt: float = 0.5
    range_error: float = 0.05
    pixel_right: float = 0.8
    params: WorldModel = PARAMS

    def change(self) -> NDArray[np.float64]:
        """Return P(content now | content before), (5, 5), by the filter's rates, but without transitions to UNKNOWN.

        The street itself forgets nothing, so there is no UNKNOWN. A cell that keeps its state keeps its content. A cell
        that becomes FREE is road or sidewalk, in the proportions of the street; a cell that becomes STATIC gets a
        parked car, and a cell that becomes DYNAMIC a moving car.
        """
        rates = np.array(self.params.rates)
        rates[:, State.UNKNOWN] = 0
        M = transition_matrix(replace(self.params, rates=tuple(map(tuple, rates))), self.dt)[:3, :3]
        ground = np.array(STREET) * (STATE_OF == State.FREE)
        comes = np.stack([ground / ground.sum(), np.eye(5)[2], np.eye(5)[3]])
        changes = M[STATE_OF] * (STATE_OF[:, None] != np.arange(3))
        return np.diag(M[STATE_OF, STATE_OF]) + changes @ comes

    def scan(self) -> NDArray[np.float64]:
        """Return P(l | near, far), (5, 5, 3): a return from near, from far, or none, because the beam passes both."""
        sensor = self.params.sensor
        beam = BeamWorld(n_cells=2, noise=0, hit=sensor.p_hit_occupied, clutter=sensor.p_hit_free)
        e = self.range_error
        measured = np.array([[1 - e, e, 0], [e, 1 - e, 0], [0, 0, 1]])
        occupied = (STATE_OF != State.FREE).astype(int)
        return reflection(beam).table[np.ix_(occupied, occupied)] @ measured

    def sees(self) -> NDArray[np.float64]:
        """Return P(class that the pixel sees | near, far), (5, 5, 4): near's if an object is there, else far's."""
        near = np.broadcast_to(CLASS_OF[:, None], (5, 5, 4))
        far = np.broadcast_to(CLASS_OF[None, :], (5, 5, 4))
        return np.where((STATE_OF != State.FREE)[:, None, None], near, far)

    def image(self) -> NDArray[np.float64]:
        """Return P(i | near, far), (5, 5, 4): the class that the network predicts, right with `pixel_right`."""
        return self.sees() @ self.confusion()

    def confusion(self) -> NDArray[np.float64]:
        """Return P(class predicted | class seen), (4, 4)."""
        return np.where(np.eye(4) == 1, self.pixel_right, (1 - self.pixel_right) / 3)

    def occupancy(self) -> list[NDArray[np.float32]]:
        """Return o: the belief of the package's filter after every possible sequence of scans.

        Returns
        -------
        list of (3^(t+1), 2, 4) float32
            For each t = 0, 1, ...: by sequence of scans (the last one changes fastest), by cell (near, far), by state.
        """
        spec = GridSpec(0, 1, 0, 2, 1)
        histories = []
        states = [FilterState.unknown(spec)]
        for t in range(self.steps):
            dt = self.dt if t else 0.0
            states = [_after(state, scan, spec, self.params, dt) for state in states for scan in range(3)]
            histories.append(np.array([state.probability[:, 0].T for state in states]))
        return histories


def _after(state: FilterState, scan: int, spec: GridSpec, params: WorldModel, dt: float) -> FilterState:
    """Predict, then update each cell: it has the return, the beam passes it, or it is behind the return."""
    obstacles = np.array([[scan == 0, scan == 1]]).astype(int)
    passed = np.array([[scan != 0, scan == 2]])
    evidence = likelihoods(obstacles, passed, params.sensor)
    return update(predict(state, spec, params, dt, np.random.default_rng(0)), spec, evidence, params)
