"""Values that pass between processes: back they are the same, and bytes of any other kind are refused."""

import json
import math
from array import array
from collections import OrderedDict, deque, namedtuple
from decimal import Decimal
from enum import Enum, IntEnum
from fractions import Fraction

import numpy as np
import pytest
import sympy
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from mpmath import mpf

from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor
from semgrid_edu.grid import GridSpec
from semgrid_edu.workshop.course.sandbox.values import MAX_JSON, MAX_KEYS, NotPlainError, decode, encode

scalars = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
plain = st.recursive(
    scalars, lambda inner: st.lists(inner) | st.tuples(inner, inner) | st.dictionaries(scalars, inner), max_leaves=12
)


@given(plain)
def test_containers_come_back_as_they_are(value):
    assert decode(encode(value)) == value


@given(arrays.arrays(st.sampled_from(["<f8", "<f4", ">i2", "u1", "?", "c8", "U3"]), arrays.array_shapes(min_dims=0)))
def test_arrays_come_back_as_they_are(sent):
    got = decode(encode([sent]))[0]
    assert got.dtype == sent.dtype
    np.testing.assert_array_equal(got, sent)


def test_kinds_of_numbers_are_kept():
    values = [np.float32(1.5), np.int64(7), np.bool_(True), 2 + 3j]
    got = decode(encode(values))
    assert got == values
    assert [type(one) for one in got[:3]] == [np.float32, np.int64, np.bool_]
    assert math.isnan(decode(encode(float("nan"))))


class Liar(np.ndarray):
    """Claims to be equal to everything."""

    def __eq__(self, other):
        return np.ones(self.shape, dtype=bool)


class State(IntEnum):
    """A number with a name."""

    FREE = 0
    STATIC = 1


class Part(str, Enum):  # noqa: UP042 (a StrEnum's text is its value, this one's isn't)
    """A text with a name."""

    BETA = "beta"


def test_numbers_and_texts_with_names_pass_as_what_they_equal():
    for sent, plain in (
        (State.STATIC, 1),
        (Part.BETA, "beta"),
        (type("Loud", (str,), {"__str__": str.upper})("a"), "a"),
    ):
        (got,) = decode(encode([sent]))
        assert sent == plain
        assert got == plain
        assert type(got) is type(plain)


def test_what_numpy_takes_for_an_array_passes_as_one():
    strided = np.arange(12.0).reshape(3, 4)[:, ::2]
    numbers = np.ones(2, np.longdouble), np.array([1.5, 2], dtype=object), torch.ones(2), np.asfortranarray(strided)
    sent = [strided, np.ma.array([1, 2], mask=[0, 1]), np.ones(2).view(Liar), range(3), *numbers]
    got = decode(encode(sent))
    assert [type(one) for one in got] == [np.ndarray] * len(sent)
    for one, original in zip(got[2:], sent[2:], strict=True):
        np.testing.assert_array_equal(one, np.asarray(original, dtype=float))
    np.testing.assert_array_equal(got[0], strided)
    rows = namedtuple("Rows", ["first", "second"])([1.0, 2.0], [3.0, 4.0])
    assert decode(encode(rows)) == ([1.0, 2.0], [3.0, 4.0])


@pytest.mark.parametrize(
    "value",
    [Decimal("1.5"), deque([[Fraction(3, 2), 1], [2, 3]]), array("d", [1, 2]), mpf(1.5), sympy.Float(1.5), sympy.pi],
)
def test_other_numbers_and_sequences_pass_as_numpy_reads_them(value):
    got = decode(encode((value, [value, 7])))
    np.testing.assert_array_equal(got[0], np.array(value, dtype=float))
    np.testing.assert_array_equal(got[1][0], got[0])
    assert (np.ndim(got[0]) == 0) == isinstance(got[0], float)


def test_ragged_arrays_and_subclasses_of_dict_pass():
    ragged = np.array([[1, 2], [3]], dtype=object)
    assert decode(encode(ragged)).tolist() == [[1, 2], [3]]
    assert decode(encode(OrderedDict(a=1))) == {"a": 1}


def test_records_of_the_package_pass():
    spec, factor = GridSpec(0, 4, -1, 1, 0.5), Factor(("a", "b"), [[1.0, 2], [3, 4]])
    frame = sample_drive()[0]
    got_spec, got_factor, got_frame = decode(encode([spec, factor, frame]))
    assert got_spec == spec
    assert got_factor.names == factor.names
    np.testing.assert_array_equal(got_factor.table, factor.table)
    np.testing.assert_array_equal(got_frame.points, frame.points)
    np.testing.assert_array_equal(got_frame.camera.K, frame.camera.K)


def test_a_text_that_no_file_can_hold_gets_a_question_mark():
    assert decode(encode({"a\ud800": ["\udcff"]})) == {"a?": ["?"]}


def test_functions_pass_as_numbers():
    functions = []
    data = encode({"f": abs, "g": [len]}, functions)
    assert functions == [abs, len]
    assert decode(data, functions.__getitem__) == {"f": abs, "g": [len]}


@pytest.mark.parametrize("value", [object(), abs, (n for n in "ab"), np.array(["2026-01-01"], "M8[D]"), b"text"])
def test_anything_else_is_refused(value):
    with pytest.raises(NotPlainError):
        encode([value])


class Pickled:
    """Would run code if anything unpickled it."""

    def __reduce__(self):
        return print, ("run",)


def test_an_object_in_an_array_is_not_pickled():
    with pytest.raises(NotPlainError):
        encode(np.array([Pickled()], dtype=object))


@pytest.mark.parametrize(
    "value", [set(range(MAX_KEYS + 1)), [0.123456789] * 2_000_000, np.zeros(20_000_000, dtype=np.uint8)]
)
def test_what_the_other_side_would_refuse_is_not_sent(value):
    with pytest.raises(NotPlainError, match="more than"):
        encode(value)


def message(value, described=(), data=b""):
    return json.dumps({"value": value, "arrays": list(described)}).encode() + b"\n" + data


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x80\x04K\x01.",
        b"[1",
        message({"record": "os.system", "fields": ["ls"]}),
        message({"record": "semgrid_edu.frame.Frame", "fields": []}),
        message({"array": 0}),
        message({"eval": "1"}),
        message({"dict": [[[1], 2]]}),
        message({"array": 0}, [["<f8", [2]]], b"short"),
        message({"array": 0}, [["O", [1]]], b"12345678"),
        message({"array": 0}, [["<f8", [-1]]], b"12345678"),
        message({"array": 0}, [["<f8", [10**30]]], b"12345678"),
        message({"array": 0}, [["V9", [1]]], b"123456789"),
        b'{"value": ' + b"[" * 100_000,
        message([{"array": 0}, {"array": 0}], [["<f8", [1]]], b"12345678"),
        message({"dict": [[k * (2**61 - 1), 0] for k in range(MAX_KEYS + 1)]}),
        b'{"value": [' + b"[]," * (MAX_JSON // 3) + b"[]]}",
    ],
)
def test_bytes_of_another_kind_are_refused(data):
    with pytest.raises(ArgumentError, match="data"):
        decode(data)
