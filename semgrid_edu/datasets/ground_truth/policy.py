"""The choices behind a ground truth made from LIDAR, on which people disagree (section 4)."""

from dataclasses import dataclass

from semgrid_edu.errors import ArgumentError

MOVERS = ("smeared", "carved", "carried")
SIGHTS = ("any", "camera", "lidar")


@dataclass(frozen=True)
class TruthPolicy:
    """How to make a semantic grid from image labels and LIDAR scans. The defaults are the paper's, as far as it says.

    Parameters
    ----------
    past, future : int
        Numbers of scans before and after the labelled one that are added to it, moved by the vehicle's poses. The
        paper uses the one scan.
    movers : str
        What happens to returns from moving things in these other scans. "smeared": nothing, so that they stay where
        the thing was. "carved": they are removed. "carried": they are moved to where the thing is now, by the velocity
        of their cell. What moves, and how fast, is what the occupancy filter believes: nothing else is known of a real
        drive.
    deskew : bool
        Whether to undo the motion of the vehicle within a turn of the LIDAR (`deskew_scan`). It is for scans as a
        scanner records them, such as KITTI's raw ones. Simulated scans are taken at one instant, so it would bend
        them, unless `TruthFlaws.skewed` has bent them first.
    visible_to : str
        Which cells may keep a label. "any": all. "camera": those in the sight of the camera, as far as this scan tells
        (`in_sight`). "lidar": those about which the LIDAR has said something: their most probable state isn't UNKNOWN.
    cleanup : bool
        Whether the gaps between the rings are closed (`close_gaps`).

    Raises
    ------
    ArgumentError
        When there is no such choice.

    Examples
    --------
    >>> TruthPolicy(past=9, movers="carried").visible_to
    'any'
    """

    past: int = 0
    future: int = 0
    movers: str = "smeared"
    deskew: bool = False
    visible_to: str = "any"
    cleanup: bool = True

    def __post_init__(self) -> None:
        """Refuse what isn't a choice."""
        for name, choices in (("movers", MOVERS), ("visible_to", SIGHTS)):
            if getattr(self, name) not in choices:
                raise ArgumentError(name, f"one of {', '.join(choices)}", repr(getattr(self, name)))
        for name in ("past", "future"):
            if type(getattr(self, name)) is not int or getattr(self, name) < 0:
                raise ArgumentError(name, "a number of scans, 0 or more", repr(getattr(self, name)))
