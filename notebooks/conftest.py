"""How nbval starts the kernel of a notebook, and what it checks beside the outputs."""

import pytest

from tests.forked_kernel import fork_kernels

BEFORE_THE_NETWORKS = ("01_bayes", "01b_graphical_models", "02_grids", "03_bof", "04_cmcdot", "05_pixels")
"""Lectures that a student without a deep-learning library could run."""


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Fork the kernel from a process that has loaded torch, where the lecture may load it."""
    fork_kernels(item.path.stem not in BEFORE_THE_NETWORKS)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """After a lecture's last cell, ask its kernel whether anything has imported torch."""
    fork_kernels(False)
    ends = nextitem is None or nextitem.path != item.path
    if ends and item.path.stem in BEFORE_THE_NETWORKS and item.parent.kernel.is_alive():
        ask = {"torch": "'torch' in __import__('sys').modules"}
        reply = item.parent.kernel.kc.execute_interactive("", silent=True, user_expressions=ask, timeout=60)
        said = reply["content"]["user_expressions"]["torch"]["data"]["text/plain"]
        assert said == "False", f"{item.path.name}: torch has been imported"
