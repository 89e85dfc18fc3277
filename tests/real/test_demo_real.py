"""The demo on a real KITTI drive: LIDAR on the objects in the image, obstacles where they stand."""

import json

import numpy as np
import pytest

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.networks import Architecture, build_net, save_net
from semgrid_edu.plotting.images import visible_points
from semgrid_edu.workshop.demo import write_demo

pytestmark = pytest.mark.real

CAR_IN_IMAGE = (785, 1070, 195, 355)
"""u_min, u_max, v_min, v_max of the overtaking car in frame 12, read off the image by eye."""

FRAMES_READ_BY_EYE = 24
"""Length of the stretch that was looked at, the drive's first frames."""

BY_EYE = 3
"""Pixels: nobody reads an edge off more exactly."""


@pytest.fixture(scope="module")
def drive(kitti_root):
    return KittiRawDrive(kitti_root, "2011_09_26", "0013")


def test_returns_from_the_overtaking_car_are_drawn_on_it(drive, kitti_root):
    if len(drive) != FRAMES_READ_BY_EYE:
        pytest.skip("needs the stretch whose frame 12 was read by eye")
    x_min, x_max, y_min, y_max, _ = json.loads((kitti_root / "moving_cars_0013.json").read_text())["car_1"]["12"]
    frame = drive[12]
    x, y, z = frame.points[:, :3].T
    car = frame.points[(x > x_min) & (x < x_max) & (y > y_min) & (y < y_max) & (z > -1.4)]
    pixels, _ = visible_points(type(frame)(frame.image, car, frame.camera, frame.T_world_from_lidar, frame.time))
    u_min, u_max, v_min, v_max = CAR_IN_IMAGE
    u, v = pixels.T
    on_car = (u > u_min - BY_EYE) & (u < u_max + BY_EYE) & (v > v_min - BY_EYE) & (v < v_max + BY_EYE)
    assert len(pixels) > 300
    assert np.mean(on_car) > 0.99
    assert u.max() - u.min() > 0.8 * (u_max - u_min)


def test_the_page_is_written_and_warns_of_its_semantics(drive, tmp_path):
    weights = tmp_path / "net.safetensors"
    save_net(build_net(Architecture(), drive.camera), weights)
    html = write_demo(drive, weights, tmp_path / "out").read_text(encoding="utf-8")
    assert "Expect poor semantics" in html
    assert f'max="{len(drive) - 1}"' in html
    assert len(html) < 0.5e6 * len(drive)
