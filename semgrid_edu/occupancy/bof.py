"""The BOF, the Bayesian Occupancy Filter, from which CMCDOT descends (Coue et al., IJRR 2006; paper, section 3.2)."""

from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.bof_state import BofParams, BofState
from semgrid_edu.occupancy.bof_steps import bof_move, bof_predict, bof_update, bof_velocity
from semgrid_edu.occupancy.local_belief import local_belief, observe
from semgrid_edu.occupancy.planar_motion import MAX_YAW, PlanarMotion, map_around, scroll
from semgrid_edu.occupancy.state import Belief


class Bof:
    """The exact filter on a lattice of velocities: what `Cmcdot` tends to as its particles grow in number.

    It has no randomness and no sampling error. The price is time and memory that grow with the number of velocities,
    in every cell, whether anything moves there or not. Its map scrolls under the vehicle as that of `Cmcdot` does.

    Parameters
    ----------
    spec : GridSpec
        The grid in which the filter hands out its beliefs, (H, W) cells.
    params : BofParams, optional
        The lattice of velocities, and what the filter assumes of the world and of its sensor.

    Raises
    ------
    ArgumentError
        When the lattice has so many velocities that those of all cells don't fit into memory.

    Examples
    --------
    >>> import numpy as np
    >>> tracker = Bof(GridSpec.compact())
    >>> wall = np.array([[20.25, y, 1.0] for y in np.arange(-3, 3, 0.1)])
    >>> belief = tracker.step(wall, PlanarMotion(), dt=0.1)
    >>> belief.probability[:, 101, 31].argmax(), belief.probability[:, 120, 31].argmax()
    (np.int64(1), np.int64(0))
    """

    def __init__(self, spec: GridSpec, params: BofParams | None = None) -> None:
        self.spec = spec
        self.params = params or BofParams()
        self.map_spec = map_around(spec, MAX_YAW)
        self._pose = PlanarMotion()
        self._state = BofState.nothing_known(self.map_spec, self.params.lattice)

    def step(self, points_grid: NDArray, motion: PlanarMotion, dt: float) -> Belief:
        """Take in one scan: move, predict, update.

        Parameters
        ----------
        points_grid : (N, 3+) float
            The scan's returns: x forward, y left, z above the ground on which the vehicle stands (m), in the grid
            frame of the vehicle now.
        motion : PlanarMotion
            Motion of the vehicle since the last step, metres and radians. At the first step nothing has been seen yet
            that it could move.
        dt : float
            Time since the last step, seconds. At the first step nothing is known yet that could change in that time:
            the time between two scans will do.

        Returns
        -------
        Belief
            What is believed of the cells of `spec`, in the grid frame of the vehicle now.

        Raises
        ------
        ArgumentError
            When the points aren't a table of finite coordinates, the time is negative or not finite, or the sensor
            doesn't turn the scan into evidence. The tracker then stays as it was.
        """
        world = self.params.world
        shift, pose = scroll(self._pose.then(motion), self.map_spec.cell, MAX_YAW)
        seen = observe(world.sensor, points_grid, pose, self.map_spec, self.spec)
        moved = bof_move(self._state, self.map_spec, shift)
        predicted = bof_predict(moved, self.map_spec, self.params, dt)
        self._state, self._pose = bof_update(predicted, self.map_spec, seen.on_map, self.params), seen.pose
        velocity = bof_velocity(self._state)
        return local_belief(predicted.probability, velocity, seen, self.map_spec, self.spec, world)
