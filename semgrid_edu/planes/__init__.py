"""Planes above the ground and the image's scores on them: s -> p, equations (1) and (2) (paper, section 3.3)."""

from importlib import import_module

from semgrid_edu.planes.pixels import plane_heights, plane_pixels, sample_planes_naive

__all__ = [
    "PlaneOperator",
    "PlaneSampler",
    "SparseMatrix",
    "bilinear_matrix",
    "plane_heights",
    "plane_pixels",
    "sample_planes_naive",
]

_WITH_TORCH = {
    "PlaneOperator": "sampler",
    "PlaneSampler": "sampler",
    "SparseMatrix": "sparse",
    "bilinear_matrix": "sparse",
}


def __getattr__(name: str) -> object:
    """Import what needs torch only when it is asked for, because torch takes seconds and equation (1) needs none."""
    if name not in _WITH_TORCH:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_WITH_TORCH[name]}"), name)
