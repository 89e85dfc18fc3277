"""The one rule by which every command knows what it may replace."""

import gc
import json

import numba
import pytest

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import CmcdotParams, SensorModel
from semgrid_edu.storage.files import check_ours, write_json
from semgrid_edu.training import TrainingParams
from semgrid_edu.workshop.demo.run import compile_bar

MARK = '"command": "semgrid-edu evaluate '


def test_a_new_file_an_empty_one_and_our_own_may_be_written(tmp_path):
    (tmp_path / "empty.json").touch()
    write_json(tmp_path / "ours.json", {"command": "semgrid-edu evaluate --data DIR"})
    for name in ("new/scores.json", "empty.json", "ours.json"):
        check_ours(MARK, tmp_path / name)


@pytest.mark.parametrize("content", ["{}", json.dumps({"command": "semgrid-edu reproduce table1"}), "notes"])
def test_nothing_else_is_replaced_without_being_asked(tmp_path, content):
    path = tmp_path / "scores.json"
    path.write_text(content)
    for force, told in ((None, "lost$"), (False, "lost without --force$")):
        with pytest.raises(DataError, match=f"scores.json: expected a new file.*{told}"):
            check_ours(MARK, path, force=force)
    check_ours(MARK, path, force=True)
    assert path.read_text() == content


def test_files_that_belong_together_are_as_the_first_of_them(tmp_path):
    page, picture = tmp_path / "index.html", tmp_path / "overview.png"
    picture.write_text("mine")
    with pytest.raises(DataError, match=r"overview.png"):
        check_ours("a page of ours", page, picture)
    page.write_text("a page of ours")
    check_ours("a page of ours", page, picture)


@pytest.mark.parametrize("force", [False, True])
def test_a_folder_is_never_replaced(tmp_path, force):
    with pytest.raises(DataError, match="expected a file to write, found a folder"):
        check_ours(MARK, tmp_path, force=force)


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda wrong: TrainingParams(learning_rate=wrong), "learning_rate"),
        (lambda wrong: TrainingParams(batch_size=wrong), "batch_size"),
        (lambda wrong: GridSpec(0.0, 1.0, 0.0, 1.0, wrong), "cell"),
        (lambda wrong: SensorModel(edge=wrong), "edge"),
    ],
)
@pytest.mark.parametrize("wrong", ["0.2", None, [1]])
def test_a_parameter_of_a_wrong_type_is_named(make, field, wrong):
    with pytest.raises(ArgumentError, match=f"{field}: expected a number, found "):
        make(wrong)
    CmcdotParams()


def test_compiling_shows_a_bar_of_its_own(capsys):
    with compile_bar():
        numba.njit(lambda x: x + 1)(1)
    gc.collect()  # the bar closes with its listener
    assert "compiling, only the first time: 1 functions" in capsys.readouterr().err
