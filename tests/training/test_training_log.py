import resource

import pytest

from semgrid_edu.errors import DataError
from semgrid_edu.training.log import Step, append_step, begin_log, read_log

STEPS = [Step(0, "image", 0.05, 2.5), Step(1, "image", 0.025, 1.25), Step(2, "grid", 0.05, 3.0)]


@pytest.fixture
def path(tmp_path):
    begin_log(tmp_path / "log.csv", 0)
    for step in STEPS:
        append_step(tmp_path / "log.csv", step)
    return tmp_path / "log.csv"


def test_what_was_written_is_read(path):
    assert read_log(path).tolist() == [tuple(step) for step in STEPS]


def test_a_log_without_steps_is_empty(tmp_path):
    begin_log(tmp_path / "log.csv", 0)
    log = read_log(tmp_path / "log.csv")
    assert len(log) == len(log.loss) == 0


def test_going_on_drops_what_no_checkpoint_holds(path):
    with path.open("a") as log:
        log.write("3,gr")  # cut short by a kill
    begin_log(path, 2)
    assert read_log(path).loss.tolist() == [2.5, 1.25]


@pytest.mark.parametrize("content", ["", "iteration,stage,learning_rate,loss\n0,image,0.05,2.5\n1,image,0.02"])
def test_going_on_needs_the_steps_before(path, content):
    path.write_text(content)
    with pytest.raises(DataError, match=r"log.csv: expected the 2 steps that the checkpoint continues"):
        begin_log(path, 2)
    assert path.read_text() == content
    path.unlink()
    with pytest.raises(DataError, match=r"the 2 steps that the checkpoint continues, found none"):
        begin_log(path, 2)


@pytest.mark.parametrize("damage", [b"\xff\xfe", b"1,both,0,1\n0,"])
def test_going_on_from_a_damaged_log_is_refused(path, damage):
    header, first, *others = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([header, first, damage, *others]))
    with pytest.raises(DataError, match=r"log.csv: expected iteration,stage,learning_rate,loss in line 3"):
        begin_log(path, 2)


@pytest.mark.parametrize(
    "line", ["3,grid,0.05", "3,grid,0.05,x", "3,both,0.05,1", "3.5,grid,0.05,1", "", "3,grid,1,1,1"]
)
def test_a_wrong_line_is_named(path, line):
    with path.open("a") as log:
        log.write(f"{line}\n")
    with pytest.raises(DataError, match=rf"log.csv: expected iteration,.*,loss in line 5, found '{line}'"):
        read_log(path)


@pytest.mark.parametrize("content", ["", "a,b\n1,2\n", "\ufeff"])
def test_another_file_is_refused(path, content):
    path.write_text(content)
    with pytest.raises(DataError, match=r"log.csv: expected iteration,stage,learning_rate,loss in line 1"):
        read_log(path)


def test_a_full_disk_is_named(path):
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size, hard))
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            append_step(path, STEPS[0])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    assert caught.value.filename == str(path)
