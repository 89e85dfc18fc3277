"""A student's process: calls look as if they were made here, and nothing that it does stops the next call."""

import math
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from semgrid_edu.workshop.course.sandbox import process as process_module
from semgrid_edu.workshop.course.sandbox.limits import Limits
from semgrid_edu.workshop.course.sandbox.process import StudentProcess
from semgrid_edu.workshop.course.sandbox.session import (
    AnswerEndedError,
    AnswerError,
)


def test_cells_share_names_and_display(harmless):
    assert harmless.run("import math\nx = 3\nprint('seen')\nx")["streams"]["stdout"].startswith("seen")
    shown = harmless.run("from IPython.display import display\ndisplay(x + 1)")["shown"]
    assert shown == [{"text/plain": "4"}]
    assert harmless.names(["x", "missing"], harmless) == {"x": 3}
    assert "error" not in harmless.run("!echo 1\nx = 1")
    harmless.run("%matplotlib inline\nvalue = await __import__('asyncio').sleep(0, 5)")
    assert harmless.names(["value"], harmless) == {"value": 5}
    figure = harmless.run("import matplotlib.pyplot as plt\nplt.plot([1, 2])\nplt.show()")
    assert "image/png" in figure["shown"][0]


def test_too_many_pictures_are_left_out(harmless):
    reply = harmless.run("from IPython.display import HTML, display\nfor _ in range(9): display(HTML('x' * 10**6))")
    assert "error" not in reply
    assert 1 <= len(reply["shown"]) < 9


def test_no_reply_names_what_was_not_asked_for(session):
    session.run(
        "import __main__\nf = 1\n"
        "__main__.Worker.names = lambda self, wanted: "
        "{'functions': [*wanted, 'isinstance'], 'values': {'np': 1, 'answer_array': 2}}"
    )
    assert set(session.names(["f"], session)) == {"f"}


def test_only_the_students_own_time_counts(session, hostile_answer):
    assert session.left_in_all <= 20 * session.timeout
    session.timeout = 1
    f = hostile_answer("def f():\n    return 1")
    session.begin()
    time.sleep(1.2)
    assert f() == 1
    session.left_in_all = 0.3
    assert session.run("while True: pass")["error"]["kind"] == "AnswerTimeoutError" or session.left_in_all <= 0
    assert "used up their time" in session.run("x = 1")["error"]["message"], "all cells together have a limit"


def test_what_the_grader_does_for_an_answer_comes_to_an_end():
    """Even where it is one call that Python can't interrupt: the process ends, as `test_pool` knows it."""
    code = "from semgrid_edu.workshop.course.sandbox import session\nsession.GRADERS_TIME = 0\n"
    code += "session.Session(None, 0.2)\n10**10**9"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 1


def test_a_call_returns_values_and_changes_arguments(answer):
    f = answer("def f(a, b=1, *, c):\n    a += b\n    return a * c, {'b': b}, float('nan')")
    array = np.ones(3)
    result, named, nan = f(array, c=np.float32(2))
    np.testing.assert_array_equal(array, [2, 2, 2])
    np.testing.assert_array_equal(result, [4, 4, 4])
    assert named == {"b": 1}
    assert math.isnan(nan)
    assert f.__name__ == "f"


def test_a_function_that_is_given_works_here(answer):
    kernel, calls = np.array([[1.0, 2], [3, 4]]), []

    def blur(values, /, twice=False):
        calls.append(values)
        return kernel @ values * (2 if twice else 1)

    f = answer("def f(blur, Q):\n    return blur(Q) + blur(Q, twice=True)")
    np.testing.assert_allclose(f(blur, np.ones(2)), [9, 21])
    assert len(calls) == 2


def test_arguments_beside_a_function_are_changed_too(answer):
    f, given, array = answer("def f(g, a, *, h):\n    a *= 2"), [abs], np.ones(2)
    f(given, array, h=len)
    np.testing.assert_array_equal(array, [2, 2])
    assert given == [abs]


def test_in_changed_arguments_nan_replaces_what_cannot_be_sent(answer):
    f = answer(
        "class Mine: pass\ndef f(values, table, array):\n    values[1], table['n'] = Mine(), iter([])\n    array += 1"
    )
    values, table, array = [1, 2, [3]], {"n": 0, "m": (1,)}, np.zeros(2)
    f(values, table, array)
    np.testing.assert_equal((values, table), ([1, math.nan, [3]], {"n": math.nan, "m": (1,)}))
    np.testing.assert_array_equal(array, [1, 1])


def test_images_that_became_floats_come_back(answer):
    frames = [{"image": np.ones((800, 1200), np.uint8)} for _ in range(5)]
    f = answer("def f(frames):\n    for frame in frames:\n        frame['image'] = frame['image'] / 255\n    return 1")
    assert f(frames) == 1
    assert all(frame["image"].dtype == float for frame in frames)


