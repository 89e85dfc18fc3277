"""Let numba compile the functions of the filter, the CRF and the simulator, which takes about a minute of two cores.

numba compiles a function when it is first called, and keeps the result beside the module. Three test processes and a
student's process that begin without it would each compile the same functions. So make.py runs this once for each clone.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np


def filters_and_simulator() -> None:
    """Track two frames of the shipped drive, and simulate two others."""
    from semgrid_edu.datasets.samples import sample_drive
    from semgrid_edu.fast import track_drive
    from semgrid_edu.grid import GridSpec
    from semgrid_edu.workshop.simulation.datasets import DatasetRecipe, Route, make_from_recipe

    spec, drive = GridSpec(0, 32, -8, 8, 1.0), sample_drive()
    list(track_drive([drive[0], drive[1]], spec))
    with tempfile.TemporaryDirectory() as folder:
        recipe = DatasetRecipe("small", "KITTI-14", (Route("test", 2, every=2),))
        make_from_recipe(recipe, Path(folder), seed=0, workers=1)


def refinement() -> None:
    """Refine a small map."""
    from semgrid_edu.crf import CrfParams
    from semgrid_edu.fast import mean_field

    rng = np.random.default_rng(0)
    unary = rng.random((14, 8, 6), np.float32)
    occupancy = np.moveaxis(rng.dirichlet(np.ones(4), (8, 6)), 2, 0).astype(np.float32).copy()
    mean_field(unary, occupancy, CrfParams())


PARTS = {part.__name__: part for part in (filters_and_simulator, refinement)}
"""What is compiled in a process of its own each: they take about the same time, and share no module."""


def compile_all() -> int:
    """Run all parts side by side; return 1, and show what they said, when one of them fails."""
    command = [sys.executable, __file__]
    running = [subprocess.Popen([*command, part], stderr=subprocess.PIPE, text=True) for part in PARTS]
    said = [process.communicate()[1] for process in running]
    failed = [text for process, text in zip(running, said, strict=True) if process.returncode]
    print("".join(failed), end="", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(PARTS[sys.argv[1]]() if sys.argv[1:] else compile_all())
