"""Where numba keeps what it compiles when the installation is read-only."""

import os
import stat

import pytest

from semgrid_edu.fast import numba_cache
from semgrid_edu.fast.numba_cache import NUMBA_VARIABLE, keep_compiled_functions

pytestmark = pytest.mark.skipif(not hasattr(os, "getuid"), reason="this system has other rights to files")


@pytest.fixture(autouse=True)
def nothing_set(monkeypatch, tmp_path):
    monkeypatch.setenv(NUMBA_VARIABLE, "")
    monkeypatch.delenv(NUMBA_VARIABLE)
    monkeypatch.setattr(numba_cache.tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(numba_cache.tempfile, "mkdtemp", lambda prefix: str(tmp_path / f"{prefix}other"))


def test_a_folder_that_takes_files_is_left_to_numba(tmp_path, monkeypatch):
    monkeypatch.setattr(numba_cache, "PACKAGE", tmp_path / "package")
    assert keep_compiled_functions() == ""
    assert NUMBA_VARIABLE not in os.environ


def test_without_any_a_folder_of_the_user_alone_is_named_in_one_line(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setattr(numba_cache, "_usual_folders", lambda: [tmp_path / "file" / "__pycache__"])
    said = keep_compiled_functions()
    folder = tmp_path / f"semgrid_edu-{os.getuid()}"
    assert str(folder) in said
    assert "\n" not in said
    assert os.environ[NUMBA_VARIABLE] == str(folder)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_a_folder_that_others_can_write_to_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setattr(numba_cache, "_usual_folders", list)
    folder = tmp_path / f"semgrid_edu-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    keep_compiled_functions()
    assert os.environ[NUMBA_VARIABLE] == str(tmp_path / "semgrid_edu-other")
