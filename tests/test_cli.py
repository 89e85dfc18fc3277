"""The command line: a mistake ends in one line that names it; the environment is set there and nowhere else."""

import os
import subprocess
import sys

import pytest

from semgrid_edu.workshop.commands.main import run


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["data", "make", "sample", "FILE"], r"FILE.*: Not a directory"),
        (["demo", "--out", "FILE"], r"FILE: File exists"),
        (["demo", "--kitti", "FILE"], r"--kitti, --date, --drive: expected all three or none, found only --kitti"),
        (["data", "verify", "FILE"], r"FILE: expected folders of samples"),
        (["reproduce", "occupancy", "--out", "FOLDER"], r"FOLDER: expected a file to write, found a folder"),
        (["reproduce", "occupancy", "--out", "FILE/scores.json"], r"FILE: File exists"),
        (["evaluate", "--data", ".", "--weights", ".", "--out", "FOLDER"], r"FOLDER: expected a file to write"),
        (["search-crf", "--data", ".", "--test", ".", "--weights", ".", "--out", "FOLDER"], r"FOLDER: expected a file"),
    ],
)
def test_a_mistake_ends_in_one_line(tmp_path, monkeypatch, arguments, message):
    (tmp_path / "FILE").write_text("a file where a folder should be")
    (tmp_path / "FOLDER").mkdir()
    arguments = [str(tmp_path / a) if a.startswith(("FILE", "FOLDER")) else a for a in arguments]
    monkeypatch.setattr("sys.argv", ["semgrid-edu", *arguments])
    with pytest.raises(SystemExit, match=f"^semgrid-edu: .*{message}") as caught:
        run()
    assert "\n" not in str(caught.value)


def printed(code: str) -> str:
    """What a fresh Python without a wait policy prints."""
    environment = {name: value for name, value in os.environ.items() if name != "OMP_WAIT_POLICY"}
    command = [sys.executable, "-c", code]
    return subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout


def test_importing_the_package_leaves_the_environment_as_it_was():
    every = "module.name for module in pkgutil.walk_packages(semgrid_edu.__path__, 'semgrid_edu.')"
    code = (
        "import importlib, os, pkgutil; before = dict(os.environ); import semgrid_edu; "
        f"imported = [importlib.import_module(name) for name in ({every})]; "
        "print(len(imported) > 100, dict(os.environ) == before)"
    )
    assert printed(code) == "True True\n"


def test_the_command_line_sets_the_wait_policy_before_openmp_is_loaded():
    code = (
        "import os, sys; from semgrid_edu.workshop.commands import main as cli; "
        "cli.app = lambda: print(os.environ['OMP_WAIT_POLICY'], {'torch', 'numba'} & sys.modules.keys()); cli.run()"
    )
    assert printed(code) == "PASSIVE set()\n"
