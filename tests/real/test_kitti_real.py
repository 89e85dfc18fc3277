"""The reader against pykitti, on a real drive."""

from itertools import pairwise

import numpy as np
import pykitti
import pytest
from pykitti_peer import check_against_pykitti

from semgrid_edu.datasets import KittiRawDrive

pytestmark = pytest.mark.real


@pytest.fixture(scope="module")
def drive(kitti_root):
    return KittiRawDrive(kitti_root, "2011_09_26", "0013")


@pytest.fixture(scope="module")
def peer(kitti_root):
    return pykitti.raw(str(kitti_root), "2011_09_26", "0013")


def test_drive_is_sound_and_as_pykitti_reads_it(drive, peer):
    assert drive.problems() == []
    check_against_pykitti(drive, peer)


def test_car_moves_as_its_odometer_says(drive, peer):
    # Forward speed (field vf) is measured apart from the positions.
    frames = drive[:]
    positions = np.array([frame.T_world_from_lidar[:2, 3] for frame in frames])
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    driven = sum((a.packet.vf + b.packet.vf) / 2 for a, b in pairwise(peer.oxts))
    seconds = (frames[-1].time - frames[0].time) / (len(frames) - 1)
    assert steps.sum() == pytest.approx(driven * seconds, rel=0.02)
