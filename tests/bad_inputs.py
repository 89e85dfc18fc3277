"""The table of bad inputs: what is spoilt, which command meets it, and what it has to say. `test_bad_inputs` tries it.

Each row works on a copy of what the fixture `prepared` makes: TINY, a data set with its arrays; `weights.safetensors`,
a network that has made a step, `image_stage.safetensors`, and `fresh.safetensors`, which has made none; RUN, a training
run with a log; SAMPLES, a sample with its provenance. Where a command says that something is doubtful, it goes on.
"""

import json
import os
import shutil
import socket
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import torch
from PIL import Image
from safetensors.torch import load_file, save_file
from tiny_drive import DATE

from semgrid_edu.storage.files import sole_writer
from semgrid_edu.storage.provenance import write_provenance
from semgrid_edu.training.log import LOG, Step, append_step, begin_log

DRIVE = f"TINY/{DATE}/{DATE}_drive_0001_sync"
SCAN = f"{DRIVE}/velodyne_points/data/000000000{{}}.bin"
OXTS = f"{DRIVE}/oxts/data/000000000{{}}.txt"
PHOTO = f"{DRIVE}/image_02/data/0000000000.png"
CALIBRATION = f"TINY/{DATE}/calib_cam_to_cam.txt"
HUGE = str(2**70)

DEMO = f"demo {DRIVE} --out OUT"
TRAIN = "train --data TINY --out OUT"
EVALUATE = "evaluate --data TINY --weights weights.safetensors --out scores.json"
FETCH = "data fetch kitti --drive 2011_09_26_0013 --folder OUT"
FROM_BAG, TOPICS = "data from-bag", "--image /camera --points /points --odometry /odometry --lidar-height 1.7"
TABLE1 = "reproduce table1 --runs RUNS --out OUT --plan"
CHECK = "reproduce check OUT"

CARD = f"{DEMO} --weights weights.safetensors"
UNPREPARED = "--cache OTHER train --data TINY"
IN_FILE = "reproduce table1 --runs RUNS --out architecture.json --plan"

LOST = "expected a new file, or an earlier result of this command, found something else, which would be lost"

Spoil = Callable[[Path], object]


class Row(NamedTuple):
    """One kind of bad input: its name, the command that meets it, what that says (a pattern), and what is spoilt."""

    kind: str
    command: str
    says: str
    spoil: Spoil = lambda _: None


def rows(command: str, begins: str, *found: tuple) -> tuple[Row, ...]:
    """Rows of one command that begins what it says with the same words: kind, what else it says, and what is spoilt."""
    return tuple(Row(kind, command, begins + says, *spoil) for kind, says, *spoil in found)


def text(name: str, content: str) -> Spoil:
    return lambda root: (root / name).parent.mkdir(exist_ok=True, parents=True) or (root / name).write_text(content)


def a_class(root: Path) -> None:
    """Make what looks like a course with one exercise, and without a gradebook."""
    text("CLASS/semgrid_course.json", "{}")(root)
    (root / "CLASS" / "source" / "01_bayes").mkdir(parents=True)


def a_foreign_database(path: Path) -> None:
    """Make a database of another program."""
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE birds (name TEXT)")
        database.commit()


