"""Tables that pandas pickled: columns come back, and nothing that a hostile file asks for is run."""

import base64
import gzip
import os
import pickle
import sys

import numpy as np
import pytest
from pandas import DataFrame
from tiny_pandaset import Called, pickled_table

from semgrid_edu.errors import DataError
from semgrid_edu.storage import pickled_tables
from semgrid_edu.storage.pickled_tables import read_pickled_table

WRITTEN_BY_PANDAS = (
    "ABzY8000000t1CpO>fjN5RJD<DQyJ>q@}%7oM5>`;?@JAs}><3Vk`AtSx(|?q9#t{IBFMB2@aH2@{OUtlYanXZx*tvt!l~k_+w_?"
    "Jo|n1ejT}vZTeBgM9gYGDkb+5$qEko{#&NlJ8S=hm*3z52HK^?Sc2Z|UeAQ$Qn0-C3nti@%Nq3NL0(3upQdYcALxGTLh~%F|NDS`"
    "NE=aQ(P_?UXq@o2ej=Kpn)uYlN1Mwm0=+>KSr%cFB-5BTEqaGIgn;&}6V9=kR0gx|g|FcH>IWRdAXw4l3yemikAJY)A#fCg0SVko"
    "(Bu#lUejw~ljSNCh|8<<EHYsNH}C>tq69rNrW@&l!OhTF)_(7|Mti(Ayz3m&$GVs7b#cC4hO=jIraJ~@x*Isbdf+WWdbR+D+_JVQ"
    "vrfwN#cjm=OGpsF90$7JeWRj5)|iwG`QN0HN2REhY$ApHrCa(QKD|9eHl6QqNJ5yVCT$u7bkqgZp9i#$fUZyQ7ZHYU6=IKI#Bmdm"
    "t>F8RyQr9FeXE_fk^Scjh4wIDC!7M4c6<K6$NZeve#mN6$vPGMjD9eCrq&bf&1|ce7&Qdxn{;UEP7h{Puj1nUw4!sYCdU35v@5Le"
    "NP&F<w!VDSTpD0h?<~V0nHU=o$7b#%MnC+(ib;ipYqwTqh5y(X91UV)ax<W!Q7tHT19T>QT5!cI@)OhnQwk-00eY1tIU8H^Da-Tn"
    "tfp~Op-PzIG-n}4IbYRH=>G+)qo1x?1ONa"
)
"""The table as pandas 2.3.3 pickled it with protocol 5, packed."""


def written(folder, content):
    path = folder / "table.pkl.gz"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("by", ["pandas 2", "the pandas of today"])
def test_reads_what_pandas_wrote(tmp_path, by):
    path = written(tmp_path, base64.b85decode(WRITTEN_BY_PANDAS))
    if by == "the pandas of today":
        DataFrame(read_pickled_table(path).columns).to_pickle(path)
    table, rows = read_pickled_table(path)
    assert rows.tolist() == [0, 1, 2, 3]
    assert list(table) == ["x", "d", "z", "name", "m", "y"]
    assert table["x"].tolist() == table["y"].tolist() == [0, 1, 2, 3]
    assert (table["d"].tolist(), table["z"].tolist()) == ([0, 1, 0, 1], [0, 2, 4, 6])
    assert table["name"].tolist()[:3] == ["a", "b", "c"]
    assert table["m"].dtype == bool


@pytest.mark.parametrize("protocol", [3, 4, 5])
def test_reads_the_form_of_pandas_1(tmp_path, protocol):
    columns = {"x": np.array([1.5, -2.0]), "name": ["a", "b"], "n": np.array([3, 4]), "y": np.array([0.5, np.inf])}
    table, _ = read_pickled_table(written(tmp_path, gzip.compress(pickled_table(columns, protocol))))
    assert list(table) == list(columns)
    for name, values in columns.items():
        assert table[name].tolist() == list(values)


HOSTILE = {
    "os.system": (Called(os.system, "echo run > harm"), r"names \w+\.system"),
    "builtins.eval": (Called(eval, "open('harm', 'w')"), r"names builtins\.eval"),
    "a call inside a table": ({"_data": [Called(os.mkdir, "harm")]}, r"names \w+\.mkdir"),
    "a call of what a call returns": (Called(os.system, Called(eval, "'echo run > harm'")), r"names \w+\.system"),
    "numpy's loader": (Called(np.load, "harm"), r"names numpy\.load"),
    "text": ("a table?", "str in place of DataFrame"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_runs_nothing(tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    thing, says = HOSTILE[kind]
    with pytest.raises(DataError, match=says):
        read_pickled_table(written(tmp_path, gzip.compress(pickle.dumps(thing))))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["table.pkl.gz"]


def test_reaches_nothing_inside_of_what_is_allowed(tmp_path):
    with pytest.raises(DataError, match=r"names pandas\.DataFrame\.to_pickle, which no table needs"):
        read_pickled_table(written(tmp_path, gzip.compress(b"\x80\x04cpandas\nDataFrame.to_pickle\n.")))


def test_names_the_extra_when_pandas_is_missing(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(DataError, match=r"pip install 'semgrid_edu\[pandaset\]'"):
        read_pickled_table(tmp_path / "table.pkl.gz")


@pytest.mark.parametrize("kind", ["cut short", "not packed", "packed noise", "a damaged pickle", "empty"])
def test_says_that_a_file_is_damaged(tmp_path, kind):
    sound = pickled_table({"x": np.arange(100.0)})
    content = {
        "cut short": gzip.compress(sound)[:-20],
        "not packed": sound,
        "packed noise": gzip.compress(bytes(range(256))),
        "a damaged pickle": gzip.compress(sound[:-30]),
        "empty": gzip.compress(b""),
    }[kind]
    with pytest.raises(DataError, match=r"table\.pkl\.gz: expected a gzipped pickle of a pandas table"):
        read_pickled_table(written(tmp_path, content))


def test_stops_unpacking_what_is_too_long(tmp_path, monkeypatch):
    monkeypatch.setattr(pickled_tables, "MOST_BYTES", 10**6)
    with pytest.raises(DataError, match="expected at most 1000000 bytes, unpacked"):
        read_pickled_table(written(tmp_path, gzip.compress(bytes(2 * 10**6))))


@pytest.mark.parametrize(
    "content",
    [b"Nr\0\0\0\x10.", b"Np268435456\n.", b"(" + b"\x8f" * 10**6 + b"t."],
    ids=["a memo of gigabytes", "the same in text", "a set for each byte"],
)
def test_a_small_file_cannot_ask_for_much_memory(tmp_path, content):
    with pytest.raises(DataError, match="found more than 1000000 operations"):
        read_pickled_table(written(tmp_path, gzip.compress(content)))


def test_a_column_is_a_row_of_numbers(tmp_path):
    with pytest.raises(DataError, match="a column of the shape"):
        read_pickled_table(written(tmp_path, gzip.compress(pickled_table({"x": np.zeros((4, 3))}))))


def test_an_array_of_anything_else_is_refused(tmp_path):
    for values in (np.zeros(2, "M8[s]"), np.zeros(2, [("a", "f8")])):
        with pytest.raises(DataError, match="expected a gzipped pickle"):
            read_pickled_table(written(tmp_path, gzip.compress(pickled_table({"x": values}))))
