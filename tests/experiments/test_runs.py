import json
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from tiny_notes import Note, wait_for
from tiny_runs import results, tiny_training_runs

from semgrid_edu.errors import DataError
from semgrid_edu.networks import WEIGHTS
from semgrid_edu.workshop.paper.experiments import EXPERIMENTS
from semgrid_edu.workshop.paper.reproduce import Request, plan_table, reproduce
from semgrid_edu.workshop.paper.run import claim_folder, estimate, execute_plan, left_to_do, run_one, with_needs
from semgrid_edu.workshop.paper.scales import SCALES
from semgrid_edu.workshop.workplace import Workplace, workplace

A = Note("a")
B, C = Note("b", (A,)), Note("c", (A,))
D = Note("d", (B, C))


def here():
    """One thread of this process."""
    return Workplace(ThreadPoolExecutor(1), 1)


def started(root):
    return {path.parent.name: len(path.read_text()) for path in root.glob("note-*/started")}


def test_a_plan_holds_each_run_once_after_those_that_it_needs():
    assert with_needs([D, C]) == [A, B, C, D]


def test_every_run_is_done_once(tmp_path):
    for _ in range(2):
        assert execute_plan(with_needs([D]), tmp_path, here()) == {}
    assert started(tmp_path) == {"note-a": 1, "note-b": 1, "note-c": 1, "note-d": 1}


def test_a_run_that_fails_stops_only_those_that_need_it_and_is_tried_again(tmp_path):
    weak = Note("weak", (A,), fails_without="help")
    plan = with_needs([weak, Note("after", (weak,)), D])
    failed = execute_plan(plan, tmp_path, here())
    assert [run.name for run in failed] == ["note-weak", "note-after"]
    assert "no help" in failed[weak]
    assert "note-weak" in failed[Note("after", (weak,))]
    assert "no help" in (weak.folder(tmp_path) / "output.txt").read_text()
    assert D.has_ended(tmp_path)
    (tmp_path / "help").touch()
    assert execute_plan(plan, tmp_path, here()) == {}
    assert started(tmp_path) == {f"note-{name}": 1 + (name == "weak") for name in ("a", "b", "c", "d", "weak", "after")}


def test_a_process_that_dies_ends_the_plan_with_advice(tmp_path):
    """It dies before it has loaded what a run needs, which takes seconds."""

    def plan_of_one_that_dies():
        with workplace(1) as place:
            dies = SimpleNamespace(submit=lambda *_: place.executor.submit(os._exit, 1))
            execute_plan([A], tmp_path, replace(place, executor=dies))

    with pytest.raises(ChildProcessError, match="memory ran out"):
        plan_of_one_that_dies()


def test_the_folder_of_another_run_is_refused(tmp_path):
    claim_folder(Note("a", seconds_each=1.0), tmp_path)
    with pytest.raises(DataError, match="seconds_each"):
        claim_folder(A, tmp_path)
    assert "DataError" in run_one(A, tmp_path)


def test_the_estimate_adds_up_what_is_left(tmp_path):
    """Two steps of 30 s each."""
    plan = with_needs([D])
    estimated = estimate(plan, tmp_path)
    assert estimated == dict.fromkeys(plan, 60.0)
    cells = plan_table(plan, estimated).splitlines()[2].strip("|").split("|")
    assert [cell.strip() for cell in cells] == ["note", "4", "0", "2", "1.0"]


def test_one_run_of_one_minute_is_told_as_such(tmp_path, monkeypatch):
    monkeypatch.setattr(Request, "plan", lambda _: [A])
    told = []
    request = Request(experiment="table1", scale="quick", runs=tmp_path / "runs", out=tmp_path / "out", workers=1)
    reproduce(request, told.append, plan_only=True)
    assert told[0].startswith("Estimating")  # before the trials, which take seconds
    assert told[1].endswith("\n\nleft: 1 of 1 runs, about 1 min")


