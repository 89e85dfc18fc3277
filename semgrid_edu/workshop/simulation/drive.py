"""One simulated drive: a world, the recording car that drives through it, and the frames that its sensors record."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import transform_points
from semgrid_edu.frame import LABEL_GRID, Frame
from semgrid_edu.workshop.simulation.sensors.camera import Picture, take_picture
from semgrid_edu.workshop.simulation.sensors.lidar import labelled_scan
from semgrid_edu.workshop.simulation.sensors.raycast import Instant, PorousMesh, RayMesh
from semgrid_edu.workshop.simulation.sensors.rig import Geodesy, Rig
from semgrid_edu.workshop.simulation.sensors.truth import BirdseyeTruth, birdseye_truth
from semgrid_edu.workshop.simulation.street import road_users
from semgrid_edu.workshop.simulation.street.footprints import footprint_table
from semgrid_edu.workshop.simulation.street.plan import RANDOM_STREET, Wishes, draw_plan
from semgrid_edu.workshop.simulation.street.scenery import build_scenery
from semgrid_edu.workshop.simulation.street.traffic import Traffic
from semgrid_edu.workshop.simulation.street.trajectories import ActorPace, Ego

PERIOD = 0.1
"""Seconds between frames: KITTI's LIDAR spins at 10 Hz."""
_VIEW = 110.0
"""Moving objects farther than this from the recording car, metres, are left out."""


@dataclass(frozen=True, eq=False)
class SimulatedFrame:
    """One instant of a simulated drive: sensor data and ground truth.

    Parameters
    ----------
    time : float
        Seconds since the drive began.
    T_world_from_lidar : (4, 4) float64
        Pose of the LIDAR, metres.
    picture : Picture
        The camera image, and what each of its pixels shows.
    points : (N, 4) float32
        LIDAR returns: x, y, z in the LIDAR frame, metres, and reflectance 0..1.
    truth : BirdseyeTruth or None
        The class of every cell; None for an unlabelled frame.
    objects : list of dict
        Cars, pedestrians and bicycles in the bird's-eye grid, from `SimulatedDrive.objects`.
    """

    time: float
    T_world_from_lidar: NDArray[np.float64]
    picture: Picture
    points: NDArray[np.float32]
    truth: BirdseyeTruth | None
    objects: list[dict]