def cut(name: str, share: float) -> Spoil:
    def spoil(root: Path) -> None:
        content = (root / name).read_bytes()
        (root / name).write_bytes(content[: int(len(content) * share) // 16 * 16])

    return spoil


def gone(name: str) -> Spoil:
    return lambda root: (root / name).unlink()


def a_loop(root: Path) -> None:
    """Make a link to itself."""
    (root / "loop").symlink_to(root / "loop")


def pipe(name: str) -> Spoil:
    def spoil(root: Path) -> None:
        if not hasattr(os, "mkfifo"):
            pytest.skip("this system has no pipes among its files")
        (root / name).unlink(missing_ok=True)
        os.mkfifo(root / name)

    return spoil


def folder(name: str) -> Spoil:
    def spoil(root: Path) -> None:
        (root / name).unlink(missing_ok=True)
        (root / name).mkdir()

    return spoil


def a_socket(name: str) -> Spoil:
    def spoil(root: Path) -> None:
        if not hasattr(socket, "AF_UNIX"):
            pytest.skip("this system has no sockets among its files")
        (root / name).unlink()
        before = Path.cwd()
        os.chdir((root / name).parent)  # names of sockets are short
        with socket.socket(socket.AF_UNIX) as one:
            one.bind((root / name).name)
        os.chdir(before)

    return spoil


def one_point(root: Path) -> None:
    for k in range(3):
        (root / SCAN.format(k)).write_bytes(np.array([5.0, 0, 0, 0], "<f4").tobytes())


def packet(field: int, value: str, k: int = 1) -> Spoil:
    def spoil(root: Path) -> None:
        words = (root / OXTS.format(k)).read_text().split()
        words[field] = value
        (root / OXTS.format(k)).write_text(" ".join(words))

    return spoil


def tensors(make: Callable[[torch.Tensor], torch.Tensor], name: str = "weights.safetensors") -> Spoil:
    def spoil(root: Path) -> None:
        made = {key: make(one) if one.is_floating_point() else one for key, one in load_file(root / name).items()}
        save_file(made, root / name, {"architecture": (root / "architecture.json").read_text()})

    return spoil


def header(**values: object) -> Spoil:
    """Replace entries of the architecture in the header of the weights."""

    def spoil(root: Path) -> None:
        described = json.loads((root / "architecture.json").read_text()) | values
        path = root / "weights.safetensors"
        save_file(load_file(path), path, {"architecture": json.dumps(described)})

    return spoil


def raw_header(content: str) -> Spoil:
    return lambda root: save_file({"a": torch.zeros(1)}, root / "weights.safetensors", {"architecture": content})


def index(**values: object) -> Spoil:
    def spoil(root: Path) -> None:
        path = root / "TINY" / "dataset.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | values))

    return spoil


def frames(n: int = 6, **values: object) -> Spoil:
    """Leave n frames to learn from, one of each drive, and change the first."""
    first, *others = ({"date": DATE, "drive": f"{k:04d}", "frame": 2} for k in range(1, n + 1))
    return index(splits={"train": [first | values, *others]})


def log(*steps: Step) -> Spoil:
    def spoil(root: Path) -> None:
        begin_log(root / "RUN" / LOG, 0)
        for step in steps:
            append_step(root / "RUN" / LOG, step)

    return spoil


def checkpoint(described: dict[str, str]) -> Spoil:
    return lambda root: (
        (root / "OUT").mkdir() or save_file({"a": torch.zeros(1)}, root / "OUT" / "checkpoint.safetensors", described)
    )


def locked(name: str) -> Spoil:
    """Lock a folder until the table's `HELD` is emptied."""

    def spoil(root: Path) -> None:
        held = sole_writer(root / name)
        held.__enter__()
        HELD.append(held)

    return spoil


HELD: list = []
"""Locks of the row that is tried."""


def sample(root: Path) -> None:
    text("SAMPLES/one/file.txt", "as it was")(root)
    write_provenance(root / "SAMPLES" / "one", "made", 0, ("numpy",))


def arrays(name: str) -> Spoil:
    return lambda root: np.savez(root / name, mine=np.arange(3))


def a_result(counts: bytes | dict | None = None, content: str = '{"scale": "quick", "seeds": 1}') -> Spoil:
    """A result of Table 1, beside it the bytes or the arrays of its counts."""

    def spoil(root: Path) -> None:
        (root / "OUT").mkdir()
        (root / "OUT" / "table1.json").write_text(content)
        if isinstance(counts, dict):
            np.savez(root / "OUT" / "table1_counts.npz", **counts)
        elif counts is not None:
            (root / "OUT" / "table1_counts.npz").write_bytes(counts)

    return spoil


def png(name: str, size: tuple[int, int], mode: str = "RGB", value: int = 0, form: str = "png") -> Spoil:
    return lambda root: Image.new(mode, size, value).save(root / name, form)


DRIVES = (
    Row("a scan that is a pipe", DEMO, "0000.bin: expected a file, found a pipe", pipe(SCAN.format(0))),
    Row("a scan that is a socket", DEMO, "0000.bin: expected a file, found a pipe, a socket", a_socket(SCAN.format(0))),
    Row("a scan that is a folder", DEMO, "0000.bin: expected a file, found a folder", folder(SCAN.format(0))),
    Row("a missing scan", DEMO, "doubtful: .*0000.bin: expected a scan, found none", gone(SCAN.format(0))),
    Row("scans of one point", DEMO, "doubtful: .*0000.bin: expected a scan of at least 100 points, found 1", one_point),
    Row("a yaw in degrees", DEMO, "0000.txt: expected roll, pitch and yaw", packet(5, "180.0", 0)),
    Row("a JPEG called PNG", DEMO, "0000.png: expected a sound PNG", png(PHOTO, (40, 12), form="jpeg")),
    Row("time stamps not in ASCII", DEMO, "timestamps.txt: expected ASCII", text(f"{DRIVE}/oxts/timestamps.txt", "é")),
    Row("a calibration that is a pipe", DEMO, "calib_cam_to_cam.txt: expected a file", pipe(CALIBRATION)),
    Row(
        "a drive that isn't there", DEMO.replace("0001", "0042"), "0042_sync: expected the folder of a drive, found no"
    ),
    Row("an empty drive", "data fetch kitti --drive ''", "--drive: expected a value, found nothing"),
    Row("an empty drive after an equals sign", "data fetch kitti --drive=", "--drive: expected a value, found nothing"),
    Row("a folder without a drive", "demo RUN --out OUT", "RUN: expected a drive of KITTI raw"),
    Row(
        "a file in place of a drive", "demo architecture.json --out OUT", "expected the folder of a drive, found a file"
    ),
    Row("a reader and nothing to read", "demo --reader my.py --out OUT", "--reader: expected PATH"),
    Row("no file of a reader", "demo TINY --reader none.py --out OUT", "none.py: expected a Python file"),
    Row("a reader and a camera", "demo TINY --reader my.py --camera image_03 --out OUT", "--camera: expected none"),
    Row(
        "a page in place of a file", DEMO.replace("OUT", "architecture.json"), "json: expected a folder, found the file"
    ),
    Row("no file of stages", f"{DEMO} --stages none.py", "none.py: expected a Python file"),
    *rows(
        f"{DEMO} --stages my.py",
        "my.py: ",
        ("stages that are a pipe", "expected a Python file", pipe("my.py")),
        ("stages that can't be imported", "expected .* import", text("my.py", "import no")),
        ("stages without a stage", "expected at least one function", text("my.py", "")),
        ("a stage without arguments", ".*refine", text("my.py", "def refine(): pass")),
    ),
)

INDEXES = (
    Row("no index", TRAIN, "dataset.json: expected a file", gone("TINY/dataset.json")),
    Row("an index that is a list", TRAIN, "dataset.json: expected a JSON object", text("TINY/dataset.json", "[1]")),
    Row(
        "no frames to train on",
        TRAIN,
        "dataset.json: expected the split train, found test",
        index(splits={"test": [{"date": DATE, "drive": "0007", "frame": 2}]}),
    ),
    Row("a frame of 26 digits", TRAIN, "dataset.json: expected a frame like", frames(frame=10**25)),
    Row("a name that is a list", TRAIN, "dataset.json: expected name", index(name=["tiny"])),
    Row("a drive that isn't there, in an index", TRAIN, "0042_sync: expected a folder", frames(drive="0042")),
    Row("a frame beyond the drive", TRAIN, "the frame 7 that dataset.json lists, found", frames(frame=7)),
    Row("a frame without labels", TRAIN, "expected labels of the frame 0", frames(frame=0)),
    Row("a scan cut in half, in a data set", EVALUATE, "doubtful: .*0000.bin", cut(SCAN.format(0), 0.5)),
    Row("a pose 4000 km away, in a data set", TRAIN, "doubtful: .*0001.txt", packet(0, "85.0")),
)

WEIGHTS = (
    *rows(
        EVALUATE,
        "weights.safetensors: ",
        ("no weights", "expected a safetensors file", gone("weights.safetensors")),
        ("weights that are a pipe", "expected a safetensors file", pipe("weights.safetensors")),
        ("a pickle", "expected a safetensors", text("weights.safetensors", "\x80\x04pickle")),
        ("empty weights", "expected a safetensors file", text("weights.safetensors", "")),
        (
            "weights of the image stage",
            "expected a whole network",
            lambda r: (r / "image_stage.safetensors").replace(r / "weights.safetensors"),
        ),
        ("weights of NaN", "expected finite numbers", tensors(lambda one: one * np.nan)),
        (
            "one infinite weight",
            "expected finite numbers",
            tensors(lambda one: one.masked_fill(one == one.max(), np.inf)),
        ),
        ("variances below 0", "expected variances of at least 0", tensors(lambda one: -one - 1)),
        ("a header of 10^9 pixels", ".*image_size", header(image_size=[31623, 31623])),
        (
            "a header of 10^9 cells",
            ".*grid",
            header(grid={"x_min": 0, "x_max": 71, "y_min": -15.5, "y_max": 15.5, "cell": 0.001}),
        ),
        ("a header with a size of words", ".*header", header(image_size=["a", "b"])),
        ("a header of an unknown network", ".*header", header(segmenter="vit")),
        ("a header of another network", "expected", header(segmenter="fcn")),
        ("a header that is a list", ".*a JSON object", raw_header("[]")),
        ("no header", ".*header", lambda r: save_file({"a": torch.zeros(1)}, r / "weights.safetensors")),
    ),
    Row(
        "weights rounded to whole numbers",
        EVALUATE,
        "doubtful: .*weights.safetensors: .* rounded",
        tensors(torch.round),
    ),
    Row(
        "weights that never learnt",
        EVALUATE,
        "doubtful: .*weights.safetensors: expected a network that has learnt",
        lambda r: (r / "fresh.safetensors").replace(r / "weights.safetensors"),
    ),
)

RUNS = (
    *rows(
        f"{UNPREPARED} --out OUT",
        "",
        ("a folder that holds a network", "OUT: .* without a trained network", text("OUT/weights.safetensors", "x")),
        ("a folder that holds a checkpoint", "OUT: .* an interrupted run", text("OUT/checkpoint.safetensors", "x")),
        ("an image stage of one's own", f"image_stage.safetensors: {LOST}", text("OUT/image_stage.safetensors", "x")),
        ("a log of one's own", f"log.csv: {LOST}", text("OUT/log.csv", "day,hours")),
    ),
    Row(
        "a folder that another process writes to", TRAIN, "OUT: expected a folder that no other process", locked("OUT")
    ),
    Row("too few frames for a batch", TRAIN, "--data: expected at least one batch of 6", frames(1)),
    Row("a training run in its data set", TRAIN.replace("OUT", "TINY"), "TINY: expected .*, found a data set"),
    Row(
        "a training run over other results",
        TRAIN.replace("OUT", "SAMPLES/one"),
        "found the provenance.json of something",
    ),
    Row("a name that isn't UTF-8", "train --data TINY --out \udcff", "--out: expected UTF-8"),
    Row("a link to itself", "curves loop --out c.png", "[Ll]oop", lambda r: (r / "loop").symlink_to(r / "loop")),
    Row("a device that isn't there", f"{TRAIN} --device cuda:99", "--device: expected cpu"),
    Row("an unknown device", f"{TRAIN} --device abacus", "--device: expected"),
    Row("an unknown preset", f"{TRAIN} --preset huge", "--preset: expected compact or paper"),
    Row("an unknown truth", f"{TRAIN} --truth guessed", "--truth: expected one of true, lidar"),
    Row("an unknown image network", f"{TRAIN} --segmenter vit", "--segmenter: expected one of"),
    Row("no steps", f"{TRAIN} --iterations 0", "Invalid value for '--iterations'"),
    Row("a seed that is a word", f"{TRAIN} --seed luck", "Invalid value for '--seed'"),
    Row("a seed below 0", f"{TRAIN} --seed=-1", "Invalid value for '--seed'"),
    *rows(
        "curves RUN --out c.png",
        "",
        ("a log without a finite number", "expected a finite loss", log(Step(0, "image", 0.1, np.nan))),
        ("a log without steps", "logs: expected", log()),
        (
            "a log with lines out of order",
            "log.csv: expected step 1 in line 3",
            log(Step(0, "image", 0.1, 1.0), Step(2, "image", 0.1, 1.0), Step(1, "image", 0.1, 1.0)),
        ),
        (
            "a log that goes back to images",
            "log.csv: .*image stage before the grid stage",
            log(Step(0, "grid", 0.1, 1.0), Step(1, "image", 0.1, 1.0)),
        ),
        ("a log that is a pipe", "log.csv: expected the log", pipe(f"RUN/{LOG}")),
    ),
    Row("no log", "curves SAMPLES --out c.png", "log.csv: expected the log"),
    Row("a picture of an unknown format", "curves RUN --out c.docx", "--out: expected a picture that ends in"),
    Row("a picture that can't say who made it", "curves RUN --out c.jpg", "--out: expected a picture that ends in"),
    Row("a picture without a format", "curves RUN --out c", "--out: expected a picture that ends in"),
)

DATA = (
    Row("an unknown data set", "data make maxikitti OUT", "name: expected one of minikitti"),
    Row("a seed below 0, of data", "data make sample OUT --seed=-1", "seed: expected a whole number from 0 up"),
    *rows(
        "data make sample OUT",
        "OUT/sample",
        ("data that another process makes", ": expected a folder that no other process", locked("OUT/sample")),
        ("a folder with other files", ": expected an empty folder", text("OUT/sample/thesis.txt", "x")),
    ),
    Row("no workers", "data make sample OUT --workers 0", "--workers: expected at least one process"),
    Row("1000 workers", "data make sample OUT --workers 1000", r"--workers: expected .* \d+ cores .* found 1000"),
    Row(
        "a data set of another seed",
        "data make sample OUT",
        "simulation.json: expected data made with",
        text("OUT/sample/simulation.json", '{"seed": 5}'),
    ),
    Row("an empty folder's name", "data make sample ''", "argument 4: expected a value"),
    Row("no bag there", f"{FROM_BAG} NONE.bag OUT {TOPICS}", "NONE.bag: expected.*nothing"),
    Row("a drive in place of a bag", f"{FROM_BAG} TINY OUT {TOPICS}", "TINY: expected.*without metadata.yaml"),
    Row("an unknown archive", "data fetch nuscenes --drive 2011_09_26_0013 --folder OUT", "expected kitti or pandaset"),
    Row("a drive of scenes", "data fetch pandaset --drive 2011_09_26_0013", "--drive: expected no drive of PandaSet"),
    Row("a drive that is no date", "data fetch kitti --drive 13 --folder OUT", "drive: expected date and number"),
    Row("samples without provenance", "data verify TINY", "provenance.json: expected a file"),
    Row("no samples", "data verify OUT", "OUT: expected folders of samples"),
    Row("a sample that was changed", "data verify SAMPLES", "file.txt: changed", text("SAMPLES/one/file.txt", "x")),
    Row(
        "provenance with a number for its checksums",
        "data verify SAMPLES",
        "provenance.json: expected .*checksums",
        text("SAMPLES/one/provenance.json", '{"sha256": 1}'),
    ),
)

COURSE = (
    Row("an unknown lecture to build", "course notebooks 99_none", "99_none"),
    Row("an unknown lecture to measure", "course minutes 99_none", "99_none"),
    Row("a course over other files", "course build SAMPLES", "SAMPLES: expected an empty folder"),
    Row("a class without a course", "course grade TINY", "TINY: expected a course"),
    Row("a class with fewer than no workers", "course grade TINY --workers 0", "Invalid value for '--workers'"),
    Row("a course over a file", "course build architecture.json", "architecture.json: expected a folder, found a file"),
    Row("an argument too many", "course check all", "unexpected extra argument"),
    Row(
        "a class and an unknown exercise",
        "course grade CLASS 99_none",
        "assignments: expected some of 01_bayes",
        a_class,
    ),
    Row("a class in no time", "course grade CLASS --timeout 0", "Invalid value for '--timeout'", a_class),
    Row("a class without memory", "course grade CLASS --memory 10", "Invalid value for '--memory'", a_class),
    Row("a class with many workers", "course grade CLASS --workers 65", "Invalid value for '--workers'", a_class),
    *rows(
        "course grade CLASS",
        "",
        (
            "a course without exercises",
            "CLASS/source: No such file",
            lambda root: (a_class(root), shutil.rmtree(root / "CLASS" / "source")),
        ),
        ("a course without its gradebook", "gradebook.db: No such file", a_class),
        (
            "a gradebook that is another file",
            "gradebook.db: expected nbgrader's gradebook, .* found another file",
            lambda root: (a_class(root), text("CLASS/gradebook.db", "a,b\n")(root)),
        ),
        (
            "a gradebook that is another program's",
            "gradebook.db: expected nbgrader's gradebook, .* found another file",
            lambda root: (a_class(root), a_foreign_database(root / "CLASS" / "gradebook.db")),
        ),
    ),
)

EXPERIMENTS = (
    Row("an unknown device, runs", f"{TABLE1} --device abacus", "--device: expected"),
    Row("a scene that isn't there", "data index OUT --pandaset TINY --scene 002", "TINY/002"),
    Row(
        "a network of another kind to start from",
        f"{TRAIN} --from fresh.safetensors --segmenter fcn",
        "fresh.safetensors: expected a network like the one to train",
    ),
    Row("no network to start from", f"{TRAIN} --from none", "none: expected a safetensors file, found no such file"),
    Row("half a size", f"{TRAIN} --image-size 640", "--image-size: expected height x width in pixels"),
    Row("a tint that can't be", f"{TRAIN} --tint -1", "--tint: expected a share from 0 to 1"),
    Row("no results to check", "reproduce check TINY", "TINY: expected results such as table1.json, found none"),
    Row("no folder of results", "reproduce check NONE", "NONE: expected results such as table1.json, found none"),
    *rows(
        CHECK,
        "",
        ("results without counts", "table1_counts.npz: expected a file, found nothing there", a_result()),
        ("counts cut short", "table1_counts.npz: expected an npz file of arrays", a_result(b"PK\x03\x04")),
        ("counts of something else", "table1_counts.npz: expected counts that", a_result({"a": np.zeros(2)})),
        ("counts of no run", "expected the record of a run", a_result({"records.json": np.array("{}")})),
        ("counts with damaged records", "expected a JSON object", a_result({"records.json": np.array("{")})),
        ("a result without a scale", "table1.json: expected a result of", a_result({"records.json": "{}"}, "{}")),
    ),
    Row("a cache in place of a file", f"--cache architecture.json {TRAIN}", "architecture.json", frames()),
    Row(
        "a result over the weights",
        EVALUATE.replace("scores.json", "weights.safetensors"),
        "weights.safetensors: expected a new file",
    ),
    Row(
        "a result over an index",
        EVALUATE.replace("scores.json", "TINY/dataset.json"),
        "dataset.json: expected a new file",
    ),
    Row(
        "matrices over the weights",
        f"{EVALUATE} --confusions weights.safetensors",
        "--confusions: expected a file that ends in .npz",
    ),
    Row(
        "runs that another process does",
        TABLE1.replace(" --plan", ""),
        "RUNS: expected a folder that no other process",
        locked("RUNS"),
    ),
    Row("a word for the number of seeds", f"{TABLE1} --seeds many", "Invalid value for '--seeds'"),
    Row("an unknown scale", TABLE1 + " --scale galactic", "--scale: expected"),
    Row("a file in place of the runs", TABLE1.replace("RUNS", "architecture.json"), "--runs: expected a folder"),
    *rows(
        TABLE1,
        "ended.json: expected ",
        (
            "a run's record with a word for its seconds",
            "the record",
            text("RUNS/data-quickkitti/ended.json", '{"seconds": "long", "date": "x"}'),
        ),
    ),
    *(
        Row(
            f"a run's record with {seconds} seconds",
            TABLE1,
            f"ended.json: expected the record .* found {seconds.lower()}",
            text("RUNS/data-quickkitti/ended.json", f'{{"seconds": {seconds}, "date": "x"}}'),
        )
        for seconds in ("-1.0", "NaN")
    ),
    Row("1000 workers for runs", TABLE1.replace(" --plan", " --workers 1000"), "--workers: expected .*, found 1000"),
    Row("no seeds", f"{TABLE1} --seeds 0", "Invalid value for '--seeds'"),
)

# Results over what isn't ours, and what is refused before any work: every command that writes.

IN_PLACE = "architecture.json: expected a folder, found the file"

PAPERS = ("table1", "all")
"""Of the paper's experiments, which are one command, the first and all."""


def of_paper(name: str) -> tuple[Row, ...]:
    """What an experiment of the paper refuses before the first run starts."""
    command, first = f"reproduce {name} --runs RUNS --out OUT", "table1" if name == "all" else name
    return (
        Row(f"a file in place of the results of {name}", command.replace("OUT", "architecture.json"), IN_PLACE),
        Row(f"notes over which {name} would write", command, LOST, text(f"OUT/{first}.md", "my notes")),
        Row(f"a picture over which {name} would write", command, LOST, text(f"OUT/{first}.png", "a picture")),
        Row(f"a folder in place of a file of {name}", command, "found a folder", in_out(f"{first}.json")),
        Row(f"no workers for {name}", f"{command} --workers 0", "--workers: expected at least one process"),
        Row(f"too many seeds for {name}", f"{command} --seeds 1001", "Invalid value for '--seeds'"),
        Row(f"an unknown scale of {name}", f"{command} --scale none", "--scale: expected"),
    )


def in_out(name: str) -> Spoil:
    return lambda root: (root / "OUT" / name).mkdir(parents=True)


def page(name: str) -> Spoil:
    return text(f"OUT/{name}", "<p>my own page</p>")


REFUSED_FIRST = (
    *(row for name in PAPERS for row in of_paper(name)),
    Row("a page of one's own", DEMO, f"index.html: {LOST} without --force", page("index.html")),
    Row("a picture of one's own", DEMO, "overview.png: expected a new file", page("overview.png")),
    Row("a folder called index.html", DEMO, "index.html: expected a file to write", in_out("index.html")),
    Row(
        "a page of one's own, both streets",
        "demo --out OUT",
        f"simulated/index.html: {LOST}",
        page("simulated/index.html"),
    ),
    Row("frames beyond the drive", f"{DEMO} --frames 0:1000", "--frames: expected FIRST:LAST.* 0 to 2"),
    Row("frames that end before they begin", f"{DEMO} --frames 2:1", "--frames: expected FIRST:LAST"),
    Row("frames in words", f"{DEMO} --frames all", "--frames: expected FIRST:LAST"),
    Row("one frame in none", f"{DEMO} --frames ::0", "--frames: expected FIRST:LAST"),
    Row(
        "a camera without images",
        DEMO,
        "0001_sync: expected images of image_02, found none",
        lambda root: (root / DRIVE / "image_02").rename(root / DRIVE / "kept"),
    ),
    Row("a camera of no name", f"{DEMO} --camera image_09", "--camera: expected image_02 or image_03"),
    Row("scores over one's own JSON", EVALUATE, f"{LOST} without --force", text("scores.json", '{"mine": 1}')),
    Row("scores over the index", EVALUATE.replace("scores.json", "TINY/dataset.json"), LOST),
    Row("matrices over one's own arrays", f"{EVALUATE} --confusions a.npz", LOST, arrays("a.npz")),
    Row("matrices in a folder", f"{EVALUATE} --confusions a.npz", "a.npz: .*found a folder", folder("a.npz")),
    Row("curves over one's own picture", "curves RUN --out c.png", f"{LOST} without --force", text("c.png", "x")),
    Row("curves over a pipe", "curves RUN --out c.png", "c.png: .*found a pipe", pipe("c.png")),
    Row("a log of one's own, resumed", f"{TRAIN} --resume", f"log.csv: {LOST}", text("OUT/log.csv", "day,hours")),
    Row("no ImageNet weights", f"{TRAIN} --preset paper --imagenet none", "none: expected a safetensors file"),
    Row(
        "ImageNet weights for a compact network", f"{TRAIN} --imagenet fresh.safetensors", "fresh.safetensors: expected"
    ),
    Row(
        "ImageNet weights for U-Net", f"{TRAIN} --segmenter unet --imagenet a", "segmenter: expected one with published"
    ),
    Row("an index in its scene", "data index TINY/002 --pandaset TINY --scene 002", "expected a folder outside"),
    Row("an index over another", "data index TINY --pandaset NONE", "dataset.json: expected no data set yet"),
    Row("an argument to the list of data", "data list all", "unexpected extra argument"),
)

REFUSED_BY_NAME = (
    *rows(
        CARD,
        "card.json: expected ",
        ("a card that is a list", r"a JSON object, found \[1\]", text("card.json", "[1]")),
        ("a card that is a folder", "a file, found a folder", folder("card.json")),
        (
            "a card with a number for its drives",
            "learned_drives: a list of names of folders, found 3",
            text("card.json", '{"learned_drives": 3}'),
        ),
        (
            "a card with a list for its words",
            "other_streets: a text, found",
            text("card.json", '{"other_streets": [1]}'),
        ),
    ),
    Row("frames of 5000 digits", f"{DEMO} --frames 0:{'9' * 5000}", "--frames: expected FIRST:LAST"),
    Row("frames in digits of another script", f"{DEMO} --frames \u0660:\u0662", "--frames: expected FIRST:LAST"),
    Row("a size of 5000 digits", f"{TRAIN} --image-size {'9' * 5000}x2", "--image-size: expected height x width"),
    Row("an image without pixels", f"{TRAIN} --image-size 0x0", "--image-size: expected two whole numbers"),
    Row("a tint that is no number", f"{TRAIN} --tint nan", "--tint: expected a share from 0 to 1, found nan"),
    Row("a folder in place of weights", f"{DEMO} --weights TINY", "TINY: expected a safetensors file, found a folder"),
    Row("a folder in place of a reader", "demo TINY --reader RUN", "RUN: expected a Python file.*found a folder"),
    Row("a page below a file", DEMO.replace("OUT", "architecture.json/page"), "expected a folder, found the file"),
    Row("results beside a folder to be made", DEMO.replace("OUT", "no/../architecture.json"), "found the file"),
    Row("saved below a file", f"{DEMO} --save architecture.json/saved", "expected a folder, found the file"),
    Row("a page in a link to itself", DEMO.replace("OUT", "loop/page"), "found the link to nowhere", a_loop),
    Row("a page of a long name", DEMO.replace("OUT", "x" * 300), "x/index.html: File name too long"),
    Row("a tint of more than all", f"{TRAIN} --tint 2", "--tint: expected a share from 0 to 1, found 2"),
    Row("a run below a file", f"{UNPREPARED} --out architecture.json/run", "expected a folder, found the file"),
    Row("a run in a link to itself", f"{UNPREPARED} --out loop", "found the link to nowhere", a_loop),
    Row(
        "a checkpoint of another format",
        f"{UNPREPARED} --out OUT --resume",
        "checkpoint.safetensors: expected a safetensors file",
        text("OUT/checkpoint.safetensors", "my notes"),
    ),
    Row(
        "an image stage to start from",
        f"{UNPREPARED} --out OUT --from image_stage.safetensors",
        "image_stage.safetensors: expected a whole network",
    ),
    Row(
        "one file for scores and matrices",
        "evaluate --data TINY --weights weights.safetensors --out a.npz --confusions a.npz",
        "--confusions: expected another file than --out",
    ),
    Row(
        "a network of other classes",
        EVALUATE,
        "weights.safetensors: expected a network for KITTI-14, found one for SYNTHIA-10",
        header(label_set="SYNTHIA-10"),
    ),
    Row("a month that isn't there", FETCH.replace("_09_", "_13_"), "--drive: expected date and number"),
    Row(
        "a drive in digits of another script",
        FETCH.replace("2011", "\u0662\u0660\u0661\u0661"),
        "--drive: expected date and number",
    ),
    Row(
        "checksums of another format",
        FETCH,
        "registry.txt: expected lines",
        lambda root: (
            (root / "OUT/archives").mkdir(parents=True),
            (root / "OUT/archives/registry.txt").write_bytes(b"\xff"),
        ),
    ),
    Row("a scene by a path", "data index OUT --pandaset TINY --scene ../TINY/002", "--scene: expected the name"),
    Row(
        "a course's mark with a number for its lectures",
        "course build OUT",
        "semgrid_course.json: expected lectures as `course build` writes it, found 3",
        text("OUT/semgrid_course.json", '{"lectures": 3}'),
    ),
    Row(
        "a course's mark with a list of files",
        "course build OUT",
        "semgrid_course.json: expected files as `course build` writes it",
        text("OUT/semgrid_course.json", '{"files": [1]}'),
    ),
    Row(
        "a result of 10^8 seeds",
        CHECK,
        "table1.json: expected a result of",
        a_result({"records.json": "{}"}, '{"scale": "quick", "seeds": 100000000}'),
    ),
    Row("saved where the page is", f"{DEMO} --save OUT", "--save: expected a folder of its own"),
    Row("scores in a new folder, of no data", "evaluate --data no --weights no --out a/b.json", "no/dataset.json"),
    Row("curves in a new folder, of no run", "curves none --out a/b.png", "log.csv: expected the log"),
    Row("runs in a new folder, results over a file", IN_FILE, "architecture.json: expected a folder, found the file"),
)

TABLE = (*REFUSED_BY_NAME, *DRIVES, *INDEXES, *WEIGHTS, *RUNS, *DATA, *COURSE, *EXPERIMENTS, *REFUSED_FIRST)
