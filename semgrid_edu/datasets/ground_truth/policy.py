"""The choices behind ground truth from LIDAR, on which people disagree (section 4)."""

from dataclasses import dataclass

from semgrid_edu.errors import ArgumentError

MOVERS = ("smeared", "carved", "carried")
LABELS = ("present", "own")
SIGHTS = ("any", "camera", "lidar")
VOTES = ("standing", "majority")
CLEANUPS = ("none", "spread", "close")


@dataclass(frozen=True)
class TruthPolicy:
    """How to make a semantic grid from image labels and LIDAR scans; by default as in the paper, where it is specific.

    Parameters
    ----------
    past, future : int
        Numbers of scans before and after the labelled one that are added to it, moved by the vehicle's poses. The paper
        uses only the labelled scan.
    labels : str
        Which image labels the returns of these other scans. "present": the labelled frame's, so that one labelled image
        is enough, as in KITTI, where one image in ten has labels. A point that is hidden at that instant gets the label
        of whatever hides it, unless that has a return on the same pixel. "own": the image taken with the scan, so that
        all frames of the window need labels.
    movers : str
        What happens to returns from moving things in these other scans. "smeared": nothing, so that they stay where the
        thing was. "carved": they are removed. "carried": they are moved to where the thing is now, by the velocity of
        their cell. The occupancy filter decides what moves, and how fast, because a real drive has no better source.
    deskew : bool
        Whether to undo the motion of the vehicle within a turn of the LIDAR (`deskew_scan`). Use it for scans as a
        scanner records them, such as KITTI's raw ones and the simulated data sets. Scans of one instant, such as the
        sample drive's, would be distorted by it, unless `TruthFlaws.skewed` has skewed them first.
    vote : str
        The class of a cell whose returns have several. "standing": the most frequent class that isn't ground, and a
        ground class only if there is no other, as in the true grids (`LabelSet.most_voted`); a thin pole then keeps its
        cell, but so does one wrong return. "majority": the most frequent class.
    visible_to : str
        Which cells may keep a label. "any": all. "camera": cells in the camera's sight, as far as this scan shows
        (`in_sight`). "lidar": cells that the LIDAR has observed, whose most probable state isn't UNKNOWN.
    cleanup : str
        How the gaps between the rings are closed. "none": not at all. "spread": all classes spread into them
        (`close_gaps`). "close": objects are closed, and only the ground spreads (`close_and_spread`). The paper uses
        morphological methods, but doesn't specify which.

    Examples
    --------
    >>> TruthPolicy(past=9, movers="carried").visible_to
    'any'
    """

    past: int = 0
    future: int = 0
    labels: str = "present"
    movers: str = "smeared"
    deskew: bool = False
    vote: str = "standing"
    visible_to: str = "any"
    cleanup: str = "close"

    def __post_init__(self) -> None:
        """Check that every field is one of its choices."""
        choices_of = {"labels": LABELS, "movers": MOVERS, "vote": VOTES, "visible_to": SIGHTS, "cleanup": CLEANUPS}
        for name, choices in choices_of.items():
            if getattr(self, name) not in choices:
                raise ArgumentError(name, f"one of {', '.join(choices)}", repr(getattr(self, name)))
        for name in ("past", "future"):
            if type(getattr(self, name)) is not int or getattr(self, name) < 0:
                raise ArgumentError(name, "a number of scans, 0 or more", repr(getattr(self, name)))
