"""Planes above the ground and the image's scores on them: s -> p, equations (1) and (2) (paper, section 3.3)."""

from semgrid_edu.planes.literal import sample_planes_naive
from semgrid_edu.planes.pixels import plane_heights, plane_pixels
from semgrid_edu.planes.sampler import PlaneOperator, PlaneSampler
from semgrid_edu.planes.sparse import SparseMatrix, bilinear_matrix

__all__ = [
    "PlaneOperator",
    "PlaneSampler",
    "SparseMatrix",
    "bilinear_matrix",
    "plane_heights",
    "plane_pixels",
    "sample_planes_naive",
]
