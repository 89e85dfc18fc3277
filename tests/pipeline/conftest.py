"""The drive that tests of the pipeline share."""

import pytest
from tiny_drive import DATE, write_tiny_drive

from semgrid_edu.datasets import KittiRawDrive


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    root = tmp_path_factory.mktemp("drive")
    write_tiny_drive(root)
    return KittiRawDrive(root, DATE, "0001")
