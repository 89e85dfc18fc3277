"""The command line: a mistake ends in one line that names it; the environment is set there and nowhere else."""

import os
import signal
import subprocess
import sys
import time
from importlib.metadata import version

import pytest
import typer

import semgrid_edu
import semgrid_edu.datasets.index
import semgrid_edu.workshop.paper.reproduce
import semgrid_edu.workshop.training_run
from semgrid_edu.workshop import demo
from semgrid_edu.workshop.commands.arguments import SHOWN_DOUBTS, tell
from semgrid_edu.workshop.commands.main import run
from semgrid_edu.workshop.simulation import datasets


def test_one_doubt_too_many_is_told_as_such(capsys):
    tell(["a doubt"] * (SHOWN_DOUBTS + 1))
    assert capsys.readouterr().err.splitlines()[-1] == "semgrid-edu: doubtful: and 1 more"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["data", "make", "sample", "FILE"], r"FILE.*: expected a folder, found the file .*FILE"),
        (["demo", "--out", "FILE"], r"FILE: expected a folder, found the file .*FILE"),
        (["data", "verify", "FILE"], r"FILE: expected folders of samples"),
        (
            ["evaluate", "--data", ".", "--weights", ".", "--out", "FILE/scores.json"],
            r"FILE: expected a folder, found the file",
        ),
        (["evaluate", "--data", ".", "--weights", ".", "--out", "FOLDER"], r"FOLDER: expected a file to write"),
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
        "cli.app = lambda **_: print(os.environ['OMP_WAIT_POLICY'], {'torch', 'numba'} & sys.modules.keys()); cli.run()"
    )
    assert printed(code) == "PASSIVE set()\n"


def said(monkeypatch, capsys, *arguments: str) -> str:
    """What a command that succeeds prints."""
    monkeypatch.setattr("sys.argv", ["semgrid-edu", *arguments])
    with pytest.raises(SystemExit) as caught:
        run()
    assert caught.value.code in (0, None)
    return capsys.readouterr().out


def test_the_version_is_told_everywhere(monkeypatch, capsys):
    assert semgrid_edu.__version__ == version("semgrid_edu")
    assert said(monkeypatch, capsys, "--version") == f"semgrid_edu {semgrid_edu.__version__}\n"
    command = [sys.executable, "-m", "semgrid_edu", "--version"]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()[-1] == version(
        "semgrid_edu"
    )


@pytest.mark.parametrize("group", ["", "data", "course", "reproduce"])
def test_help_says_whole_sentences_and_no_type_of_a_flag(monkeypatch, capsys, group):
    monkeypatch.setenv("COLUMNS", "80")
    usage, *lines = said(monkeypatch, capsys, *group.split(), "--help").splitlines()
    assert usage.startswith("Usage: ")
    assert [line for line in lines if line.endswith("...") or "bool" in line] == []


@pytest.mark.parametrize(("typed", "completed"), [("data m", "make"), ("dem", "demo"), ("data make no", "")])
def test_shells_complete_commands(typed, completed, monkeypatch, capsys):
    monkeypatch.setenv("COMP_WORDS", f"semgrid-edu {typed}")
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split())))
    monkeypatch.setenv("_SEMGRID_EDU_COMPLETE", "complete_bash")
    monkeypatch.setattr("sys.argv", ["semgrid-edu"])
    with pytest.raises(SystemExit):
        run()
    shown = capsys.readouterr()
    assert (shown.out.strip(), shown.err) == (completed, "")


def test_the_list_of_data_names_each_with_its_command(monkeypatch, capsys):
    listed = said(monkeypatch, capsys, "data", "list").splitlines()
    assert [line.partition(":")[0] for line in listed] == [*datasets.RECIPES, "kitti", "pandaset"]
    assert all("semgrid-edu data " in line for line in listed)
    assert "142 labelled frames in 'train', 110 labelled frames in 'test'" in listed[0]


def test_the_demo_opens_its_page(monkeypatch, capsys, tmp_path):
    opened = []
    monkeypatch.setattr(demo, "write_both_streets", lambda out, *_, **__: out / "index.html")
    monkeypatch.setattr(typer, "launch", opened.append)
    said(monkeypatch, capsys, "demo", "--out", str(tmp_path))
    assert opened == []
    said(monkeypatch, capsys, "demo", "--out", str(tmp_path), "--open")
    assert opened == [(tmp_path / "index.html").as_uri()]


@pytest.mark.parametrize(
    ("arguments", "module", "name", "told"),
    [
        ("demo --out OUT", demo, "write_both_streets", ""),
        ("train --data DATA --out OUT", semgrid_edu.workshop.training_run, "train_network", " with --resume"),
    ],
)
def test_ctrl_c_says_what_to_run(arguments, module, name, told, monkeypatch, tmp_path):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    (tmp_path / "DATA").mkdir()
    (tmp_path / "DATA" / "dataset.json").write_text('{"name": "a", "label_set": "KITTI-14", "splits": {}}')
    monkeypatch.setattr(semgrid_edu.workshop.commands.main, "dataset_doubts", lambda *_: [])
    monkeypatch.setattr(module, name, interrupted)
    monkeypatch.setattr("sys.argv", ["semgrid-edu", *arguments.split()])
    with pytest.raises(SystemExit, match=f"^semgrid-edu: interrupted; run the same command again{told}$"):
        run()


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("sent", ["SIGINT", "SIGTERM"])
def test_workers_end_without_a_word_when_their_command_is_stopped(tmp_path, sent):
    """A terminal sends Ctrl-C to all of them; `kill` reaches the command alone."""
    command = [sys.executable, "-m", "semgrid_edu", "data", "make", "minikitti", str(tmp_path)]
    pipe = {"stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    # Where the tests run in the background of a shell, SIGINT is ignored, and programs that they start inherit that.
    with subprocess.Popen(command, **pipe, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)) as made:
        until = time.monotonic() + 100
        while not list(tmp_path.glob("minikitti/*/.*")) and made.poll() is None and time.monotonic() < until:
            time.sleep(0.2)  # until a worker has begun a drive
        (os.killpg if sent == "SIGINT" else os.kill)(made.pid, getattr(signal, sent))
        said = made.communicate(timeout=60)[1]
    assert said.endswith("semgrid-edu: interrupted; run the same command again\n"), said
    assert "Traceback" not in said


def test_a_script_without_a_main_guard_is_told_so(tmp_path):
    script = tmp_path / "mine.py"
    script.write_text(
        "from semgrid_edu.workshop.workplace import workplace\n"
        "with workplace(1) as place: place.executor.submit(abs, 1).result()"
    )
    ended = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert ended.returncode
    assert 'outside `if __name__ == "__main__":`' in ended.stderr.splitlines()[-1]
