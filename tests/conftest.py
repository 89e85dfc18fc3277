"""Fixtures that all tests share."""

import gc
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Keep the garbage collector from what is loaded for good: it would go through a million objects at each turn."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_runtest_teardown() -> None:
    """Close the figures that a test has left open."""
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(scope="session")
def kitti_root() -> Path:
    """The folder of real KITTI drives that KITTI names; skips without."""
    if not os.environ.get("KITTI"):
        pytest.skip("needs real KITTI data: set KITTI to its folder")
    return Path(os.environ["KITTI"])
