"""What a student's code can't reach, on a system that can limit it; elsewhere the process says what it couldn't."""

import errno
import os
import platform
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

import semgrid_edu
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS
from semgrid_edu.workshop.course.sandbox import limits, linux, resources
from semgrid_edu.workshop.course.sandbox.limits import Limits, _all_but
from semgrid_edu.workshop.course.sandbox.process import StudentProcess
from semgrid_edu.workshop.course.sandbox.resources import has_ended, namespace_of, processes_in


@pytest.fixture
def limited(session):
    """Return a function that runs a line in a limited process, and returns the error that it raised, or its value."""

    def run(line, part):
        session.run("pass")
        if part in session.process.unlimited:
            pytest.skip(f"this system can't limit {part}")
        reply = session.run(
            f"try:\n    got = ('value', {line})\nexcept BaseException as error:\n"
            "    got = ('error', type(error).__name__)"
        )
        return session.names(["got"], session)["got"] if "error" not in reply else ("error", reply["error"]["kind"])

    return run


SECRETS = [
    str(NOTEBOOKS / "src" / "exercises" / "01_bayes.py"),
    str(NOTEBOOKS / "instructor" / "semgrid_instructor" / "bayes.py"),
    str(Path(semgrid_edu.__file__).parents[1] / "notebooks" / "README.md"),
    "/etc/shadow",
]


def test_secrets_cannot_be_read(limited):
    for path in SECRETS:
        assert limited(f"open({path!r}).read()", "files")[0] == "error"


def test_a_wheel_among_the_systems_programs_hides_its_solutions(monkeypatch):
    hidden = Path("/usr/local/lib/semgrid_edu_notebooks")
    monkeypatch.setattr(limits, "shipped_folder", lambda name: hidden if name == "notebooks" else Path("/nowhere"))
    _, read = limits._readable()
    assert Path("/usr/bin") in read
    assert not {hidden, *hidden.parents}.intersection(read)


def test_a_course_cannot_be_read_changed_or_listed(limited, tmp_path):
    (tmp_path / "gradebook.db").write_text("grades")
    for line in (
        f"open('{tmp_path}/gradebook.db').read()",
        f"open('{tmp_path}/gradebook.db', 'a').write('x')",
        f"__import__('os').listdir('{tmp_path}')",
        f"__import__('os').remove('{tmp_path}/gradebook.db')",
    ):
        assert limited(line, "files") == ("error", "PermissionError")
    assert (tmp_path / "gradebook.db").read_text() == "grades"


def test_its_folder_the_libraries_and_the_sample_drive_can_be_used(limited):
    line = "open('a', 'w').write('x') and open(__import__('shutil').copy2('a', 'b')).read()"
    assert limited(line, "files") == ("value", "x"), "although the mode of a copy can't be set"
    assert limited("__import__('scipy.ndimage').__name__", "files") == ("value", "scipy")
    line = "len(__import__('semgrid_edu.datasets.samples', fromlist=['x']).sample_drive())"
    assert limited(line, "files")[0] == "value"


def test_no_network(limited):
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = server.getsockname()
        got = limited(f"__import__('socket').create_connection({address!r}, 2).fileno()", "network")
    assert got[0] == "error"
    for kind in ("AF_INET, SOCK_DGRAM", "AF_UNIX, SOCK_STREAM", "AF_NETLINK, SOCK_RAW"):
        family, way = (f"__import__('socket').{name}" for name in kind.split(", "))
        got = limited(f"__import__('socket').socket({family}, {way}).fileno()", "network")
        assert got == ("error", "PermissionError"), kind


def test_calls_that_were_given_up_fail(session):
    calls = linux.PROCESSORS.get(platform.machine(), {"denied": {}})["denied"]
    session.run(
        "import ctypes\nlibc = ctypes.CDLL(None, use_errno=True)\ndef try_call(number):\n"
        "    ctypes.set_errno(0)\n    return libc.syscall(number, 0, 0, 0, 0, 0), ctypes.get_errno()\n"
        f"got = {{name: try_call(number) for name, number in {calls}.items()}}"
    )
    assert session.names(["got"], session)["got"] == dict.fromkeys(calls, (-1, errno.EPERM))


