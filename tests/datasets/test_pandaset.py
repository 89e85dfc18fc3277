"""PandaSet's reader on a tiny scene whose street is known: frames, truth, image labels, and bad inputs."""

import gzip
import json
import os
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest
from pandas import DataFrame
from PIL import Image
from scipy.spatial.transform import Rotation
from tiny_pandaset import (
    CAR_SIZE,
    CENTRE,
    DRIVING,
    GROUND,
    LIDAR,
    NUMBERS,
    PARKED,
    SCENE,
    STEP,
    WALL,
    write_table,
    write_tiny_pandaset,
)

from semgrid_edu.camera import project, rigid_transform, transform_points
from semgrid_edu.datasets import PandasetScene, load_index
from semgrid_edu.datasets.cuboids import ANY_LIDAR, MARGIN, Cuboids, put_together
from semgrid_edu.datasets.index import write_pandaset_index
from semgrid_edu.datasets.pandaset_files import read_pandaset_scan
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.fast import TrainingSet
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE
from semgrid_edu.occupancy import SensorModel, scan_evidence
from semgrid_edu.occupancy.sensor import prepare_scan
from semgrid_edu.storage.pickled_tables import read_pickled_table
from semgrid_edu.workshop.doubts import drive_doubts

SPEC = GridSpec(x_min=0, x_max=24, y_min=-8, y_max=8, cell=0.5)
ROAD, CAR, BUILDING = (KITTI_14.index(name) for name in ("road", "car", "building"))


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return write_tiny_pandaset(tmp_path_factory.mktemp("pandaset"))


@pytest.fixture
def copy(root, tmp_path):
    shutil.copytree(root / SCENE, tmp_path / SCENE)
    return tmp_path


@pytest.fixture(scope="module")
def scene(root):
    return PandasetScene(root, SCENE)


@pytest.fixture(scope="module")
def frames(scene):
    return list(scene)


def class_at(grid, x, y):
    rows, cols, inside = SPEC.cells(np.array([[x, y]]))
    assert inside.all()
    return grid[rows[0], cols[0]]


def test_there_is_a_frame_for_each_image(scene, frames, root):
    assert (len(scene), scene.numbers, scene.gaps, scene.problems()) == (3, NUMBERS, (), [])
    assert [frame.time for frame in frames] == pytest.approx([0.0, 0.2, 0.4])
    side = PandasetScene(root, SCENE, camera="left_camera")
    assert (len(side), side.numbers, side.gaps) == (2, (0, 4), ())


def test_the_grid_lies_on_the_ground_below_the_lidar_along_the_cameras_heading(frames):
    for frame, number in zip(frames, NUMBERS, strict=True):
        assert frame.camera.lidar_height == pytest.approx(LIDAR[2] - GROUND)
        np.testing.assert_allclose(frame.T_world_from_lidar[:3, 3], np.add(LIDAR, (0, STEP * number, 0)), atol=1e-9)
        np.testing.assert_allclose(frame.T_world_from_lidar[:3, 0], [0, 1, 0], atol=1e-9)  # ahead
        np.testing.assert_allclose(frame.T_world_from_lidar[:3, 2], [0, 0, 1], atol=1e-9)  # up
        assert frame.points_grid[:, 2].min() == pytest.approx(0, abs=1e-5)
        assert frame.points[:, 0].max() == pytest.approx(WALL - STEP * number, abs=1e-5)
        assert set(frame.points[:, 3].tolist()) == {np.float32(0.2)}


def test_each_camera_has_a_grid_of_its_own(root):
    frame = PandasetScene(root, SCENE, camera="left_camera")[0]
    np.testing.assert_allclose(frame.T_world_from_lidar[:3, 0], [-1, 0, 0], atol=1e-9)
    assert frame.points[:, 1].min() == pytest.approx(-WALL, abs=1e-5)


def test_the_filter_gets_the_turning_lidar_alone(scene, frames):
    scan = scene._scan(0)
    assert (scan.lidars == 1).sum() == 1
    assert len(frames[0].points) == len(scan.points) - 1
    assert len(scan.labelled.points) == len(scan.points) - 1  # the reflection isn't labelled


