"""The fully connected CRF that refines the semantic grid: energy, naive and fast mean field (eq. (3), (4))."""

from semgrid_edu.crf.dense import energy, mean_field_naive, pair_weights
from semgrid_edu.crf.lattice import PermutohedralLattice
from semgrid_edu.crf.mean_field import mean_field
from semgrid_edu.crf.params import CrfParams, unary_from_log_probability, unary_from_probability
from semgrid_edu.crf.spatial import SeparableGaussian

__all__ = [
    "CrfParams",
    "PermutohedralLattice",
    "SeparableGaussian",
    "energy",
    "mean_field",
    "mean_field_naive",
    "pair_weights",
    "unary_from_log_probability",
    "unary_from_probability",
]
