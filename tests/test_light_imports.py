"""What a student imports first is there at once: no deep-learning library, and no catalogue of distributions.

Lectures 01 to 05 are asked when they have run: `notebooks/conftest.py`.
"""

import subprocess
import sys

ROOMS = ("graphical", "occupancy", "planes", "crf", "plotting")


def test_no_room_loads_torch_or_scipy_stats():
    """All in one process, which then loads one of the two to show that it would be found."""
    script = f"""
import importlib, sys
for module in (*(f"semgrid_edu.{{room}}" for room in {ROOMS!r}), "scipy.stats"):
    importlib.import_module(module)
    print(module, *sys.modules.keys() & {{"torch", "scipy.stats"}})
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [*(f"semgrid_edu.{room}" for room in ROOMS), "scipy.stats scipy.stats"]


EXTRAS = ("numba", "trimesh", "embreex", "lightning_fabric", "joblib", "pandas", "pooch", "requests", "rosbags")


def test_the_core_runs_a_frame_and_writes_a_bag_without_any_optional_extra():
    """A process in which none of them can be imported: the book runs, and what is missing is said once.

    `pip install semgrid_edu[ros]` is all that `data from-bag` needs, without the simulator.
    """
    script = f"""
import sys, warnings
sys.modules.update(dict.fromkeys({EXTRAS!r}))
import semgrid_edu.workshop.bags.convert
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
