from types import SimpleNamespace

import numpy as np
import pytest

from semgrid_edu.labels import KITTI_14, SYNTHIA_10
from semgrid_edu.metrics import METRICS, pixel_accuracy
from semgrid_edu.workshop.paper.reports.claims import CLAIMS, STATEMENTS, called, called_void
from semgrid_edu.workshop.paper.reports.deviations import deviations
from semgrid_edu.workshop.paper.reports.verdicts import Statement, verdict
from semgrid_edu.workshop.paper.runs.other_runs import time_saved
from semgrid_edu.workshop.paper.runs.paper import NETWORKS, TABLE_1_SCORES, TABLE_3_CONFUSION
from semgrid_edu.workshop.paper.runs.scales import SCALES
from semgrid_edu.workshop.paper.runs.score_runs import NETWORK, WITH_CRF
from semgrid_edu.workshop.scoring.confusions import FrameConfusions
from semgrid_edu.workshop.scoring.score_with_interval import on_cells, score_with_interval, shown, shown_seeds

DRIVES, CELLS = 12, 2000


class Counted:
    """A run whose grids were counted: two classes, called right so often; drives differ by chance."""

    def __init__(self, seed, **right):
        self.seed, self.right = seed, right

    def confusions(self, _root, method, _truth, _band=None):
        rng, (first, second) = np.random.default_rng(self.seed), self.right[method]
        matrices = np.zeros((DRIVES, 14, 14), int)
        for matrix in matrices:  # the second class is ten times rarer
            for c, (cells, share) in enumerate(((CELLS, first), (CELLS // 10, second))):
                matrix[c, c] = round(cells * (share + rng.normal(0, 0.005)))
                matrix[c, 1 - c] = cells - matrix[c, c]
        return FrameConfusions(tuple(f"drive {k}" for k in range(DRIVES)), {method: matrices})


def networks(**right):
    """Three seeds of each network of Table 1: what it calls right without and with the CRF."""
    return {
        name: [Counted(seed, **{NETWORK: without, WITH_CRF: with_crf}) for seed in range(3)]
        for name, (without, with_crf) in right.items()
    }


def test_every_claim_has_its_statements():
    assert list(CLAIMS) == list(STATEMENTS) == list(range(1, 10))


def judge(number, runs, drives=DRIVES):
    return verdict(STATEMENTS[number](runs, None), 3, drives)


SMOOTHED = {"segnet": ((0.9, 0.6), (0.93, 0.5)), "fcn": ((0.88, 0.58), (0.9, 0.5)), "deeplab": ((0.8, 0.5), (0.9, 0.3))}


def test_better_networks_in_the_papers_order_reproduce_claim_1():
    assert judge(1, SimpleNamespace(networks=networks(**SMOOTHED))) == "reproduced"


def test_a_wrong_order_of_two_networks_does_not():
    swapped = SMOOTHED | {"segnet": SMOOTHED["fcn"], "fcn": SMOOTHED["segnet"]}
    assert judge(1, SimpleNamespace(networks=networks(**swapped))) == "not reproduced"


def test_equal_networks_tell_nothing():
    level = dict.fromkeys(NETWORKS, ((0.9, 0.6), (0.9, 0.6)))
    runs = SimpleNamespace(networks=networks(**level))
    assert judge(1, runs) == "cannot tell"


def test_a_crf_that_smooths_reproduces_claims_2_and_3_and_one_that_does_nothing_does_not_tell():
    found = networks(**SMOOTHED)
    assert judge(2, SimpleNamespace(networks=found)) == "reproduced"
    assert judge(3, SimpleNamespace(new_routes=found["segnet"])) == "reproduced"
    idle = networks(segnet=((0.9, 0.6), (0.9, 0.6)))["segnet"]
    assert judge(3, SimpleNamespace(new_routes=idle)) == "cannot tell"
    better = networks(segnet=((0.9, 0.5), (0.93, 0.6)))["segnet"]
    assert judge(3, SimpleNamespace(new_routes=better)) == "not reproduced"


def test_few_drives_or_seeds_are_too_small_to_tell():
    runs = SimpleNamespace(networks=networks(**SMOOTHED))
    assert judge(2, runs, drives=9) == "cannot tell (too small)"
    assert verdict(STATEMENTS[2](runs, None), 2, DRIVES) == "cannot tell (too small)"


@pytest.mark.parametrize(
    ("low", "high", "above", "holds"),
    [(0.1, 0.2, True, True), (-0.2, -0.1, True, False), (-0.1, 0.1, True, None), (-0.2, -0.1, False, True)],
)
def test_a_statement_holds_when_the_whole_interval_is_on_the_claimed_side(low, high, above, holds):
    assert Statement("", {"mean": 0, "low": low, "high": high, "seeds": []}, 0, above).holds is holds


def test_a_number_without_an_interval_tells_nothing():
    assert Statement("", {"mean": 0.5, "low": None, "high": None, "seeds": [0.5]}).holds is None


def test_the_papers_own_table_3_has_what_claim_4_says_of_it():
    matrix = np.array(TABLE_3_CONFUSION)
    road, car, lane = (SYNTHIA_10.index(name) for name in ("road", "car", "lane"))
    rows = matrix / matrix.sum(axis=1, keepdims=True)
    mean = np.diag(rows).mean()
    assert called_void(matrix) > 0.5
    assert called(matrix, road, road) > mean
    assert called(matrix, car, car) > mean
    assert called(matrix, lane, lane) > called(matrix, road, lane)


def test_the_paper_tells_every_network_with_and_without_crf():
    assert set(TABLE_1_SCORES) == {(name, crf) for name in NETWORKS for crf in (False, True)}
    assert all(set(row) == set(METRICS) for row in TABLE_1_SCORES.values())


def test_a_score_of_one_drive_has_no_interval():
    value = score_with_interval(np.array([[[[3, 1], [0, 4]]], [[[4, 0], [1, 3]]]]), pixel_accuracy)
    assert value == {"mean": 7 / 8, "low": None, "high": None, "seeds": [7 / 8, 7 / 8]}
    assert shown(value) == "87.5"
    assert shown_seeds(value) == "87.5, 87.5"


def test_many_seeds_are_shown_by_their_ends():
    value = {"mean": 0.5, "low": None, "high": None, "seeds": [0.5, 0.1, 0.95, 0.3, 0.2, 0.4]}
    assert shown_seeds(value) == "10.0 to 95.0 (6 seeds)"


def test_semantic_cells_are_the_first_ten_rows():
    kept = on_cells(np.ones((2, 3, 14, 14), int), "semantic", KITTI_14)
    assert kept.sum() == 2 * 3 * 10 * 14


def test_time_saved_has_students_interval():
    """Saved are 1/2, 3/4 and 5/8: mean 5/8, standard error 1/8 / sqrt 3, t_2 = 4.303."""
    value = time_saved(np.array([[1, 2], [1, 4], [3, 8]]))
    assert value["mean"] == pytest.approx(5 / 8)
    assert value["high"] - value["mean"] == pytest.approx(4.3027 / 8 / np.sqrt(3), rel=1e-4)


@pytest.mark.parametrize("scale", SCALES.values(), ids=SCALES)
def test_every_deviation_of_scale_is_told(scale):
    told = "\n".join(deviations(scale, "kitti"))
    assert scale.kitti in told
    assert f"{scale.image_iterations} steps" in told
    assert ("Compact networks" in told) == (scale.preset == "compact")
