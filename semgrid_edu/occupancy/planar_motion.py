"""Ego-motion in the plane, and a map that scrolls under the vehicle by whole cells (paper, section 3.2, step 1)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec


@dataclass(frozen=True)
class PlanarMotion:
    """The pose of one frame in the plane, the child, in another, its parent.

    As a motion it is the pose of the vehicle now (child) in the grid frame of the previous instant (parent). As a pose
    it says where the vehicle (child) is in a map (parent).

    Parameters
    ----------
    dx, dy : float
        Displacement forward and to the left, along the parent's axes, metres.
    dyaw : float
        Turn to the left, radians.

    Examples
    --------
    >>> PlanarMotion(1.0, 0.0, np.pi / 2).parent_from_child(np.array([[2.0, 0.0]])).round(6)
    array([[1., 2.]])
    """

    dx: float = 0.0
    dy: float = 0.0
    dyaw: float = 0.0

    def __post_init__(self) -> None:
        """Check that the motion is finite."""
        if not np.isfinite([self.dx, self.dy, self.dyaw]).all():
            raise ArgumentError("motion", "finite metres and radians", self)

    @classmethod
    def from_poses(cls, T_world_from_before: NDArray, T_world_from_now: NDArray) -> "PlanarMotion":
        """Return the motion between two poses, seen from above.

        Parameters
        ----------
        T_world_from_before, T_world_from_now : (4, 4) float
            Poses of the vehicle in the world, at the previous instant and now: rigid transforms, metres.

        Returns
        -------
        PlanarMotion
            Displacement and turn in the plane of the previous instant's x and y axes; height, pitch and roll are lost.
        """
        for name, T in (("T_world_from_before", T_world_from_before), ("T_world_from_now", T_world_from_now)):
            if np.shape(T) != (4, 4) or not np.isfinite(T).all():
                raise ArgumentError(name, "a finite 4x4 transform", T)
        axes = T_world_from_before[:3, :3]  # of the previous instant, as columns
        dx, dy, _ = axes.T @ (T_world_from_now[:3, 3] - T_world_from_before[:3, 3])
        ahead = axes.T @ T_world_from_now[:3, 0]
        return cls(float(dx), float(dy), float(np.arctan2(ahead[1], ahead[0])))

    @property
    def rotation(self) -> NDArray[np.float64]:
        """(2, 2): turns vectors along the child's axes into vectors along the parent's."""
        cos = np.cos(self.dyaw)
        sin = np.sin(self.dyaw)
        return np.array([[cos, -sin], [sin, cos]])

    @property
    def inverse(self) -> "PlanarMotion":
        """The pose of the parent in the child."""
        dx, dy = self.child_from_parent(np.zeros(2))
        return PlanarMotion(float(dx), float(dy), -self.dyaw)

    def parent_from_child(self, xy: NDArray) -> NDArray:
        """Return the coordinates in the parent of points given in the child, for example in the map of scan points.

        Parameters
        ----------
        xy : (..., 2) float
            x and y in the child, metres.
        """
        return xy @ self.rotation.T + (self.dx, self.dy)

    def child_from_parent(self, xy: NDArray) -> NDArray:
        """Return the coordinates in the child of points given in the parent.

        Parameters
        ----------
        xy : (..., 2) float
            x and y in the parent, metres.
        """
        return (xy - (self.dx, self.dy)) @ self.rotation

    def then(self, motion: "PlanarMotion") -> "PlanarMotion":
        """Return this motion followed by another one, as a single motion.

        Parameters
        ----------
        motion : PlanarMotion
            The motion that follows, in the frame to which this one leads.
        """
        dx, dy = self.parent_from_child(np.array([motion.dx, motion.dy]))
        return PlanarMotion(float(dx), float(dy), self.dyaw + motion.dyaw)


def map_around(spec: GridSpec, yaw: float) -> GridSpec:
    """Return the cells of the map that the grid around the vehicle needs, however the vehicle is turned in the map.

    Parameters
    ----------
    spec : GridSpec
        The grid around the vehicle.
    yaw : float
        Heading of the vehicle in the map, radians. The vehicle is at most half a cell from the origin of the map.

    Returns
    -------
    GridSpec
        The smallest rectangle of the map's cells that contains the turned grid. All such rectangles share their cell
        borders, so a map changes from one to the other without interpolation.

    Examples
    --------
    >>> map_around(GridSpec(0, 10, -2, 2, cell=1), yaw=np.pi / 2)
    GridSpec(x_min=-3.0, x_max=3.0, y_min=-1.0, y_max=11.0, cell=1)
    """
    corners = np.array([(x, y) for x in (spec.x_min, spec.x_max) for y in (spec.y_min, spec.y_max)])
    turned = PlanarMotion(dyaw=yaw).parent_from_child(corners)
    border = np.array([spec.x_max, spec.y_max])  # borders of the map's cells are whole cells away from here
    rounding = 1e-6  # of a cell
    lowest = np.floor((turned.min(axis=0) - border) / spec.cell - 0.5 + rounding)
    highest = np.ceil((turned.max(axis=0) - border) / spec.cell + 0.5 - rounding)
    x_min, y_min = (border + lowest * spec.cell).tolist()
    x_max, y_max = (border + highest * spec.cell).tolist()
    return GridSpec(x_min, x_max, y_min, y_max, spec.cell)


def scroll(pose: PlanarMotion, cell: float) -> tuple[PlanarMotion, PlanarMotion]:
    """Decide how the map follows the vehicle.

    The map shifts by whole cells, which is exact, and the rest of the vehicle's displacement stays in the pose, so
    nothing is interpolated. The map never turns: the vehicle turns in it.

    Parameters
    ----------
    pose : PlanarMotion
        Pose of the vehicle in the frame of the map, metres and radians.
    cell : float
        Side of a cell, metres.

    Returns
    -------
    shift : PlanarMotion
        Pose of the map's new frame in its old one.
    pose : PlanarMotion
        Pose of the vehicle in the map's new frame.

    Examples
    --------
    >>> scroll(PlanarMotion(1.25, 0.0, 0.3), cell=0.5)
    (PlanarMotion(dx=1.0, dy=0.0, dyaw=0.0), PlanarMotion(dx=0.25, dy=0.0, dyaw=0.3))
    """
    # The remainder of a division by the cell, between minus and plus half a cell.
    dx = math.remainder(pose.dx, cell)
    dy = math.remainder(pose.dy, cell)
    return PlanarMotion(pose.dx - dx, pose.dy - dy), PlanarMotion(dx, dy, pose.dyaw)


def look_up(values: NDArray, outside: NDArray, source: GridSpec, target: GridSpec, pose: PlanarMotion) -> NDArray:
    """Give each cell of one grid the values of the cell of another grid that contains its centre.

    Parameters
    ----------
    values : (K, H, W) float
        K values of each cell of `source`.
    outside : (K,) float
        The values of a cell whose centre is outside `source`.
    source, target : GridSpec
        The two grids, (H, W) and (H', W') cells.
    pose : PlanarMotion
        Pose of the frame of `target` in that of `source`, metres and radians.
    """
    rows, cols, inside = source.cells(pose.parent_from_child(target.centers().reshape(-1, 2)))
    cells = rows * source.shape[1] + cols
    found = np.take(values.reshape(len(values), -1), cells, axis=1)  # unlike values[:, rows, cols], plane after plane
    found[:, ~inside] = np.asarray(outside)[:, None]
    return found.reshape(len(values), *target.shape)


def shift_plane(plane: NDArray, cells: NDArray[np.int64]) -> NDArray:
    """Move a plane by whole cells along x and y, which is up and to the left; zeros come in from outside.

    Parameters
    ----------
    plane : (H, W) float
        One number per cell.
    cells : (2,) int
        How far, in cells along x and y.
    """
    height, width = plane.shape
    up = max(-height, min(int(cells[0]), height))
    left = max(-width, min(int(cells[1]), width))
    # x points to row 0, so a shift by +1 along x takes row 1 to row 0, and the last row is filled with zeros.
    shifted = np.zeros_like(plane)
    source = plane[max(up, 0) : height + min(up, 0), max(left, 0) : width + min(left, 0)]
    shifted[max(-up, 0) : height - max(up, 0), max(-left, 0) : width - max(left, 0)] = source
    return shifted


def turn_moments(mean: NDArray, covariance: NDArray, motion: PlanarMotion) -> tuple[NDArray, NDArray]:
    """Express moments of velocity in the axes of another frame: R^T mean, R^T C R.

    Parameters
    ----------
    mean : (2, H, W) float32
        Mean velocity along the axes of one frame, m/s.
    covariance : (2, 2, H, W) float32
        Covariance of the velocity along the same axes, m^2/s^2.
    motion : PlanarMotion
        Pose of the other frame in that one; R is its rotation.

    Returns
    -------
    mean : (2, H, W) float32
        Mean velocity along the axes of the other frame, m/s.
    covariance : (2, 2, H, W) float32
        Covariance along the same axes, m^2/s^2, symmetric to the last bit.
    """
    R = motion.rotation.astype(mean.dtype)
    turned = np.einsum("jkhw,kl->jlhw", np.einsum("ij,ikhw->jkhw", R, covariance), R)
    turned[1, 0] = turned[0, 1]  # rounded differently
    return np.einsum("ij,ihw->jhw", R, mean), turned
