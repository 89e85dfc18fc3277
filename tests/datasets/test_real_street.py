"""The shipped real street: complete, small, under its licence, and as good to work with as the simulated one."""

import json

import numpy as np
import pytest

from semgrid_edu.camera import invert_rigid, transform_points
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.index import load_index
from semgrid_edu.datasets.project_lidar import cells_in_view, closest_returns
from semgrid_edu.datasets.samples import real_drive, real_weights, samples_dir
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import confusion_matrix, pixel_accuracy
from semgrid_edu.networks import load_net
from semgrid_edu.occupancy import State
from semgrid_edu.pipeline import run_pipeline
from semgrid_edu.planes import plane_heights, plane_pixels
from semgrid_edu.storage.provenance import provenance_problems

SPEC = GridSpec.compact()
FOLDER = samples_dir() / "real"


@pytest.fixture(scope="module")
def drive():
    return real_drive()


@pytest.fixture(scope="module")
def results(drive):
    return list(run_pipeline(drive[:4], load_net(real_weights(), drive.camera)))


def test_it_is_as_it_was_made_and_small(drive):
    assert drive.problems() == []
    assert provenance_problems(FOLDER) == []
    assert sum(path.stat().st_size for path in FOLDER.rglob("*") if path.is_file()) <= 10e6
    assert drive.camera.size[1] <= 640


def test_licence_and_terms_lie_beside_it(drive):
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    for words in ("PandaSet by Hesai and Scale AI", "https://creativecommons.org/licenses/by/4.0/", "What was changed"):
        assert words in text
    for term in ("attribute the data", "makers' names or marks for publicity", "identify anyone", "remove data"):
        assert term in text
    assert "PandaSet by Hesai and Scale AI, CC BY 4.0" in drive.credit
    command = json.loads((FOLDER / "provenance.json").read_text())["command"]
    assert command == "python data_samples/make_real.py PANDASET 002 10 real"


def test_its_index_lists_every_frame(drive):
    ((opened, numbers),) = load_index(FOLDER).drives("drive")
    assert opened.folder == drive.folder
    assert numbers == list(range(len(drive))) == list(range(10))


def test_much_of_it_is_labelled(drive):
    for frame in drive[::3]:
        labels = frame.labels
        assert 0.3 < np.mean(labels.image != IGNORE) < 0.6
        assert 0.1 < np.mean(labels.birdseye != IGNORE) < 0.3
        assert not (labels.visible & (labels.birdseye == IGNORE)).mean() > 0.01
        assert {"road", "car", "vegetation"} <= {KITTI_14.names[c] for c in np.unique(labels.birdseye) if c != IGNORE}


def test_returns_fall_on_the_pixels_that_their_labels_are_on(drive):
    """Pixels get the depth of labelled returns, from both LIDARs; the returns that are kept are of one of them."""
    frame = drive[5]
    returns, (u, v) = (part.T for part in closest_returns(frame))
    depth = transform_points(frame.camera.T_camera_from_lidar, frame.points[returns, :3])[:, 2]
    known = np.isfinite(frame.labels.depth[v, u])
    assert known.mean() > 0.8
    assert np.median(np.abs(frame.labels.depth[v, u] - depth)[known]) < 0.02


def test_what_moves_is_the_street_not_the_camera(drive):
    """The vehicle waits, and its LIDAR frame is fixed to the camera, so returns of what stands stay where they are."""
    first, last = drive[0], drive[6]
    T = invert_rigid(first.T_world_from_lidar) @ last.T_world_from_lidar
    assert np.linalg.norm(T[:3, 3]) < 0.1
    standing = [np.unique((frame.points[:, :3] // 1.0).astype(int), axis=0) for frame in (first, last)]
    both = {tuple(one) for one in standing[0]} & {tuple(one) for one in standing[1]}
    assert len(both) > 0.75 * min(map(len, standing))


def test_a_cell_is_in_view_when_some_plane_has_a_point_of_it_in_the_image(drive):
    _, visible = plane_pixels(SPEC, plane_heights(), drive.camera)
    np.testing.assert_array_equal(cells_in_view(drive.camera, SPEC), visible.any(axis=0))


def test_cells_in_view_without_a_label_are_left_out_and_the_others_are_unknown(drive, results):
    for k, result in enumerate(results):
        truth, in_view = grid_truth(result.frame.labels, result.belief.probability, SPEC), drive.undecided(k, SPEC)
        assert np.mean(in_view == cells_in_view(drive.camera, SPEC)) > 0.97
        assert 0.2 < np.mean(truth[in_view] < KITTI_14.n_semantic) < 0.7
        assert ((truth == IGNORE) <= in_view).all()
        assert (truth[~in_view] >= KITTI_14.n_semantic).all()


def test_its_image_labels_are_those_of_the_labelled_pixels(drive):
    labels = drive[0].labels.image
    assert np.mean(drive.image_labels(0, (96, 320)) != IGNORE) > np.mean(labels != IGNORE) + 0.05
    pairs = drive.image_labels(0, (29, 96)), labels.reshape(29, 5, 96, 5).swapaxes(1, 2).reshape(29, 96, 25)
    for pooled, pixels in zip(pairs[0].ravel(), pairs[1].reshape(-1, 25), strict=True):
        known = pixels[pixels != IGNORE]
        counts = np.bincount(known, minlength=len(KITTI_14))
        assert pooled == (counts.argmax() if known.size else IGNORE)


def test_it_can_be_scored(results):
    confusion = sum(
        confusion_matrix(
            grid_truth(result.frame.labels, result.belief.probability, SPEC), result.grid.argmax(axis=0), 14
        )
        for result in results
    )
    assert confusion.sum() < len(results) * SPEC.shape[0] * SPEC.shape[1]
    assert pixel_accuracy(confusion) > 0.6


def test_the_shipped_network_invents_no_crowd(results):
    """A network that learns nothing of cells far from labels calls more than 160 cells pedestrian; ten are."""
    person = KITTI_14.index("pedestrian")
    for result in results:
        truth = grid_truth(result.frame.labels, result.belief.probability, SPEC)
        assert (result.grid.argmax(axis=0) == person).sum() < 3 * (truth == person).sum()


def test_the_filter_sees_the_oncoming_car_move_and_the_street_stand(results):
    dynamic = results[-1].belief.probability[State.DYNAMIC] > 0.5
    rows, cols = np.nonzero(dynamic)
    x, y = SPEC.x_max - (rows + 0.5) * SPEC.cell, SPEC.y_max - (cols + 0.5) * SPEC.cell
    oncoming = (x < 25) & (y > 4) & (y < 12)
    assert oncoming.sum() > 10
    velocity = results[-1].belief.velocity[:, rows[oncoming], cols[oncoming]]
    assert np.nanmedian(velocity[0]) < -2
    assert dynamic.mean() < 0.05
