import subprocess
import sys

import pytest

CODE = """
import resource
import torch
from semgrid_edu.memory import keep_freed_memory

if {keep}:
    keep_freed_memory()
for _ in range(20):  # blocks of the heap have to find their places first
    torch.ones(2**25)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(5):
    torch.ones(2**25)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def _pages_touched_anew(keep):
    done = subprocess.run([sys.executable, "-c", CODE.format(keep=keep)], capture_output=True, text=True, check=True)
    return int(done.stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems' allocators are left as they are")
def test_freed_buffers_are_used_again():
    """Five buffers of 128 MB are 163,840 pages of 4 kB, or 320 of 2 MB."""
    assert _pages_touched_anew(keep=True) < 100
    assert _pages_touched_anew(keep=False) >= 320
