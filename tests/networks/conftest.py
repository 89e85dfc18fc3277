import pytest
from tiny_streets import CAMERA


@pytest.fixture
def camera():
    """A camera like KITTI's image_02."""
    return CAMERA
