"""The equation register: where each equation and procedure of the paper stands in code, lectures and exercises.

Links to code and notebooks: in the registers' tables, shown in the folder of notebooks, and in exercises.
"""

import re
from dataclasses import dataclass
from importlib import import_module

from semgrid_edu.errors import ArgumentError


def find_code(name: str) -> object:
    """Return the function or class that a dotted name stands for.

    Parameters
    ----------
    name : str
        A dotted name, such as "semgrid_edu.camera.project".

    Returns
    -------
    object
        The function or class.

    Raises
    ------
    ArgumentError
        When nothing of that name can be imported.
    """
    module, _, attribute = name.rpartition(".")
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError):
        raise ArgumentError("name", "the dotted name of something that can be imported", name) from None


def code_link(name: str) -> str:
    """Link a function or class to the module that defines it.

    Parameters
    ----------
    name : str
        Its dotted name, such as "semgrid_edu.camera.project".

    Returns
    -------
    str
        A link in Markdown.

    Raises
    ------
    ArgumentError
        When nothing of that name can be imported.
    """
    module = find_code(name).__module__
    return f"[`{name.rpartition('.')[2]}`](../{module.replace('.', '/')}.py)"


def notebook_link(place: str | None, folder: str = "") -> str:
    """Link a part of a notebook to the notebook.

    Parameters
    ----------
    place : str or None
        Notebook and part, such as "02_grids#log-odds" or, for a companion, "deeper/graphical_models#messages"; None
        while it is to come.
    folder : str
        Folder of the notebook inside the folder of notebooks, such as "exercises/".

    Returns
    -------
    str
        A link in Markdown, and the name of the part; "to come" for None.

    Examples
    --------
    >>> notebook_link("02_grids#update", "exercises/")
    '[02](exercises/02_grids.ipynb), `update`'
    >>> notebook_link("deeper/graphical_models#messages")
    '[graphical models](deeper/graphical_models.ipynb), `messages`'
    """
    if place is None:
        return "to come"
    name, _, part = place.partition("#")
    title = name[:2] if name[:2].isdigit() else name.rpartition("/")[2].replace("_", " ")
    return f"[{title}]({folder}{name}.ipynb), `{part}`"


def point_links(text: str, lectures: str) -> str:
    """Let an exercise link to the lectures where its students find them.

    Parameters
    ----------
    text : str
        A text cell of an exercise. Its links to notebooks begin with `../`, the folder of notebooks.
    lectures : str
        The address of the folder that holds `00_tour.ipynb`, or its path from a student's copy of the exercise; "" when
        students can't open it. Then the link's text stays alone.

    Returns
    -------
    str
        The text with links that live.

    Raises
    ------
    ArgumentError
        When the folder can't stand in a link.

    Examples
    --------
    >>> point_links("The lecture is [00: the tour](../00_tour.ipynb).", "https://course.example/lectures")
    'The lecture is [00: the tour](https://course.example/lectures/00_tour.ipynb).'
    >>> point_links("The lecture is [00: the tour](../00_tour.ipynb).", "")
    'The lecture is 00: the tour.'
    """
    if re.search(r"[\s()<>]", lectures):
        raise ArgumentError("lectures", "an address or a path without blanks, parentheses and < or >", lectures)
    new = rf"[\1]({lectures.rstrip('/')}/\2)" if lectures else r"\1"
    return re.sub(r"\[([^\]]*)\]\(\.\./([^)]*)\)", lambda link: link.expand(new), text)


@dataclass(frozen=True)
class Equation:
    """One equation or numbered procedure of the paper.

    Parameters
    ----------
    id : str
        "eq-N" for the paper's equation (N); a short name for a procedure.
    section : str
        Number of the paper's section, such as "3.2".
    title : str
        What it says, in a few words.
    literal : str
        Dotted name of the code that reads like the equation.
    fast : str or None
        Dotted name of what the pipeline calls; None where there is only the literal code.
    lecture : str or None
        "NN_name#tag": the notebook and the tag of the cell that derives it; None while that is to come.
    exercise : str or None
        "NN_name#task": the exercise and the grade_id of its answer cell; None while that is to come.
    """

    id: str
    section: str
    title: str
    literal: str
    fast: str | None = None
    lecture: str | None = None
    exercise: str | None = None

    @property
    def functions(self) -> list[str]:
        """The dotted names of its code, literal first."""
        return [name for name in (self.literal, self.fast) if name]


