"""One simulated drive: a world, the recording car's way through it, and every frame that its sensors take."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import transform_points
from semgrid_edu.frame import LABEL_GRID, Frame
from semgrid_edu.simulation.sensors.camera import Picture, take_picture
from semgrid_edu.simulation.sensors.gps import Geodesy
from semgrid_edu.simulation.sensors.lidar import scan
from semgrid_edu.simulation.sensors.raycast import Instant, RayMesh
from semgrid_edu.simulation.sensors.rig import Rig
from semgrid_edu.simulation.sensors.truth import birdseye_kinds, visible_cells, world_cells
from semgrid_edu.simulation.street.footprints import footprint_table
from semgrid_edu.simulation.street.plan import ANY, Plan, Wishes, draw_plan
from semgrid_edu.simulation.street.road_users import fill_street
from semgrid_edu.simulation.street.scenery import build_scenery
from semgrid_edu.simulation.street.traffic import Actor, Traffic
from semgrid_edu.simulation.street.trajectories import Ego, Pace, Trajectory

PERIOD = 0.1
"""Seconds between frames: KITTI's LIDAR turns ten times a second."""
_VIEW = 110.0


@dataclass(frozen=True, eq=False)
class BirdseyeTruth:
    """The bird's-eye truth of a frame: `kinds` (710, 310) uint8, members of `Kind`, and `visible` (710, 310) bool."""

    kinds: NDArray[np.uint8]
    visible: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SimulatedFrame:
    """One instant of a simulated drive.

    Parameters
    ----------
    time : float
        Seconds since the drive began.
    T_world_from_lidar : (4, 4) float64
    picture : Picture
    points : (N, 4) float32
        As in `Frame`.
    truth : BirdseyeTruth or None
        None where nobody asked for it.
    objects : list of dict
        Cars, pedestrians and bicycles in the bird's-eye grid, in the grid frame.
    """

    time: float
    T_world_from_lidar: NDArray[np.float64]
    picture: Picture
    points: NDArray[np.float32]
    truth: BirdseyeTruth | None
    objects: list[dict]


