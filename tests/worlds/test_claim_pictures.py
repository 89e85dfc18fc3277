from worlds.lecture_12_claims import claim_picture, judged
from worlds.lecture_12_pictures import kept


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
