"""Rights that a Linux process gives up for good: to all files except some (Landlock), to some system calls (seccomp).

Landlock needs kernel 5.13: landlock(7). Seccomp's filter is a small program for the kernel: seccomp(2), bpf(2).
"""

import ctypes
import errno
import os
import platform
import struct
import sys
from collections.abc import Iterable
from pathlib import Path

from semgrid_edu.storage.files import table_beside

LIBRARY = ctypes.CDLL(None, use_errno=True) if sys.platform == "linux" else None
"""The C library, looked up once: in a process that has loaded torch, a look-up takes milliseconds."""

NO_NEW_PRIVILEGES = 38
"""The prctl option that the kernel requires before Landlock and seccomp."""

CREATE, ADD, RESTRICT = 444, 445, 446
"""Numbers of Landlock's three system calls, the same on every processor."""

EXECUTE, READ_FILE, READ_DIR, TRUNCATE, DEVICE_CONTROL = 1 << 0, 1 << 2, 1 << 3, 1 << 14, 1 << 15
READ = EXECUTE | READ_FILE | READ_DIR
"""The rights to files and folders that may only be read."""

OF_FILES = EXECUTE | 1 << 1 | READ_FILE | TRUNCATE | DEVICE_CONTROL
"""The rights that a single file can have; the others belong to folders."""

FILE_RIGHTS = {1: (1 << 13) - 1, 2: (1 << 14) - 1, 3: (1 << 15) - 1, 4: (1 << 15) - 1, 5: (1 << 16) - 1}
"""All rights to files by version of Landlock; later versions have those of version 5."""

PROCESSORS = table_beside(__file__)
"""By processor: the code of its native calls ("audit"), and the calls that seccomp denies or ignores, by name."""

NEWER = 467
"""System calls with this number or a higher one fail with ENOSYS. x86_64 repeats all calls from 2^30 on, so a filter
by number alone could be bypassed."""

LOAD, EQUAL, AT_LEAST, ANY_BIT, RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
"""The five instructions of the filter: load a word, compare it in three ways, and end."""

NUMBER, ARCHITECTURE, FIRST = 0, 4, 16
"""Offsets of the number of a call, its processor, and the low word of its first argument in struct seccomp_data."""

ALLOW, IDLE, DENY, UNKNOWN = 0x7FFF0000, 0x00050000, 0x00050000 | errno.EPERM, 0x00050000 | errno.ENOSYS
"""The filter's verdicts: do it, do nothing and report success, or fail."""

SET_SECCOMP, FILTER = 22, 2
"""Arguments of prctl."""

CAPABILITIES, READ_ANY = 0x20080522, 1 << 2
"""The version of capset's arguments, and the one capability that root keeps: Python may belong to another user."""


def landlock_version() -> int:
    """Return the kernel's version of Landlock; 0 without it, and on other systems."""
    # On other systems this number is another call.
    if sys.platform != "linux":
        return 0
    try:
        return max(_call(CREATE, None, 0, 1), 0)
    except OSError:
        return 0


def give_up_files(look: Iterable[Path], read: Iterable[Path], write: Iterable[Path]) -> list[str]:
    """Give up all other files, and TCP and signals to other processes if Landlock supports that.

    Parameters
    ----------
    look : iterable of Path
        Folders that may be listed, with the folders below; the files in them can't be opened.
    read : iterable of Path
        Files and folders that may be read and executed, with everything in them. Missing ones are ignored.
    write : iterable of Path
        Folders and devices to which everything is allowed.

    Returns
    -------
    list of str
        What was given up: of "files", "network" and "signals".

    Raises
    ------
    OSError
        When the kernel doesn't allow it.
    """
    known = landlock_version()
    files = FILE_RIGHTS[min(known, 5)]
    attributes = struct.pack("QQQ", files, 3 if known >= 4 else 0, 3 if known >= 6 else 0)
    rules = _call(CREATE, attributes, 8 if known < 4 else 16 if known < 6 else 24, 0)
    for rights, paths in ((READ_DIR, look), (READ, read), (files, write)):
        for path in filter(Path.exists, paths):
            _allow(rules, path, rights & files)
    LIBRARY.prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    _call(RESTRICT, rules, 0)
    os.close(rules)
    return ["files", *(["network"] if known >= 4 else []), *(["signals"] if known >= 6 else [])]


def _allow(rules: int, path: Path, rights: int) -> None:
    """Add a rule for a path and everything below it."""
    handle = os.open(path, os.O_PATH)
    try:
        _call(ADD, rules, 1, struct.pack("=Qi", rights if path.is_dir() else rights & OF_FILES, handle), 0)
    finally:
        os.close(handle)


def _call(number: int, *arguments: bytes | int | None) -> int:
    """Make a system call; raise OSError if it fails."""
    passed = [ctypes.c_long(one) if isinstance(one, int) else one for one in arguments]
    result = LIBRARY.syscall(ctypes.c_long(number), *passed)
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result


def give_up_calls() -> bool:
    """Give up the system calls of `linux.toml`, and all capabilities; return False if that isn't possible."""
    machine = platform.machine()
    if sys.platform != "linux" or machine not in PROCESSORS:
        return False
    code = _filter(**PROCESSORS[machine])
    program = ctypes.create_string_buffer(code)
    # struct sock_fprog: the number of instructions, and where they are.
    described = struct.pack("HP", len(code) // 8, ctypes.addressof(program))
    LIBRARY.prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    for kept in (READ_ANY, 0):  # root in Docker doesn't have the first
        if LIBRARY.capset(struct.pack("Ii", CAPABILITIES, 0), struct.pack("6I", kept, kept, 0, 0, 0, 0)) == 0:
            break
    return LIBRARY.prctl(SET_SECCOMP, FILTER, described, 0, 0) == 0


def _filter(audit: int, denied: dict[str, int], unknown: dict, idle: dict, denied_if: dict) -> bytes:
    """Return the filter's instructions: a code, how many to skip if it is true and if it is not, and a number."""
    lines = [(LOAD, 0, 0, ARCHITECTURE), (EQUAL, 1, 0, audit), (RETURN, 0, 0, DENY), (LOAD, 0, 0, NUMBER)]
    lines += [(AT_LEAST, 0, 1, NEWER), (RETURN, 0, 0, UNKNOWN)]
    for calls, verdict in ((denied, DENY), (unknown, UNKNOWN), (idle, IDLE)):
        for number in calls.values():
            lines += [(EQUAL, 0, 1, number), (RETURN, 0, 0, verdict)]
    for call in denied_if.values():
        compare = ANY_BIT if "bits" in call else EQUAL
        lines += [(EQUAL, 0, 4, call["call"]), (LOAD, 0, 0, FIRST), (compare, 0, 1, call.get("bits") or call["value"])]
        lines += [(RETURN, 0, 0, DENY), (LOAD, 0, 0, NUMBER)]
    return b"".join(struct.pack("HBBI", *line) for line in [*lines, (RETURN, 0, 0, ALLOW)])
