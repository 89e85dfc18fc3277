"""Errors like those of real data: calibration slightly off, labels drawn by hand, scans that are skewed (section 4).

The simulator's calibration and labels are exact, so truth made from them would be better than any made of real data.
Its scans are already skewed where its scanner turns while the vehicle drives, as in the simulated data sets.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter, label
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import Camera, rigid_transform
from semgrid_edu.datasets.ground_truth.window import EgoVelocity, ego_velocity, skew_scan
from semgrid_edu.errors import check_fields, not_negative
from semgrid_edu.frame import Frame
from semgrid_edu.labels import IGNORE, LabelSet

WAVE = 8.0
"""Width (standard deviation) of the Gaussian that smooths the shifts of outlines, pixels: an assumption."""


@dataclass(frozen=True)
class TruthFlaws:
    """How large the errors are. All are drawn from normal distributions around 0.

    Parameters
    ----------
    rotation : float
        Standard deviation of the camera's error about each axis, degrees. The default is an assumption: 1.3 pixels of
        the simulated camera, 2.5 of KITTI's.
    translation : float
        Standard deviation of its error along each axis, metres. The default is an assumption.
    outline : float
        Standard deviation of the shift of outlines, along u and along v, pixels. With the defaults 1.6 % of the pixels
        of six frames of minikitti change, and two annotators disagree on 2.2 %. Two annotators of Cityscapes disagree
        on 2 % of what both label (Cordts et al., 2016, section 2.2).
    small : int
        Area below which an object may be missed, pixels: an assumption.
    missed : float
        Probability that such a small object is missed, 0..1: an assumption.
    skewed : bool
        Whether scans of one instant are skewed as a turning scanner on a moving vehicle records them (`skew_scan`).
    """

    rotation: float = 0.2
    translation: float = 0.03
    outline: float = 0.4
    small: int = 40
    missed: float = 0.5
    skewed: bool = False

    def __post_init__(self) -> None:
        """Check that sizes are finite and not negative, and that the probability is one."""
        check_fields(self, "degrees, 0 or more", not_negative, "rotation")
        check_fields(self, "a finite number, 0 or more", not_negative, "translation", "outline", "small")
        check_fields(self, "a probability, 0 to 1", lambda p: 0 <= p <= 1, "missed")

    def apply(self, frames: Sequence[Frame], seed: int, number: int) -> list[Frame]:
        """Return the frames of a drive with these errors. Parameters are those of `flawed_drive`."""
        return flawed_drive(frames, self, seed, number)


NO_FLAWS = TruthFlaws(rotation=0, translation=0, outline=0, small=0, missed=0, skewed=False)
"""The simulator's own frames: exact calibration, exact labels, scans of one instant."""


def miscalibrated(camera: Camera, flaws: TruthFlaws, rng: np.random.Generator) -> Camera:
    """Return a camera whose calibration has an error in position and direction.

    Parameters
    ----------
    camera : Camera
        The true calibration.
    flaws : TruthFlaws
        How large the error is.
    rng : numpy.random.Generator
        Source of the error: the same generator state gives the same camera.
    """
    angles, shift = rng.standard_normal((2, 3)) * [[flaws.rotation], [flaws.translation]]
    error = rigid_transform(Rotation.from_rotvec(angles, degrees=True).as_matrix(), shift)
    return replace(camera, T_camera_from_lidar=error @ camera.T_camera_from_lidar)


def flawed_labels(
    labels: NDArray[np.uint8], label_set: LabelSet, flaws: TruthFlaws, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Return image labels as a person might have drawn them: some small objects missed, outlines slightly off.

    Parameters
    ----------
    labels : (h, w) uint8
        The true class of each pixel; 255 where unlabelled.
    label_set : LabelSet
        The classes; patches of flat classes, such as road between two cars, are never missed.
    flaws : TruthFlaws
        How large the errors are.
    rng : numpy.random.Generator
        Source of the errors.

    Returns
    -------
    (h, w) uint8
    """
    kept = _without_small_objects(labels, label_set, flaws, rng)
    if not flaws.outline:
        return kept
    waves = gaussian_filter(rng.standard_normal((2, *labels.shape)), (0, WAVE, WAVE))
    shifts = np.rint(waves * (flaws.outline / waves.std())).astype(int)
    limits = np.reshape(labels.shape, (2, 1, 1)) - 1
    rows, cols = np.clip(np.indices(labels.shape) + shifts, 0, limits)
    return kept[rows, cols]


def _without_small_objects(
    labels: NDArray[np.uint8], label_set: LabelSet, flaws: TruthFlaws, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Paint over some small objects with what surrounds them."""
    flat = {label_set.index(name) for name in label_set.flat}
    missed = np.zeros(labels.shape, bool)
    for c in sorted(set(np.unique(labels).tolist()) - flat - {IGNORE}):
        objects, count = label(labels == c)
        areas = np.bincount(objects.ravel(), minlength=count + 1)
        overlooked = (areas < flaws.small) & (rng.random(count + 1) < flaws.missed)
        missed |= overlooked[objects] & (objects > 0)
    if not missed.any() or missed.all():
        return labels
    return labels[tuple(distance_transform_edt(missed, return_distances=False, return_indices=True))]


def flawed_drive(frames: Sequence[Frame], flaws: TruthFlaws, seed: int, number: int = 0) -> list[Frame]:
    """Return the frames of a drive as a real recording would have them, each by `flawed_frame`.

    Parameters
    ----------
    frames : sequence of Frame
        The frames of a simulated drive in temporal order.
    flaws : TruthFlaws
        How large the errors are.
    seed : int
        Seed for the errors. Drives with the same seed have the same calibration error.
    number : int
        Number of the drive: drives with the same seed but another number have other errors in their labels.

    Returns
    -------
    list of Frame
        In a drive of one frame the scan isn't skewed, because a single pose doesn't tell how the vehicle moves.
    """
    others = [frames[k - 1 if k else min(1, len(frames) - 1)] for k in range(len(frames))]
    velocities = [ego_velocity(a, b) if a is not b else None for a, b in zip(frames, others, strict=True)]
    return [flawed_frame(frame, flaws, seed, (number, k), velocities[k]) for k, frame in enumerate(frames)]


def flawed_frame(
    frame: Frame, flaws: TruthFlaws, seed: int, key: tuple[int, ...] = (), velocity: EgoVelocity | None = None
) -> Frame:
    """Return a frame as a real recording would have it: calibration off, labels drawn by hand, scan skewed.

    Parameters
    ----------
    frame : Frame
        A simulated frame.
    flaws : TruthFlaws
        How large the errors are.
    seed : int
        Seed for the calibration error, which frames with the same seed share, as all frames of one day do.
    key : tuple of int
        Identifies the frame among those with the same seed, so that the errors in their labels differ.
    velocity : EgoVelocity, optional
        Velocity of the vehicle; without it the scan isn't skewed.

    Returns
    -------
    Frame
        A new frame; bird's-eye labels, depth and image stay the true ones.
    """
    camera = miscalibrated(frame.camera, flaws, np.random.default_rng([seed, 0]))
    points = skew_scan(frame.points, velocity) if flaws.skewed and velocity else frame.points
    labels = frame.labels
    if labels is not None:
        rng = np.random.default_rng([seed, 1, *key])
        labels = replace(labels, image=flawed_labels(labels.image, labels.label_set, flaws, rng))
    return replace(frame, camera=camera, points=points, labels=labels)
