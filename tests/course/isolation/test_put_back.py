"""Changes that a function made in a copy of its arguments: the originals become equal to it, in place."""

import copy

import numpy as np
import pytest

from semgrid_edu.workshop.course.sandbox.values import put_back


def change_all(array, rows, names, both):
    array *= 2
    rows.append(rows.pop(0) + 1)
    rows[0][0] = 9
    names["b"] = names.pop("a")
    both[0][:] = 7


def test_arguments_become_what_the_function_made_of_them():
    arguments = np.ones(3), [1, [2, 3]], {"a": [1]}, (np.zeros(2), "text")
    direct, sent = copy.deepcopy(arguments), copy.deepcopy(arguments)
    held = arguments[1][1], arguments[3][0]
    change_all(*direct)
    change_all(*sent)
    put_back(arguments, sent)
    np.testing.assert_equal(arguments, direct)
    assert held[1] is arguments[3][0]


@pytest.mark.parametrize("changed", [np.zeros(3), np.zeros(2, int), [0.0, 0.0], None], ids=repr)
def test_an_array_that_became_something_else_stays(changed):
    array = np.ones(2)
    put_back((array,), (changed,))
    np.testing.assert_array_equal(array, [1, 1])


def test_what_may_not_be_written_stays():
    array = np.ones(2)
    array.setflags(write=False)
    put_back([array], [np.zeros(2)])
    np.testing.assert_array_equal(array, [1, 1])
