"""The reference answers of exercise 10, against the package."""

import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from entries import source_of
from scipy.ndimage import gaussian_filter
from scipy.special import log_softmax
from submissions import reference_answers

from semgrid_edu.crf import (
    CrfParams,
    energy,
    exact_marginals,
    free_energy,
    mean_field_naive,
    mean_field_sequential,
    pair_weights,
)
from semgrid_edu.workshop.course.notebooks.build import read_percent
from semgrid_edu.workshop.demo.stages_file import load_stages

SOURCE = source_of("10_crf")
SETUP = next(cell.source for cell in read_percent(SOURCE).cells if "REACH, UPDATES" in cell.source)


def answers():
    """Return the reference's functions."""
    names = {}
    with warnings.catch_warnings():  # the setup silences warnings
        exec(
            "\n".join([SETUP, *(text for text in reference_answers(SOURCE).values() if text.startswith("def"))]), names
        )
    return SimpleNamespace(**names)


def test_the_reference_computes_what_the_package_does():
    own, rng = answers(), np.random.default_rng(1)
    unary, values = rng.exponential(size=(3, 2, 3)), np.moveaxis(rng.dirichlet(np.ones(4), (2, 3)), -1, 0)
    params = CrfParams(1.2, 0.8, 2.0, 0.5, 1.5, "none")
    phi, k = unary.reshape(3, -1), pair_weights(values, params)
    labels, Q, potts = rng.integers(0, 3, 6), rng.dirichlet(np.ones(3), 6).T, 1 - np.eye(3)
    after = np.where(np.arange(6) == 4, 2, labels)
    change = np.diff([energy(x.reshape(2, 3), unary, values, params) for x in (labels, after)])[0]
    assert own.energy_change(labels, 4, 2, phi, k) == pytest.approx(change)
    np.testing.assert_allclose(own.marginals(phi, k, {}), exact_marginals(unary, values, params).reshape(3, -1))
    F = free_energy(Q.reshape(3, 2, 3), unary, values, params)
    assert own.free_energy(Q, phi, k, potts) == pytest.approx(F)
    settled = mean_field_sequential(unary, values, params, iterations=2000).reshape(3, -1)
    np.testing.assert_allclose(own.update(settled, phi, k, potts), settled, atol=1e-9)


def test_an_update_of_one_cell_lowers_the_free_energy_of_any_borders():
    own, rng = answers(), np.random.default_rng(2)
    phi, k, mu = rng.exponential(size=(3, 5)), rng.uniform(0, 2, (5, 5)), rng.uniform(0, 3, (3, 3))
    k, mu = k + k.T, (mu + mu.T) * (1 - np.eye(3))
    Q = rng.dirichlet(np.ones(3), 5).T
    for i in range(5):
        better = np.where(np.arange(5) == i, own.update(Q, phi, k, mu), Q)
        assert own.free_energy(better, phi, k, mu) < own.free_energy(Q, phi, k, mu)
        Q = better


def test_the_reference_is_a_stage_that_agrees_with_the_package(tmp_path):
    """What the exercise tells students to write into a file refines a map nearly as the package does."""
    answer = reference_answers(SOURCE)["refine"].replace("### BEGIN SOLUTION", "").replace("### END SOLUTION", "")
    path = tmp_path / "my_stages.py"
    path.write_text(f"{SETUP}\n\n{answer}", encoding="utf-8")
    rng = np.random.default_rng(0)
    scores = gaussian_filter(rng.normal(size=(4, 24, 18)), (0, 2, 2)) * 12 + rng.normal(size=(4, 24, 18))
    log_g, o = log_softmax(scores, axis=0), np.zeros((4, 24, 18))
    o[0] = 1  # FREE
    refined = load_stages(path).refine(log_g, o)
    np.testing.assert_allclose(refined.sum(axis=0), 1)
    package = mean_field_naive(-log_g, o, CrfParams.for_cells(0.5))
    assert (refined.argmax(axis=0) == package.argmax(axis=0)).mean() > 0.9
    assert (refined.argmax(axis=0) != log_g.argmax(axis=0)).mean() > 0.1
