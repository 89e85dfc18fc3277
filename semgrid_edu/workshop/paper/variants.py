"""How a network can differ from the paper's, and errors in its calibration: the rows of the ablations (section 4)."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import Camera, rigid_transform
from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import Architecture
from semgrid_edu.planes import plane_heights


@dataclass(frozen=True)
class CalibrationError:
    """An error of calibration (3.3): by how much the calibration that the network is given differs from the true one.

    Parameters
    ----------
    pitch : float
        Degrees that the camera is believed to look further down.
    yaw : float
        Degrees that it is believed to look further to the left.
    height : float
        Metres that it is believed to be higher.
    """

    pitch: float = 0.0
    yaw: float = 0.0
    height: float = 0.0

    @property
    def name(self) -> str:
        """What is wrong, each part after a hyphen; empty when nothing is."""
        parts = (("pitch", self.pitch, ""), ("yaw", self.yaw, ""), ("height", self.height, "m"))
        return "".join(f"-{what}{size:+g}{unit}" for what, size, unit in parts if size)

    def applied_to(self, camera: Camera) -> Camera:
        """Return the camera that the network believes in.

        Parameters
        ----------
        camera : Camera
            The true one.
        """
        # The camera's axes: x right, y down, z ahead. To believe that it looks down and left is to see the world
        # turned up and right, and to believe that it is higher is to see the world lower, at larger y.
        turn = Rotation.from_euler("xy", [self.pitch, self.yaw], degrees=True).as_matrix()
        moved = rigid_transform(turn, np.array([0.0, self.height, 0.0]))
        return replace(camera, T_camera_from_lidar=moved @ camera.T_camera_from_lidar)


EXACT = CalibrationError()
"""No error."""


@dataclass(frozen=True)
class Variant:
    """How a network can differ from the paper's, for the ablations.

    Parameters
    ----------
    n_planes : int
        D, the number of planes.
    spacing : float
        d, the distance between planes, metres.
    occupancy : bool
        Whether the network sees the occupancy grid.
    reduces : bool
        Whether a 1x1 convolution reduces the planes.
    balanced : bool
        Whether the loss weights rare classes more (median frequency balancing).
    end_to_end : bool
        Whether the loss on the grid teaches the image network too; else that stays as it was after the first stage.
    """

    n_planes: int = 20
    spacing: float = 0.2
    occupancy: bool = True
    reduces: bool = True
    balanced: bool = True
    end_to_end: bool = True

    @property
    def name(self) -> str:
        """What differs from the paper, each part after a hyphen; empty when nothing does."""
        parts = (
            (f"{self.n_planes}planes", self.n_planes == USUAL.n_planes),
            (f"{self.spacing:g}m", self.spacing == USUAL.spacing),
            ("no-occupancy", self.occupancy),
            ("no-reduction", self.reduces),
            ("unbalanced", self.balanced),
            ("two-stage", self.end_to_end),
        )
        return "".join(f"-{part}" for part, as_usual in parts if not as_usual)

    def applied_to(self, described: Architecture) -> Architecture:
        """Return an architecture with this variant's changes.

        Parameters
        ----------
        described : Architecture
            The usual one.
        """
        heights = tuple(plane_heights(self.n_planes, self.spacing).tolist())
        return replace(described, heights=heights, uses_occupancy=self.occupancy, reduces=self.reduces)


USUAL = Variant()
"""The network of the paper."""


def named_variants(rows: dict[str, dict]) -> dict[str, Variant]:
    """Return the variants of a table, by what its rows are called.

    Runs of variants with equal names would share a folder, so each needs a name of its own.

    Parameters
    ----------
    rows : dict of str to dict
        Of each row the fields of `Variant` that differ from the usual network's.

    Raises
    ------
    ArgumentError
        When a variant has the name of the usual network, or of another row.
    """
    variants = {what: Variant(**fields) for what, fields in rows.items()}
    owners = {USUAL.name: "the usual network"}
    for what, variant in variants.items():
        if variant.name in owners:
            expected = "a variant with a `Variant.name` of its own"
            raise ArgumentError(f"row {what!r} of the ablations", expected, f"that of {owners[variant.name]}")
        owners[variant.name] = f"row {what!r}"
    return variants
