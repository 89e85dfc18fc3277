"""The register's second table: each stage of the system, its graphical model, and the exact check that it passes."""

from dataclasses import dataclass

from semgrid_edu.workshop.course.registers.equations import code_link, notebook_link


@dataclass(frozen=True)
class StageModel:
    """One stage as a graphical model, small enough for exact inference.

    Parameters
    ----------
    id : str
        A short name, such as "bof".
    title : str
        What is modelled, in a few words.
    model : str
        Dotted name of the function that builds the model.
    check : str
        Where exact inference on the model is compared with what the package does: a test as
        "tests/folder/test_file.py::test_name", or the tag of a cell as "NN_name#tag".
    lecture : str or None
        "NN_name#tag": the cell that draws the graph; None while that is to come.
    """

    id: str
    title: str
    model: str
    check: str
    lecture: str | None = None


STAGES = (
    StageModel(
        "line",
        "Bayes' rule on a line",
        model="semgrid_edu.stage_models.bayes_on_a_line",
        check="tests/graphical/stages/test_stage_line.py::test_forward_messages_are_lecture_01s_recursion",
    ),
    StageModel(
        "log-odds",
        "One cell of the log-odds grid",
        model="semgrid_edu.stage_models.one_log_odds_cell",
        check="tests/graphical/stages/test_stage_cell.py::test_log_odds_are_exact_within_their_bounds",
    ),
    StageModel(
        "cell",
        "One cell, four states",
        model="semgrid_edu.stage_models.one_cell",
        check="tests/graphical/stages/test_stage_cell.py::test_predict_and_update_are_the_forward_messages",
    ),
    StageModel(
        "beam",
        "A beam over several cells",
        model="semgrid_edu.stage_models.beam_over_cells",
        check="tests/graphical/stages/test_stage_beam.py::test_the_package_makes_walls_thick",
    ),
    StageModel(
        "pose",
        "Rings that share a pose error",
        model="semgrid_edu.stage_models.scan_with_pose_error",
        check="tests/graphical/stages/test_stage_beam.py::test_a_second_ring_adds_little_when_it_shares_the_pose_error",
    ),
    StageModel(
        "bof",
        "BOF: cells, velocities, antecedents",
        model="semgrid_edu.stage_models.bof_stage",
        check="tests/graphical/stages/test_stage_bof.py::test_bof_adds_what_two_antecedents_send",
    ),
    StageModel(
        "cmcdot",
        "CMCDOT: four states and particles",
        model="semgrid_edu.stage_models.cmcdot_stage",
        check="tests/graphical/stages/test_stage_cmcdot.py::test_elsewhere_they_tend_to_bof_and_its_bias_remains",
    ),
    StageModel(
        "label",
        "How one cell gets its label",
        model="semgrid_edu.stage_models.made_label_stage",
        check="tests/graphical/stages/test_stage_made_label.py::test_a_shared_error_is_never_outvoted",
        lecture="09_truth#graph",
    ),
    StageModel(
        "crf",
        "The fully connected CRF on a few cells",
        model="semgrid_edu.stage_models.crf_stage",
        check="tests/crf/test_crf_exact.py::test_everything_exact_is_what_enumeration_says",
        lecture="10_crf#graph",
    ),
    StageModel(
        "system",
        "The whole system, from world to semantic grid",
        model="semgrid_edu.stage_models.whole_system",
        check="tests/graphical/stages/test_stage_system.py::test_who_knows_more_loses_less",
    ),
)
"""All stages in the order of the pipeline, and the whole system last."""


def stage_table() -> str:
    """Return the stages as a Markdown table, whose links work in the folder of notebooks."""
    rows = ["| stage | its graphical model | its exact check | lecture |", "|---|---|---|---|"]
    for stage in STAGES:
        rows.append(f"| {stage.title} | {code_link(stage.model)} | {_check(stage)} | {notebook_link(stage.lecture)} |")
    return "\n".join(rows)


def _check(stage: StageModel) -> str:
    """Link a stage's check, a test or a cell of a notebook."""
    path, is_test, test = stage.check.partition("::")
    return f"[`{test}`](../{path})" if is_test else notebook_link(stage.check)
