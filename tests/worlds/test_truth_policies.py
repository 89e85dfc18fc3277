"""How wrong ways of making ground truth are: counts by hand, and trials on the sample drive."""

import re

import numpy as np
import pytest
from worlds import lecture_09_policies as policies
from worlds.lecture_09_counts import BAND_EDGES, COUNTED, TruthCounts, counts_of
from worlds.lecture_09_policies import TRIALS, Trial
from worlds.lecture_09_tables import class_table, distance_table, policy_table, truth_tables

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.ground_truth import TruthPolicy
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import LABEL_GRID
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.workshop.flaws import NO_FLAWS
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.calibration_files import write_calibration
from semgrid_edu.workshop.simulation.writer import DATE, write_drive

ROAD, WALK, CAR = (KITTI_14.index(name) for name in ("road", "sidewalk", "car"))
FREE, HIDDEN = KITTI_14.index("unknown-free"), KITTI_14.index("unknown-unobserved")
LANE = GridSpec(0.0, 25.0, -5.0, 5.0, 5.0)
"""5 rows, 12.5 to 22.5 m away, then 7.5 and 2.5 m; 2 columns."""


def counts():
    """Of 5 seen road cells 3 are found, 1 is mistaken, 1 is missed; one car is right, one isn't, and that is hidden."""
    truth = np.array([[ROAD, ROAD], [ROAD, FREE], [ROAD, CAR], [ROAD, HIDDEN], [FREE, FREE]])
    made = np.array([[ROAD, FREE], [CAR, FREE], [ROAD, CAR], [ROAD, CAR], [FREE, WALK]])
    standing = np.array([[ROAD, ROAD], [ROAD, CAR], [ROAD, CAR], [ROAD, ROAD], [ROAD, WALK]])
    return TruthCounts.of_frame(made, truth, standing, LANE, KITTI_14)


def of_class(c):
    return dict(zip(COUNTED, counts().cells.sum(axis=1)[:, c].tolist(), strict=True))


def test_cells_are_counted_by_class():
    assert of_class(ROAD) == {"seen": 5, "found": 3, "missed": 1, "labelled": 3, "right": 3, "hidden": 0}
    assert of_class(CAR) == {"seen": 1, "found": 1, "missed": 0, "labelled": 3, "right": 1, "hidden": 1}
    assert of_class(WALK) == {"seen": 0, "found": 0, "missed": 0, "labelled": 1, "right": 1, "hidden": 1}


def test_cells_are_counted_by_distance():
    # The centres of the rows lie 22.6, 17.7, 12.7, 7.9 and 3.5 m away.
    assert counts().cells[COUNTED.index("seen")].sum(axis=1).tolist() == [1, 3, 2, 0, 0, 0]


def test_shares_follow_from_the_counts():
    shares = counts().shares(axis=0)
    expected = {"found": 3 / 5, "mistaken": 1 / 5, "missed": 1 / 5, "wrong": 0, "hidden": 0, "iou": 3 / 5}
    assert {name: share[ROAD] for name, share in shares.items()} == pytest.approx(expected)
    assert shares["wrong"][CAR] == pytest.approx(2 / 3)
    assert shares["iou"][CAR] == pytest.approx(1 / 2)  # of the two cars in sight of the camera one is right
    assert np.isnan(shares["found"][WALK])
    assert counts().shares(axis=(0, 1))["found"] == pytest.approx(4 / 6)
    assert (counts() + counts()).shares(axis=(0, 1))["wrong"] == pytest.approx(2 / 7)


def test_maps_of_another_grid_are_refused():
    flat = np.zeros(LANE.shape, int)
    with pytest.raises(ArgumentError, match="standing"):
        TruthCounts.of_frame(flat, flat, flat.T, LANE, KITTI_14)


def test_every_cell_of_the_grid_lies_in_a_band():
    corner = np.hypot(LABEL_GRID.x_max, LABEL_GRID.y_max)
    assert BAND_EDGES[0] == 0
    assert BAND_EDGES[-1] >= corner


