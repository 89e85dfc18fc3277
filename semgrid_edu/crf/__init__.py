"""The fully connected CRF that refines the semantic grid: energy, exact inference, and mean field in two versions."""

from semgrid_edu.crf.exact import crf_model, energy, exact_marginals, free_energy, log_partition, most_likely
from semgrid_edu.crf.lattice import PermutohedralLattice, bilateral_kernel, enclosing_simplices
from semgrid_edu.crf.mean_field import SeparableGaussian, damping, mean_field
from semgrid_edu.crf.naive import (
    gram_matrix,
    mean_field_naive,
    mean_field_sequential,
    mean_field_updates,
    pair_weights,
)
from semgrid_edu.crf.params import CrfParams, unary_from_probability

__all__ = [
    "CrfParams",
    "PermutohedralLattice",
    "SeparableGaussian",
    "bilateral_kernel",
    "crf_model",
    "damping",
    "enclosing_simplices",
    "energy",
    "exact_marginals",
    "free_energy",
    "gram_matrix",
    "log_partition",
    "mean_field",
    "mean_field_naive",
    "mean_field_sequential",
    "mean_field_updates",
    "most_likely",
    "pair_weights",
    "unary_from_probability",
]