@pytest.mark.parametrize(("camera", "beside"), [("front_camera", (0.25, 1.25)), ("left_camera", (1.25, -0.25))])
def test_the_vehicles_own_returns_are_those_on_its_roof_whichever_way_the_grid_looks(copy, camera, beside):
    """What stands 1.25 m to the left is inside the outline of a vehicle that looks there, and yet it is no bonnet."""
    shutil.rmtree(copy / SCENE / "annotations")
    scan = read_pandaset_scan(copy / SCENE, 0)
    roof, thing = np.add(LIDAR, (0.3, -1.0, -0.4)), np.add(LIDAR, (-1.25, 0.25, -1.0))
    points = np.concatenate([scan.points, [roof, thing]])
    columns = dict(zip("xyz", points.T, strict=True)) | {"i": np.zeros(len(points)), "t": np.full(len(points), 100.0)}
    write_table(copy / SCENE / "lidar/00.pkl.gz", columns | {"d": np.append(scan.lidars, [0, 0])})
    frame = PandasetScene(copy, SCENE, camera)[0]
    assert np.flatnonzero(frame.vehicle_returns).tolist() == [len(frame.points) - 2]
    evidence = scan_evidence(frame.points_grid, SPEC, SensorModel())
    assert class_at(evidence.occupied > evidence.free, *beside)
    assert not np.isin(roof[2] - GROUND, prepare_scan(frame.points_grid, SensorModel(ground=None))[:, 2])


