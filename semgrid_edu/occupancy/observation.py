"""A scan on the scrolling map: the input of one step of any of the filters (paper, section 3.2)."""

from typing import NamedTuple

from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.evidence import Evidence, Sensor, evidence_of, take_scan
from semgrid_edu.occupancy.moving_map import MAX_YAW, scroll
from semgrid_edu.occupancy.planar_motion import PlanarMotion


class Observation(NamedTuple):
    """What one step needs to know of the vehicle and of its scan.

    Parameters
    ----------
    shift : PlanarMotion
        How the map scrolls: its new frame in its old one, metres and radians.
    pose : PlanarMotion
        Pose of the vehicle in the new frame of the map.
    on_map : Evidence
        What the scan says of the cells of the map, (H, W).
    in_grid : Evidence
        What the scan says of the cells of the grid around the vehicle, (H', W').
    """

    shift: PlanarMotion
    pose: PlanarMotion
    on_map: Evidence
    in_grid: Evidence


def observe(
    sensor: Sensor, points_grid: NDArray, pose: PlanarMotion, map_spec: GridSpec, spec: GridSpec
) -> Observation:
    """Let the map follow the vehicle, and ask the sensor what the scan says of its cells and of the vehicle's.

    Parameters
    ----------
    sensor : Sensor
        Turns the scan into evidence.
    points_grid : (N, 3+) float
        The scan: x forward, y left, z above the ground (m), in the grid frame of the vehicle now.
    pose : PlanarMotion
        Pose of the vehicle now in the frame that the map has had until now, metres and radians.
    map_spec, spec : GridSpec
        The cells of the map, (H, W), and those of the grid around the vehicle, (H', W').

    Returns
    -------
    Observation
        How the map scrolls, where the vehicle then is in it, and the evidence in both grids.

    Raises
    ------
    ArgumentError
        When the points aren't a table of finite coordinates, or the sensor doesn't turn them into evidence.
    """
    shift, pose = scroll(pose, map_spec.cell, MAX_YAW)
    measurement = take_scan(sensor, points_grid)
    in_grid = evidence_of(measurement, spec, PlanarMotion())
    return Observation(shift, pose, evidence_of(measurement, map_spec, pose), in_grid)
