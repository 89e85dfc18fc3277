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


EXTRAS = ("numba", "trimesh", "embreex", "lightning_fabric", "joblib", "pandas", "pooch", "requests", "rosbags")


def test_the_core_runs_a_frame_without_any_optional_extra():
    """A process in which none of them can be imported: the book runs, and what is missing is said once."""
    script = f"""
import sys, warnings
sys.modules.update(dict.fromkeys({EXTRAS!r}))
import semgrid_edu as sg
drive = sg.sample_drive()
net = sg.load_net(sg.sample_weights(), drive.camera)
with warnings.catch_warnings(record=True) as told:
    warnings.simplefilter("always")
    results = list(sg.run_pipeline(drive[:2], net, sg.CmcdotParams(n_particles=1000)))
print(len(results), [str(one.message) for one in told if "numba" in str(one.message)])
try:
    sg.fast.mean_field
except ImportError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    ran, missing = done.stdout.splitlines()
    assert ran.startswith("2 ['numba is missing, so the slower readable stages run: pip install")
    assert ran.count("numba is missing") == 1
    assert missing == "numba isn't installed: pip install 'semgrid_edu[fast]'"


def test_a_bag_is_written_without_the_simulator():
    """`pip install semgrid_edu[ros]` is all that `data from-bag` needs."""
    script = f"import sys; sys.modules.update(dict.fromkeys({EXTRAS!r})); import semgrid_edu.workshop.bags.convert"
    subprocess.run([sys.executable, "-c", script], check=True)


def test_what_is_loaded_is_found():
    assert loaded("import torch") >= {"torch"}
