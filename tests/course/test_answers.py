"""Results of answers: nested lists are arrays, what is no array gets a sentence, and memory is measured."""

import numpy as np
import pytest

from semgrid_edu.workshop.course.answers import answer_array, answer_arrays, answer_number, peak_megabytes


@pytest.mark.parametrize(
    "result", [[[1, 2], [3, 4]], ((1, 2), (3, 4)), [np.array([1, 2]), (3.0, 4)], np.arange(1, 5).reshape(2, 2)]
)
def test_lists_and_tuples_are_arrays(result):
    got = answer_array(result)
    assert got.dtype == float
    np.testing.assert_array_equal(got, [[1.0, 2.0], [3.0, 4.0]])


def test_array_is_a_new_one():
    result = np.zeros(3)
    answer_array(result)[0] = 1
    assert result[0] == 0


@pytest.mark.parametrize(
    ("result", "sentence"),
    [
        (None, r"^locate returned nothing: did you forget `return`\?"),
        ("0.4, 0.6", r"^locate returned no array of numbers but a str"),
        ({"a": 1}, r"^locate returned no array of numbers but a dict"),
        ([[1, 2], [3]], r"but a list that holds something else: are its rows equally long\?"),
    ],
)
def test_anything_else_gets_a_sentence(result, sentence):
    with pytest.raises(AssertionError, match=sentence):
        answer_array(result, "locate")


@pytest.mark.parametrize("result", [2, 2.0, np.float32(2), np.array(2.0), [2.0], np.array([[2]])])
def test_one_number_in_any_wrapping_is_a_number(result):
    assert answer_number(result) == 2.0


@pytest.mark.parametrize(
    ("result", "sentence"),
    [
        (None, "^reach returned nothing"),
        ([1, 2], r"^reach returned several numbers instead of one$"),
        ("far", "^reach returned no array of numbers but a str"),
    ],
)
def test_what_is_not_one_number_gets_a_sentence(result, sentence):
    with pytest.raises(AssertionError, match=sentence):
        answer_number(result, "reach")


def test_parts_of_a_result_are_arrays():
    mean, covariance = answer_arrays(([1, 2], ((1, 0), (0, 1))), 2)
    np.testing.assert_array_equal(mean, [1.0, 2.0])
    np.testing.assert_array_equal(covariance, np.eye(2))


@pytest.mark.parametrize(
    ("result", "sentence"),
    [
        (None, r"^mix returned nothing"),
        (np.zeros(2), r"^mix must return 2 arrays, separated by commas$"),
        ((1, 2, 3), r"^mix must return 2 arrays, separated by commas$"),
        (([1, 2], "x"), r"^mix returned no array of numbers but a str"),
    ],
)
def test_other_parts_get_a_sentence(result, sentence):
    with pytest.raises(AssertionError, match=sentence):
        answer_arrays(result, 2, "mix")


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
