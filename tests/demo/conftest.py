"""What the demo's tests share."""

import pytest

from semgrid_edu.workshop.demo import run


@pytest.fixture(scope="module")
def few_stories():
    """Only the first frame of a page gets the stories of its cells, because they take most of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "STORIES", 1)
        yield