def test_a_given_function_gets_no_larger_arguments_than_a_result(hostile_answer, monkeypatch):
    monkeypatch.setattr(process_module, "MAX_REPLY", 1000)
    calls, f = [], hostile_answer("def f(g, n):\n    return g([0] * n)")
    assert f(lambda x: calls.append(len(x)), 10) is None
    with pytest.raises(AnswerEndedError):
        f(lambda x: calls.append(len(x)), 1000)
    assert calls == [10]


def test_an_error_of_a_given_function_reaches_the_answer(answer):
    f = answer("def f(g):\n    try:\n        g()\n    except ValueError as error:\n        return str(error)")
    assert "ZeroDivisionError" in f(lambda: 1 / 0)
    assert "more than can be sent" in f(lambda: np.ones(2_000_000)), "and the next call gets its reply"
    assert len(f(lambda: {}["x" * 20_000_000])) < 2000


@pytest.mark.parametrize(
    ("code", "kind", "says"),
    [
        ("raise IndexError('7')", IndexError, "7"),
        ("return {}['key']", KeyError, "key"),
        ("class Mine(ValueError): pass\n    raise Mine('mine')", ValueError, "mine"),
        ("class Mine(Exception): pass\n    raise Mine('mine')", AnswerError, "Mine: mine"),
        ("b'x'.decode('ascii', 'none'); '\\xff'.encode('ascii')", AnswerError, "UnicodeEncodeError"),
        ("exit()", AnswerError, "SystemExit"),
        ("raise KeyboardInterrupt", AnswerError, "KeyboardInterrupt"),
        ("return object()", TypeError, "a object where numbers"),
        ("return f()", RecursionError, "recursion"),
        ("raise StopIteration('ends loops')", AnswerError, "StopIteration"),
        ("return bytearray(10**10)", MemoryError, "bytearray"),
    ],
)
def test_errors_come_back_as_what_they_are(answer, code, kind, says):
    f = answer(f"def f():\n    {code}")
    with pytest.raises(kind, match=says):
        f()


def test_an_error_names_its_line(answer):
    f = answer("def f(x):\n    y = x\n    return y[9]")
    with pytest.raises(IndexError) as caught:
        f([1])
    assert caught.value.__notes__ == ["in your line: return y[9]"]


def test_where_inputs_are_secret_an_error_reports_its_line_alone(session, hostile_answer):
    session.secret = True
    f = hostile_answer("def f(x):\n    raise ValueError(f'hidden: {x}')")
    with pytest.raises(ValueError, match=r"^an error in line 2$") as caught:
        f(123)
    assert not hasattr(caught.value, "__notes__")


TELLING = {
    "a line of a table": "# <9319>\ndef f(x):\n    import linecache\n"
    "    linecache.getline = lambda *a: f'<{x}>'\n    [][x]",
    "a class": "def f(x):\n    raise type(f'cells_{x}', (Exception,), {})(x)",
    "a class that can't be made": "def f(x):\n"
    "    raise type(f'c{x}', (UnicodeDecodeError,), {})('ascii', b'', 0, 1, str(x))",
    "a line number of its own": "def f(x):\n    exec(compile('\\n' * x + 'raise ValueError', '<ipython-1', 'exec'))",
    "a line of many": "\n" * 10_000
    + "def f(x):\n    exec(compile('\\n' * x + 'raise ValueError', '<ipython-1', 'exec'))",
}


def test_no_error_tells_a_secret_input(session, hostile_answer):
    for code in TELLING.values():
        session.secret = False
        f = hostile_answer(code)
        session.secret = True
        with pytest.raises(Exception, match=r"^an error") as caught:
            f(9319)
        assert "9319" not in f"{caught.value} {type(caught.value)}"
        assert "9320" not in str(caught.value)


def test_an_error_of_a_students_class_is_not_the_graders(session):
    reply = session.run("class AnswerEndedError(Exception): pass\nraise AnswerEndedError('full points')")
    assert (reply["error"]["kind"], session.ended) == ("AnswerEndedError", "")
    session.run("import os; os._exit(0)")
    assert session.ended.startswith("Python itself ended here")


def test_a_pool_of_processes_fails_with_a_sentence(session):
    if "files" in session.run("1") or "files" in session.process.unlimited:
        pytest.skip("this system can't limit files")
    error = session.run("import multiprocessing\nmultiprocessing.Pool(2)")["error"]
    assert "not allowed where answers are graded: pools of processes" in error["message"]