def test_the_kept_rows_of_an_image_have_the_camera_that_took_them(frames):
    frame = frames[0]
    assert frame.image.shape == (580, 1920, 3)
    assert frame.image[0, 0].tolist() == pytest.approx([216 // 8] * 3, abs=2)
    wall = np.array([[WALL, 2.0, 1.0 - LIDAR[2] + GROUND]])  # 2 m to the left, 1 m above the ground
    uv, seen = project(transform_points(frame.camera.T_camera_from_lidar, wall), frame.camera)
    below = LIDAR[2] - 0.1 - GROUND - 1.0
    assert seen.all()
    np.testing.assert_allclose(uv[0], [CENTRE[0] - 2000 / WALL, CENTRE[1] - 216 + 1000 * below / WALL])


def test_a_lidar_stands_where_it_was_when_the_image_was_taken(copy):
    path = copy / SCENE / "camera/front_camera/timestamps.json"
    path.write_text(json.dumps([time - 0.05 for time in json.loads(path.read_text())]))
    frame = PandasetScene(copy, SCENE)[1]
    np.testing.assert_allclose(frame.T_world_from_lidar[:3, 3], np.add(LIDAR, (0, STEP * 1.5, 0)), atol=1e-9)


@pytest.mark.parametrize(("before", "after"), [(0, 0), (1, 1), (9, 9)])
def test_cells_hold_what_stands_there_at_that_frame(scene, before, after):
    truth, number = scene.truth(1, SPEC, before, after), NUMBERS[1]
    x, left = WALL - STEP * number, -DRIVING[0]
    assert class_at(truth, x, 0.1) == BUILDING
    assert class_at(truth, PARKED[1] - STEP * number, -PARKED[0]) == CAR
    for other in NUMBERS:
        expected = CAR if other == number else ROAD
        assert class_at(truth, DRIVING[1] - STEP * number, left - other) == expected, other
    cars = truth == CAR
    covered = 2 * CAR_SIZE[0] * CAR_SIZE[1] / SPEC.cell**2
    assert covered <= cars.sum() <= 1.9 * covered  # a cell belongs to a car when the car covers a part of it
    assert class_at(truth, 6.0, 0.0) == ROAD  # nothing is where a reflection is seen


def test_only_the_scans_own_things_are_kept_when_nobody_says_where_they_went(copy):
    for number in (0, 4):
        path = copy / SCENE / f"annotations/cuboids/{number:02d}.pkl.gz"
        empty = {
            "uuid": np.zeros(0, object),
            "stationary": np.zeros(0, bool),
            "cuboids.sibling_id": np.zeros(0, object),
        }
        numbers = ("yaw", *(f"{what}.{axis}" for what in ("position", "dimensions") for axis in "xyz"))
        write_table(path, empty | {name: np.zeros(0) for name in numbers} | {"cuboids.sensor_id": np.zeros(0, int)})
    scene = PandasetScene(copy, SCENE)
    np.testing.assert_array_equal(scene.truth(1, SPEC, 1, 1) == CAR, scene.truth(1, SPEC, 0, 0) == CAR)


def test_what_the_camera_sees_is_told_from_what_only_a_lidar_sees(scene):
    truth, visible = scene.truth(0, SPEC), scene.visible(0, SPEC)
    assert visible[truth != IGNORE].mean() > 0.5
    assert class_at(visible, PARKED[1] - 1.9, -PARKED[0])
    behind = PARKED[1] + 2.6, -PARKED[0] * (PARKED[1] + 2.6) / (PARKED[1] - 2)
    assert class_at(truth, *behind) == ROAD
    assert not class_at(visible, *behind)  # the car hides it from the camera
    assert not visible[truth == IGNORE].any()
    assert not visible[-5:, :].any()  # too near: below the image


@pytest.mark.parametrize("size", [(580, 1920), (96, 320)])
def test_pixels_take_the_class_of_what_the_camera_sees(scene, frames, size):
    labels, camera = scene.image_labels(0, size), scene.camera.resized(size)
    places = {BUILDING: (WALL, -1.0, 3.0), CAR: (PARKED[1] - 2.0, -PARKED[0], 0.75), ROAD: (9.1, 0.0, 0.0)}
    for number, (x, y, z) in places.items():
        uv, _ = project(transform_points(camera.T_camera_from_grid, np.array([[x, y, z]])), camera)
        u, v = np.rint(uv[0]).astype(int)
        reach = size[0] // 60
        around = labels[v - reach : v + reach + 1, u - reach : u + reach + 1]
        assert set(around[around != IGNORE]) == {number}, KITTI_14.names[number]
    found = frames[0].labels
    assert (labels != IGNORE).mean() > (0.005 if size[0] == 580 else 0.15)
    if size == scene.camera.size:
        np.testing.assert_array_equal(found.image, labels)
        assert np.isfinite(found.depth[labels != IGNORE]).all()
        assert found.depth[labels == BUILDING].max() == pytest.approx(WALL, abs=1e-3)


def test_a_scene_without_labels_has_frames(copy):
    shutil.rmtree(copy / SCENE / "annotations")
    scene = PandasetScene(copy, SCENE)
    assert scene[0].labels is None
    assert scene.lidar_height == pytest.approx(2.13)
    with pytest.raises(DataError, match=r"semseg: expected the classes of the returns"):
        scene.truth(0, SPEC)
    with pytest.raises(DataError, match=r"semseg: expected the classes of the returns"):
        write_pandaset_index(copy / "data", copy, SCENE)


def test_a_worker_process_can_open_it_again(root):
    scene = PandasetScene(root, SCENE, camera="left_camera")
    first = scene[0]
    again = pickle.loads(pickle.dumps(scene))
    assert (again.name, again.numbers) == (scene.name, scene.numbers)
    np.testing.assert_array_equal(again[0].points, first.points)


@pytest.mark.parametrize("window", [{"before": -1}, {"after": -1}])
def test_a_window_of_fewer_than_no_scans_is_refused(scene, window):
    with pytest.raises(ArgumentError, match=rf"{next(iter(window))}: expected a whole number from 0 up, found -1"):
        scene.truth(1, SPEC, **window)


def test_two_boxes_of_one_thing_are_one(copy):
    """A thing that moves has a box for each LIDAR; returns of the second go to where the first saw the thing."""
    table = {"uuid": ["a", "b"], "stationary": np.array([False, False]), "yaw": np.zeros(2)}
    places = {"x": [0.0, 1.0], "y": [14.0, 14.0], "z": [GROUND + 0.75] * 2}
    table |= {f"position.{axis}": np.array(values) for axis, values in places.items()}
    table |= {f"dimensions.{axis}": np.full(2, size) for axis, size in zip("xyz", CAR_SIZE, strict=True)}
    table |= {"cuboids.sibling_id": ["b", "a"], "cuboids.sensor_id": np.array([0, 1])}
    write_table(copy / SCENE / "annotations/cuboids/00.pkl.gz", table)
    points = np.array([[0.5, 14.0, GROUND + 0.5], [1.5, 14.0, GROUND + 0.5]])
    scan = {axis: points[:, column] for column, axis in enumerate("xyz")} | {"i": np.zeros(2), "d": np.array([0, 1])}
    write_table(copy / SCENE / "lidar/00.pkl.gz", scan)
    write_table(copy / SCENE / "annotations/semseg/00.pkl.gz", {"class": np.array([13, 13])})
    moved, classes = put_together(read_pandaset_scan(copy / SCENE, 0).labelled, [])
    np.testing.assert_allclose(moved, [points[0]] * 2)
    assert classes.tolist() == [CAR, CAR]


def brute_force_holder(cuboids, points, lidars):
    """Every return in every box: of two boxes that hold it, the later one."""
    holder = np.full(len(points), -1)
    for b, T in enumerate(cuboids.T_world_from_box):
        inside = (np.abs(transform_points(np.linalg.inv(T), points)) <= cuboids.sizes[b] / 2 + MARGIN).all(axis=1)
        holder[inside & np.isin(cuboids.lidars[b], ANY_LIDAR) | inside & (lidars == cuboids.lidars[b])] = b
    return holder


@pytest.mark.parametrize("n_boxes", [0, 1, 30])
def test_a_return_is_in_the_box_that_holds_it(n_boxes):
    rng = np.random.default_rng(n_boxes)
    turns = Rotation.from_rotvec(rng.normal(0, 1, (n_boxes, 3))) if n_boxes else []
    T = np.array([rigid_transform(turn.as_matrix(), rng.uniform(-20, 20, 3)) for turn in turns]).reshape(-1, 4, 4)
    names = np.array([str(b) for b in range(n_boxes)])
    boxes = Cuboids(names, T, rng.uniform(0, 9, (n_boxes, 3)), np.ones(n_boxes, bool), rng.integers(-1, 2, n_boxes))
    points, lidars = rng.uniform(-25, 25, (2000, 3)), rng.integers(0, 2, 2000)
    np.testing.assert_array_equal(boxes.holding(points, lidars), brute_force_holder(boxes, points, lidars))
    assert boxes.holding(points[:0], lidars[:0]).shape == (0,)


@pytest.mark.parametrize("name", ["annotations/semseg/00.pkl.gz", "lidar/00.pkl.gz"])
def test_classes_follow_the_names_of_the_rows_not_their_order(copy, scene, frames, name):
    path = copy / SCENE / name
    table = DataFrame(read_pickled_table(path).columns)
    table.sample(frac=1, random_state=0).to_pickle(path)
    shuffled = PandasetScene(copy, SCENE)
    np.testing.assert_array_equal(shuffled.truth(0, SPEC), scene.truth(0, SPEC))
    np.testing.assert_array_equal(shuffled[0].labels.image, frames[0].labels.image)


def test_rows_of_other_names_are_refused(copy):
    path = copy / SCENE / "annotations/semseg/00.pkl.gz"
    table = DataFrame(read_pickled_table(path).columns)
    table.set_index(np.arange(len(table)) + 1).to_pickle(path)
    with pytest.raises(DataError, match=r"semseg/00\.pkl\.gz: expected the index .* of the scan's table"):
        PandasetScene(copy, SCENE).truth(0, SPEC)


@pytest.mark.parametrize("scene", [2, ""])
def test_a_scene_is_named_by_text(root, scene):
    with pytest.raises(ArgumentError, match="scene: expected text such as '002'"):
        PandasetScene(root, scene)


def written(content):
    return lambda path: path.write_bytes(content)


def table(**columns):
    return lambda path: write_table(path, columns)


def column(key, values):
    """Write a table again, with other values in one column."""
    return lambda path: write_table(path, read_pickled_table(path).columns | {key: values})


SCAN, CLASSES, CUBOIDS = (f"{name}/02.pkl.gz" for name in ("lidar", "annotations/semseg", "annotations/cuboids"))
POSES, CAMERA = "lidar/poses.json", "camera/front_camera"
NOWHERE = dict.fromkeys("yzid", np.zeros(3)) | {"x": np.array([0.0, 0.0, 9e5])}

BAD = {
    "missing poses": (POSES, Path.unlink, "a file"),
    "missing poses of the camera": (f"{CAMERA}/poses.json", Path.unlink, "a file"),
    "too few poses": (POSES, written(b"[]"), "at least 5 poses.*found 0"),
    "a pose of something else": (POSES, written(b"[1, 2, 3, 4, 5]"), "poses of"),
    "times without end": ("lidar/timestamps.json", written(b"[1, 2, 3, 4, Infinity]"), "5 finite times"),
    "no intrinsics": (f"{CAMERA}/intrinsics.json", written(b'{"fx": 1}'), "the"),
    "an image cut short": (f"{CAMERA}/02.jpg", lambda path: os.truncate(path, 1000), "a sound JPEG"),
    "labels of another length": (
        CLASSES,
        table(**{"class": np.full(7, 7)}),
        r"a class for each of the scan's \d+ returns, found 7",
    ),
    "unknown classes": (
        CLASSES,
        lambda path: write_table(path, {"class": read_pickled_table(path).columns["class"] + 92}),
        "labels among",
    ),
    "another table": (SCAN, table(a=[1.0]), "the columns x"),
    "a place that is nowhere": (
        CUBOIDS,
        column("position.x", np.array([0.0, np.nan])),
        r"finite numbers in the column position\.x",
    ),
    "a name that is a number": (CUBOIDS, column("uuid", np.array([1, 2])), "text in the columns uuid"),
    "neither true nor false": (CUBOIDS, column("stationary", ["no", "yes"]), "true or false in the column stationary"),
    "a box that is turned inside out": (
        CUBOIDS,
        column("dimensions.x", np.array([2.0, -2.0])),
        "dimensions from 0 m up, found -2 m",
    ),
    "a return at the end of the world": (
        SCAN,
        table(**NOWHERE),
        r"returns within 1000 m .* found \[900000\.0, 0\.0, 0\.0\] in row 2",
    ),
    "too much light": (
        SCAN,
        table(**dict.fromkeys("xyzid", np.array([3.0, 256.0]))),
        "i from 0 to 255, found 3 to 256",
    ),
    "a hostile scan": (SCAN, written(gzip.compress(pickle.dumps(print))), r".*names builtins\.print"),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_inputs_are_named(copy, kind):
    file, spoil, says = BAD[kind]
    spoil(copy / SCENE / file)
    scene = PandasetScene(copy, SCENE)
    with pytest.raises(DataError, match=f"{file}: expected {says}"):
        _ = scene[1]
    assert scene.problems()


@pytest.mark.parametrize(("before", "after"), [(0, 0), (1, 0), (2, 2)])
def test_returns_that_cannot_be_in_the_grid_are_not_missed(scene, before, after, monkeypatch):
    truths = [scene.truth(k, SPEC, before, after) for k in range(3)]
    monkeypatch.setattr(scene, "_around", lambda k, spec, points: np.ones(len(points), bool))
    for k, truth in enumerate(truths):
        np.testing.assert_array_equal(scene.truth(k, SPEC, before, after), truth)


def test_images_may_be_png(copy, frames):
    path = copy / SCENE / "camera/front_camera/02.jpg"
    Image.open(path).save(path.with_suffix(".png"))
    path.unlink()
    np.testing.assert_array_equal(PandasetScene(copy, SCENE)[1].image, frames[1].image)


def test_a_missing_image_is_doubtful(copy):
    (copy / SCENE / "camera/front_camera/06.jpg").write_bytes(
        (copy / SCENE / "camera/front_camera/04.jpg").read_bytes() + b"\0"  # another file
    )
    (copy / SCENE / "camera/front_camera/02.jpg").unlink()
    scene = PandasetScene(copy, SCENE)
    (copy / SCENE / "lidar/06.pkl.gz").write_bytes((copy / SCENE / "lidar/04.pkl.gz").read_bytes()[:-1])
    assert (scene.numbers, scene.gaps) == ((0, 4, 6), ())
    (line,) = (line for line in drive_doubts(scene) if "02.jpg" in line)
    assert "02.jpg: expected an image" in line


def test_an_image_and_a_scan_that_come_again_are_doubtful(copy):
    assert drive_doubts(PandasetScene(copy, SCENE)) == []
    for folder, name in (("camera/front_camera", "{}.jpg"), ("lidar", "{}.pkl.gz")):
        first = (copy / SCENE / folder / name.format("00")).read_bytes()
        for number in ("02", "04"):
            (copy / SCENE / folder / name.format(number)).write_bytes(first)
    scan, image, in_frames = drive_doubts(PandasetScene(copy, SCENE))
    assert scan.endswith("02.pkl.gz: expected scans that differ, found 00.pkl.gz again, up to 04.pkl.gz")
    assert image.endswith("02.jpg: expected images that differ, found 00.jpg again, up to 04.jpg")
    assert "expected images that differ, found the same image again" in in_frames


def test_a_scan_that_was_packed_again_is_the_same_scan(copy):
    first, second = (copy / SCENE / "lidar" / f"{number}.pkl.gz" for number in ("02", "04"))
    second.write_bytes(gzip.compress(gzip.decompress(first.read_bytes()), 1, mtime=1))
    assert first.read_bytes() != second.read_bytes()
    (line,) = drive_doubts(PandasetScene(copy, SCENE))
    assert line.startswith(f"{second}: expected scans that differ, found {first.name} again")


def test_says_which_scenes_and_cameras_there_are(root, tmp_path):
    with pytest.raises(ArgumentError, match="camera: expected one of front_camera, "):
        PandasetScene(root, SCENE, camera="rear")
    with pytest.raises(DataError, match=r"003: expected a scene, found only 002"):
        PandasetScene(root, "003")
    with pytest.raises(DataError, match=r"back_camera: expected images such as 00\.jpg, found no folder"):
        PandasetScene(root, SCENE, camera="back_camera")


def test_a_scene_is_learnt_from_like_a_simulated_data_set(root, tmp_path):
    """Cells in view without a label teach nothing; the labels of pixels are projected at the size of the image."""
    write_pandaset_index(tmp_path / "data", root, SCENE, ["left_camera"])
    index = load_index(tmp_path / "data")
    assert {split: len(frames) for split, frames in index.splits.items()} == {"train": 3, "test": 2}
    (front,) = TrainingSet.by_camera(index, "train")
    scene = PandasetScene(root, SCENE)
    assert front.camera.same_as(scene.camera.resized((96, 320)))
    for k in range(3):
        sample, truth, view = front[k], scene.truth(k, front.spec), scene.undecided(k, front.spec)
        unknown = np.array(UNKNOWN_OF_STATE)[sample.occupancy.numpy().argmax(axis=0)]
        np.testing.assert_array_equal(sample.labels.numpy(), scene.image_labels(k, (96, 320)))
        np.testing.assert_array_equal(sample.truth.numpy(), np.where(view, truth, unknown))
    assert (truth[view] == IGNORE).any()


def test_a_scene_whose_poses_cannot_be_read_is_refused_before_its_index_is_written(copy, tmp_path):
    poses = copy / SCENE / "lidar" / "poses.json"
    poses.write_text(poses.read_text().replace('"x": ', '"x": NaN, "was": ', 1))
    with pytest.raises(DataError, match=r"poses.json: "):
        write_pandaset_index(tmp_path / "data", copy, SCENE)
    assert not (tmp_path / "data").exists()


def test_what_cannot_be_a_data_set_is_refused(root, tmp_path):
    with pytest.raises(ArgumentError, match=r"camera: expected one of .*, found 'roof'"):
        write_pandaset_index(tmp_path, root, SCENE, ["roof"])
    with pytest.raises(ArgumentError, match="test_cameras: expected at least one camera less"):
        write_pandaset_index(tmp_path, root, SCENE, ["front_camera", "left_camera"])
    write_pandaset_index(tmp_path, root, SCENE)
    with pytest.raises(DataError, match=r"dataset.json: expected no data set yet"):
        write_pandaset_index(tmp_path, root, SCENE)
    moved = json.loads((tmp_path / "dataset.json").read_text()) | {"root": "nowhere"}
    (tmp_path / "dataset.json").write_text(json.dumps(moved))
    with pytest.raises(DataError, match=r"root: a folder that holds the drives, found 'nowhere'"):
        load_index(tmp_path)
