"""Atomic files and provenance: nothing half-written, nothing silently changed."""

import json

import pytest

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import atomic_path, sha256, write_text
from semgrid_edu.storage.provenance import PROVENANCE, provenance_problems, write_provenance


def test_a_failed_write_leaves_the_old_file_and_no_litter(tmp_path):
    target = tmp_path / "weights.bin"
    write_text(target, "old")

    def fail_half_way() -> None:
        with atomic_path(target) as temporary:
            temporary.write_text("ha")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail_half_way()
    assert target.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["weights.bin"]


def test_sha256_of_nothing_is_the_published_one(tmp_path):
    (tmp_path / "empty").touch()
    assert sha256(tmp_path / "empty") == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"


@pytest.fixture
def recorded(tmp_path):
    write_text(tmp_path / "a" / "1.txt", "one")
    write_text(tmp_path / "2.txt", "two")
    write_provenance(tmp_path, "semgrid-edu data make", seed=7, packages=("numpy",))
    return tmp_path


def test_untouched_files_have_no_problems(recorded):
    assert provenance_problems(recorded) == []
    record = json.loads((recorded / PROVENANCE).read_text())
    assert record["command"] == "semgrid-edu data make"
    assert set(record["versions"]) == {"python", "semgrid_edu", "numpy"}


def test_what_is_cached_beside_the_files_is_no_part_of_them(recorded):
    write_text(recorded / "cache" / "arrays.npy", "made of the others")
    assert provenance_problems(recorded) == []


def test_what_a_killed_write_left_is_no_part_of_them(recorded):
    write_text(recorded / ".1-abc.txt", "half of i")
    assert provenance_problems(recorded) == []


def test_changed_missing_and_added_files_are_each_named(recorded):
    write_text(recorded / "2.txt", "tow")
    (recorded / "a" / "1.txt").unlink()
    write_text(recorded / "3.txt", "three")
    problems = provenance_problems(recorded)
    assert [line.rsplit("/", 1)[-1] for line in problems] == [
        "2.txt: changed",
        "3.txt: not in provenance.json",
        "1.txt: missing",
    ]


@pytest.mark.parametrize("content", [None, "", "[]", "{}"])
def test_a_folder_without_a_readable_record_is_an_error(tmp_path, content):
    if content is not None:
        write_text(tmp_path / PROVENANCE, content)
    with pytest.raises(DataError, match=PROVENANCE):
        provenance_problems(tmp_path)
