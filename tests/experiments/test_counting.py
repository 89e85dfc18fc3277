"""Grids counted against the truth by distance and confidence, and what is counted otherwise."""

import json
from pathlib import Path

import numpy as np
import pytest
from sklearn.metrics import confusion_matrix

from semgrid_edu.camera import project, transform_points
from semgrid_edu.crf import CrfParams
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.storage.tensors import write_arrays
from semgrid_edu.workshop.paper.other_runs import boxes_on
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.score_runs import (
    CONFUSIONS,
    RELIABILITY,
    SEARCHED,
    CountingRun,
)
from semgrid_edu.workshop.paper.variants import EXACT, CalibrationError
from semgrid_edu.workshop.scoring.calibration import expected_calibration_error
from semgrid_edu.workshop.scoring.confusions import (
    BANDS,
    count_grids,
    distance_band_names,
    distance_bands,
    save_confusions,
)
from semgrid_edu.workshop.simulation.sensors.rig import Rig

SPEC = GridSpec(0.0, 71.0, -15.5, 15.5, 0.5)


class ThreeFrames:
    """Frames of two drives."""

    drives, spec, label_set = ("a", "a", "b"), SPEC, KITTI_14

    def __init__(self, truth, true):
        self.arrays = {"truth": truth, "true": true}

    def __len__(self):
        return len(self.drives)


class Here(CountingRun):
    """A run whose folder is the folder of all runs. It is only read, never done."""

    kind, tag = "score", "here"
    steps = pace = grids = None

    def folder(self, root):
        return root


@pytest.fixture(scope="module")
def counted(tmp_path_factory):
    """Three frames of two drives with random truths and grids, counted and written."""
    rng, folder = np.random.default_rng(0), tmp_path_factory.mktemp("counted")
    made, true = rng.integers(0, 14, (2, 3, *SPEC.shape)).astype(np.uint8)
    probability = rng.dirichlet(np.ones(14), (3, *SPEC.shape)).transpose(0, 3, 1, 2)
    frames = ThreeFrames(made, true)
    counts = count_grids(lambda k: {"network": probability[k], "classes": probability[k].argmax(axis=0)}, frames)
    write_arrays(folder / RELIABILITY, counts.reliability)
    save_confusions(folder / CONFUSIONS, counts.confusions)
    assert counts.methods == ("network", "classes")
    return folder, {"lidar": made, "true": true}, probability


@pytest.mark.parametrize("method", ["network", "classes"])
@pytest.mark.parametrize("truth", ["lidar", "true"])
def test_all_bands_together_are_the_whole_grid(counted, truth, method):
    folder, truths, probability = counted
    found = Here().confusions(RunCounts(folder), method, truth)
    called = probability.argmax(axis=1)
    for drive, frames in enumerate((slice(0, 2), slice(2, 3))):
        expected = confusion_matrix(truths[truth][frames].ravel(), called[frames].ravel(), labels=range(14))
        np.testing.assert_array_equal(found.counts[method][drive], expected)
    assert found.drives == ("a", "b")


def test_frames_labelled_by_their_data_set_have_one_truth():
    true = np.full((3, *SPEC.shape), 255, np.uint8)
    true[0, 0, 0] = 3
    counts = count_grids(lambda k: {"car": np.full(SPEC.shape, 3)}, ThreeFrames(true, true))
    assert {key.split(", ")[1] for key in counts.confusions.counts} == {"true labels"}
    assert counts.confusions.of("car", "true").total("car").sum() == 1  # unlabelled cells count nowhere
    assert counts.reliability == {}


def test_a_grid_of_another_shape_is_refused():
    with pytest.raises(ArgumentError, match="grids: expected the shape of the truth"):
        count_grids(lambda k: {"car": np.zeros((2, 2), int)}, ThreeFrames(*np.zeros((2, 3, *SPEC.shape), np.uint8)))


def test_a_band_holds_the_cells_at_its_distance(counted):
    folder, _, _ = counted
    x, y = np.moveaxis(SPEC.centers(), -1, 0)
    for name, low, high in zip(distance_band_names(), range(0, 70, 10), [*range(10, 70, 10), 100], strict=True):
        cells = ((x**2 + y**2 >= low**2) & (x**2 + y**2 < high**2)).sum()
        counted_there = Here().confusions(RunCounts(folder), "network", "true", name).counts["network"]
        assert counted_there.sum(axis=(1, 2)).tolist() == [2 * cells, cells]
    assert distance_bands(SPEC, BANDS)[-1, SPEC.shape[1] // 2] == 0


@pytest.mark.parametrize("truth", ["true", "lidar"])
def test_reliability_adds_up_over_the_frames(counted, truth):
    """The expected calibration error, computed from all cells at once."""
    folder, truths, probability = counted
    confidence, right = probability.max(axis=1), probability.argmax(axis=1) == truths[truth]
    bins = np.ceil(confidence * 15).astype(int)
    expected = sum(abs((confidence - right)[bins == b].sum()) for b in range(1, 16)) / confidence.size
    found = Here().reliability(RunCounts(folder), "network", truth)
    assert expected_calibration_error(found) == pytest.approx(expected)


def moved(error, x, y, z):
    """How far a point of the grid moves in the image, pixels to the right and down."""
    camera = Rig().camera
    places = []
    for one in (error.applied_to(camera), camera):
        uv, _ = project(transform_points(one.T_camera_from_grid, np.array([[x, y, z]])), one)
        places.append(uv[0])
    return places[0] - places[1]


def test_errors_of_calibration_move_the_world_as_they_are_named():
    f = Rig().camera.K[0, 0]
    ahead = (500.0, 0.0, Rig().camera.lidar_height)
    np.testing.assert_allclose(moved(CalibrationError(pitch=1.0), *ahead), [0, -f * np.tan(np.pi / 180)], atol=0.1)
    np.testing.assert_allclose(moved(CalibrationError(yaw=1.0), *ahead), [f * np.tan(np.pi / 180), 0], atol=0.1)
    du, dv = moved(CalibrationError(height=0.2), 20.0, 0.0, 0.0)
    assert du == pytest.approx(0, abs=1e-3)
    assert dv == pytest.approx(f * 0.2 / (20 - 0.27), rel=0.01)
    np.testing.assert_array_equal(moved(EXACT, *ahead), 0)


def test_errors_have_names_of_their_own():
    assert CalibrationError(pitch=-0.5, height=0.1).name == "-pitch-0.5-height+0.1m"
    assert EXACT.name == ""


def test_a_box_covers_its_cells():
    spec = GridSpec(0.0, 10.0, -5.0, 5.0, 1.0)
    along = {"centre": [4.5, 0.5, 0.7], "size": [3.0, 1.0, 1.4], "yaw": 0.0}
    across = along | {"yaw": np.pi / 2}
    cells = {(r, c) for r, c in np.argwhere(boxes_on(spec, [along], margin=0))}
    assert cells == {(4, 4), (5, 4), (6, 4)}
    assert {(r, c) for r, c in np.argwhere(boxes_on(spec, [across], margin=0))} == {(5, 3), (5, 4), (5, 5)}
    assert not boxes_on(spec, []).any()


def test_searched_parameters_are_those_of_the_searches():
    results = Path(__file__).parents[2] / "docs" / "results"
    for segmenter, (temperature, params) in SEARCHED.items():
        name = "crf_search.json" if segmenter == "segnet" else f"crf_search_{segmenter}.json"
        found = json.loads((results / name).read_text())
        assert temperature == pytest.approx(found["temperature"], abs=1e-4)
        assert params == CrfParams(**found["chosen"]["pixel accuracy"]["params"])
