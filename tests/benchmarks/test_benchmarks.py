"""What benchmarks compare does the same, and what they time is there; how long it takes is no test's business."""

import bench_frame
import bench_networks
import bench_occupancy
import bench_planes
import numpy as np
import torch
from tiny_streets import CAMERA, SMALL, tiny_streets

from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import Architecture, build_net
from semgrid_edu.planes import plane_pixels


def test_all_ways_to_sample_planes_give_the_same(monkeypatch):
    camera = bench_planes.kitti_camera().resized((48, 160))
    monkeypatch.setattr(bench_planes, "KITTI_SIZE", camera.size)
    pixels, visible = plane_pixels(GridSpec(-4, 68, -16, 16, cell=2.0), [0.0, 0.9, 2.0], camera)
    assert not visible.all()
    generator = torch.Generator().manual_seed(0)
    scores = torch.randn(1, 4, *camera.size, generator=generator, requires_grad=True)
    weight = torch.randn(5, 4, 3, 1, 1, generator=generator, requires_grad=True)
    ways = {
        name: bench_planes.tasks(name, way(pixels, visible), scores, weight)
        for name, way in bench_planes.SAMPLINGS.items()
    }
    bench_planes.check_agreement(ways, scores, weight)
    sampled, forward, learnt = (run() for run in ways[bench_planes.OURS].values())
    assert sampled.shape == (1, 4, 3, 36, 16)
    expected = torch.einsum("bcdhw,kcd->bkhw", sampled, weight[..., 0, 0])
    for reduced in (forward, learnt):
        torch.testing.assert_close(reduced, expected, rtol=1e-4, atol=1e-4)


def test_each_step_of_both_stages_is_timed(monkeypatch):
    monkeypatch.setattr(bench_networks, "STEPS", 3)
    monkeypatch.setattr(bench_networks, "WARM_UP", 1)
    monkeypatch.setattr(bench_networks, "sample_frames", lambda: tiny_streets(2))
    image, grid = bench_networks.step_times(build_net(SMALL, CAMERA))
    assert len(image) == len(grid) == 1  # without warming up and the last, which ends with what comes after it
    assert min(*image, *grid) > 0


def test_each_part_of_a_frame_is_timed():
    drive = sample_drive()
    times = bench_frame.frame_times([drive[0], drive[1]], build_net(Architecture(), drive.camera).eval())
    assert times.shape == (2, len(bench_frame.ROWS) + 3)
    assert (times > 0).all()
    np.testing.assert_allclose(times[:, : len(bench_frame.ROWS)].sum(axis=1), times[:, -3])


def test_every_step_and_each_of_its_parts_is_timed():
    drive, spec = bench_occupancy.made_up_drive(scans=3, points=500), GridSpec(0, 20, -10, 10, 1.0)
    waits = bench_occupancy.waiting_times(drive, spec, passes=2)
    assert waits.shape == (2, 3)
    assert (waits > 0).all()
    times = bench_occupancy.step_times(drive, spec, particles=1000, passes=3)
    assert set(times) == {bench_occupancy.WHOLE, *bench_occupancy.PARTS.values()}
    assert all(milliseconds > 0 for milliseconds in times.values())
