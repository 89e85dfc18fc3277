"""What `demo --save` writes: maps as `map_server` reads them, arrays without pickle, all of it or nothing."""

import hashlib
import sys
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from semgrid_edu.errors import ArgumentError, DataError, MissingExtraError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import save_net
from semgrid_edu.occupancy import State
from semgrid_edu.workshop.demo import run, write_both_streets, write_demo
from semgrid_edu.workshop.demo.run import _handed_out
from semgrid_edu.workshop.demo.save import saved_drive, world_map

pytestmark = pytest.mark.usefixtures("few_stories")

SPEC = GridSpec(x_min=0.0, x_max=20.0, y_min=-10.0, y_max=10.0, cell=0.5)
POSES = [(0.0, 0.0, 0.0), (3.0, 1.0, np.pi / 6), (3.0, 4.0, -0.4)]
"""x, y and yaw of the vehicle in the world; it moves and turns."""

BUILDING, CAR, ROAD = (KITTI_14.index(name) for name in ("building", "car", "road"))


def made_result(k: int) -> SimpleNamespace:
    """A world with a wall at x 14..15.5, y -1..6, unknown behind it, and a car that drives along y = -4.

    At its first sight the car is STATIC, as a filter without a past may believe, and later DYNAMIC.
    """
    x, y, yaw = POSES[k]
    T = np.eye(4)
    T[:2, :2], T[:3, 3] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]], (x, y, 1.73)
    world_x, world_y = np.moveaxis(SPEC.centers() @ T[:2, :2].T + T[:2, 3], -1, 0)
    state = np.where(world_x > 15.5, State.UNKNOWN, State.FREE)
    wall = (world_x > 14) & (world_x < 15.5) & (world_y > -1) & (world_y < 6)
    car = (np.abs(world_x - 6 - 2 * k) < 2) & (np.abs(world_y + 4) < 1)
    state[wall] = State.STATIC
    state[car] = State.DYNAMIC if k else State.STATIC
    probability = np.moveaxis(0.1 + 0.6 * np.eye(4, dtype=np.float32)[state], -1, 0)
    classes = np.select([wall, car], [BUILDING, CAR], ROAD)
    grid = np.moveaxis(np.full(14, 0.02) + 0.72 * np.eye(14)[classes], -1, 0).astype(np.float32)
    velocity = np.where(car, np.array([[[20.0]], [[0.0]]]), np.nan).astype(np.float32)
    frame = SimpleNamespace(T_world_from_lidar=T, time=0.1 * k)
    belief = SimpleNamespace(probability=probability, velocity=velocity)
    return SimpleNamespace(frame=frame, belief=belief, grid=grid, refined=grid, remembered=None)


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    path = tmp_path_factory.mktemp("some_net") / "weights.safetensors"
    path.write_bytes(b"numbers")
    return path


@pytest.fixture(scope="module")
def folder(weights, tmp_path_factory):
    folder = tmp_path_factory.mktemp("saved") / "new"
    with saved_drive(folder, SPEC, KITTI_14, weights, iter((5, 6, 9))) as take:
        for k in range(len(POSES)):
            take(made_result(k))
    return folder


