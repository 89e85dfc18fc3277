"""What one scan tells about each cell, P(z | occupied) and P(z | free), and what a sensor must offer (section 3.2).

A filter needs two things: a sensor that processes a scan (`Sensor.scan`), and a result that can be asked about the
cells of any grid (`Measurement.evidence`). Any two classes with these methods will do.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, check_shape
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.state import check_part


@dataclass(frozen=True, eq=False)
class Evidence:
    """The two likelihoods of a scan in each cell. Where they are equal, the scan tells nothing.

    Parameters
    ----------
    occupied, free : (H, W) float32
        P(z | occupied) and P(z | free), not negative. Only their ratio matters, so neither has to be at most 1.

    Raises
    ------
    ArgumentError
        When the two have different shapes, or an entry is negative or NaN.
    """

    occupied: NDArray[np.float32]
    free: NDArray[np.float32]

    def __post_init__(self) -> None:
        """Check that Bayes' rule makes sense with these numbers."""
        check_shape("free", self.free, np.shape(self.occupied))
        for name in ("occupied", "free"):
            if not (least := np.min(getattr(self, name), initial=0)) >= 0:  # NaN isn't either
                raise ArgumentError(name, "likelihoods, not negative", least)


@runtime_checkable
class Measurement(Protocol):
    """What a sensor has made of one scan. The package's default is `Scan`."""

    def evidence(self, spec: GridSpec, pose: PlanarMotion) -> Evidence:
        """Return what the scan tells about each cell of a grid.

        A filter asks twice per step: for the cells of its map, in which the vehicle moves, and for the cells of the
        grid in which it hands out its beliefs, whose frame is that of the vehicle.

        Parameters
        ----------
        spec : GridSpec
            The cells, (H, W).
        pose : PlanarMotion
            Pose of the vehicle in the frame of `spec`, metres and radians. So `pose.to_previous(points[:, :2])` gives
            the x and y of the scan's points in the frame of `spec`, and `spec.cells` tells their cells.

        Returns
        -------
        Evidence
            P(z | occupied) and P(z | free), each (H, W); equal in cells about which the scan tells nothing.
        """
        ...


@runtime_checkable
class Sensor(Protocol):
    """A model of the sensor: it turns a scan into a measurement. The package's default is `SensorModel`.

    `fast.Cmcdot` calls it in a separate thread, while it predicts.

    Examples
    --------
    A sensor that never sees anything. With it, a filter believes UNKNOWN for ever:

    >>> class Blind:
    ...     def scan(self, points):
    ...         return self
    ...     def evidence(self, spec, pose):
    ...         return Evidence(np.ones(spec.shape), np.ones(spec.shape))
    >>> isinstance(Blind(), Sensor)
    True
    """

    def scan(self, points: NDArray) -> Measurement:
        """Process one scan.

        Parameters
        ----------
        points : (N, 3+) float32 or float64
            Returns: x forward, y left, z above the ground on which the vehicle stands (m), in the grid frame of the
            vehicle now; a fourth column, where there is one, is reflectance, a fifth marks returns from the vehicle
            itself (`Frame.vehicle_returns`). The filters have checked that x, y and z are finite. N may be 0.

        Returns
        -------
        Measurement
            Can be asked for the evidence in the cells of any grid.
        """
        ...


def scan_evidence(points: NDArray, spec: GridSpec, sensor: Sensor, pose: PlanarMotion | None = None) -> Evidence:
    """Turn a scan into evidence: `sensor.scan(points).evidence(spec, pose)`, with its input and output checked.

    Parameters
    ----------
    points : (N, 3+) float
        Returns: x forward, y left, z above the ground on which the vehicle stands (m), in the grid frame of the
        vehicle; N may be 0.
    spec : GridSpec
        The cells, (H, W).
    sensor : Sensor
        How the scanner errs: usually a `SensorModel`.
    pose : PlanarMotion, optional
        Pose of the vehicle in the frame of `spec`; by default it is at the origin of that frame.

    Returns
    -------
    Evidence
        P(z | occupied) and P(z | free), each (H, W).

    Raises
    ------
    ArgumentError
        When `points` isn't a table of finite coordinates, or the sensor returns anything but evidence on `spec`.
    """
    return evidence_of(take_scan(sensor, points), spec, pose or PlanarMotion())


