"""The stages and their ledger: every price is the number of its sentence, every dashed line joins two drawn nodes."""

import re
from inspect import signature

import pytest
from matplotlib.patches import Ellipse, PathPatch
from worlds.lecture_00_ledger import STAGES, ledger, ledger_table, stage_table
from worlds.lecture_00_stage_graph import Price, short
from worlds.lecture_01_line import bayes_on_a_line
from worlds.lecture_02_cell import read_scans

from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent

PRICED = [(stage, edge) for stage in STAGES for edge in stage.cut if edge.price]
EACH_STAGE = pytest.mark.parametrize("stage", STAGES, ids=[stage.id for stage in STAGES])


def graph_of(stage):
    return stage.build(read_scans("##.")) if "scans" in signature(stage.build).parameters else stage.build()


def numbers(sentence):
    """The numbers of a sentence, each with half a unit of its last digit; fractions are exact."""
    found = [(1.0, 0.0011)] if re.search(r"\b1\b(?!/)", sentence) else []
    found += [(int(a) / int(b), 1e-9) for a, b in re.findall(r"\b(\d)/(\d)\b", sentence)]
    return found + [(float(n), 0.51 * 10.0 ** -len(n.partition(".")[2])) for n in re.findall(r"\d+\.\d+", sentence)]


@pytest.mark.parametrize("edge", [edge for _, edge in PRICED], ids=[edge.price.__name__ for _, edge in PRICED])
def test_a_price_is_the_number_of_its_sentence(edge):
    told = numbers(edge.cost)
    for measured in edge.price()[:2]:
        assert measured == 0 or any(abs(measured - number) <= margin for number, margin in told)


@EACH_STAGE
def test_every_dashed_line_joins_two_drawn_nodes_and_its_price_can_be_read(stage):
    """A price is at least 8 points high, and on no node and no other text."""
    graph = graph_of(stage)
    assert graph.cut == stage.cut
    assert [edge.ends for edge in graph.dashed] == [edge.ends for edge in stage.cut]
    ax = graph.draw()
    ax.figure.set_dpi(110)
    ax.figure.canvas.draw()
    assert sum(type(artist) is PathPatch for artist in ax.patches) == len(stage.cut)
    texts = [(text, text.get_window_extent()) for text in ax.texts if text.get_text()]
    prices = [(text, here) for text, here in texts if "\u2192" in text.get_text()]
    assert [text.get_text() for text, _ in prices] == [edge.price().text for edge in stage.cut if edge.price]
    others = [artist.get_window_extent() for artist in ax.patches if type(artist) is Ellipse]
    for text, here in prices:
        assert text.get_fontsize() >= 8
        assert not any(here.overlaps(there) for there in others)
        assert not any(here.overlaps(there) for other, there in texts if other is not text)
        assert ax.get_window_extent().contains(here.x0, here.y0)
        assert ax.get_window_extent().contains(here.x1, here.y1)


def test_an_edge_whose_ends_a_small_graph_does_not_have_is_not_drawn():
    assert bayes_on_a_line(steps=2).dashed == []


def test_the_ledger_lists_one_line_per_price():
    lines = ledger()
    assert [(line.stage, line.edge) for line in lines] == [(stage.id, edge.edge) for stage, edge in PRICED]
    assert [line for line in lines if line.stage == "bof"] == list(ledger("bof"))


def test_the_table_has_a_row_per_line():
    head, rule, row = ledger_table(ledger("beam")).splitlines()
    assert head.count("|") == rule.count("|") == row.count("|")
    assert all(text in row for text in ("02", "beam", ".34", ".57"))


@pytest.mark.parametrize(
    ("number", "written"), [(0, "0"), (0.0096, ".010"), (0.5, ".50"), (2 / 3, ".67"), (12.3, "12.30")]
)
def test_numbers_are_written_short(number, written):
    assert short(number) == written
    assert Price(number, 1.0, "things").text == f"{written} \u2192 1"


@EACH_STAGE
def test_the_check_and_the_lecture_of_a_stage_exist(stage):
    path, test = stage.check.split("::")
    assert f"def {test}(" in (NOTEBOOKS.parent / path).read_text(encoding="utf-8")
    name, tag = stage.lecture.split("#")
    cells = read_percent(NOTEBOOKS / "src" / f"{name}.py").cells
    assert any(tag in cell.metadata.get("tags", []) for cell in cells)


def test_links_of_the_table_of_stages_work_in_the_folder_of_notebooks():
    links = re.findall(r"\]\(([^)]*)\)", stage_table())
    assert len(links) == 3 * len(STAGES)
    assert len({stage.id for stage in STAGES}) == len(STAGES)
    assert [link for link in links if not (NOTEBOOKS / link).exists()] == []