EQUATIONS = (
    Equation(
        "segnet",
        "3.1",
        "SegNet: unpooling by the indices of max-pooling",
        literal="semgrid_edu.networks.SegNet",
        lecture="07_segmentation#unpool",
        exercise="07_segmentation#pool",
    ),
    Equation(
        "fcn",
        "3.1",
        "FCN: sum of the scores from three depths",
        literal="semgrid_edu.networks.Fcn",
        lecture="07_segmentation#skips",
        exercise="07_segmentation#skip",
    ),
    Equation(
        "deeplab",
        "3.1",
        "DeepLab v2: atrous convolutions",
        literal="semgrid_edu.networks.DeepLab",
        lecture="07_segmentation#atrous",
        exercise="07_segmentation#atrous",
    ),
    Equation(
        "sensor-model",
        "3.2",
        "What a scan says of each cell",
        literal="semgrid_edu.occupancy.scan_evidence_literal",
        fast="semgrid_edu.occupancy.scan_evidence",
        lecture="02_grids#sensor-model",
        exercise="02_grids#beam-evidence",
    ),
    Equation(
        "log-odds",
        "3.2",
        "Log-odds grid: Bayes' rule on two states is a sum",
        literal="semgrid_edu.occupancy.update_log_odds",
        lecture="02_grids#log-odds",
        exercise="02_grids#update",
    ),
    Equation(
        "bof-predict",
        "3.2",
        "BOF, on which CMCDOT builds: predict, one velocity at a time",
        literal="semgrid_edu.occupancy.bof_predict_literal",
        fast="semgrid_edu.occupancy.bof_predict",
        lecture="03_bof#bof-predict",
        exercise="03_bof#arrive",
    ),
    Equation(
        "bof-update",
        "3.2",
        "BOF: update by Bayes' rule",
        literal="semgrid_edu.occupancy.bof_update_literal",
        fast="semgrid_edu.occupancy.bof_update",
        lecture="03_bof#bof-update",
        exercise="03_bof#update",
    ),
    Equation(
        "cmcdot-1",
        "3.2",
        "CMCDOT, step 1: move with the vehicle",
        literal="semgrid_edu.occupancy.move_literal",
        fast="semgrid_edu.occupancy.move",
        lecture="04_cmcdot#cmcdot-1",
        exercise="04_cmcdot#in-cells",
    ),
    Equation(
        "cmcdot-2",
        "3.2",
        "CMCDOT, step 2: predict",
        literal="semgrid_edu.occupancy.predict_literal",
        fast="semgrid_edu.occupancy.predict",
        lecture="04_cmcdot#cmcdot-2",
        exercise="04_cmcdot#meet",
    ),
    Equation(
        "cmcdot-3",
        "3.2",
        "CMCDOT, step 3: update by Bayes' rule",
        literal="semgrid_edu.occupancy.update_literal",
        fast="semgrid_edu.occupancy.update",
        lecture="04_cmcdot#cmcdot-3",
        exercise="04_cmcdot#update",
    ),
    Equation(
        "cmcdot-4",
        "3.2",
        "CMCDOT, step 4: resample the particles",
        literal="semgrid_edu.occupancy.resample_literal",
        fast="semgrid_edu.occupancy.resample",
        lecture="04_cmcdot#cmcdot-4",
        exercise="04_cmcdot#systematic",
    ),
    Equation(
        "eq-1",
        "3.3",
        "From a point of a plane to its pixel",
        literal="semgrid_edu.camera.project",
        fast="semgrid_edu.planes.plane_pixels",
        lecture="05_pixels#eq-1",
        exercise="05_pixels#plane-pixels",
    ),
    Equation(
        "eq-2",
        "3.3",
        "A point of a plane takes the scores of its pixel",
        literal="semgrid_edu.planes.sample_planes_naive",
        fast="semgrid_edu.planes.PlaneSampler",
        lecture="06_planes#eq-2",
        exercise="06_planes#sample-plane",
    ),
    Equation(
        "fusion",
        "3.4",
        "Reduction of the planes, fusion with the occupancy grid",
        literal="semgrid_edu.networks.FusionNet",
        lecture="08_fusion#fusion",
        exercise="08_fusion#reduce-planes",
    ),
    Equation(
        "eq-3",
        "3.5",
        "Energy of a labelling",
        literal="semgrid_edu.crf.energy",
        lecture="10_crf#eq-3",
        exercise="10_crf#energy",
    ),
    Equation(
        "eq-4",
        "3.5",
        "What two cells with different labels cost",
        literal="semgrid_edu.crf.pair_weights",
        lecture="10_crf#eq-4",
        exercise="10_crf#pair-price",
    ),
    Equation(
        "mean-field",
        "3.5",
        "Mean-field inference",
        literal="semgrid_edu.crf.mean_field_naive",
        fast="semgrid_edu.crf.mean_field",
        lecture="10_crf#mean-field",
        exercise="10_crf#update",
    ),
    Equation(
        "lattice",
        "3.5",
        "The sum over all cells as a filter: splat, blur, slice",
        literal="semgrid_edu.crf.lattice.literal",
        fast="semgrid_edu.crf.PermutohedralLattice",
        lecture="11_fast_crf#splat-blur-slice",
        exercise="11_fast_crf#lattice-filter",
    ),
    Equation(
        "ground-truth",
        "4",
        "Labels of the image, carried to the grid",
        literal="semgrid_edu.datasets.ground_truth.carry_labels",
        lecture="09_truth#recipe",
        exercise="09_truth#count-votes",
    ),
    Equation(
        "median-frequency",
        "4.1",
        "Median frequency balancing",
        literal="semgrid_edu.training.median_frequency_weights",
        lecture="08_fusion#median-frequency",
        exercise="08_fusion#balance",
    ),
    Equation(
        "loss",
        "4.1",
        "Cross-entropy, weighted by class",
        literal="semgrid_edu.training.weighted_cross_entropy",
        fast="semgrid_edu.training.loss.cross_entropy_sums",
        lecture="08_fusion#loss",
        exercise="08_fusion#weighted-loss",
    ),
    Equation(
        "pixel-accuracy",
        "4.2",
        "Pixel accuracy",
        literal="semgrid_edu.metrics.pixel_accuracy",
        lecture="00_tour#accuracies",
        exercise="00_tour#accuracies",
    ),
    Equation(
        "class-accuracy",
        "4.2",
        "Class accuracy",
        literal="semgrid_edu.metrics.class_accuracy",
        lecture="00_tour#accuracies",
        exercise="00_tour#accuracies",
    ),
    Equation("fmiou", "4.2", "FmIoU", literal="semgrid_edu.metrics.frequency_weighted_iou"),
)
"""All equations and procedures, in the order of the paper."""


def equation_table() -> str:
    """Return the register as a Markdown table, whose links work in the folder of notebooks."""
    rows = ["| | paper | what | literal code | fast code | lecture | exercise |", "|---|---|---|---|---|---|---|"]
    for entry in EQUATIONS:
        number = f"({entry.id[3:]})" if entry.id.startswith("eq-") else ""
        code = [code_link(entry.literal), code_link(entry.fast) if entry.fast else "the same"]
        places = [notebook_link(entry.lecture), notebook_link(entry.exercise, "exercises/")]
        rows.append("| " + " | ".join([number, entry.section, entry.title, *code, *places]) + " |")
    return "\n".join(rows)
