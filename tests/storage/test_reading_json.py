"""JSON from disk is what its place says, or an error that names the file."""

import json
import os

import pytest

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import write_json
from semgrid_edu.storage.reading import read_json


def test_what_was_written_is_read(tmp_path):
    for content, kind in (({"é": [1, None, 0.5]}, dict), ([1, {"a": "b"}], list)):
        write_json(tmp_path / "a.json", content)
        assert read_json(tmp_path / "a.json", kind) == content


DEEP = b"[" * 10**5, b'{"a":' * 10**5
LONG = b'{"a": ' + b"9" * 5000 + b"}"


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b"3", b"null", b'"a"', b"\xff\xfe{}", LONG, *DEEP])
def test_anything_but_an_object_is_refused(tmp_path, content):
    (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(DataError, match=r"a\.json: expected") as caught:
        read_json(tmp_path / "a.json")
    assert len(str(caught.value)) < 500 + len(str(tmp_path))


def test_an_object_is_no_array(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps({"a": 1}))
    with pytest.raises(DataError, match=r"expected a JSON array, found \{'a': 1\}"):
        read_json(tmp_path / "a.json", list)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes among its files")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.json")
    with pytest.raises(DataError, match="expected a file, found a pipe"):
        read_json(tmp_path / "a.json")
