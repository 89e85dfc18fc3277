"""Fixtures that all tests share."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def kitti_root() -> Path:
    """The folder of real KITTI drives that KITTI names; skips without."""
    if not os.environ.get("KITTI"):
        pytest.skip("needs real KITTI data: set KITTI to its folder")
    return Path(os.environ["KITTI"])