@pytest.fixture(scope="module")
def scored():
    """Four trials on a frame of the shipped drive."""
    trials = {
        "paper": TRIALS["one scan (our reading)"],
        "bare": Trial(TruthPolicy(cleanup="none")),
        "exact": Trial(flaws=NO_FLAWS),
        "wide": Trial(TruthPolicy(past=2, future=2, movers="carved")),
    }
    return policies.score_frame(trials, sample_drive()[:6], 3, GridSpec.compact(), seed=4)


class TestSampleDrive:
    def test_all_trials_are_measured_by_the_same_truth(self, scored):
        seen = [one.cells[COUNTED.index("seen")] for one in scored.values()]
        assert seen[0].sum() > 1000
        for other in seen[1:]:
            np.testing.assert_array_equal(other, seen[0])

    def test_closing_gaps_labels_more_cells(self, scored):
        paper, bare = (scored[name].shares(axis=(0, 1)) for name in ("paper", "bare"))
        assert paper["found"] > bare["found"]

    def test_more_scans_leave_fewer_cells_without_a_label(self, scored):
        assert scored["wide"].shares(axis=(0, 1))["missed"] < scored["paper"].shares(axis=(0, 1))["missed"]

    def test_errors_in_the_data_make_it_worse(self, scored):
        assert scored["paper"].shares(axis=(0, 1))["iou"] < scored["exact"].shares(axis=(0, 1))["iou"]

    def test_the_same_seed_gives_the_same_counts(self, scored):
        again = policies.score_frame({"paper": Trial()}, sample_drive()[:6], 3, GridSpec.compact(), seed=4)
        np.testing.assert_array_equal(again["paper"].cells, scored["paper"].cells)

    def test_a_frame_that_has_no_labels_is_refused(self):
        with pytest.raises(ArgumentError, match="k: expected the number of a labelled frame"):
            policies.score_frame({}, sample_drive()[:2], 2, GridSpec.compact())


def test_windows_of_scans_reach_as_far_as_the_simulated_drives_and_as_their_names_say():
    for name, (policy, _) in TRIALS.items():
        said = re.search(r"(\d+) (scans before|before and after)", name)
        reach, after = (int(said[1]), said[2] == "before and after") if said else (0, False)
        assert (policy.past, policy.future) == (reach, reach * after)
        assert reach in (0, policies.REACH)


def test_a_simulated_frame_is_what_a_reader_finds_on_disk(tmp_path):
    (frame,) = policies.simulated_drive(7, n_frames=1)
    drive = SimulatedDrive(7, 1)
    write_calibration(tmp_path, drive.rig, DATE)
    write_drive(tmp_path, "0001", drive, {0})
    read = KittiRawDrive(tmp_path, "2026_01_01", "0001")[0]
    np.testing.assert_array_equal(frame.points, read.points)
    for kind in ("image", "birdseye", "visible"):
        np.testing.assert_array_equal(getattr(frame.labels, kind), getattr(read.labels, kind))
    np.testing.assert_allclose(frame.camera.T_camera_from_lidar, read.camera.T_camera_from_lidar, atol=1e-9)


def test_the_counts_of_all_drives_are_added_up(monkeypatch):
    numbers = []

    def score(trials, spec, number, lidar):
        numbers.append(number)
        return {name: TruthCounts(counts().cells * (number - 1699)) for name in trials}

    monkeypatch.setattr(policies, "score_trials", score)
    result = policies.truth_policies(seed=1, drives=4)
    assert numbers == [1700, 1701, 1702, 1703]
    paper = "one scan (our reading)"
    np.testing.assert_array_equal(counts_of(result, paper).cells, counts().cells * (1 + 2 + 3 + 4))
    assert list(result["drives"]) == ["1700", "1701", "1702", "1703"]
    assert policy_table(result) in truth_tables(result)
    assert class_table(result, paper) in truth_tables(result)
    found = {row.split("|")[1].strip(): row.split("|")[2].strip() for row in policy_table(result).splitlines()[2:]}
    assert found == dict.fromkeys(TRIALS, "66.7")
    assert "| 10-20 m  |  66.7 |     33.3 |    0.0 |" in distance_table(result, paper)
    with pytest.raises(ArgumentError, match="name"):
        counts_of(result, "none")
