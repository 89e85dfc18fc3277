"""What `make demo` and `make test` run, and when they make the environment."""

import os
import subprocess
import sys
from importlib import import_module
from types import SimpleNamespace

import pytest

import compile_functions
import make

INSTALLS = ("-m", "pip", "install", "--quiet", "-c", "constraints.txt", "-e", ".[test]")


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A clone without an environment, in which no program is really run."""
    monkeypatch.setattr(make, "CLONE", tmp_path)
    monkeypatch.setattr(make, "ENVIRONMENT", tmp_path / ".venv")
    monkeypatch.setattr(make, "MADE", tmp_path / ".venv" / "made")
    for name in make.NEEDS:
        (tmp_path / name).touch()
    (tmp_path / "notebooks" / "deeper").mkdir(parents=True)
    for name in ("b.ipynb", "a.ipynb", "deeper/c.ipynb"):
        (tmp_path / "notebooks" / name).touch()
    monkeypatch.setattr(make.venv, "create", lambda folder, **_: folder.mkdir(exist_ok=True))
    return tmp_path


@pytest.fixture
def ran(monkeypatch):
    """The commands that were run: program, arguments, environment variables."""
    commands = []

    def run(command, cwd, env, check):
        commands.append((command[0].name, *command[1:], env))
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr(make.subprocess, "run", run)
    return commands


def test_the_environment_is_made_once_and_again_when_a_pin_changes(clone, ran):
    make.environment()
    make.environment()
    assert [command[1:-1] for command in ran] == [INSTALLS, ("compile_functions.py",)]
    made = make.MADE.stat().st_mtime
    os.utime(clone / "constraints.txt", (made + 5, made + 5))
    make.environment()
    assert len(ran) == 4


def test_an_environment_that_could_not_be_made_is_made_again(clone, monkeypatch):
    monkeypatch.setattr(make.subprocess, "run", lambda *_, **__: SimpleNamespace(returncode=3))
    with pytest.raises(SystemExit) as stopped:
        make.environment()
    assert stopped.value.code == 3
    assert not make.MADE.exists()


SLOW_TO_COMPILE = {
    "semgrid_edu.fast.occupancy.particles": "_fly",
    "semgrid_edu.fast.crf.mean_field": "_update",
    "semgrid_edu.workshop.simulation.sensors.shading": "_shade",
}
"""A function each of the filter, the CRF and the simulator, by its module."""


def test_what_takes_long_to_compile_is_called_when_the_environment_is_made(monkeypatch):
    called = set()
    for module, name in SLOW_TO_COMPILE.items():
        function = getattr(import_module(module), name)
        monkeypatch.setattr(
            sys.modules[module], name, lambda *a, f=function, m=module, **k: (called.add(m), f(*a, **k))[1]
        )
    for part in compile_functions.PARTS.values():
        part()
    assert called == set(SLOW_TO_COMPILE)


def test_a_part_that_does_not_compile_is_told(monkeypatch, capsys):
    monkeypatch.setattr(compile_functions, "PARTS", {"nothing of this name": None})
    assert compile_functions.compile_all() == 1
    assert "KeyError: 'nothing of this name'" in capsys.readouterr().err


def test_tests_are_style_tests_and_notebooks(clone, ran):
    make.test()
    assert [command[1] for command in ran[:2]] == ["-m", "compile_functions.py"]
    assert [command[2] for command in ran if command[1] == "-m"] == ["pip", "ruff", "ruff", "pytest"]
    words = ran[-1][:-1]
    assert len([word for word in words if word.endswith(".ipynb")]) == 3
    assert {"--nbval", "tests"} <= set(words)
    assert ran[-1][-1]["OMP_NUM_THREADS"] == "1"
    assert all(command[-1]["OMP_WAIT_POLICY"] == "PASSIVE" for command in ran)


def test_tests_in_a_browser_are_apart(clone, ran):
    make.make_targets(["test-browser"])
    assert [command[2] for command in ran if command[1] == "-m"] == ["pip", "pip", "pytest"]
    assert ".[browser]" in ran[2]
    assert ran[-1][3] == "tests/browser"
    ran.clear()
    make.test()
    assert "--ignore=tests/browser" in ran[2]


def test_real_data_is_named_by_variables(clone, ran, monkeypatch):
    for name in make.REAL_DATA:
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(SystemExit, match="usage: make test-real KITTI="):
        make.test_real()
    monkeypatch.setenv("PANDASET", str(clone))
    make.test_real()
    assert ran[-1][-1]["PANDASET"] == str(clone)
    assert ran[-1][2:-1] == ("pytest", "-m", "real", "tests")


def test_the_quick_job_leaves_notebooks_and_graders_out(clone, ran):
    make.quick()
    words = ran[-1][:-1]
    assert "tests" in words
    assert "--ignore=tests/graders" in words
    assert not any(word.endswith(".ipynb") for word in words)


def test_an_old_python_is_refused(clone, monkeypatch):
    monkeypatch.setattr(make, "OLDEST", (sys.version_info[0], sys.version_info[1] + 1))
    with pytest.raises(SystemExit, match="or later is needed"):
        make.demo()


@pytest.mark.parametrize("asked", [[], ["demos"], ["demo", "--fast"]])
def test_what_cannot_be_asked_for_is_refused(asked):
    with pytest.raises(SystemExit, match="usage"):
        make.make_targets(asked)


def test_it_needs_nothing_but_python():
    """A fresh machine has none of the package's dependencies: -S leaves out what is installed beside Python."""
    done = subprocess.run(
        [sys.executable, "-S", "-E", "make.py"],
        cwd=make.CLONE,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "usage" in done.stderr