def take_scan(sensor: Sensor, points: NDArray) -> Measurement:
    """Check a scan, let a sensor process it, and check the result.

    Parameters
    ----------
    sensor : Sensor
        The model of the sensor.
    points : (N, 3+) float
        Returns in the grid frame of the vehicle, as for `scan_evidence`.

    Raises
    ------
    ArgumentError
        When `points` isn't a table of finite coordinates, or the sensor returns something without `evidence`.
    """
    measurement = sensor.scan(check_points(points))
    if not isinstance(measurement, Measurement):
        expected = ".scan(points) to return an object with a method .evidence(spec, pose)"
        raise ArgumentError(type(sensor).__name__, expected, type(measurement).__name__)
    return measurement


def evidence_of(measurement: Measurement, spec: GridSpec, pose: PlanarMotion) -> Evidence:
    """Ask a measurement for its evidence on a grid, and check the answer.

    Parameters
    ----------
    measurement : Measurement
        What a sensor made of a scan.
    spec : GridSpec
        The cells, (H, W).
    pose : PlanarMotion
        Pose of the vehicle in the frame of `spec`, metres and radians.
    """
    evidence = measurement.evidence(spec, pose)
    if not isinstance(evidence, Evidence):
        expected = ".evidence(spec, pose) to return Evidence(occupied, free)"
        raise ArgumentError(type(measurement).__name__, expected, type(evidence).__name__)
    if np.shape(evidence.free) != spec.shape:
        expected = f".evidence(spec, pose) to cover the spec that it is given, shape {spec.shape}"
        reason = "a filter asks for its own map, which is larger, and for the grid of its beliefs"
        raise ArgumentError(type(measurement).__name__, expected, f"shape {np.shape(evidence.free)} ({reason})")
    return evidence


class Observation(NamedTuple):
    """What a scan tells a filter in one step.

    Parameters
    ----------
    pose : PlanarMotion
        Pose of the vehicle in the frame of the map, metres and radians.
    on_map : Evidence
        What the scan tells about the cells of the map, (H, W).
    in_grid : Evidence
        What the scan tells about the cells of the grid around the vehicle, (H', W').
    """

    pose: PlanarMotion
    on_map: Evidence
    in_grid: Evidence


def observe(
    sensor: Sensor, points_grid: NDArray, pose: PlanarMotion, map_spec: GridSpec, spec: GridSpec
) -> Observation:
    """Ask the sensor what a scan tells about the cells of the map, and about those around the vehicle.

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
    """
    measurement = take_scan(sensor, points_grid)
    in_grid = evidence_of(measurement, spec, PlanarMotion())
    return Observation(pose, evidence_of(measurement, map_spec, pose), in_grid)


def check_sensor(sensor: Sensor) -> None:
    """Check that an object is a sensor.

    Parameters
    ----------
    sensor : Sensor
        The object, which needs a method `scan`.
    """
    check_part("sensor", sensor, Sensor, ".scan(points), such as SensorModel()")


def check_points(points: NDArray) -> NDArray:
    """Return the points of a scan as an array of float32 or float64, after checking that coordinates are finite.

    Parameters
    ----------
    points : (N, 3+) float
        Returns: x forward, y left, z up (m), in the grid frame of the vehicle; N may be 0.
    """
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] < 3:
        raise ArgumentError("points", "shape (N, 3+): x, y, z in metres", f"shape {points.shape}")
    if points.dtype.kind not in "biuf":
        raise ArgumentError("points", "real numbers", f"type {points.dtype}")
    points = points.astype(np.float32 if np.can_cast(points.dtype, np.float32) else np.float64, copy=False)
    finite = np.isfinite(points[:, :3])
    if not finite.all():
        bad = np.count_nonzero(~finite.all(axis=1))
        raise ArgumentError("points", "finite coordinates", f"{bad} of {len(points)} points with NaN or infinity")
    return points
