"""Data sets in other layouts are named, with what to do, when a raw drive is looked for in them."""

import pytest
from tiny_drive import DATE, write_tiny_drive

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.drive_files import LAYOUTS, what_is
from semgrid_edu.errors import DataError

FOLDERS = {
    f"{DATE}/{DATE}_drive_0001_extract/velodyne_points/data": "unsynchronised",
    f"{DATE}_drive_0001_extract/velodyne_points/data": "unsynchronised",
    f"{DATE}_drive_0001_sync/velodyne_points/data": "the drives of one day",
    "velodyne_points/data": "one drive",
    f"kitti_raw/{DATE}/{DATE}_drive_0001_sync": "a folder above",
    "sequences/00/velodyne": "SemanticKittiSequence",
    "sequences/00/image_2": "fetch its scans",
    "training/velodyne": "KittiTrackingRun",
    "data_3d_raw/2013_05_28_drive_0000_sync/velodyne_points/data": "KITTI-360",
    "v1.0-mini": "nuScenes",
    "drive.bag": "data from-bag BAG DIR",
    "drive_0.db3": "data from-bag BAG DIR",
    "drive_0.mcap": "data from-bag BAG DIR",
}


def test_every_layout_is_tried():
    assert len(FOLDERS) == len(LAYOUTS)


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_layout_is_named(tmp_path, folder):
    (tmp_path / folder).mkdir(parents=True)
    with pytest.raises(DataError, match=FOLDERS[folder]):
        KittiRawDrive(tmp_path, "2011_09_26", "0001")


def test_the_right_layout_is_not_taken_for_another(tmp_path):
    write_tiny_drive(tmp_path)
    assert what_is(tmp_path) == ""
    with pytest.raises(DataError, match=f"only the drives {DATE}_drive_0001_sync$"):
        KittiRawDrive(tmp_path, DATE, "0002")