TOUCHES = {
    "chmod": "os.chmod({0!r}, 0o777)",
    "chmod by its folder": "h = os.open(os.path.dirname({0!r}), os.O_PATH); "
    "os.chmod(os.path.basename({0!r}), 511, dir_fd=h)",
    "chown": "os.chown({0!r}, 65534, 65534)",
    "utime": "os.utime({0!r}, (1, 1))",
    "fchmod": "os.fchmod(open({0!r}).fileno(), 0o666)",
    "attribute": "os.setxattr({0!r}, 'user.mine', b'1')",
    "truncate": "os.truncate({0!r}, 0)",
    "shell": "os.system('touch -d 1980-01-01 {0}; chmod 777 {0}')",
}


def test_modes_owners_and_dates_of_others_files_stay(limited, tmp_path):
    folder, file, library = tmp_path / "folder", tmp_path / "submitted.ipynb", Path(semgrid_edu.__file__)
    folder.mkdir()
    file.write_text("hers")
    for path, kinds in ((folder, TOUCHES), (file, TOUCHES), (library, ["fchmod"])):
        before = path.stat(), os.listxattr(path)
        for kind in kinds:
            line = f"import os; {TOUCHES[kind].format(str(path))}"
            limited(f"exec({line!r})", "modes and dates of files")
            assert (path.stat(), os.listxattr(path)) == before, f"{kind} {path}"


def test_the_superusers_capabilities_are_given_up(session):
    session.run("held = [line for line in open('/proc/self/status') if line.startswith(('CapEff', 'CapPrm'))]")
    if "modes and dates of files" in session.process.unlimited:
        pytest.skip("this system has no seccomp")
    for line in session.names(["held"], session)["held"]:
        assert int(line.split()[1], 16) in (0, 4)


def test_processes_are_limited_for_the_superuser_too(session):
    session.run("pass")
    if "processes" in session.process.unlimited:
        pytest.skip("this system can't limit processes")
    many = "import subprocess, time\nmany = [subprocess.Popen(['sleep', '60.25']) for _ in range(300)]\ntime.sleep(5)"
    session.timeout = 30
    assert session.run(many)["error"]["kind"] in ("AnswerEndedError", "BlockingIOError")
    session.stop()
    assert "60.25" not in subprocess.run(["ps", "ax"], capture_output=True, text=True, check=True).stdout


def test_busy_processes_are_limited_and_idle_ones_are_not(session):
    session.run("pass")
    if not session.process.namespace:
        pytest.skip("this system can't tell a student's processes from others")
    idle = "import subprocess, time\nidle = [subprocess.Popen(['sleep', '9']) for _ in range(40)]\ntime.sleep(1.5)"
    session.timeout = 30
    assert "error" not in session.run(idle)
    busy = "import os, time\nfor _ in range(40):\n    if os.fork() == 0:\n        while True: pass\ntime.sleep(20)"
    assert session.run(busy)["error"]["kind"] == "AnswerEndedError"


def test_sockets_and_pipes_hold_little_because_nobody_counts_what_is_in_them(session):
    """A pair of sockets with large buffers holds megabytes, and a process could have thousands of pairs."""
    fill = """
import os, socket
held, pairs = 0, []
try:
    while len(pairs) < 300:
        pairs.append(socket.socketpair())
        for one in pairs[-1]:
            one.setblocking(False)
            try: one.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 400_000)
            except PermissionError: pass
            try:
                while True: held += one.send(bytes(60_000))
            except BlockingIOError: pass
except OSError: pass
"""
    session.timeout = 60
    session.run(fill)
    if "modes and dates of files" in session.process.unlimited:
        pytest.skip("this system has no seccomp")
    assert session.names(["held"], session)["held"] < 60e6


