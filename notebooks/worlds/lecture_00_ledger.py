"""All stages as graphical models, and the ledger: the cost of each edge that the real system cuts."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from worlds import (
    lecture_00_system,
    lecture_01_line,
    lecture_02_beam,
    lecture_02_cell,
    lecture_02_thick_walls,
    lecture_03_bof,
    lecture_04_cmcdot_graph,
    lecture_05_pixel_ray,
    lecture_09_label,
    lecture_10_crf,
    lecture_14_class_memory,
)
from worlds.lecture_00_equations import notebook_link
from worlds.lecture_00_stage_graph import CutEdge, StageGraph, short


class Stage(NamedTuple):
    """One stage of the system as a graphical model, small enough for exact inference.

    Parameters
    ----------
    id : str
        A short name, such as "bof".
    title : str
        The subject of the model, in a few words.
    build : callable
        Builds the model; its parameters have defaults.
    cut : tuple of CutEdge
        The edges that the real system cuts.
    check : str
        The test that compares exact inference on the model with the package: "tests/worlds/test_file.py::test_name".
    lecture : str
        "NN_name#tag": the cell that draws the graph, or that says what its cut edges mean.
    """

    id: str
    title: str
    build: Callable[..., StageGraph]
    cut: tuple[CutEdge, ...]
    check: str
    lecture: str


STAGES = (
    Stage(
        "line",
        "Bayes' rule on a line",
        lecture_01_line.bayes_on_a_line,
        (),
        "tests/worlds/test_line.py::test_forward_messages_are_lecture_01s_recursion",
        "01_bayes#graph",
    ),
    Stage(
        "log-odds",
        "One cell of the log-odds grid",
        lecture_02_cell.one_log_odds_cell,
        lecture_02_cell.CUT_LOG_ODDS,
        "tests/worlds/test_cell.py::test_log_odds_are_exact_within_their_bounds",
        "02_grids#graph",
    ),
    Stage(
        "cell",
        "One cell, four states",
        lecture_02_cell.one_cell,
        lecture_02_cell.CUT_CELL,
        "tests/worlds/test_cell.py::test_predict_and_update_are_the_forward_messages",
        "01b_graphical_models#stages",
    ),
    Stage(
        "beam",
        "A beam over several cells",
        lecture_02_beam.beam_over_cells,
        lecture_02_beam.CUT_BEAM,
        "tests/worlds/test_beam.py::test_the_package_makes_walls_thick",
        "02_grids#thick-walls",
    ),
    Stage(
        "pose",
        "Rings that share a pose error",
        lecture_02_thick_walls.scan_with_pose_error,
        lecture_02_thick_walls.CUT_POSE,
        "tests/worlds/test_beam.py::test_a_second_ring_adds_little_when_it_shares_the_pose_error",
        "02_grids#pose-graph",
    ),
    Stage(
        "bof",
        "BOF: one thing, two cells",
        lecture_03_bof.stands_or_drives,
        lecture_03_bof.CUT,
        "tests/worlds/test_bof_row.py::test_a_thing_that_stands_or_drives_is_believed_in_both_places",
        "03_bof#graph",
    ),
    Stage(
        "cmcdot",
        "CMCDOT: four states and particles",
        lecture_04_cmcdot_graph.cmcdot_stage,
        lecture_04_cmcdot_graph.CUT,
        "tests/worlds/test_cmcdot_row.py::test_elsewhere_they_tend_to_bof_and_its_bias_remains",
        "04_cmcdot#graph",
    ),
    Stage(
        "pixel",
        "Pixels and the cells along their rays",
        lecture_05_pixel_ray.pixel_ray,
        (),
        "tests/worlds/test_pixels.py::test_the_posterior_is_the_sum_over_all_streets",
        "05_pixels#graph",
    ),
    Stage(
        "label",
        "How one cell gets its label",
        lecture_09_label.lidar_label_stage,
        lecture_09_label.CUT,
        "tests/worlds/test_label.py::test_a_shared_error_is_never_outvoted",
        "09_truth#graph",
    ),
    Stage(
        "crf",
        "The fully connected CRF on a few cells",
        lecture_10_crf.crf_stage,
        lecture_10_crf.CUT,
        "tests/crf/test_crf_exact.py::test_everything_exact_is_what_enumeration_says",
        "10_crf#graph",
    ),
    Stage(
        "system",
        "The whole system, from world to semantic grid",
        lecture_00_system.whole_system,
        lecture_00_system.CUT,
        "tests/worlds/test_system.py::test_o_is_the_exact_filter_of_each_cell",
        "00_tour#prices",
    ),
    Stage(
        "memory",
        "The class of one cell over time",
        lecture_14_class_memory.class_over_time,
        lecture_14_class_memory.CUT,
        "tests/worlds/test_class_memory.py::test_with_independent_frames_the_factored_filter_is_exact",
        "14_memory#graph",
    ),
)
"""All stages, in the order of the lectures; the whole system before lecture 14, which puts one of its edges back."""


class LedgerLine(NamedTuple):
    """One cut edge and its price.

    Parameters
    ----------
    stage, edge : str
        The id of the stage, such as "bof", and the edge that is cut.
    exact, system : float
        The exact answer and the answer without the edge.
    unit : str
        The meaning of the two numbers.
    lecture : str
        Number of the lecture that shows it, such as "03".
    """

    stage: str
    edge: str
    exact: float
    system: float
    unit: str
    lecture: str


def ledger(stage: str | None = None) -> tuple[LedgerLine, ...]:
    """Measure the price of every cut edge that has one, in one stage or in all (which takes a few seconds)."""
    return tuple(
        LedgerLine(each.id, edge.edge, *edge.price(), each.lecture.partition("_")[0])
        for each in STAGES
        if stage in (None, each.id)
        for edge in each.cut
        if edge.price
    )


def ledger_table(lines: Iterable[LedgerLine]) -> str:
    """Return lines of the ledger as a Markdown table, one row per cut edge."""
    rows = ["| lecture | stage | edge cut | what is asked | exact | the system |", "|---|---|---|---|---|---|"]
    for line in lines:
        cells = [line.lecture, line.stage, f"`{line.edge}`", line.unit, short(line.exact), short(line.system)]
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def stage_table() -> str:
    """Return the stages as a Markdown table, whose links work in the folder of notebooks."""
    rows = ["| stage | its graphical model | its exact check | lecture |", "|---|---|---|---|"]
    for stage in STAGES:
        model = f"[`{stage.build.__name__}`]({stage.build.__module__.replace('.', '/')}.py)"
        file, test = stage.check.split("::")
        rows.append(f"| {stage.title} | {model} | [`{test}`](../{file}) | {notebook_link(stage.lecture)} |")
    return "\n".join(rows)
