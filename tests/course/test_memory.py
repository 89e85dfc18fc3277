"""How much memory a function needs: known arrays, and functions that measure themselves."""

import numpy as np

from semgrid_edu.workshop.course.answers import peak_megabytes


def test_what_is_held_for_a_moment_counts():
    def work(n):
        return float(np.ones(n).sum())

    result, megabytes = peak_megabytes(work, 1_000_000)
    assert result == 1_000_000
    assert 8 <= megabytes < 8.5


def test_a_function_in_another_process_is_measured_there():
    class Elsewhere:
        def peak_megabytes(self, n):
            return n + 1, 42.0

    assert peak_megabytes(Elsewhere(), 1) == (2, 42.0)
