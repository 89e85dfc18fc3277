"""What a student imports first is there at once: no deep-learning library, and no catalogue of distributions."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).parents[1] / "notebooks" / "src"
LECTURES = ("01_bayes", "02_grids", "03_bof", "04_cmcdot", "05_pixels")
ROOMS = ("graphical", "occupancy", "crf", "plotting")


def loaded(statements: str) -> set[str]:
    """Run import statements in a process of their own; return which heavy modules that loads."""
    script = f"{statements}\nimport sys\nprint(*sys.modules.keys() & {{'torch', 'scipy.stats'}})"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def imports_of(lecture: str) -> str:
    """The import statements of a lecture."""
    tree = ast.parse((NOTEBOOKS / f"{lecture}.py").read_text(encoding="utf-8"))
    return "\n".join(ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom))


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_loads_neither_torch_nor_scipy_stats(room):
    assert loaded(f"import semgrid_edu.{room}") == set()


@pytest.mark.parametrize("lecture", LECTURES)
def test_a_lecture_before_the_networks_imports_no_torch(lecture):
    assert "torch" not in loaded(imports_of(lecture))


def test_the_reader_of_imports_finds_them_all():
    assert "torch" in loaded(imports_of("06_planes"))
