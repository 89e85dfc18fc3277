"""Planes above the ground and the image's scores on them: s -> p, equations (1) and (2) (paper, section 3.3)."""

from semgrid_edu.planes.pixels import plane_heights, plane_pixels, sample_planes_naive

__all__ = ["PlaneSampler", "plane_heights", "plane_pixels", "sample_planes_naive"]


def __getattr__(name: str) -> object:
    """Load PyTorch, which takes seconds, only for the sampler: equation (1) and lectures 01 to 05 need none of it."""
    if name == "PlaneSampler":
        from semgrid_edu.planes.sampler import PlaneSampler

        return PlaneSampler
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
