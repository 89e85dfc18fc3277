"""Arrays are made in this process: worker processes take seconds to start, which a few frames aren't worth."""

import pytest

from semgrid_edu.datasets import training_cache


@pytest.fixture(autouse=True, scope="module")
def _in_this_process():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training_cache, "WORKERS", 1)
        yield
