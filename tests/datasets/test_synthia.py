"""SYNTHIA's layout: every class, depth carried back to known points, poses, and what is missing or damaged."""

import shutil

import cv2
import numpy as np
import pytest
from PIL import Image

from semgrid_edu.errors import DataError
from semgrid_edu.frame import LABEL_GRID
from semgrid_edu.labels import IGNORE, SYNTHIA_10
from semgrid_edu.workshop.paper.datasets import SynthiaSequence

NAME = "SYNTHIA-SEQS-04-SPRING"
VIEW = "Stereo_Left/Omni_F"
SIZE = (40, 64)
FOCAL, CENTRE_U, CENTRE_V = 32.0, 31.5, 19.5
HEIGHT = 1.5
"""Metres from the ground to the camera."""
WALL = 24.0
"""Metres ahead at which a building fills the upper half of the image."""
STEP = 0.8

README = {
    0: "void", 2: "building", 3: "road", 4: "sidewalk", 5: "fence", 6: "vegetation", 7: "pole", 8: "car", 9: "sign",
    12: "lane",
}  # fmt: skip
"""Classes of the readme that the paper detects; sky, pedestrian, bicycle, reserved and traffic light are void to it."""


def write_png16(path, channels):
    """Write three 16-bit channels with OpenCV, which takes blue, green, red."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.dstack(channels)[..., ::-1].astype(np.uint16))


def scene(wall=WALL):
    """A flat road from the lower edge of the image to a wall: class and depth of each pixel, by geometry alone."""
    rows = np.arange(SIZE[0])[:, None] * np.ones(SIZE[1])
    below = np.maximum(rows - CENTRE_V, 1e-9)
    depth = np.minimum(FOCAL * HEIGHT / below, wall)
    return np.where(depth < wall, 3, 2), depth


def colours(first):
    """An image whose first pixel has a red of its own."""
    image = np.random.default_rng(first).integers(0, 256, (*SIZE, 3), dtype=np.uint8)
    image[0, 0, 0] = first
    return image


@pytest.fixture
def root(tmp_path):
    folder = tmp_path / NAME
    (folder / "RGB" / VIEW).mkdir(parents=True)
    (folder / "CameraParams" / VIEW).mkdir(parents=True)
    (folder / "CameraParams" / "intrinsics.txt").write_text(f"{FOCAL}\n\n{CENTRE_U}\n\n{CENTRE_V}\n\n0.8\n")
    for k in range(3):
        classes, depth = scene(WALL - k * STEP)
        Image.fromarray(colours(k)).save(folder / "RGB" / VIEW / f"{k:06d}.png")
        write_png16(folder / "GT/LABELS" / VIEW / f"{k:06d}.png", [classes, np.full(SIZE, 7), np.zeros(SIZE)])
        write_png16(folder / "Depth" / VIEW / f"{k:06d}.png", [np.round(100 * depth)] * 3)
        (folder / "CameraParams" / VIEW / f"{k:06d}.txt").write_text(pose(k))
    return tmp_path


def pose(k):
    """A camera that drives along the world's x axis. Its x points right (world z), y up, z back (world -x)."""
    T_world_from_camera = np.array([[0, 0, -1, 10 + k * STEP], [0, 1, 0, 2], [1, 0, 0, 3], [0, 0, 0, 1]])
    return " ".join(str(float(x)) for x in T_world_from_camera.T.ravel()) + "\n"


def test_a_depth_camera_has_no_bonnet(root):
    frame = SynthiaSequence(root, NAME)[0]
    assert frame.vehicle_returns.shape == (len(frame.points),)
    assert not frame.vehicle_returns.any()


def test_depth_in_metres_is_told(root, folder):
    _, depth = scene(WALL)
    write_png16(folder / "Depth" / VIEW / "000000.png", [np.round(depth)] * 3)
    with pytest.raises(DataError, match=r"a camera at least 0\.5 m above .* is the depth in metres"):
        SynthiaSequence(root, NAME)[0]


