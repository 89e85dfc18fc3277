import numpy as np
from worlds.lecture_12_claims import claim_picture, judged
from worlds.lecture_12_intervals import by_seed, half_width, some_drives, tried
from worlds.lecture_12_pictures import kept

from semgrid_edu.metrics import class_accuracy, pixel_accuracy
from semgrid_edu.workshop.scoring.statistics import drive_interval, paired_interval


def test_a_claims_picture_marks_each_statement_and_its_limit():
    readings = kept("claims")["claims"]["5"]["readings"]
    figure = claim_picture(readings)
    assert len(figure.axes) == 4
    for ax, reading in zip(figure.axes, readings, strict=True):
        marks = [{"yes": True, "no": False, "?": None}[text.get_text()] for text in ax.texts]
        assert marks == [one["holds"] for one in judged(reading)]
        limits = [line for line in ax.get_lines() if line.get_label() == "limit"]
        assert [line.get_xdata()[0] for line in limits] == [100 * one["limit"] for one in judged(reading)]


def test_what_all_statements_share_is_written_once():
    figure = claim_picture(kept("claims")["claims"]["10"]["readings"])
    names = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert names == ["pixel accuracy", "class accuracy", "FmIoU"]
    assert "end to end minus two stages" in figure.axes[0].get_xlabel()


def test_few_drives_have_the_second_class():
    matrices = some_drives(np.random.default_rng(0), 500, 0.2)
    assert matrices.shape == (500, 2, 2)
    assert (matrices[:, 0].sum(axis=1) == 2000).all()
    assert 70 < (matrices[:, 1].sum(axis=1) > 0).sum() < 130


def test_an_interval_that_holds_for_a_common_class_fails_for_a_rare_one():
    def interval(matrices, metric):
        return drive_interval(matrices[None], metric)

    common, rare = (tried(share, interval, class_accuracy, trials=60) for share in (0.8, 0.1))
    assert common[:, 1].mean() > 0.85 > rare[:, 1].mean()
    assert not rare[rare[:, 0] == 0, 1].any()  # no drive has the class: another quantity


def test_a_half_width_is_the_packages_and_shrinks_with_what_is_bought():
    usual, two = (by_seed("claims", f"segnet-lidar{end}", "lidar", 3) for end in ("", "-two-stage"))
    assert usual.shape == two.shape == (3, 110, 14, 14)

    def difference(a, b):
        return pixel_accuracy(a) - pixel_accuracy(b)

    one = paired_interval(usual, two, pixel_accuracy)
    now, seeds, drives = (half_width(difference, (usual, two), *n) for n in ((1, 1), (4, 1), (1, 4)))
    np.testing.assert_allclose(now, 50 * (one.high - one.low))
    assert seeds < 0.4 * now < 0.8 * now < drives < now
