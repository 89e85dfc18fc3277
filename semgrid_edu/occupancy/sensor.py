"""What one scan tells about each cell, P(z | occupied) and P(z | free), and the LIDAR that takes it (section 3.2).

A filter needs two things: a sensor that processes a scan (`Sensor.scan`), and a result that can be asked about the
cells of any grid (`Measurement.evidence`). Any two classes with these methods will do. The package's are `SensorModel`
and `Scan`: which returns count, how far beams see, and how the LIDAR errs.
"""

import math
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import (
    ArgumentError,
    check_fields,
    check_shape,
    not_negative,
    positive_count,
    types_named,
)
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.polar import (
    GroundParams,
    beyond_reach,
    fill_gaps,
    height_above_ground,
    polar_profile,
    visible_range,
)
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

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(H, W): whether the scan tells anything about the cell."""
        return self.occupied != self.free


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
            Pose of the vehicle in the frame of `spec`, metres and radians. So `pose.parent_from_child(points[:, :2])`
            gives the x and y of the scan's points in the frame of `spec`, and `spec.cells` tells their cells.

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


@dataclass(frozen=True)
class SensorModel:
    """Which returns of a LIDAR count, and how it errs: the package's default `Sensor`.

    Parameters
    ----------
    obstacle_min, obstacle_max : float
        Returns between these heights above the ground (m) are obstacles: higher than a kerb, and lower than what a car
        can drive under. Lower returns come from the ground, higher ones are ignored.
    azimuth_step : float
        Width of a beam, degrees. KITTI's scanner has a column of returns each 0.18 degrees, so that a beam of the
        default width holds one column or two.
    column_spacing : float
        The widest gap between two neighbouring columns of returns, degrees, that isn't a hole in what the scanner
        sees. The default is the spacing of our simulated scanner's columns.
    p_hit_occupied, p_hit_free : float
        Probability of an obstacle return from a cell that is occupied, and from one that is free (because of a ray that
        grazes an edge, or of a pixel that mixes two ranges).
    max_returns : int
        Further returns in the same cell add nothing, because they aren't independent.
    p_pass_occupied, p_pass_free : float
        Probability that a beam passes a cell that is occupied (because foliage is porous and objects fill cells only in
        part), and one that is free.
    under : float
        A ground return up to this far behind the first obstacle of its beam is ignored, metres, because it may come
        from below that obstacle, from between a car's wheels. The default is the length of a car.
    vehicle : (float, float, float, float)
        Outline of the vehicle itself, x_min, x_max, y_min, y_max in the grid frame, metres. Unless the points are
        marked (`Frame.vehicle_returns`), an obstacle inside it is the vehicle's own bonnet or mirror. The default is
        the outline of KITTI's estate car, whose LIDAR sees the end of its bonnet 2.5 m ahead.
    edge : float
        Up to how far outside the outline an obstacle whose reflectance is 0 counts as the vehicle's own, metres. A
        beam that grazes the vehicle's edge is split, and its two echoes merge into one range in between while they are
        closer than half the length of a pulse: 0.75 m for the default, a pulse of 5 ns. The rule is off in a scan of
        which most returns have reflectance 0: that scanner doesn't measure it.
    ground : GroundParams or None
        How the ground is found from which heights count; None for flat ground at z = 0.

    Notes
    -----
    What to expect of other weather and other scanners (`benchmarks/other_sensors.py`). *Rain and spray*: 30, 150 or 600
    returns a scan, scattered within 15 m, make 0.4, 5 or 33 % of the free cells there STATIC; no rule rejects them.
    *Fewer beams*: on flat ground 32 or 16 of KITTI's 64 beams cost nothing; on a road that begins to rise by 10 %, 4 %
    of the ground cells become obstacles with 64 beams, 6 % with 32 and 11 % with 16.
    """

    obstacle_min: float = 0.3
    obstacle_max: float = 2.5
    azimuth_step: float = 0.3
    column_spacing: float = 0.9
    p_hit_occupied: float = 0.8
    p_hit_free: float = 0.05
    max_returns: int = 2
    p_pass_occupied: float = 0.3
    p_pass_free: float = 0.7
    under: float = 5.0
    vehicle: tuple[float, float, float, float] = (-2.1, 2.7, -1.1, 1.1)
    edge: float = 0.75
    ground: GroundParams | None = field(default_factory=GroundParams)

    @types_named
    def __post_init__(self) -> None:
        """Check that the sensor is possible, and that it can err: else no scan could ever correct a certain cell."""
        check_fields(self, "metres, not negative", not_negative, "under", "edge")
        check_fields(self, "degrees, above 0 and up to 360", lambda angle: 0 < angle <= 360, "azimuth_step")
        check_fields(self, "degrees, from 0 to 360", lambda angle: 0 <= angle <= 360, "column_spacing")
        check_fields(self, "a whole number of at least 1", positive_count, "max_returns")
        if not self.obstacle_min < self.obstacle_max:
            raise ArgumentError("obstacle_min", f"less than obstacle_max, {self.obstacle_max}", self.obstacle_min)
        if len(self.vehicle) != 4 or not (self.vehicle[0] <= self.vehicle[1] and self.vehicle[2] <= self.vehicle[3]):
            raise ArgumentError("vehicle", "x_min, x_max, y_min, y_max in metres, the smaller first", self.vehicle)
        probabilities = "p_hit_occupied", "p_hit_free", "p_pass_occupied", "p_pass_free"
        check_fields(self, "a probability between 0 and 1", lambda p: 0 < p < 1, *probabilities)

    @property
    def beams(self) -> int:
        """Number of beams in a turn."""
        return round(360 / self.azimuth_step)

    @property
    def gap(self) -> int:
        """The largest number of empty beams between two neighbouring columns of returns."""
        return math.ceil(self.column_spacing / self.azimuth_step - 1e-9)

    def scan(self, points: NDArray) -> "Scan":
        """Process one scan: remove the vehicle's own returns, find the ground, and measure how far each beam sees.

        Parameters are those of `Sensor.scan`.
        """
        prepared = prepare_scan(points, self)
        profile = polar_profile(prepared, self.obstacle_min, self.obstacle_max, self.beams)
        return Scan(prepared, fill_gaps(visible_range(*profile), self.gap), self)


@dataclass(frozen=True, eq=False)
class Scan:
    """A scan from which evidence can be computed, made by `SensorModel.scan`.

    A beam is a narrow sector of azimuth. It is free up to its first obstacle or, when it has none, up to its farthest
    ground return. So all that beams tell about free space is one range per beam, its reach, in which each cell is
    looked up. A cell with obstacle returns is occupied. A cell whose beam sees half a cell or more past its centre, or
    that holds a ground return, is free. About all other cells, behind obstacles or out of range, the scan tells
    nothing.

    What this assumes:

    - *Heights.* Obstacles stand on the ground that `height_above_ground` finds. What hangs higher than `obstacle_max`,
      such as crowns of trees and bridges, hides nothing below it.
    - *Occlusion.* A beam ends at its first obstacle, however low that is, although higher rings may look over it. What
      those rings hit behind it still counts: obstacle returns always do, ground returns from `under` metres on, because
      nearer ones may come through below the obstacle.
    - *Thin objects.* One return stops its whole beam, which is 16 cm wide at 30 m. A cell shared by several beams
      belongs to the beam through its centre. Something thinner than the distance between two columns of returns may
      be between them unseen, and its cell counts as passed.
    - *Several rings.* The scan assumes that nothing is between the ground returns of two rings. Where the rings differ
      by an angle a, they miss things lower than a times the distance: for KITTI's scanner 0.3 m at 50 m. Nothing checks
      the space below the lowest ring, nearer than 4 m, nor along rays that don't come back.
    - *Independence.* Returns are independent, up to `max_returns` in each cell. An obstacle return overrules everything
      else that a cell holds.

    Parameters
    ----------
    points : (M, 3) float
        Returns that don't come from the vehicle itself: x and y in the grid frame of the vehicle, and the height above
        the ground there, metres.
    reach : (B,) float
        How far each beam sees, metres; zero for beams in which nothing came back, unless the gap is narrow
        (`fill_gaps`). Beam 0 begins straight behind the
        vehicle, and the beams go counter-clockwise.
    sensor : SensorModel
        The sensor that took the scan.
    """

    points: NDArray[np.floating]
    reach: NDArray[np.floating]
    sensor: SensorModel

    def evidence(self, spec: GridSpec, pose: PlanarMotion) -> Evidence:
        """Look each cell up in its beam. Parameters and result are those of `Measurement.evidence`."""
        height = self.points[:, 2]
        obstacle = (height >= self.sensor.obstacle_min) & (height <= self.sensor.obstacle_max)
        xy = pose.parent_from_child(self.points[:, :2])
        # What speaks about a cell: obstacle returns in it, ground returns in it, and the beam through its centre.
        obstacles = count_in_cells(xy[obstacle], spec)
        ground = count_in_cells(xy[height < self.sensor.obstacle_min], spec)
        beyond = beyond_reach(self.reach, spec, pose)
        passed = beyond <= -spec.cell / 2  # the beam reaches half a cell past the centre
        # Just behind an obstacle, a beam may have come through below it.
        under = (beyond > spec.cell / 2) & (beyond < self.sensor.under)
        return likelihoods(obstacles, passed | ((ground > 0) & ~under), self.sensor)


def count_in_cells(xy: NDArray, spec: GridSpec) -> NDArray[np.int64]:
    """Count the points in each cell, (H, W).

    Parameters
    ----------
    xy : (N, 2) float
        Points in the frame of `spec`, metres; those outside don't count.
    spec : GridSpec
        The cells, (H, W).
    """
    rows, cols, inside = spec.cells(xy)
    height, width = spec.shape
    cells = rows[inside] * width + cols[inside]
    return np.bincount(cells, minlength=height * width).reshape(spec.shape)


def prepare_scan(points: NDArray, sensor: SensorModel) -> NDArray[np.floating]:
    """Prepare a scan for evidence: remove the vehicle's own returns, and measure heights from the ground.

    Parameters
    ----------
    points : (N, 3+) float
        Returns: x forward, y left, z above the ground on which the vehicle stands (m), in its grid frame, then
        reflectance and which are the vehicle's own (`Frame.vehicle_returns`), where these are known; N may be 0.
    sensor : SensorModel
        The sensor, with the outline of its vehicle, and how the ground is found.

    Returns
    -------
    (M, 3) float32 or float64
        The other returns, in their order: x, y, and the height above the ground at that place (m).
    """
    points = without_own_returns(points, sensor)
    if sensor.ground is not None:
        points[:, 2] = height_above_ground(points, sensor.ground)
    return points


def edge_of_splits(points: NDArray, edge: float) -> float:
    """Return how far outside the vehicle's outline dark returns come from split beams, metres.

    Parameters
    ----------
    points : (N, 3+) float
        Returns; a fourth column is reflectance.
    edge : float
        `SensorModel.edge`. It becomes 0 if most returns have reflectance 0, because a scanner that doesn't measure
        reflectance writes 0 everywhere; KITTI's has 15 % of them.
    """
    dark = np.count_nonzero(points[:, 3:4] == 0)
    return 0.0 if dark > len(points) / 2 else edge


def without_own_returns(points: NDArray, sensor: SensorModel) -> NDArray:
    """Remove the returns that come from the vehicle itself, and from beams that its edge splits.

    They would travel along with the vehicle for ever, and hide what is behind them. Beside KITTI's car, some 30 returns
    per scan are up to 0.65 m outside its outline, behind mirrors and roof. Unlike returns from a thing that close, they
    bring hardly any light back: their reflectance is exactly 0.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the grid frame of the vehicle, metres; a fourth column is reflectance. A fifth column is not 0 for
        the vehicle's own returns. With it, exactly those are removed, and outline and edge don't matter.
    sensor : SensorModel
        The outline of its `vehicle`, the `edge` around it, and `obstacle_min`: lower returns come from the ground.

    Returns
    -------
    (M, 3) float
        x, y and z of the other returns, in their order.
    """
    x, y, z = points[:, :3].T
    columns = points.shape[1]
    if columns > 4:  # the reader knows which returns are the vehicle's own
        return points[points[:, 4] == 0, :3]
    no_light = points[:, 3] == 0 if columns > 3 else np.zeros(len(points), bool)
    # Only returns without any light can lie outside the outline and still be the vehicle's own.
    around = np.where(no_light, edge_of_splits(points, sensor.edge), 0.0)
    x_min, x_max, y_min, y_max = sensor.vehicle
    beside = (x > x_min - around) & (x < x_max + around) & (y > y_min - around) & (y < y_max + around)
    return points[~(beside & (z >= sensor.obstacle_min)), :3]


def likelihoods(obstacles: NDArray, free: NDArray, sensor: SensorModel) -> Evidence:
    """Turn what a scan has found in each cell into P(z | occupied) and P(z | free).

    Parameters
    ----------
    obstacles : (H, W) int
        Number of obstacle returns in each cell, n: then P(z | .) = p_hit^min(n, max_returns).
    free : (H, W) bool
        Whether the scan has found the cell free: then P(z | .) = p_pass. Obstacle returns overrule it, because an
        object may fill a cell only in part.
    sensor : SensorModel
        The sensor, with its probabilities of errors.

    Returns
    -------
    Evidence
        P(z | occupied) and P(z | free), each (H, W); both are 1 where neither holds.

    Examples
    --------
    >>> likelihoods(np.array([[1, 0, 0]]), np.array([[True, True, False]]), SensorModel()).free.round(2)
    array([[0.05, 0.7 , 1.  ]], dtype=float32)
    """
    hits = np.minimum(obstacles, sensor.max_returns)  # of zero hits both likelihoods are 1: they tell nothing
    passed = free & (obstacles == 0)
    occupied = np.where(passed, sensor.p_pass_occupied, sensor.p_hit_occupied**hits)
    empty = np.where(passed, sensor.p_pass_free, sensor.p_hit_free**hits)
    return Evidence(occupied.astype(np.float32), empty.astype(np.float32))