@pytest.fixture
def folder(root):
    return root / NAME


class TestFrames:
    def test_time_and_image(self, root):
        frames = SynthiaSequence(root, NAME)[:]
        assert [frame.time for frame in frames] == pytest.approx([0, 0.2, 0.4])
        assert [frame.image[0, 0, 0] for frame in frames] == [0, 1, 2]

    def test_camera(self, root):
        camera = SynthiaSequence(root, NAME).camera
        np.testing.assert_array_equal(camera.K, [[FOCAL, 0, CENTRE_U], [0, FOCAL, CENTRE_V], [0, 0, 1]])
        # A point 5 m ahead, 2 m to the left and 1 m up of the camera.
        np.testing.assert_allclose(camera.T_camera_from_lidar @ [5, 2, 1, 1], [-2, -1, 5, 1])

    def test_height_of_the_camera_is_that_of_the_road(self, root):
        assert SynthiaSequence(root, NAME).camera.lidar_height == pytest.approx(HEIGHT, abs=0.01)

    def test_the_world_is_the_first_frame_and_the_camera_drives_ahead(self, root):
        for k, frame in enumerate(SynthiaSequence(root, NAME)):
            expected = np.eye(4)
            expected[0, 3] = k * STEP
            np.testing.assert_allclose(frame.T_world_from_lidar, expected, atol=1e-12)

    def test_depth_is_carried_back_to_road_and_wall(self, root):
        frame = SynthiaSequence(root, NAME)[0]
        assert len(frame.points) == SIZE[0] / 4 * SIZE[1] / 2
        x, _, z, reflectance = frame.points.T
        wall = x > WALL - 0.01
        np.testing.assert_allclose(x[wall], WALL, atol=0.006)
        np.testing.assert_allclose(z[~wall], -HEIGHT, atol=0.006 * HEIGHT)
        assert (reflectance == 0).all()
        # The first pixel kept is the upper left one: it looks (31.5, 19.5) / 32 to the left and up.
        expected = [WALL, WALL * CENTRE_U / FOCAL, WALL * CENTRE_V / FOCAL]
        np.testing.assert_allclose(frame.points[0, :3], expected, atol=1e-4)

    def test_what_the_labels_hold_comes_out(self, root):
        classes, depth = scene()
        labels = SynthiaSequence(root, NAME)[0].labels
        names = np.where(classes == 3, SYNTHIA_10.index("road"), SYNTHIA_10.index("building"))
        np.testing.assert_array_equal(labels.image, names)
        np.testing.assert_allclose(labels.depth, depth, atol=0.006)

    def test_truth_from_above(self, root):
        labels = SynthiaSequence(root, NAME)[0].labels
        seen = labels.birdseye[labels.birdseye != IGNORE]
        assert set(seen) == {SYNTHIA_10.index("road"), SYNTHIA_10.index("building")}
        np.testing.assert_array_equal(labels.visible, labels.birdseye != IGNORE)
        x = LABEL_GRID.centers()[..., 0]
        assert x[labels.birdseye == SYNTHIA_10.index("building")] == pytest.approx(WALL, abs=0.1)
        assert (labels.birdseye[x > WALL + 0.1] == IGNORE).all()


def test_every_class_becomes_that_of_synthia_10(root, folder):
    numbers = np.arange(SIZE[0] * SIZE[1]).reshape(SIZE) % 16
    write_png16(folder / "GT/LABELS" / VIEW / "000001.png", [numbers, 0 * numbers, 0 * numbers])
    expected = np.array([SYNTHIA_10.index(README.get(number, "void")) for number in range(16)])
    np.testing.assert_array_equal(SynthiaSequence(root, NAME)[1].labels.image, expected[numbers])


