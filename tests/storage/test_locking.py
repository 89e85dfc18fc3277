"""One writer at a time, also between processes, and also after a kill."""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from semgrid_edu.errors import DataError
from semgrid_edu.storage.files import sole_writer

HOLDS = """
import sys, time
from semgrid_edu.storage.files import sole_writer
with sole_writer(sys.argv[1]):
    print("held", flush=True)
    time.sleep(600)
"""


def test_another_process_is_refused_until_this_one_is_killed(tmp_path):
    with subprocess.Popen([sys.executable, "-c", HOLDS, tmp_path / "new"], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        with (
            pytest.raises(DataError, match="new: expected a folder that no other process"),
            sole_writer(tmp_path / "new"),
        ):
            pass
        other.kill()
    with sole_writer(tmp_path / "new"):
        pass


def test_it_is_never_held_twice_though_its_file_comes_and_goes(tmp_path):
    inside, most = [], []

    def work(number):
        for _ in range(25):
            with sole_writer(tmp_path):
                inside.append(number)
                most.append(len(inside))
                time.sleep(0.001)
                inside.remove(number)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(work, range(2)))
    assert most == [1] * 50
    assert os.name == "nt" or list(tmp_path.iterdir()) == []  # Windows keeps files that are open


def test_an_error_gives_the_folder_free(tmp_path):
    with pytest.raises(ZeroDivisionError), sole_writer(tmp_path):
        raise ZeroDivisionError
    with sole_writer(tmp_path), pytest.raises(DataError), sole_writer(tmp_path):
        pass
