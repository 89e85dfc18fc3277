"""In what a network can differ from the paper's: the rows of the ablations (section 4)."""

from dataclasses import dataclass, replace

from semgrid_edu.networks import Architecture
from semgrid_edu.planes import plane_heights


@dataclass(frozen=True)
class Variant:
    """In what a network can differ from the paper's, for the ablations.

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
        Whether the loss on the grid teaches the image network too.
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
        """Return an architecture changed as this variant says.

        Parameters
        ----------
        described : Architecture
            The usual one.
        """
        heights = tuple(plane_heights(self.n_planes, self.spacing).tolist())
        return replace(described, heights=heights, uses_occupancy=self.occupancy, reduces=self.reduces)


USUAL = Variant()
"""The network of the paper."""
