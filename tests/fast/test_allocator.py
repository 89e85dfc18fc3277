import subprocess
import sys

import pytest

CODE = """
import resource
import numpy as np
from semgrid_edu.fast.allocator import keep_freed_memory


def pages_touched_anew(buffers):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(buffers):
        np.ones(2**23)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


print(pages_touched_anew(5))
keep_freed_memory()
pages_touched_anew(5)  # the heap has to grow first
print(pages_touched_anew(5))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems' allocators are left as they are")
def test_freed_buffers_are_used_again():
    """Five buffers of 64 MB are 81,920 pages of 4 kB, or 160 of 2 MB. In a process of its own: it can't be undone."""
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    handed_back, kept = map(int, done.stdout.split())
    assert handed_back >= 160
    assert kept < 100
