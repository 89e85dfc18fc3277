"""Planar motion of the vehicle: what the filter needs to know of ego-motion (paper, section 3.2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import invert_rigid
from semgrid_edu.errors import ArgumentError


@dataclass(frozen=True)
class PlanarMotion:
    """The pose of the vehicle now, in the grid frame of the previous instant.

    Parameters
    ----------
    dx, dy : float
        Displacement forward and to the left, metres.
    dyaw : float
        Turn to the left, radians.

    Raises
    ------
    ArgumentError
        When one of them isn't finite.

    Examples
    --------
    >>> PlanarMotion(1.0, 0.0, np.pi / 2).to_previous(np.array([[2.0, 0.0]])).round(6)
    array([[1., 2.]])
    """

    dx: float = 0.0
    dy: float = 0.0
    dyaw: float = 0.0

    def __post_init__(self) -> None:
        """Refuse a motion that isn't finite."""
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

        Raises
        ------
        ArgumentError
            When one isn't a finite 4x4 matrix.
        """
        for name, T in (("T_world_from_before", T_world_from_before), ("T_world_from_now", T_world_from_now)):
            if np.shape(T) != (4, 4) or not np.isfinite(T).all():
                raise ArgumentError(name, "a finite 4x4 transform", T)
        T_before_from_now = invert_rigid(T_world_from_before) @ T_world_from_now
        dyaw = np.arctan2(T_before_from_now[1, 0], T_before_from_now[0, 0])
        return cls(float(T_before_from_now[0, 3]), float(T_before_from_now[1, 3]), float(dyaw))

    @property
    def rotation(self) -> NDArray[np.float64]:
        """(2, 2): turns vectors along the axes of now into vectors along the axes of the previous instant."""
        cos, sin = np.cos(self.dyaw), np.sin(self.dyaw)
        return np.array([[cos, -sin], [sin, cos]])

    def to_previous(self, xy: NDArray) -> NDArray:
        """Return the coordinates in the previous frame of points given in the frame of now.

        Parameters
        ----------
        xy : (..., 2) float
            x and y in the grid frame of now, metres.

        Returns
        -------
        (..., 2) float
            x and y in the grid frame of the previous instant, metres.
        """
        return xy @ self.rotation.T + (self.dx, self.dy)

    def to_now(self, xy: NDArray) -> NDArray:
        """Return the coordinates in the frame of now of points given in the previous frame.

        Parameters
        ----------
        xy : (..., 2) float
            x and y in the grid frame of the previous instant, metres.

        Returns
        -------
        (..., 2) float
            x and y in the grid frame of now, metres.
        """
        return (xy - (self.dx, self.dy)) @ self.rotation

    def then(self, motion: "PlanarMotion") -> "PlanarMotion":
        """Return this motion followed by another one, as a single motion.

        Parameters
        ----------
        motion : PlanarMotion
            The motion that follows, in the frame to which this one leads.

        Returns
        -------
        PlanarMotion
            The pose after both motions, in the frame before them.
        """
        dx, dy = self.to_previous(np.array([motion.dx, motion.dy]))
        return PlanarMotion(float(dx), float(dy), self.dyaw + motion.dyaw)
