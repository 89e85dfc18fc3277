"""What a student imports first is there at once: no deep-learning library, and no catalogue of distributions.

Lectures 01 to 05 are asked when they have run: `notebooks/conftest.py`.
"""

import subprocess
import sys

import pytest

ROOMS = ("graphical", "occupancy", "crf", "plotting")


def loaded(statements: str) -> set[str]:
    """Run import statements in a process of their own; return which heavy modules that loads."""
    script = f"{statements}\nimport sys\nprint(*sys.modules.keys() & {{'torch', 'scipy.stats'}})"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_loads_neither_torch_nor_scipy_stats(room):
    assert loaded(f"import semgrid_edu.{room}") == set()


def test_what_is_loaded_is_found():
    assert loaded("import torch") >= {"torch"}
