"""Merge labelled scans of several instants: returns of moving objects move with their cuboids, so they don't smear."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from semgrid_edu.camera import invert_rigid, transform_points

MARGIN = 0.1
"""Metres by which a return may be outside its object's cuboid, because cuboids are drawn by hand."""

ANY_LIDAR = -1
"""In place of a LIDAR's number: the cuboid is valid for all LIDARs."""


@dataclass(frozen=True, eq=False)
class Cuboids:
    """The objects at one instant, each in a box.

    Parameters
    ----------
    names : (B,) str
        Identifies an object at all instants.
    T_world_from_box : (B, 4, 4) float64
        Pose of each box, metres. The origin of a box's frame is at its centre.
    sizes : (B, 3) float
        Lengths of the edges along the box's axes, metres.
    moving : (B,) bool
        Whether the object moves at any time.
    lidars : (B,) int
        Number of the LIDAR whose returns are in the box, because two LIDARs see a moving object in two places;
        `ANY_LIDAR` for all.
    """

    names: NDArray
    T_world_from_box: NDArray[np.float64]
    sizes: NDArray[np.float64]
    moving: NDArray[np.bool_]
    lidars: NDArray[np.int64]

    def holding(self, points: NDArray, lidars: NDArray) -> NDArray[np.int64]:
        """Return the number of the box that contains each point, (N,); -1 if none does.

        Parameters
        ----------
        points : (N, 3) float
            World, metres.
        lidars : (N,) int
            Number of the LIDAR of each point.
        """
        holder = np.full(len(points), -1)
        if not (len(points) and len(self.names)):
            return holder
        # Only points in the sphere around a box are tested; a search tree finds them without looking at the others.
        radii = np.linalg.norm(self.sizes / 2 + MARGIN, axis=1) + 1e-6  # a corner is in despite rounding
        around = KDTree(points).query_ball_point(self.T_world_from_box[:, :3, 3], radii, return_sorted=True)
        for b, (T, size, lidar) in enumerate(zip(self.T_world_from_box, self.sizes, self.lidars, strict=True)):
            near = np.array(around[b], np.int64)
            inside = (np.abs(transform_points(invert_rigid(T), points[near])) <= size / 2 + MARGIN).all(axis=1)
            holder[near[inside & ((lidar == ANY_LIDAR) | (lidars[near] == lidar))]] = b
        return holder

    def poses(self) -> dict[str, NDArray[np.float64]]:
        """Return T_world_from_box of each object by name; with two boxes, the one with the lower LIDAR number."""
        return {self.names[b]: self.T_world_from_box[b] for b in np.argsort(-self.lidars, kind="stable")}


@dataclass(frozen=True, eq=False)
class LabelledScan:
    """The returns of one instant with their classes, and the objects among them.

    Parameters
    ----------
    points : (N, 3) float64
        World, metres.
    classes : (N,) uint8
        Class of each return; 255 where unlabelled.
    movable : (N,) bool
        Whether it comes from an object that can move, such as a car, parked or not.
    lidars : (N,) int
        Number of the LIDAR of each return.
    cuboids : Cuboids
        The objects.
    """

    points: NDArray[np.float64]
    classes: NDArray[np.uint8]
    movable: NDArray[np.bool_]
    lidars: NDArray[np.int64]
    cuboids: Cuboids

    @cached_property
    def holder(self) -> NDArray[np.int64]:
        """The number of the cuboid of each movable return, in their order; -1 if none holds it."""
        return self.cuboids.holding(self.points[self.movable], self.lidars[self.movable])

    @cached_property
    def resting(self) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
        """Points and classes of the returns that are where they were at any other instant, too."""
        kept = np.ones(len(self.points), bool)
        boxes = np.append(self.cuboids.moving, True)  # the last one is for movable returns in no box
        kept[np.flatnonzero(self.movable)[boxes[self.holder]]] = False
        return self.points[kept], self.classes[kept]

    @cached_property
    def carried(self) -> dict[int, tuple[NDArray[np.float64], NDArray[np.uint8]]]:
        """Points and classes of the returns in each moving cuboid that holds any, by its number."""
        movable = np.flatnonzero(self.movable)
        by_holder = movable[np.argsort(self.holder, kind="stable")]
        ends = np.searchsorted(np.sort(self.holder), np.arange(len(self.cuboids.names) + 1))
        groups = {b: by_holder[ends[b] : ends[b + 1]] for b in np.flatnonzero(self.cuboids.moving)}
        return {b: (self.points[held], self.classes[held]) for b, held in groups.items() if len(held)}


def put_together(
    now: LabelledScan, others: Sequence[LabelledScan], wanted: Callable[[NDArray], NDArray[np.bool_]] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Merge the returns of several scans at one instant.

    Returns from a moving object are moved to its cuboid at that instant. If it has no cuboid then, its returns in the
    other scans are left out. Returns from movable objects outside all cuboids are left out too, because we don't know
    whether they moved.

    Parameters
    ----------
    now : LabelledScan
        The scan of that instant; its returns come first.
    others : sequence of LabelledScan
        Scans of other instants.
    wanted : callable, optional
        Tells for points (N, 3) in the world which are wanted, (N,) bool; by default all. Points of moving objects in
        other scans are returned in any case.

    Returns
    -------
    points : (N, 3) float64
        World, metres.
    classes : (N,) uint8
        Class of each; 255 where unlabelled.
    """
    places = now.cuboids.poses()
    parts = []
    for points, classes in (_of_now(now, places), *(scan.resting for scan in others)):
        seen = slice(None) if wanted is None else wanted(points)
        parts.append((points[seen], classes[seen]))
    parts += [part for scan in others for part in _moved(scan, places).values()]
    points, classes = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return points, classes


def _of_now(now: LabelledScan, places: dict[str, NDArray]) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Return all returns of the scan of that instant; of the two cuboids that two LIDARs see, the first one counts."""
    points = now.points.copy()
    movable = np.flatnonzero(now.movable)
    for b, (moved, _) in _moved(now, places).items():
        points[movable[now.holder == b]] = moved
    return points, now.classes


def _moved(scan: LabelledScan, places: dict[str, NDArray]) -> dict[int, tuple[NDArray[np.float64], NDArray[np.uint8]]]:
    """Return the returns in each moving cuboid that has a pose in `places`, moved there."""
    there = {}
    for b, (points, classes) in scan.carried.items():
        name = scan.cuboids.names[b]
        if name in places:
            T_now_from_then = places[name] @ invert_rigid(scan.cuboids.T_world_from_box[b])
            there[b] = transform_points(T_now_from_then, points), classes
    return there