class TrinaryMap:
    """A map as `map_server` documents it, with none of the package's code."""

    def __init__(self, folder):
        lines = (line.split(": ", 1) for line in (folder / "map.yaml").read_text().splitlines())
        self.said = dict(lines)
        self.cell = float(self.said["resolution"])
        self.origin = [float(part) for part in self.said["origin"].strip("[]").split(",")]
        with Image.open(folder / self.said["image"]) as image:
            assert image.format == "PPM"
            assert image.mode == "L"
            self.pixels = np.array(image)

    def pixel(self, x, y):
        column, up = (int((at - low) // self.cell) for at, low in zip((x, y), self.origin[:2], strict=True))
        return len(self.pixels) - 1 - up, column

    def at(self, x, y):
        p = (255 - int(self.pixels[self.pixel(x, y)])) / 255
        if p > float(self.said["occupied_thresh"]):
            return "occupied"
        return "free" if p < float(self.said["free_thresh"]) else "unknown"


class TestMap:
    def test_says_what_map_server_asks_for(self, folder):
        said = TrinaryMap(folder).said
        assert said["negate"] == "0"
        assert said["mode"] == "trinary"
        assert TrinaryMap(folder).origin[2] == 0
        assert set(np.unique(TrinaryMap(folder).pixels)) == {0, 205, 254}

    def test_nav2_whose_limits_belong_to_both_sides_reads_the_same(self, folder):
        said = TrinaryMap(folder).said
        p = (255 - np.array([0, 205, 254])) / 255
        assert (p >= float(said["occupied_thresh"])).tolist() == [True, False, False]
        assert (p <= float(said["free_thresh"])).tolist() == [False, False, True]

    @pytest.mark.parametrize("y", [-0.4, 2.2, 5.4])
    def test_a_wall_is_where_it_is_in_the_world_after_the_vehicle_turned(self, folder, y):
        drawn = TrinaryMap(folder)
        assert drawn.at(14.75, y) == "occupied"
        assert drawn.at(12.9, y) == "free"
        assert drawn.at(16.6, y) == "unknown"

    def test_the_wall_ends_where_it_ends(self, folder):
        drawn = TrinaryMap(folder)
        assert drawn.at(14.75, -2.0) == "free"
        assert drawn.at(14.75, 7.0) == "free"
        occupied = np.argwhere(drawn.pixels == 0)
        x = drawn.origin[0] + (occupied[:, 1] + 0.5) * drawn.cell
        y = drawn.origin[1] + (len(drawn.pixels) - occupied[:, 0] - 0.5) * drawn.cell
        assert ((x > 13.5) & (x < 16) & (y > -1.5) & (y < 6.5)).all()
        assert len(occupied) == pytest.approx(1.5 * 7 / 0.25, abs=10)

    def test_a_moving_car_leaves_no_occupied_pixel(self, folder):
        drawn = TrinaryMap(folder)
        assert {drawn.at(x, -4) for x in np.arange(4.5, 12, 0.5)} <= {"free", "unknown"}

    def test_what_no_grid_reaches_is_unseen(self, folder):
        drawn = TrinaryMap(folder)
        assert drawn.pixels[0, 0] == drawn.pixels[-1, -1] == 205

    def test_classes_have_the_colours_of_the_legend_in_the_same_pixels(self, folder):
        drawn = TrinaryMap(folder)
        with Image.open(folder / "classes.png") as image:
            numbers, colours = np.array(image), np.array(image.convert("RGB"))
        assert numbers[drawn.pixel(14.75, 2.2)] == BUILDING
        assert tuple(colours[drawn.pixel(14.75, 2.2)]) == KITTI_14.rgb[BUILDING]
        assert tuple(colours[drawn.pixel(10, 2.2)]) == KITTI_14.rgb[ROAD]
        np.testing.assert_array_equal(numbers == 255, drawn.pixels == 205)
        assert (colours[numbers == 255] == 255).all()


class TestArrays:
    def test_hold_the_frames_without_pickle(self, folder):
        with np.load(folder / "frames.npz", allow_pickle=False) as saved:
            arrays = dict(saved)
        for k in range(len(POSES)):
            result = made_result(k)
            np.testing.assert_allclose(arrays["occupancy"][k], result.belief.probability, atol=5e-4)
            np.testing.assert_array_equal(arrays["velocity"][k], result.belief.velocity)
            np.testing.assert_array_equal(arrays["T_world_from_lidar"][k], result.frame.T_world_from_lidar)
            for name in ("grid", "refined"):
                np.testing.assert_array_equal(arrays[name][k], result.grid.argmax(axis=0))
                np.testing.assert_allclose(arrays[f"{name}_probability"][k], 0.74, atol=5e-4)
        assert arrays["time"].tolist() == [0.0, 0.1, 0.2]
        assert arrays["frame"].tolist() == [5, 6, 9]

    def test_name_what_is_needed_to_read_them(self, folder, weights):
        with np.load(folder / "frames.npz", allow_pickle=False) as saved:
            assert tuple(saved["class_names"]) == KITTI_14.names
            assert saved["state_names"].tolist() == ["free", "static", "dynamic", "unknown"]
            assert GridSpec(*saved["extent"].tolist(), saved["cell"].item()) == SPEC
            assert saved["network"] == f"{weights.parent.name}/weights.safetensors"
            assert saved["network_sha256"] == hashlib.sha256(b"numbers").hexdigest()
            assert "remembered" not in saved


def test_the_animation_shows_every_frame_as_fast_as_it_was(folder):
    with Image.open(folder / "drive.gif") as image:
        assert (image.n_frames, image.info["duration"]) == (len(POSES), 100)
        image.seek(1)
        colours = np.array(image.convert("RGB"))
    assert colours.shape[:2] == (3 * 40, 3 * (40 + 4 + 40))
    assert {tuple(rgb) for rgb in colours.reshape(-1, 3).tolist()} >= {KITTI_14.rgb[c] for c in (BUILDING, CAR, ROAD)}


def test_nothing_is_left_of_a_drive_that_is_interrupted(weights, tmp_path):
    with pytest.raises(KeyboardInterrupt), saved_drive(tmp_path / "new", SPEC, KITTI_14, weights, count()):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_a_jump_of_the_poses_is_refused_and_the_frames_before_it_are_saved(weights, tmp_path):
    far = made_result(1)
    far.frame.T_world_from_lidar[:2, 3] = 1e6
    with saved_drive(tmp_path / "new", SPEC, KITTI_14, weights, count(7)) as take:
        take(made_result(0))
        with pytest.raises(
            DataError, match=r"new: expected poses of a map of at most 1,000,000,000 pixels, .* at frame 8"
        ):
            take(far)
    with np.load(tmp_path / "new" / "frames.npz") as saved:
        assert saved["frame"].tolist() == [7]


@pytest.mark.parametrize("tilt", [0, 5])
@pytest.mark.parametrize("cell", [0.5, 1 / 3, 0.2])
def test_the_map_of_one_frame_is_its_grid_turned(cell, tilt):
    """A car looks along the world's y axis, so its grid and the map have the same rows and columns, tilted or not."""
    spec = GridSpec(0.0, 30 * cell, -10 * cell, 10 * cell, cell)
    state = np.random.default_rng(0).integers(0, 2, spec.shape)
    classes = np.random.default_rng(1).integers(0, 14, spec.shape).astype(np.uint8)
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZYX", [90, tilt, -tilt], degrees=True).as_matrix()
    T[:3, 3] = 300 * cell, -700 * cell, 1.73
    drawn = world_map(np.moveaxis(np.eye(4)[state], -1, 0)[None], classes[None], T[None], spec)
    rows, cols = (np.flatnonzero((drawn.pixels != 205).any(axis=axis)) for axis in (1, 0))
    seen = np.ix_(rows, cols)
    # Forward (row 0 of the grid) is up in the map, and what is left of the car is left.
    np.testing.assert_array_equal(drawn.pixels[seen], np.where(state == State.FREE, 254, 0))
    np.testing.assert_array_equal(drawn.classes[seen], classes)
    left, below = cols[0], len(drawn.pixels) - 1 - rows[-1]
    np.testing.assert_allclose(np.add(drawn.origin, (left * cell, below * cell)), (290 * cell, -700 * cell))


def test_nothing_is_left_of_writing_that_fails(weights, tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    with (
        pytest.raises(OSError, match="No space left") as caught,
        saved_drive(tmp_path / "new", SPEC, KITTI_14, weights, count()) as take,
    ):
        take(made_result(0))
    assert caught.value.filename == str(tmp_path / "new")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("no_overview")
class TestDemo:
    @pytest.fixture
    @staticmethod
    def trained(net, tmp_path):
        save_net(net, tmp_path / "net.safetensors")
        return tmp_path / "net.safetensors"

    def test_saves_what_the_pipeline_makes(self, last_labelled, trained, told, tmp_path):
        (tmp_path / "empty").mkdir()
        write_demo(last_labelled, trained, tmp_path / "page", memory=True, save=tmp_path / "empty")
        assert {path.name for path in (tmp_path / "empty").iterdir()} == {
            "frames.npz", "map.pgm", "map.yaml", "classes.png", "drive.gif",
        }  # fmt: skip
        with np.load(tmp_path / "empty" / "frames.npz", allow_pickle=False) as saved:
            for k, result in enumerate(told):
                np.testing.assert_allclose(saved["occupancy"][k], result.belief.probability, atol=5e-4)
                np.testing.assert_array_equal(saved["remembered"][k], result.remembered.argmax(axis=0))

    @pytest.mark.parametrize(
        ("options", "error", "message"),
        [
            ({"save": "full"}, DataError, "full: expected a new or an empty folder, found one with files in it"),
            ({"save": "full/file"}, DataError, "file: expected a new or an empty folder, found a file"),
            ({"save": "."}, ArgumentError, "--save: expected a folder of its own, not one that holds .*page"),
            ({"rerun": "a.txt"}, ArgumentError, r"--rerun: expected a file that ends in \.rrd, found .*a\.txt"),
            ({"rerun": "a.rrd"}, MissingExtraError, r"rerun isn't installed: pip install 'semgrid_edu\[rerun\]'"),
        ],
    )
    def test_refuses_before_any_frame_is_read(
        self, last_labelled, trained, tmp_path, monkeypatch, options, error, message
    ):
        monkeypatch.setitem(sys.modules, "rerun", None)
        monkeypatch.setattr(run, "first_sound", lambda *_: pytest.fail("a frame was read"))
        (tmp_path / "full").mkdir()
        (tmp_path / "full" / "file").write_text("mine")
        options = {name: tmp_path / value for name, value in options.items()}
        with pytest.raises(error, match=message):
            write_demo(last_labelled, trained, tmp_path / "page", **options)
        assert (tmp_path / "full" / "file").read_text() == "mine"

    def test_of_both_streets_the_second_is_in_a_folder_of_the_first(self, tmp_path, monkeypatch):
        told = []
        monkeypatch.setattr(run, "write_demo", lambda *_, **options: told.append(options["save"]))
        write_both_streets(tmp_path / "page", save=tmp_path / "saved")
        assert told == [tmp_path / "saved", tmp_path / "saved" / "simulated"]

    def test_of_two_runs_the_students_is_saved(self):
        taken = []
        assert list(_handed_out([("package", "yours")], [taken.append])) == [("package", "yours")]
        assert taken == ["yours"]
