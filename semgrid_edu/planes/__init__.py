"""Planes above the ground and the image's scores on them: s -> p, equations (1) and (2) (paper, section 3.3)."""

from semgrid_edu.planes.pixels import plane_heights, plane_pixels, sample_planes_naive
from semgrid_edu.planes.returns import cell_heights

__all__ = [
    "PlaneSampler",
    "above_ground",
    "cell_heights",
    "pick_planes",
    "plane_heights",
    "plane_pixels",
    "sample_planes_naive",
]


def __getattr__(name: str) -> object:
    """Load PyTorch, which takes seconds, only for what needs it: equation (1) and lectures 01 to 05 don't."""
    if name == "PlaneSampler":
        from semgrid_edu.planes.sampler import PlaneSampler

        return PlaneSampler
    if name in ("above_ground", "pick_planes"):
        from semgrid_edu.planes import picking

        return getattr(picking, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
