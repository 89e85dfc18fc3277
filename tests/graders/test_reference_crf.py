"""The reference answers of exercise 10, against the package."""

import numpy as np
from entries import source_of
from scipy.ndimage import gaussian_filter
from scipy.special import log_softmax
from submissions import reference_answers

from semgrid_edu.crf import (
    CrfParams,
    mean_field_naive,
)
from semgrid_edu.workshop.course.notebooks.build import read_percent
from semgrid_edu.workshop.demo.stages_file import load_stages

SOURCE = source_of("10_crf")
SETUP = next(cell.source for cell in read_percent(SOURCE).cells if "REACH, UPDATES" in cell.source)


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
