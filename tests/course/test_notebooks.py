"""Reading, executing and checking notebooks, on a lecture of a few lines."""

import asyncio
import time

import nbformat
import pytest
import zmq
import zmq.asyncio
from jupyter_client.session import Session

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.workshop.course import checks
from semgrid_edu.workshop.course.notebooks.build import (
    WakefulChannel,
    build_lecture,
    execute,
    lecture_sources,
    named,
    read_percent,
)

LECTURE = """\
# %% [markdown]
# # A lecture

# %% tags=["two"]
print(1 + 1)

# %%
print(1 + 1)
"""


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "src" / "00_tiny.py"
    path.parent.mkdir()
    path.write_text(LECTURE)
    return path


@pytest.fixture
def only_run_problems(monkeypatch):
    monkeypatch.setattr(checks, "LECTURE_PARTS", {})


def test_conversion_is_the_same_each_time_and_ids_differ(source):
    first, second = read_percent(source), read_percent(source)
    assert first == second
    assert len({cell.id for cell in first.cells}) == 3
    assert first.cells[1].metadata == {"tags": ["two"]}


def test_editing_one_cell_leaves_the_ids_of_the_others(source):
    before = [cell.id for cell in read_percent(source).cells]
    source.write_text(LECTURE.replace("# A lecture", "# Another lecture"))
    after = [cell.id for cell in read_percent(source).cells]
    assert [a == b for a, b in zip(after, before, strict=True)] == [False, True, True]


def test_missing_source_is_named(tmp_path):
    with pytest.raises(DataError, match=r"00_none\.py"):
        read_percent(tmp_path / "00_none.py")
    with pytest.raises(DataError, match="lectures named"):
        lecture_sources(tmp_path)


def test_sources_are_chosen_by_name(source):
    assert named([source], None) == named([source], ["00_tiny"]) == [source]
    with pytest.raises(ArgumentError, match="00_tiny"):
        named([source], ["00_huge"])


def test_executed_lecture_keeps_outputs_and_nothing_of_this_machine(source, only_run_problems):
    path = build_lecture(source)
    notebook = nbformat.read(path, as_version=4)
    assert [cell.outputs[0].text for cell in notebook.cells[1:]] == ["2\n", "2\n"]
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert notebook.metadata.language_info == {"name": "python"}
    assert str(path.parent) not in path.read_text()
    assert checks.lecture_problems(source) == []
    assert build_lecture(source).read_bytes() == path.read_bytes()


def test_what_a_cell_prints_in_parts_is_one_output_and_stays_in_its_place(source):
    prints = "import time\nprint('a', end='', flush=True)\ntime.sleep(0.5)\nprint('b')\ndisplay(1)\nprint('c')"
    source.write_text(f"# %%\n{prints}\n")
    (cell,) = execute(read_percent(source), source.parent).cells
    assert [output.get("text") for output in cell.outputs] == ["ab\n", None, "c\n"]


def run(source, change):
    """Pretend to have run a lecture, change it, and return what the check says."""
    notebook = read_percent(source)
    for number, cell in enumerate(notebook.cells[1:], start=1):
        cell.execution_count = number
        cell.outputs = [nbformat.v4.new_output("stream", name="stdout", text="2\n")]
    change(notebook)
    nbformat.write(notebook, source.parents[1] / "00_tiny.ipynb")
    return checks.lecture_problems(source)


def set_source(number, text):
    return lambda notebook: notebook.cells[number].update(source=text)


def set_output(**fields):
    return lambda notebook: notebook.cells[1].update(outputs=[nbformat.v4.new_output(**fields)])


CHANGES = {
    "differs from src/00_tiny.py": set_source(1, "print(2)"),
    "links to nowhere.ipynb": set_source(0, "[there](nowhere.ipynb)"),
    "has 30 lines, more than 25": set_source(1, "pass\n" * 30),
    "names a path of one machine: /home/": set_source(1, "open('/home/me/x')"),
    "execution count None": lambda notebook: notebook.cells[2].update(execution_count=None),
    "ends in an error: ValueError: no": set_output(output_type="error", ename="ValueError", evalue="no"),
    "writes to stderr: Warning": set_output(output_type="stream", name="stderr", text="Warning\n"),
    "prints the address": set_output(output_type="stream", name="stdout", text="<Line2D at 0x7f00aa11bb22>\n"),
    "MB, more than": set_output(output_type="stream", name="stdout", text="x" * 2_100_000),
}


@pytest.mark.parametrize("problem", CHANGES)
def test_each_flaw_is_found(source, only_run_problems, problem):
    assert run(source, lambda notebook: None) == []
    found = run(source, CHANGES[problem])
    assert any(problem in line for line in found), found


def test_missing_parts_of_a_lecture_are_named(source):
    found = checks.lecture_problems(source)
    assert "00_tiny.ipynb: lacks a failure" in found
    assert "00_tiny.ipynb: not built; run `semgrid-edu course notebooks`" in found


def test_a_reply_whose_announcement_was_used_up_is_read_all_the_same():
    """What a raw send does to the socket on which nbclient waits, done on purpose."""

    async def wait_for_reply():
        with zmq.asyncio.Context() as context, context.socket(zmq.DEALER) as ours, context.socket(zmq.DEALER) as theirs:
            theirs.connect(f"tcp://127.0.0.1:{ours.bind_to_random_port('tcp://127.0.0.1')}")
            session = Session()
            waiting = asyncio.create_task(WakefulChannel(ours, session).get_msg(timeout=20))
            await asyncio.sleep(0.2)
            session.send(zmq.Socket.shadow(theirs.underlying), "execute_reply", {"status": "ok"})
            time.sleep(0.5)  # the loop must not see the announcement first
            zmq.Socket.shadow(ours.underlying).getsockopt(zmq.EVENTS)  # uses it up, as sending does
            began = time.monotonic()
            reply = await waiting
            return reply["content"], time.monotonic() - began

    content, seconds = asyncio.run(wait_for_reply())
    assert content == {"status": "ok"}
    assert seconds < 10  # a single wait of 20 seconds would end with its timeout