class SimulatedDrive:
    """A drive through a random world. The same seed gives the same drive.

    Parameters
    ----------
    seed : int or numpy.random.SeedSequence
        Seed for everything random: the world, its road users, and the sensor noise.
    n_frames : int
        Number of frames, `PERIOD` apart.
    wishes : Wishes
        The fixed properties of the street; the rest is random.
    rig : Rig, optional
        The sensors on the recording car; by default the sensors of the simulated data sets.

    Attributes
    ----------
    plan : Plan
        The plan of the street.
    ego : Ego
        How the recording car moves.
    moving, parked : list of Actor
        The road users. `moving` includes pedestrians who stand still.
    """

    def __init__(
        self, seed: int | np.random.SeedSequence, n_frames: int, wishes: Wishes = RANDOM_STREET, rig: Rig | None = None
    ) -> None:
        rng = np.random.default_rng(seed)
        self.n_frames = n_frames
        self.rig = rig or Rig()
        duration = (n_frames - 1) * PERIOD
        pace = ActorPace.random(rng, wishes.speed)
        self.plan = draw_plan(rng, pace.distance(duration), wishes)
        swing = (0.05, 0.2) if wishes.relief == {} else (0.3, 0.6)
        self.ego = Ego.random(rng, self.plan.road, pace, wishes.ego_lane, swing)
        self.geodesy = Geodesy.random(rng)
        builder = build_scenery(self.plan, rng)
        traffic = Traffic(builder, self.ego.trajectory, duration)
        cast = getattr(road_users, wishes.cast) if isinstance(wishes.cast, str) else wishes.cast
        cast(traffic)
        self.moving = traffic.moving
        self.parked = traffic.parked
        self.static = RayMesh.of(*zip(*builder.solid, strict=True))
        self.porous = PorousMesh.of(*zip(*builder.porous, strict=True)) if builder.porous else None
        self.static_footprints = footprint_table(builder.footprints)
        self.sensor_seed = rng.bit_generator.seed_seq.spawn(1)[0]

    def pose(self, t: float) -> NDArray[np.float64]:
        """Return the LIDAR's pose T_world_from_lidar at one instant, (4, 4), metres.

        Parameters
        ----------
        t : float
            Seconds since the drive began.
        """
        return self.ego.T_world_from_lidar(t)

    def T_world_from_imu(self, t: float) -> NDArray[np.float64]:
        """Return the IMU's pose at one instant, (4, 4), metres. Parameters are those of `SimulatedDrive.pose`."""
        return self.pose(t) @ self.rig.T_lidar_from_imu

    def T_grid_from_world(self, t: float) -> NDArray[np.float64]:
        """Return the world's pose in the grid of one instant, metres. Parameters are those of `SimulatedDrive.pose`."""
        return self.rig.T_grid_from_lidar @ np.linalg.inv(self.pose(t))

    def instant(self, t: float) -> Instant:
        """Return the world at one instant, ready for ray casting. Parameters are those of `SimulatedDrive.pose`."""
        road = self.plan.road
        eye = self.pose(t)[:2, 3]
        near = [a for a in self.moving if np.hypot(*(a.trajectory.pose(road, t)[0][:2] - eye)) < _VIEW]
        moving = RayMesh.of([a.shape(road, t) for a in near], [a.instance for a in near]) if near else None
        return Instant(self.static, moving, self.porous)

    def velocities(self, t: float) -> dict[int, NDArray[np.float64]]:
        """Return the velocity over ground of each road user that isn't parked, by its number.

        A velocity is (2,), m/s, along x and y of the grid frame at that instant. Parameters are those of
        `SimulatedDrive.pose`.
        """
        rotation = self.T_grid_from_world(t)[:2, :2]
        road = self.plan.road
        return {actor.instance: rotation @ actor.trajectory.velocity(road, t) for actor in self.moving}

    def objects(self, t: float) -> list[dict]:
        """Return the cars, pedestrians and bicycles with centres in `LABEL_GRID`, from `Actor.described`.

        Parameters are those of `SimulatedDrive.pose`.
        """
        road = self.plan.road
        T = self.T_grid_from_world(t)
        actors = self.parked + self.moving
        centres = [transform_points(T, actor.middle(road, t)) for actor in actors]
        inside = LABEL_GRID.cells(np.reshape(centres, (-1, 3)))[2]
        return [actor.described(road, t, T) for actor, is_inside in zip(actors, inside, strict=True) if is_inside]

    def footprints(self, t: float) -> NDArray[np.float64]:
        """Return the footprints of all objects at one instant, static and moving, (K, 9), see `footprint_table`.

        Parameters are those of `SimulatedDrive.pose`.
        """
        moving = footprint_table([actor.footprint(self.plan.road, t) for actor in self.moving])
        return np.concatenate([self.static_footprints, moving])

    def birdseye(self, t: float) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
        """Return the content of every cell of `LABEL_GRID`, whether or not a sensor sees it.

        Parameters are those of `SimulatedDrive.pose`.

        Returns
        -------
        kinds : (710, 310) uint8
            Members of `Kind`.
        instances : (710, 310) int32
            Number of the car, pedestrian or bicycle; 0 for anything else.
        """
        truth = self.truth(t)
        return truth.kinds, truth.instances

    def truth(self, t: float, picture: Picture | None = None) -> BirdseyeTruth:
        """Return the content of every cell of `LABEL_GRID`, and whether the camera sees it.

        Parameters
        ----------
        t : float
            Seconds since the drive began.
        picture : Picture, optional
            The picture that the camera took at that instant.
        """
        return birdseye_truth(self.footprints(t), self.plan.road, self.pose(t), self.rig, picture)

    def frame(self, index: int, labelled: bool) -> SimulatedFrame:
        """Record one frame. Its noise depends only on its number, not on the frames recorded before.

        Parameters
        ----------
        index : int
            Number of the frame.
        labelled : bool
            Whether to compute the bird's-eye truth too.
        """
        rng = self._noise(index)
        t = index * PERIOD
        pose = self.pose(t)
        picture = take_picture(self.instant(t), pose, self.rig, self.plan.road, self.plan.light, rng)
        points, _ = self._labelled_scan(t, rng)
        truth = self.truth(t, picture) if labelled else None
        return SimulatedFrame(t, pose, picture, points, truth, self.objects(t))

    def scan(self, index: int) -> Frame:
        """Record only the LIDAR scan of one frame, which is fast. The noise differs from the noise in `frame`.

        The frame has no image and no labels. Its pose comes from the nearest packet (`Rig.packet_interval`).

        Parameters
        ----------
        index : int
            Number of the frame.
        """
        t = index * PERIOD
        half = self.rig.packet_interval / 2
        points, _ = self.labelled_scan(index)
        nearest = t + float(self._noise(index, 2).uniform(-half, half)) if half else t
        return Frame(None, points, self.rig.camera, self.pose(nearest), t)

    def labelled_scan(self, index: int) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Record the scan of `SimulatedDrive.scan` and label each return with what it hit, as PandaSet does.

        Parameters are those of `SimulatedDrive.scan`.

        Returns
        -------
        points : (N, 4) float32
            x, y, z in the LIDAR frame, metres, and reflectance.
        kinds : (N,) uint8
            Members of `Kind`.
        """
        return self._labelled_scan(index * PERIOD, self._noise(index, 1))

    def _labelled_scan(self, t: float, rng: np.random.Generator) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Record the scan in which the LIDAR points ahead at time t, and what each return hit."""
        return labelled_scan(
            lambda after: self.instant(t + after),
            lambda after: self.pose(t + after),
            self.rig.lidar,
            self.plan.road,
            rng,
        )

    def _noise(self, *key: int) -> np.random.Generator:
        """Return this drive's random generator for a key, such as the number of a frame."""
        seed = np.random.SeedSequence(self.sensor_seed.entropy, spawn_key=(*self.sensor_seed.spawn_key, *key))
        return np.random.default_rng(seed)