def test_a_cell_that_ends_the_process_is_left_out_when_the_others_run_again(session):
    session.run("x = [1]")
    assert session.run("import os; os._exit(0)")["error"]["kind"] == "AnswerEndedError"
    session.run("x.append(2)")
    assert session.names(["x"], session) == {"x": [1, 2]}
    assert "error" in session.run("a = 1\nraise SystemExit"), "which ends this cell alone"
    session.run("quit()")
    assert session.names(["a"], session) == {"a": 1}


def test_what_an_answer_prints_is_kept_for_its_author(harmless, answer):
    harmless.printed = ""
    answer("def f():\n    print('here')")()
    assert harmless.printed == "here\n"


HIDES = {
    "numpy": "import numpy as np\ndef f(n):\n    return float(np.ones(n, 'f4').sum())",
    "torch": "import torch\ndef f(n):\n    return float(torch.ones(n).sum())",
    "mapped to a file": "import numpy as np\ndef f(n):\n"
    "    return float(np.memmap('file', 'f4', 'w+', shape=n + 1).__iadd__(1)[:n].sum())",
    "shared": "import mmap, numpy as np\ndef f(n):\n    kept = np.frombuffer(mmap.mmap(-1, 4 * n + 4), 'f4')[:n]\n"
    "    kept += 1\n    return float(kept.sum())",
    "in a child": "import numpy as np, os, time\ndef f(n):\n    read, write = os.pipe()\n    if os.fork() == 0:\n"
    "        kept = np.ones(n, 'f4'); time.sleep(0.3); os.write(write, str(kept.sum()).encode()); os._exit(0)\n"
    "    os.wait()\n    return float(os.read(read, 99))",
    "in a file": "import numpy as np\ndef f(n):\n    with open('kept', 'wb') as file:\n        for k in range(8):\n"
    "            file.write(np.ones(n // 8, 'f4').tobytes())\n    return float(sum(map(np.sum, read(n))))\n"
    "def read(n):\n    with open('kept', 'rb') as file:\n        while part := file.read(n // 2 + 4):\n"
    "            yield np.frombuffer(part[: len(part) // 4 * 4], 'f4')",
    "in a deleted file": "import numpy as np, os, time\ndef f(n):\n    with open('kept', 'wb') as file:\n"
    "        os.remove('kept')\n        for k in range(8):\n            file.write(np.ones(n // 8, 'f4').tobytes())\n"
    "        file.flush()\n        time.sleep(0.1)\n    return n",
    "in numbers of Python": "def f(n):\n    return len([1.5] * (n // 2)) * 2",
}


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="only Linux reports a process's memory")
@pytest.mark.parametrize("kind", HIDES)
def test_memory_is_measured_from_outside(session, hostile_answer, prepared, kind):
    session.start, session.timeout = lambda: StudentProcess(Limits(memory=1000, written=100), prepared), 60
    f = hostile_answer(HIDES[kind])
    f(10)
    result, megabytes = f.peak_megabytes(10_000_000)
    assert result == 10_000_000
    assert 38 <= megabytes < 60
    assert 38 <= f.peak_megabytes(10_000_000)[1] < 60, "although it was freed a moment ago"
    assert f.peak_megabytes(10)[1] < 5


def test_a_first_call_is_not_measured(answer):
    """A function that is compiled takes far more memory then."""
    f = answer("kept = []\ndef f(a):\n    kept or kept.append(bytes(b'1' * 10**8))\n    return a")
    assert f.peak_megabytes(np.arange(3.0))[1] < 5


def test_the_measured_call_cannot_be_foreseen(answer):
    """Else its result could be worked out before, with all the memory of the world."""
    f = answer("seen = []\ndef f(*arguments):\n    seen.append(arguments)\n    return seen[-2:]")
    a, b = np.arange(100.0).reshape(4, 25), np.arange(25) % 2 == 1
    (warm_a, warm_b), _ = f.peak_megabytes(a, b)[0]
    assert not any(np.array_equal(warm_a, one) for one in (a, np.flip(a), a[::-1], a[:, ::-1]))
    np.testing.assert_array_equal(warm_a[0] % 25 % 2 == 1, warm_b)  # columns of both go together


def test_a_child_is_not_measured_in_place_of_the_worker(hostile_answer, monkeypatch):
    monkeypatch.setattr(process_module, "_can_unshare", lambda: False)
    f = hostile_answer(
        "import numpy as np, subprocess\nchild = subprocess.Popen(['sleep', '9'])\n"
        "def f(n):\n    return float(np.ones(n, 'f4').sum())"
    )
    assert f.peak_megabytes(10_000_000)[1] >= 38


def test_cells_that_wait_run_before_the_first_call(session):
    session.run_later("def f():\n    return x")
    session.run_later("x = 4")
    assert session.process is None
    assert session.call("f", (), {}) == 4
