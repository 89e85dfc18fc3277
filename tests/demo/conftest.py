"""What the demo's tests share."""

import pytest

from semgrid_edu.workshop.demo import record


@pytest.fixture(scope="session")
def first_details():
    """The maps of the first frame that asks for some, for all that ask later."""
    found, original = [], record.frame_details
    return lambda *arguments: found[0] if found else found.append(original(*arguments)) or found[0]


@pytest.fixture(scope="module")
def few_stories(first_details):
    """All frames tell the stories of one frame's cells, because the stories take most of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(record, "frame_details", first_details)
        yield
