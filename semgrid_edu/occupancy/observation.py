"""A scan on the scrolling map: the input of one step of any of the filters (paper, section 3.2)."""

from typing import NamedTuple

from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.evidence import Evidence, Sensor, evidence_of, take_scan
from semgrid_edu.occupancy.planar_motion import PlanarMotion


class Observation(NamedTuple):
    """A scan, as a step of a filter uses it.

    Parameters
    ----------
    pose : PlanarMotion
        Pose of the vehicle in the frame of the map, metres and radians.
    on_map : Evidence
        What the scan says of the cells of the map, (H, W).
    in_grid : Evidence
        What the scan says of the cells of the grid around the vehicle, (H', W').
    """

    pose: PlanarMotion
    on_map: Evidence
    in_grid: Evidence


def observe(
    sensor: Sensor, points_grid: NDArray, pose: PlanarMotion, map_spec: GridSpec, spec: GridSpec
) -> Observation:
    """Ask the sensor what a scan says of the cells of the map, and of those around the vehicle.

    Parameters
    ----------
    sensor : Sensor
        Turns the scan into evidence.
    points_grid : (N, 3+) float
        The scan: x forward, y left, z above the ground (m), in the grid frame of the vehicle now.
    pose : PlanarMotion
        Pose of the vehicle in the frame of the map, metres and radians.
    map_spec, spec : GridSpec
        The cells of the map, (H, W), and those of the grid around the vehicle, (H', W').

    Returns
    -------
    Observation
        The evidence in both grids, and the pose.

    Raises
    ------
    ArgumentError
        When the points aren't a table of finite coordinates, or the sensor doesn't turn them into evidence.
    """
    measurement = take_scan(sensor, points_grid)
    in_grid = evidence_of(measurement, spec, PlanarMotion())
    return Observation(pose, evidence_of(measurement, map_spec, pose), in_grid)