def test_recorded_times_take_the_place_of_trials(tmp_path):
    claim_folder(A, tmp_path)
    (A.folder(tmp_path) / "ended.json").write_text(json.dumps({"seconds": 8}))
    estimated = estimate(with_needs([D]), tmp_path)
    assert estimated == dict.fromkeys((B, C, D), 8.0)


@pytest.mark.parametrize("scale", SCALES.values(), ids=SCALES)
def test_names_tell_runs_apart_and_stages_are_shared(scale):
    plan = with_needs(run for experiment in EXPERIMENTS.values() for run in experiment.runs(scale, 3))
    assert len({run.name for run in plan}) == len(plan)
    settings = [json.dumps(run.settings(), sort_keys=True) for run in plan]
    assert len(set(settings)) == len(plan)
    table1 = with_needs(EXPERIMENTS["table1"].runs(scale, 3))
    assert sum(run.name.startswith("image-") for run in table1) == 9
    assert sum(run.name.startswith("data-") for run in table1) == 1


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Two tiny networks, trained without any interruption."""
    root = tmp_path_factory.mktemp("runs")
    assert execute_plan(with_needs(tiny_training_runs()), root, here()) == {}
    return root


def test_the_image_stage_is_trained_once_and_both_networks_start_from_it(trained):
    assert len(list(trained.glob("image-*"))) == 1
    assert len(list(trained.glob(f"grid-*/{WEIGHTS}"))) == 2
    names = sorted(path.name for path in trained.glob("grid-*"))
    assert names == ["grid-tiny-segnet-true-2+2-seed1", "grid-tiny-segnet-true-2planes-unbalanced-2+2-seed1"]


def test_what_is_deleted_is_made_again_only_for_a_run_that_reads_it(trained, tmp_path):
    root, (first, second) = shutil.copytree(trained, tmp_path / "runs"), tiny_training_runs()
    plan, image_stage, arrays = with_needs([first, second]), first.image_stage, first.arrays
    weights = [run.folder(root) / WEIGHTS for run in (image_stage, second)]
    weights[0].unlink()
    assert left_to_do(plan, root) == []
    weights[1].unlink()
    assert left_to_do(plan, root) == [image_stage, second]
    (arrays.data.dataset_dir(root) / "dataset.json").unlink()
    assert left_to_do(plan, root) == [arrays.data, arrays, image_stage, second]
    assert arrays.record(root)["seconds"] > 0


def copied(trained, root, *kinds):
    """A folder in which the runs of these kinds are still to be done."""
    return Path(shutil.copytree(trained, root, ignore=shutil.ignore_patterns(*(f"{kind}-*" for kind in kinds))))


SCRIPT = """
import sys
from pathlib import Path
from tiny_runs import tiny_training_runs
from semgrid_edu.workshop.paper.run import execute_plan
from semgrid_edu.workshop.paper.run import with_needs
from semgrid_edu.workshop.workplace import workplace
if __name__ == "__main__":
    with workplace(1) as place:
        assert execute_plan(with_needs(tiny_training_runs()), Path(sys.argv[1]), place) == {}
"""


def test_a_killed_plan_goes_on_with_the_same_bytes(trained, tmp_path):
    """Killed as a whole when the first of two networks has been trained and the second begins."""
    script, root = tmp_path / "script.py", copied(trained, tmp_path / "runs", "grid")
    script.write_text(SCRIPT)
    paths = os.pathsep.join([str(Path(__file__).parents[1]), *sys.path])
    command = [sys.executable, str(script), str(root)]
    process = subprocess.Popen(command, env=os.environ | {"PYTHONPATH": paths}, stderr=subprocess.DEVNULL)
    second = tiny_training_runs()[1]
    wait_for(lambda: (second.folder(root) / "log.csv").exists())
    process.send_signal(signal.SIGKILL)
    process.wait()
    time.sleep(1)  # the worker notices within an instant that its parent is gone
    assert tiny_training_runs()[0].has_ended(root)
    assert not second.has_ended(root)
    assert execute_plan(with_needs(tiny_training_runs()), root, here()) == {}
    assert results(root) == results(trained)
