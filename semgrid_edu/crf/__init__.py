"""The fully connected CRF that refines the semantic grid: energy, exact inference, mean field, naive and fast."""

from semgrid_edu.crf.accurate import WindowedGaussian, mean_field_accurate
from semgrid_edu.crf.doctor.check import check
from semgrid_edu.crf.doctor.finding import Finding, Findings
from semgrid_edu.crf.exact import crf_model, energy, exact_marginals, free_energy, log_partition, most_likely
from semgrid_edu.crf.kernel import gram_matrix, pair_weights
from semgrid_edu.crf.lattice.lattice import PermutohedralLattice
from semgrid_edu.crf.lattice.literal import enclosing_simplex_literal, lattice_literal
from semgrid_edu.crf.mean_field import mean_field
from semgrid_edu.crf.naive import damping, mean_field_naive, mean_field_sequential, mean_field_updates
from semgrid_edu.crf.params import CrfParams, unary_from_log_probability, unary_from_probability
from semgrid_edu.crf.spatial import SeparableGaussian
from semgrid_edu.crf.temperature import (
    Reliability,
    at_temperature,
    expected_calibration_error,
    fit_temperature,
    negative_log_likelihood,
    reliability,
)

__all__ = [
    "CrfParams",
    "Finding",
    "Findings",
    "PermutohedralLattice",
    "Reliability",
    "SeparableGaussian",
    "WindowedGaussian",
    "at_temperature",
    "check",
    "crf_model",
    "damping",
    "enclosing_simplex_literal",
    "energy",
    "exact_marginals",
    "expected_calibration_error",
    "fit_temperature",
    "free_energy",
    "gram_matrix",
    "lattice_literal",
    "log_partition",
    "mean_field",
    "mean_field_accurate",
    "mean_field_naive",
    "mean_field_sequential",
    "mean_field_updates",
    "most_likely",
    "negative_log_likelihood",
    "pair_weights",
    "reliability",
    "unary_from_log_probability",
    "unary_from_probability",
]