TOGETHER = {
    "files": "for k in range(100): open(f'{k}', 'wb').write(bytes(2_000_000))",
    "many files": "for k in range(30_000): open(f'{k}', 'w')",
    "deep folders": "for k in range(3000): os.mkdir('dd'); os.chdir('dd')",
    "deleted files": """
kept = []
for k in range(20):
    kept.append(open(f"{k}", "wb"))
    os.remove(f"{k}")
    kept[-1].write(bytes(2_000_000))
    kept[-1].flush()
""",
    "deleted files, mapped": """
kept = []
for k in range(5):
    with open(f"{k}", "w+b") as file:
        file.write(bytes(9_000_000))
        kept.append(mmap.mmap(file.fileno(), 4096))
    os.remove(f"{k}")
""",
    "memory of children": """
for _ in range(4):
    if os.fork() == 0:
        kept = bytearray(b"1" * 300_000_000)
        time.sleep(60)
""",
    "shared memory": """
for _ in range(8):
    if os.fork() == 0:
        mine = mmap.mmap(-1, 200_000_000)
        for _ in range(20):
            mine.write(bytes(10_000_000))
        time.sleep(60)
""",
}
"""What a process takes with its children, each of them within its limits: 30 MB of files, 1000 MB of memory."""


@pytest.mark.parametrize("kind", TOGETHER)
def test_what_all_its_processes_use_is_limited(session, kind):
    session.run("import mmap, os, time")
    if not session.process.namespace:
        pytest.skip("this system can't tell a student's processes from others")
    session.timeout = 60  # a slow disk takes seconds for so many files
    assert session.run(f"{TOGETHER[kind]}\ntime.sleep(60)")["error"]["kind"] == "AnswerEndedError"


def test_children_within_the_limits_live_on(session):
    code = "import os, time\nif os.fork() == 0:\n    kept = bytearray(b'1' * 10**8)\n    time.sleep(3)\n    os._exit(0)"
    assert "error" not in session.run(f"{code}\nos.wait()")


HIDES_PROCESSES = {
    "a namespace": "libc.syscall({clone}, 0x10000000 | 17, 0, 0, 0, 0)",
    "a namespace by another call": "libc.syscall(435, ctypes.create_string_buffer(88), 88)",
    "not dumped": "libc.prctl(4, 0, 0, 0, 0)",
}


def test_no_process_can_hide_from_those_who_count(limited):
    denied_if = linux.PROCESSORS.get(platform.machine(), {}).get("denied_if")
    clone = denied_if["namespaces"]["call"] if denied_if else 0
    for kind, call in HIDES_PROCESSES.items():
        line = f"(ctypes := __import__('ctypes'), libc := ctypes.CDLL(None), {call.format(clone=clone)})[-1]"
        assert limited(line, "network") == ("value", -1), kind


def test_the_last_process_has_ended_when_it_is_stopped(session):
    session.run(
        "import subprocess\nmany = [subprocess.Popen(['sleep', '60.125'], start_new_session=True) for _ in range(20)]"
    )
    process = session.process
    if not process.namespace:
        pytest.skip("this system can't give a process namespaces of its own")
    assert len(processes_in(process.namespace)) >= 21
    session.stop()
    assert all(map(has_ended, processes_in(process.namespace)))
    assert "60.125" not in subprocess.run(["ps", "ax"], capture_output=True, text=True, check=True).stdout


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="this system has no /proc")
def test_a_process_that_waits_for_its_parent_has_ended():
    """Where nobody asks for the last words of orphans, as in many a container, they stay in /proc for ever."""
    with subprocess.Popen(["true"]) as child:
        place = Path(f"/proc/{child.pid}")
        os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
        assert place.exists()
        assert has_ended(place)
    assert has_ended(place)
    assert not has_ended(Path("/proc/self"))


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="this system has no /proc")
def test_a_process_whose_first_thread_alone_has_ended_goes_on():
    code = "import ctypes, threading, time\nthreading.Thread(target=time.sleep, args=(60,)).start()\n"
    with subprocess.Popen([sys.executable, "-c", code + "ctypes.CDLL(None).pthread_exit(None)"]) as child:
        place, until = Path(f"/proc/{child.pid}"), time.monotonic() + 30
        while "State:\tZ" not in (place / "status").read_text() and time.monotonic() < until:
            time.sleep(0.05)
        assert "State:\tZ" in (place / "status").read_text()
        assert not has_ended(place)
        child.kill()