@pytest.mark.parametrize("nothing", [0, 65535])
def test_where_no_depth_is_there_is_no_point(root, folder, nothing):
    write_png16(folder / "Depth" / VIEW / "000001.png", [np.full(SIZE, nothing)] * 3)
    frame = SynthiaSequence(root, NAME)[1]
    assert frame.points.shape == (0, 4)
    assert np.isnan(frame.labels.depth).all()
    assert not frame.labels.visible.any()


def test_what_hangs_over_a_road_leaves_it_a_road(root, folder):
    # The upper half of the wall, 24 m ahead, becomes a tree's crown over a strip of road at the same place.
    classes, depth = scene()
    strip = (depth > 12) & (depth < WALL)
    crown = np.zeros(SIZE, bool)
    crown[:4] = True
    depth = np.where(crown, 16.0, depth)
    classes = np.where(crown, 6, classes)
    assert strip.any()
    write_png16(folder / "GT/LABELS" / VIEW / "000001.png", [classes, 0 * classes, 0 * classes])
    write_png16(folder / "Depth" / VIEW / "000001.png", [np.round(100 * depth)] * 3)
    labels = SynthiaSequence(root, NAME)[1].labels
    before = SynthiaSequence(root, NAME)[0].labels.birdseye
    road = before == SYNTHIA_10.index("road")
    assert (labels.birdseye[road] == SYNTHIA_10.index("road")).all()
    assert (labels.birdseye == SYNTHIA_10.index("vegetation")).any()


class TestDamage:
    @pytest.mark.parametrize("kind", ["GT/LABELS", "Depth", "CameraParams"])
    def test_a_missing_file_hurts_its_own_frame_only(self, root, folder, kind):
        (file,) = (folder / kind / VIEW).glob("000001.*")
        file.unlink()
        sequence = SynthiaSequence(root, NAME)
        assert sequence[2].time == 0.4
        assert sequence.problems() == [f"{file}: expected a file, found nothing there"]

    @pytest.mark.parametrize(
        ("file", "content", "message"),
        [
            ("CameraParams/intrinsics.txt", "32 31.5 19.5", "expected focal length"),
            (f"CameraParams/{VIEW}/000001.txt", "1 2 3", "expected 16 numbers"),
            (f"CameraParams/{VIEW}/000001.txt", pose(1).replace("1.0", "1.1"), "expected"),
            (f"GT/LABELS/{VIEW}/000001.png", "no png", "expected a sound PNG image"),
        ],
    )
    def test_a_damaged_file_is_named(self, root, folder, file, content, message):
        (folder / file).write_text(content)
        with pytest.raises(DataError, match=f"{file}: {message}"):
            SynthiaSequence(root, NAME)[1]

    def test_an_unknown_class_is_named(self, root, folder):
        write_png16(folder / "GT/LABELS" / VIEW / "000001.png", [np.full(SIZE, 16)] * 3)
        with pytest.raises(DataError, match=r"000001.png: expected labels among 0, .*, 15, found 16"):
            SynthiaSequence(root, NAME)[1]

    def test_no_road_to_stand_on(self, root, folder):
        shutil.copy(folder / "GT/LABELS" / VIEW / "000000.png", folder / "sound.png")
        write_png16(folder / "GT/LABELS" / VIEW / "000000.png", [np.zeros(SIZE)] * 3)
        with pytest.raises(DataError, match="expected road within 20 m, to know the camera's height, found none"):
            SynthiaSequence(root, NAME)[1]

    def test_poses_in_another_convention_are_told(self, root, folder):
        # As if the files held the camera with its z ahead: then the car would drive backward.
        for k in range(3):
            text = pose(k).split()
            text[4:12] = [str(-float(x)) for x in text[4:12]]
            (folder / "CameraParams" / VIEW / f"{k:06d}.txt").write_text(" ".join(text))
        (problem,) = SynthiaSequence(root, NAME).problems()
        assert "expected steps of which at least 0.9 are ahead, found of a step of the camera -1.00 ahead" in problem
