"""Every kind of bad input ends in one line that names it, or is done after a line that says what is doubtful."""

import json
import os
import re
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import pytest
import typer
from bad_inputs import HELD, HUGE, TABLE, log, sample
from tiny_drive import DATE, write_tiny_dataset

import semgrid_edu.workshop.scoring.evaluate
import semgrid_edu.workshop.training_run
from semgrid_edu.datasets import KittiRawDrive, training_cache
from semgrid_edu.fast import TrainingSet
from semgrid_edu.networks import Architecture, build_net, save_net
from semgrid_edu.storage.files import CACHE_VARIABLE
from semgrid_edu.training.log import Step
from semgrid_edu.workshop import demo
from semgrid_edu.workshop.commands import main as cli
from semgrid_edu.workshop.commands.experiments import PAPER


@pytest.fixture(autouse=True, scope="module")
def in_this_process():
    """Make arrays without worker processes, which take seconds to start."""

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training_cache, "WORKERS", 1)
        yield


@pytest.fixture(scope="module")
def prepared(tmp_path_factory) -> Iterator[Path]:
    """What every row of the table finds, and none changes."""
    root = tmp_path_factory.mktemp("prepared")
    write_tiny_dataset(root / "TINY", train=6, test=1, validation=1)
    for split in ("train", "test", "validation"):
        TrainingSet(root / "TINY", split)
    net = build_net(Architecture(), KittiRawDrive(root / "TINY", DATE, "0001").camera)
    (root / "architecture.json").write_text(json.dumps(asdict(net.architecture)))
    save_net(net, root / "fresh.safetensors")
    for name, learnt in (("image_stage", net.segmenter), ("weights", net)):
        for buffer, steps in learnt.named_buffers():
            steps += buffer.endswith("num_batches_tracked")
        save_net(net, root / f"{name}.safetensors")
    log(Step(0, "image", 0.1, 2.0))(root)
    sample(root)
    before = states(root)
    yield root
    assert states(root) == before


def copied(source: str, target: str) -> None:
    """Copy a file, or link it where it is large and no row writes to it."""
    large = "cache" in Path(source).parts or Path(source).name in ("fresh.safetensors", "image_stage.safetensors")
    (os.link if large else shutil.copy2)(source, target)


@pytest.fixture
def place(prepared, tmp_path, monkeypatch) -> Iterator[Path]:
    """A copy to spoil, as the current folder."""
    spoilt = shutil.copytree(prepared, tmp_path / "place", copy_function=copied)
    monkeypatch.chdir(spoilt)
    monkeypatch.setenv(CACHE_VARIABLE, "")  # so that what --cache sets is undone afterwards
    yield spoilt
    while HELD:
        HELD.pop().__exit__(None, None, None)
    shutil.rmtree(spoilt)  # hundreds of files for each row


def states(folder: Path) -> dict[Path, tuple[int, ...]]:
    """What shows that a file or folder was changed: its kind and rights, size and time."""
    found = {path: path.lstat() for path in folder.rglob("*")}
    return {path: (stat.st_mode, stat.st_size, stat.st_mtime_ns) for path, stat in found.items()}


@pytest.fixture
def no_work(monkeypatch):
    """What is only doubtful would be done; here it isn't."""

    def done(*_, **__):
        raise SystemExit("done")

    monkeypatch.setattr(demo, "write_demo", done)
    monkeypatch.setattr(semgrid_edu.workshop.training_run, "train_network", done)
    monkeypatch.setattr(semgrid_edu.workshop.scoring.evaluate, "evaluate", done)


def told(arguments: list[str], monkeypatch, capsys) -> str:
    """Run a command, which must fail; return what it says."""
    monkeypatch.setattr("sys.argv", ["semgrid-edu", *arguments])
    monkeypatch.setenv("COLUMNS", "300")
    with pytest.raises(SystemExit) as caught:
        cli.run()
    assert caught.value.code not in (0, None)
    says = caught.value.code if isinstance(caught.value.code, str) else ""
    assert "\n" not in says
    return capsys.readouterr().err + says


def contents(folder: Path) -> dict[Path, bytes]:
    """What the files of a folder hold, without the large arrays and the locks."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.suffix not in (".npy", ".lock")]
    return {path: path.read_bytes() for path in files if path.name != ".lock"}


@pytest.mark.parametrize("row", TABLE, ids=[row.kind for row in TABLE])
def test_a_bad_input_is_named(row, place, request, monkeypatch, capsys):
    if "doubtful" in row.says:
        request.getfixturevalue("no_work")
    row.spoil(place)
    before, there = contents(place), {*place.rglob("*")}
    says = told(shlex.split(row.command), monkeypatch, capsys)
    assert before.items() <= contents(place).items()  # nothing is lost
    # Arrays in the cache serve the next run, and Python keeps what it compiled.
    left = {path for path in {*place.rglob("*")} - there if not {"cache", "__pycache__"} & {*path.parts}}
    assert "doubtful" in row.says or not left
    assert re.search(row.says, says), says
    assert "Traceback" not in says
    assert says.endswith("done") == ("doubtful" in row.says)


def commands(group=None, before: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every command of the program, as it is typed."""
    group = group or typer.main.get_command(cli.app)
    found = []
    for name, one in group.commands.items():
        found += commands(one, (*before, name)) if hasattr(one, "commands") else [(*before, name)]
    return found


def options(command: tuple[str, ...]) -> list[str]:
    """The options of a command that take a value."""
    one = typer.main.get_command(cli.app)
    for name in command:
        one = one.commands[name]
    return [p.opts[0] for p in one.params if p.param_type_name == "option" and not p.is_flag and p.name != "help"]


def test_the_table_is_long_and_meets_every_command():
    assert len({row.kind for row in TABLE}) == len(TABLE) >= 200
    known = commands()
    met = {command for row in TABLE for command in known if shlex.split(row.command)[: len(command)] == [*command]}
    assert {*known} == met | {("reproduce", name) for name in PAPER}  # all of these are one command: table1's


@pytest.mark.parametrize("command", commands(), ids=" ".join)
def test_no_command_takes_an_empty_option_or_one_that_it_does_not_know(command, monkeypatch, capsys):
    for option in options(command):
        for empty in ([option, ""], [f"{option}="], [option, "  "]):
            assert f"{option}: expected a value" in told([*command, *empty], monkeypatch, capsys)
        if "seed" in option:
            assert f"{option}: expected a whole number up to" in told([*command, option, HUGE], monkeypatch, capsys)
    assert "No such option" in told([*command, "--no-such"], monkeypatch, capsys)
