"""Seccomp: a Linux process gives up, for good, system calls by their numbers (seccomp(2), bpf(2))."""

import ctypes
import errno
import platform
import struct
import sys

NUMBERS = {
    "x86_64": {
        **{"socket": 41, "shmget": 29, "semget": 64, "msgget": 68, "ptrace": 101, "mount": 165, "mq_open": 240},
        **{"add_key": 248, "request_key": 249, "keyctl": 250, "unshare": 272, "perf_event_open": 298, "setns": 308},
        **{"memfd_create": 319, "bpf": 321, "userfaultfd": 323},
    },
    "aarch64": {
        **{"socket": 198, "shmget": 194, "semget": 190, "msgget": 186, "ptrace": 117, "mount": 40, "mq_open": 180},
        **{"add_key": 217, "request_key": 218, "keyctl": 219, "unshare": 97, "perf_event_open": 241, "setns": 268},
        **{"memfd_create": 279, "bpf": 280, "userfaultfd": 282},
    },
}
"""The calls that are given up, by processor: they reach other processes, outlive this one, or hide what it takes."""

EVERYWHERE = (425, 426, 427)
"""io_uring_setup, io_uring_enter and io_uring_register: the same on every processor."""

AUDIT = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}
"""The numbers of the processors' own calls; those of another kind, such as 32-bit ones, are all refused."""

LOAD, EQUAL, AT_LEAST, RETURN = 0x20, 0x15, 0x35, 0x06
"""The four instructions of the filter: load a word, two that compare it, and end."""

ALLOW, REFUSE = 0x7FFF0000, 0x00050000 | errno.EPERM
"""What the filter can say."""

NO_NEW_PRIVILEGES, SET_SECCOMP, FILTER = 38, 22, 2
"""Arguments of prctl."""


def refuse_calls() -> bool:
    """Give up the system calls of `NUMBERS`; False where that isn't possible."""
    machine = platform.machine()
    if sys.platform != "linux" or machine not in NUMBERS:
        return False
    code = _filter(AUDIT[machine], [*NUMBERS[machine].values(), *EVERYWHERE])
    program = ctypes.create_string_buffer(code)
    # struct sock_fprog: the number of instructions, and where they are.
    described = struct.pack("HP", len(code) // 8, ctypes.addressof(program))
    library = ctypes.CDLL(None)
    library.prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    return library.prctl(SET_SECCOMP, FILTER, described, 0, 0) == 0


def _filter(audit: int, refused: list[int]) -> bytes:
    """Return the filter's instructions: what they do, how many to skip if it is so and if not, and their number."""
    lines = [(LOAD, 0, 0, 4), (EQUAL, 1, 0, audit), (RETURN, 0, 0, REFUSE), (LOAD, 0, 0, 0)]
    # From 2^30 on, x86_64 has its calls once more, under other numbers.
    lines += [(AT_LEAST, 0, 1, 1 << 30), (RETURN, 0, 0, REFUSE)]
    for number in refused:
        lines += [(EQUAL, 0, 1, number), (RETURN, 0, 0, REFUSE)]
    return b"".join(struct.pack("HBBI", *line) for line in [*lines, (RETURN, 0, 0, ALLOW)])
