"""The ledger of cut edges: every price is the number of its sentence, and every dashed line joins two drawn nodes."""

import inspect
import itertools
import re

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.patches import Ellipse, PathPatch

from semgrid_edu.errors import ArgumentError
from semgrid_edu.stage_models import (
    CutEdge,
    Price,
    bayes_on_a_line,
    beam_over_cells,
    bof_stage,
    class_over_time,
    cmcdot_stage,
    crf_stage,
    late_fusion,
    ledger,
    ledger_table,
    lidar_label_stage,
    one_cell,
    one_log_odds_cell,
    pixel_height,
    pixel_ray,
    post_pixels,
    prices,
    read_scans,
    scan_with_pose_error,
    shared_pixel,
    whole_system,
)
from semgrid_edu.stage_models.stage_graph import CATALOGUE, cut_edges, short

GRAPHS = {
    "line": bayes_on_a_line,
    "log-odds": lambda: one_log_odds_cell(read_scans("##.")),
    "beam": beam_over_cells,
    "pose": scan_with_pose_error,
    "bof": bof_stage,
    "cell": lambda: one_cell(read_scans("#.")),
    "cmcdot": cmcdot_stage,
    "pixel": pixel_ray,
    "height": pixel_height,
    "planes": shared_pixel,
    "network": post_pixels,
    "fusion": late_fusion,
    "label": lidar_label_stage,
    "crf": crf_stage,
    "system": whole_system,
    "memory": class_over_time,
}
PRICED = [(stage, edge) for stage in GRAPHS for edge in cut_edges(stage) if edge.measure]


@pytest.fixture(autouse=True)
def _close_figures():
    yield
    plt.close("all")


def numbers(sentence):
    """The numbers of a sentence, each with half a unit of its last digit; fractions are exact."""
    found = [(1.0, 0.0011)] if re.search(r"\b1\b(?!/)", sentence) else []
    found += [(int(a) / int(b), 1e-9) for a, b in re.findall(r"\b(\d)/(\d)\b", sentence)]
    return found + [(float(n), 0.51 * 10.0 ** -len(n.partition(".")[2])) for n in re.findall(r"\d+\.\d+", sentence)]


def test_the_catalogue_holds_the_stages_that_have_a_graph():
    assert set(GRAPHS) <= set(CATALOGUE["lectures"]) == set(CATALOGUE) - {"lectures"}


@pytest.mark.parametrize(("stage", "edge"), PRICED, ids=[edge.measure for _, edge in PRICED])
def test_a_price_is_the_number_of_its_sentence(stage, edge):
    told = numbers(edge.price)
    for measured in edge.measured()[:2]:
        assert measured == 0 or any(abs(measured - number) <= margin for number, margin in told)


def test_each_measure_prices_one_edge():
    measures = [edge.measure for _, edge in PRICED]
    public = inspect.getmembers(prices, inspect.isfunction)
    own = [name for name, one in public if one.__module__ == prices.__name__ and not name.startswith("_")]
    assert sorted(measures) == sorted(own)


def test_an_edge_without_a_measure_has_no_price():
    assert CutEdge("a - b", "Nobody has measured it.").measured() is None


@pytest.mark.parametrize("stage", GRAPHS)
def test_every_dashed_line_joins_two_drawn_nodes(stage):
    graph = GRAPHS[stage]()
    assert [edge.ends for edge in graph.dashed] == [edge.ends for edge in graph.cut]
    ax = graph.draw()
    lines = [artist for artist in ax.patches if type(artist) is PathPatch]
    assert len(lines) == len(graph.cut)
    assert [text for edge in graph.cut if edge.measure for text in [edge.measured().text]] == [
        text.get_text() for text in ax.texts if "\u2192" in text.get_text()
    ]


@pytest.mark.parametrize("stage", GRAPHS)
def test_prices_can_be_read(stage):
    """At least 8 points high, and on no node and no other text."""
    ax = GRAPHS[stage]().draw()
    ax.figure.set_dpi(110)
    ax.figure.canvas.draw()
    nodes = [artist.get_window_extent() for artist in ax.patches if type(artist) is Ellipse]
    texts = [(text, text.get_window_extent()) for text in ax.texts if text.get_text()]
    for (one, here), (other, there) in itertools.combinations(texts, 2):
        assert "\u2192" not in one.get_text() + other.get_text() or not here.overlaps(there)
    for text, here in texts:
        if "\u2192" in text.get_text():
            assert text.get_fontsize() >= 8
            assert not any(here.overlaps(node) for node in nodes)
            assert ax.get_window_extent().contains(here.x0, here.y0)
            assert ax.get_window_extent().contains(here.x1, here.y1)


def test_an_edge_whose_ends_a_small_graph_does_not_have_is_not_drawn():
    assert bayes_on_a_line(steps=2).dashed == []


def test_the_ledger_lists_one_line_per_price_in_the_order_of_the_catalogue():
    lines = ledger()
    assert [(line.stage, line.edge) for line in lines if line.stage in GRAPHS] == [
        (stage, edge.edge) for stage, edge in sorted(PRICED, key=lambda pair: list(GRAPHS).index(pair[0]))
    ]
    assert [line for line in lines if line.stage == "bof"] == list(ledger("bof"))
    assert all(np.isfinite(line[2:4]).all() for line in lines)


def test_the_table_has_a_row_per_line():
    lines = ledger("beam")
    head, rule, *rows = ledger_table(lines).splitlines()
    assert head.count("|") == rule.count("|") == rows[0].count("|")
    assert len(rows) == len(lines) == 1
    assert all(text in rows[0] for text in ("02", "beam", ".34", ".57"))


def test_an_unknown_stage_is_refused():
    with pytest.raises(ArgumentError, match="stage"):
        ledger("sonar")


@pytest.mark.parametrize(
    ("number", "written"), [(0, "0"), (0.0096, ".010"), (0.5, ".50"), (2 / 3, ".67"), (12.3, "12.30")]
)
def test_numbers_are_written_short(number, written):
    assert short(number) == written
    assert Price(number, 1.0, "things").text == f"{written} \u2192 1"
