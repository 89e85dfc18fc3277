"""What a wheel ships: the parts of the clone that pyproject.toml names, found inside the package."""

import tomllib
import zlib

import pytest

from semgrid_edu.datasets import samples
from semgrid_edu.errors import DataError
from semgrid_edu.storage import files as shipped
from semgrid_edu.storage.files import shipped_folder

CLONE = shipped.PACKAGE.parent
LARGEST = 32_000_000
"""Bytes that a wheel may have."""


def _forced() -> dict[str, str]:
    project = tomllib.loads((CLONE / "pyproject.toml").read_text(encoding="utf-8"))
    return project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]


def test_what_a_wheel_holds_lies_where_it_is_looked_for(tmp_path, monkeypatch):
    """In the wheel each folder lies inside the package under the path that it has in the clone."""
    for source, target in _forced().items():
        assert (CLONE / source).is_dir()
        assert target == f"semgrid_edu/{source}"
        (tmp_path / target).mkdir(parents=True)
    monkeypatch.setattr(shipped, "PACKAGE", tmp_path / "semgrid_edu")
    assert (shipped_folder("data_samples") / "sample").is_dir()


def test_a_wheel_has_no_solutions():
    """Students install it, and what is graded can read what is installed."""
    assert {source.partition("/")[0] for source in _forced()} == {"data_samples"}


def test_a_wheel_says_that_it_has_no_frames(monkeypatch, tmp_path):
    monkeypatch.setattr(samples, "shipped_folder", lambda name: tmp_path / name)
    with pytest.raises(DataError, match=r"frames: expected the frames of a clone.*: a wheel has none"):
        samples.sample_frames()


def test_a_clone_has_them_beside_the_package():
    assert shipped_folder("data_samples") == CLONE / "data_samples"


def test_a_wheel_stays_small():
    folders = [CLONE / source for source in (*_forced(), "semgrid_edu")]
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file() and path.suffix != ".pyc"]
    compiled = {".nbi", ".nbc"}  # numba's cache
    sizes = [len(zlib.compress(path.read_bytes())) for path in files if path.suffix not in compiled]
    assert sum(sizes) < LARGEST
