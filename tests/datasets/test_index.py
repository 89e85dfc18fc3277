"""dataset.json: what it lists comes out, and whatever is wrong with it is said."""

import json
import ntpath
from types import SimpleNamespace

import pytest
from tiny_drive import DATE

from semgrid_edu.datasets import LabelledFrame, index, load_index
from semgrid_edu.errors import ArgumentError, DataError

FRAME = {"date": DATE, "drive": "0001", "frame": 9}
SOUND = {"name": "tiny", "label_set": "KITTI-14", "splits": {"train": [FRAME], "test": [{**FRAME, "drive": "0002"}]}}


def write(folder, content):
    (folder / "dataset.json").write_text(content if isinstance(content, str) else json.dumps(content))
    return folder


def test_lists_frames(tmp_path):
    index = load_index(write(tmp_path, SOUND))
    assert (index.root, index.name, index.label_set.name) == (tmp_path, "tiny", "KITTI-14")
    assert index.splits == {"train": (LabelledFrame((DATE, "0001"), 9),), "test": (LabelledFrame((DATE, "0002"), 9),)}


def test_groups_frames_by_drive(tmp_path):
    frames = [{**FRAME, "drive": "0002"}, FRAME, {**FRAME, "frame": 19}]
    index = load_index(write(tmp_path, {**SOUND, "splits": {"train": frames}}))
    assert index.frames_by_drive("train") == {(DATE, "0002"): [9], (DATE, "0001"): [9, 19]}
    with pytest.raises(ArgumentError, match="train"):
        index.frames_by_drive("test")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("", "a file with content"),
        ("{", "a JSON object"),
        ("[]", "a JSON object"),
        ({"name": "tiny"}, "an object with the key 'label_set'"),
        ({**SOUND, "label_set": "KITTI-15"}, "label_set: one of"),
        ({**SOUND, "label_set": ["KITTI-14"]}, "label_set: one of"),
        ({**SOUND, "splits": [FRAME]}, "splits: lists"),
        ({**SOUND, "splits": {"train": []}}, "splits: lists"),
        ({**SOUND, "splits": {"train": [{"date": DATE, "drive": "0001"}]}}, "an object with the key 'frame'"),
        ({**SOUND, "splits": {"train": [{**FRAME, "frame": "9"}]}}, "a frame like"),
        ({**SOUND, "splits": {"train": [{**FRAME, "frame": -1}]}}, "a frame like"),
        ({**SOUND, "splits": {"train": [{**FRAME, "date": "../other"}]}}, "a frame like"),
        ({**SOUND, "splits": {"train": [FRAME, FRAME]}}, "each frame of train once"),
        ({**SOUND, "splits": {"train": [FRAME], "test": [{**FRAME, "frame": 8}]}}, "each drive in one split"),
    ],
)
def test_says_what_is_wrong(tmp_path, content, expected):
    with pytest.raises(DataError, match=rf"dataset\.json: expected {expected}"):
        load_index(write(tmp_path, content))


def test_a_number_is_no_folder():
    with pytest.raises(ArgumentError, match="dataset_dir: expected the folder of a data set, found 5"):
        load_index(5)


def test_missing_index_is_named(tmp_path):
    with pytest.raises(DataError, match=r"dataset\.json"):
        load_index(tmp_path)


def test_a_path_on_another_drive_of_windows_is_written_whole(monkeypatch):
    monkeypatch.setattr(index, "os", SimpleNamespace(path=ntpath, fspath=str))
    assert index.relative_path(r"D:\data\kitti", r"D:\index") == r"..\data\kitti"
    assert index.relative_path(r"D:\data\kitti", r"C:\index") == r"D:\data\kitti"
