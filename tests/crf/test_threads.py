"""Whatever the number of threads, a compiled refinement gives the same bits.

numba fixes the largest number when it is imported, and the tests run with one. So a process of its own does it.
"""

import os
import subprocess
import sys

SCRIPT = """
import numba
import numpy as np

from semgrid_edu.crf import CrfParams
from semgrid_edu.fast import mean_field

rng, results = np.random.default_rng(0), []
unary, occupancy = 2 * rng.normal(size=(14, 31, 20)), rng.dirichlet(np.ones(4), (31, 20)).transpose(2, 0, 1)
for threads in (1, 2, 3):
    numba.set_num_threads(threads)
    results.append(mean_field(unary, occupancy, CrfParams(), 3))
print(numba.config.NUMBA_NUM_THREADS, *(np.array_equal(result, results[0]) for result in results))
"""


def test_the_number_of_threads_changes_no_bit():
    with_three = os.environ | {"NUMBA_NUM_THREADS": "3"}
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=with_three)
    assert done.stdout.split() == ["3", "True", "True", "True"]