def test_a_file_that_has_just_gone_hides_no_others(tmp_path, monkeypatch):
    """A folder is looked at to its end, although a file in it was deleted between its name and its size."""

    class Gone:
        def stat(self, follow_symlinks):
            raise FileNotFoundError

    @contextmanager
    def scandir(path):
        with real(path) as entries:
            yield [Gone(), *entries]

    (tmp_path / "large").write_bytes(bytes(2000))
    real = os.scandir
    monkeypatch.setattr(resources.os, "scandir", scandir)
    assert resources.exceeds_disk_limits(tmp_path, 1000)
    assert not resources.exceeds_disk_limits(tmp_path, 10**6)


def test_a_folder_that_is_closed_or_deeper_than_a_path_is_gone_afterwards(session):
    session.timeout = 20
    session.run(
        "import os\nos.mkdir('closed', 0)\nos.mkdir('seen', 0o444)\nos.symlink('/etc', 'link')\n"
        "for k in range(3000): os.mkdir('dd'); os.chdir('dd')\nopen('large', 'wb').write(bytes(10**6))"
    )
    folder = session.process.folder if session.process else None
    session.stop()
    assert folder is None or not folder.exists()


ENDS_FIRST = """
import os, sys, tempfile, threading
from semgrid_edu.workshop.course.sandbox.limits import Limits
from semgrid_edu.workshop.course.sandbox.process import StudentProcess
tempfile.tempdir = sys.argv[1]
process = StudentProcess(Limits())
threading.Timer(2, os._exit, [9]).start()
process.ask({"do": "run", "code": "__import__('subprocess').run(['sleep', '61.375'])"}, 1e12)
"""


def test_it_ends_with_a_grader_that_is_killed(session, tmp_path):
    session.run("pass")
    if not namespace_of(session.process.process.pid):
        pytest.skip("this system can't give a process namespaces of its own")
    subprocess.run([sys.executable, "-c", ENDS_FIRST, tmp_path], check=False, timeout=60)
    time.sleep(1)
    assert "61.375" not in subprocess.run(["ps", "ax"], capture_output=True, text=True, check=True).stdout


def test_the_grader_cannot_be_stopped(limited):
    seen = []
    before = signal.signal(signal.SIGUSR1, lambda *_: seen.append(1))
    limited(f"__import__('os').kill({os.getpid()}, {int(signal.SIGUSR1)})", "signals")
    limited(f"__import__('os').kill(__import__('os').getppid(), {int(signal.SIGUSR1)})", "signals")
    signal.signal(signal.SIGUSR1, before)
    assert seen == []


def test_memory_and_files_are_limited(limited):
    assert limited("bytearray(1_500_000_000)[:1]", "memory") == ("error", "MemoryError")
    assert limited("open('large', 'wb').write(bytes(20_000_000))", "written files")[0] == "error"


def test_the_folder_is_gone_afterwards_and_never_shared(tmp_path):
    prepared = tmp_path / "prepared"
    prepared.mkdir()
    (prepared / ".function-a1b2.nbi").symlink_to("gone")  # of a file that another process is writing
    first, second = (StudentProcess(Limits(), prepared) for _ in range(2))
    assert first.folder != second.folder
    for process in (first, second):
        process.stop()
        assert not process.folder.exists()


def test_who_interrupts_its_start_leaves_no_folder(prepared, tmp_path, monkeypatch):
    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(StudentProcess, "ask", interrupted)
    with pytest.raises(KeyboardInterrupt):
        StudentProcess(Limits(), prepared)
    assert list(tmp_path.iterdir()) == []


def test_all_of_a_folder_but_one_in_it(tmp_path):
    for name in ("a/hidden/deep", "a/open", "b"):
        (tmp_path / name).mkdir(parents=True)
    look, read = _all_but(tmp_path, tmp_path / "a" / "hidden")
    assert look == [tmp_path, tmp_path / "a"]
    assert sorted(read) == [tmp_path / "a" / "open", tmp_path / "b"]
    assert _all_but(tmp_path / "b", tmp_path / "a" / "hidden") == ([], [tmp_path / "b"])
    assert _all_but(tmp_path / "a" / "hidden" / "deep", tmp_path / "a" / "hidden") == ([], [])