class SimulatedDrive:
    """A drive through a world of its own, the same for the same seed.

    Parameters
    ----------
    seed : int or numpy.random.SeedSequence
    n_frames : int
        Frames, ten a second.
    wishes : Wishes
    rig : Rig
    """

    def __init__(
        self, seed: int | np.random.SeedSequence, n_frames: int, wishes: Wishes = ANY, rig: Rig | None = None
    ) -> None:
        self.wishes = wishes
        self.rng = np.random.default_rng(seed)
        self.n_frames, self.rig = n_frames, rig or Rig()
        duration = (n_frames - 1) * PERIOD
        pace = _draw_pace(self.rng, wishes.speed)
        self.plan = draw_plan(self.rng, pace.distance(duration), wishes)
        self.ego = _draw_ego(self.rng, self.plan, pace, wishes.ego_lane)
        self.geodesy = Geodesy(
            49.0 + float(self.rng.uniform(0, 0.05)),
            8.4 + float(self.rng.uniform(0, 0.05)),
            114.0,
            float(self.rng.uniform(-3.1, 3.1)),
        )
        builder = build_scenery(self.plan, self.rng)
        traffic = Traffic(builder, self.plan, self.ego.trajectory, duration)
        (wishes.cast or fill_street)(traffic)
        self.moving: list[Actor] = traffic.moving
        self.parked: list[Actor] = traffic.parked
        self.static = RayMesh.of(builder.shapes, builder.instances)
        self.static_footprints = footprint_table(builder.footprints)
        self.sensor_seed = self.rng.bit_generator.seed_seq.spawn(1)[0]

    def pose(self, t: float) -> NDArray[np.float64]:
        """Return T_world_from_lidar (4, 4) at t seconds."""
        return self.ego.T_world_from_lidar(t)

    def T_world_from_imu(self, t: float) -> NDArray[np.float64]:
        """Return the IMU's pose (4, 4) at t seconds."""
        return self.pose(t) @ self.rig.T_lidar_from_imu

    def instant(self, t: float) -> Instant:
        """Return the world at t seconds, ready for rays."""
        road, eye = self.plan.road, self.pose(t)[:2, 3]
        near = [a for a in self.moving if np.hypot(*(a.trajectory.pose(road, t)[0][:2] - eye)) < _VIEW]
        if not near:
            return Instant(self.static, None, np.empty((0, 4)))
        shapes = [a.shape(road, t) for a in near]
        boxes = np.array([[shape.vertices.min(axis=0), shape.vertices.max(axis=0)] for shape in shapes], np.float64)
        radii = np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1) / 2
        spheres = np.column_stack([boxes.mean(axis=1), radii])
        return Instant(self.static, RayMesh.of(shapes, [a.instance for a in near]), spheres)

    def T_grid_from_world(self, t: float) -> NDArray[np.float64]:
        """Return the pose (4, 4) of the world in the grid frame at t seconds."""
        return self.rig.T_grid_from_lidar @ np.linalg.inv(self.pose(t))

    def velocities(self, t: float) -> dict[int, NDArray[np.float64]]:
        """Return the velocity over ground of everybody in traffic, by number.

        Parameters
        ----------
        t : float
            Seconds since the drive began.

        Returns
        -------
        dict of int to (2,) float64
            m/s in grid axes.
        """
        rotation, road = self.T_grid_from_world(t)[:2, :2], self.plan.road
        return {actor.instance: rotation @ actor.trajectory.velocity(road, t) for actor in self.moving}

    def objects(self, t: float) -> list[dict]:
        """Return cars, pedestrians and bicycles that stand in the bird's-eye grid at t seconds."""
        T_grid_from_world = self.T_grid_from_world(t)
        road, found = self.plan.road, []
        for actor in self.parked + self.moving:
            position, yaw = actor.trajectory.pose(road, t)
            middle = np.add(position, (0, 0, actor.size[2] / 2))
            centre = transform_points(T_grid_from_world, middle)
            if not LABEL_GRID.cells(centre[None])[2][0]:
                continue
            velocity = T_grid_from_world[:3, :2] @ actor.trajectory.velocity(road, t)
            heading = T_grid_from_world[:3, :2] @ [np.cos(yaw), np.sin(yaw)]
            found.append(
                {
                    "id": actor.instance,
                    "class": actor.kind.name.lower(),
                    "centre": [round(float(x), 3) for x in centre],
                    "size": [round(float(x), 3) for x in actor.size],
                    "yaw": round(float(np.arctan2(heading[1], heading[0])), 4),
                    "velocity": [round(float(x), 3) for x in velocity[:2]],
                    "moving": bool(np.hypot(*velocity[:2]) > 0.05),
                }
            )
        return found

    def footprints(self, t: float) -> NDArray[np.float64]:
        """Return the footprints of all that stands or moves at t seconds, a `footprint_table`."""
        return np.concatenate(
            [self.static_footprints, footprint_table([a.footprint(self.plan.road, t) for a in self.moving])]
        )

    def birdseye(self, t: float) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
        """Return what the cells of `LABEL_GRID` hold, seen by anybody or not.

        Parameters
        ----------
        t : float
            Seconds since the drive began.

        Returns
        -------
        kinds : (710, 310) uint8
            Members of `Kind`.
        instances : (710, 310) int32
            Number of the car, pedestrian or bicycle there; 0 for all else.
        """
        footprints = self.footprints(t)
        kinds, which = birdseye_kinds(world_cells(self.pose(t), self.rig), footprints, self.plan.road)
        return kinds, np.where(which >= 0, footprints[which, 7], 0).astype(np.int32)

    def truth(self, t: float, picture: Picture) -> BirdseyeTruth:
        """Return the bird's-eye truth at t seconds, of which `picture` was taken."""
        road, pose = self.plan.road, self.pose(t)
        cells, footprints = world_cells(pose, self.rig), self.footprints(t)
        kinds, which = birdseye_kinds(cells, footprints, road)
        return BirdseyeTruth(
            kinds, visible_cells(cells, kinds, which, footprints, road, picture, pose, self.rig.camera)
        )

    def frame(self, index: int, labelled: bool) -> SimulatedFrame:
        """Take one frame; every frame has its own noise, whichever frames were taken before."""
        rng = self._noise(index)
        t, road = index * PERIOD, self.plan.road
        instant, pose = self.instant(t), self.pose(t)
        picture = take_picture(instant, pose, self.rig, road, self.plan.light, rng)
        points = scan(instant, pose, self.rig.lidar, road, rng)
        truth = self.truth(t, picture) if labelled else None
        return SimulatedFrame(t, pose, picture, points, truth, self.objects(t))

    def scan(self, index: int) -> Frame:
        """Take one frame without image and labels, fast; the noise of its returns is another than `frame`'s.

        Parameters
        ----------
        index : int
            Number of the frame, `PERIOD` apart.

        Returns
        -------
        Frame
        """
        t = index * PERIOD
        points = scan(self.instant(t), self.pose(t), self.rig.lidar, self.plan.road, self._noise(index, 1))
        return Frame(None, points, self.rig.camera, self.pose(t), t)

    def _noise(self, *key: int) -> np.random.Generator:
        """Return a generator of the drive's own for each key."""
        seed = np.random.SeedSequence(self.sensor_seed.entropy, spawn_key=(*self.sensor_seed.spawn_key, *key))
        return np.random.default_rng(seed)

    def frames(self, labelled: set[int]) -> Iterator[SimulatedFrame]:
        """Take all frames, with bird's-eye truth for those in `labelled`."""
        return (self.frame(k, k in labelled) for k in range(self.n_frames))


def _draw_pace(rng: np.random.Generator, speed: float | None) -> Pace:
    """Draw how fast the recording car drives: 5 to 14 m/s, now and then 0."""
    drawn = 0.0 if rng.random() < 0.1 else float(rng.uniform(5, 14))
    mean = drawn if speed is None else speed
    swing, phase = float(rng.uniform(0.0, 0.12)) * mean, float(rng.uniform(0, 6.28))
    return Pace(mean, swing, 0.8, phase)


def _draw_ego(rng: np.random.Generator, plan: Plan, pace: Pace, lane: int | None) -> Ego:
    """Draw the recording car's lane (0: beside the centre line), the outer one more often, and how it sways."""
    road = plan.road
    drawn = road.lanes_right - 1 if rng.random() < 0.65 else 0
    lane = drawn if lane is None else lane
    d = -(lane + 0.5) * road.lane + float(rng.normal(0, 0.1))
    sway, phase = float(rng.uniform(0.02, 0.1)), float(rng.uniform(0, 6.28))
    roll, pitch = (float(x) for x in np.radians(rng.uniform(0.05, 0.2, 2)))
    return Ego(road, Trajectory(0.0, d, 1.0, 0.0, pace), sway, roll, pitch, phase)
