"""Each rule on notebooks that keep it and on notebooks that break it."""

import base64
import io

import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from PIL import Image

from semgrid_edu.plotting import Animation
from semgrid_edu.workshop.course.notebooks.build import read_percent
from semgrid_edu.workshop.course.notebooks.rules import (
    LECTURE_RULES,
    answers_in_sight,
    coarse_figures,
    dishonest_minutes,
    missing_alternative_texts,
    plot_code_in_sight,
    too_long,
    unfit_animations,
)

QUESTION = "**Predict before you run.** How many?\n\n<details><summary>Answer</summary>Two.</details>"
FIGURE = "fig, ax = plt.subplots()\nax.plot([1, 2])\nplt.show()"
HIDDEN = {"jupyter": {"source_hidden": True}}
ALT = {"alt": "a line that rises from one to two"}


def image(kind="image/png", alt=None, **options):
    stored = io.BytesIO()
    Image.new("RGB", (4, 3)).save(stored, "PNG", **options)
    about = {kind: {"alt": alt}} if alt else {}
    return new_output("display_data", {kind: base64.b64encode(stored.getvalue()).decode()}, metadata=about)


def moving(frames):
    """An animation in which every pixel changes in every frame, so that its size is known to be large."""
    pictures = [Image.effect_noise((200, 200), 90 + k) for k in range(frames)]
    stored = io.BytesIO()
    pictures[0].save(stored, "PNG", save_all=True, append_images=pictures[1:])
    png, metadata = Animation(stored.getvalue(), "noise that never stands still")._repr_png_()
    return new_output("display_data", {"image/png": base64.b64encode(png).decode()}, metadata={"image/png": metadata})


def text(source):
    return new_markdown_cell(source)


def code(source="print(2)", *outputs, **metadata):
    return new_code_cell(source, outputs=list(outputs), metadata=metadata)


def printed():
    return new_output("stream", text="2\n")


def minutes(stated, equations):
    return [text(f"**Time.** {stated} minutes" + "\n\n$$ x $$" * equations)]


KEPT = {
    dishonest_minutes: [
        minutes(stated=40, equations=10),
        [text("no minutes yet")],
    ],
    too_long: [
        minutes(stated=1, equations=19),  # 76 minutes
        [text("word " * 3_300)],
        [text("7 " * 110)],
        [text("## section\n\n" * 13)],
    ],
    answers_in_sight: [
        [text(QUESTION), code("x = 1"), code("print(2)", printed(), jupyter={"outputs_hidden": True})],
        [text(QUESTION + "\n\n## Then something else"), code("print(2)", printed())],
        [text(QUESTION), text("### Then something else"), code("print(2)", printed())],
        [
            text("## Heading\n\n" + QUESTION),
            code("2", printed(), jupyter={"outputs_hidden": True}),
            code("3", printed()),
        ],
    ],
    plot_code_in_sight: [
        [code(FIGURE, image(), **HIDDEN)],
        [code("def f(x):\n    return x\n\n\n" + FIGURE, image())],
        [code("assert 1 + 1 == 2\n" + FIGURE, image())],
        [code("np.testing.assert_allclose(1, 1)\n" + FIGURE, image())],
        [code("print(2)\n" + FIGURE, printed(), image())],
        [code("%matplotlib inline\n" + FIGURE, image())],
        [code("x = 1")],
    ],
    missing_alternative_texts: [
        [code(FIGURE, image(), **ALT)],
        [code(FIGURE, image(alt="an animation with its own text"))],
        [code()],
    ],
    coarse_figures: [
        [code(FIGURE, image(dpi=(110, 110)))],
        [code(FIGURE, image())],
        [code("drive[0].image", moving(2))],
    ],
    unfit_animations: [[code("animate()", moving(2))], [code(FIGURE, image())]],
}

BROKEN = {
    dishonest_minutes: [minutes(stated=39, equations=10)],
    too_long: [
        minutes(stated=99, equations=21),  # 84 minutes
        [text("word " * 3_301)],
        [text("7 " * 111)],
        [text("## section\n\n" * 14)],
    ],
    answers_in_sight: [
        [text(QUESTION), code("print(2)", printed())],
        [text("## Heading\n\n" + QUESTION), code("x = 1"), text("Now look."), code("print(2)", printed())],
        [text(QUESTION), code(FIGURE, image(), **HIDDEN)],
    ],
    plot_code_in_sight: [[code(FIGURE, image())], [code("plotting.animate(frames, 0.1, 'a text')", moving(2))]],
    missing_alternative_texts: [[code(FIGURE, image())], [code(FIGURE, image(), alt="a figure")]],
    coarse_figures: [[code(FIGURE, image(dpi=(80, 80)))], [code(FIGURE, image(dpi=(109, 109)))]],
    unfit_animations: [[code("animate()", moving(20))], [code("Image('drive.gif')", image("image/gif"))]],
}


def cases(notebooks):
    return [
        pytest.param(rule, cells, id=f"{rule.__name__}-{k}")
        for rule in notebooks
        for k, cells in enumerate(notebooks[rule])
    ]


def test_every_rule_is_tried():
    assert set(KEPT) == set(BROKEN) == set(LECTURE_RULES)


@pytest.mark.parametrize(("rule", "cells"), cases(KEPT))
def test_a_notebook_that_keeps_the_rule(rule, cells):
    assert [*rule(new_notebook(cells=cells))] == []


@pytest.mark.parametrize(("rule", "cells"), cases(BROKEN))
def test_a_notebook_that_breaks_the_rule(rule, cells):
    assert len([*rule(new_notebook(cells=cells))]) == 1


def test_a_problem_names_its_cell_and_the_remedy():
    [problem] = plot_code_in_sight(new_notebook(cells=[code(FIGURE, image())]))
    assert problem == "cell 'fig, ax = plt.subplots()' only plots; give it jupyter={\"source_hidden\": true}"


def test_a_percent_header_carries_all_that_the_rules_read(tmp_path):
    source = tmp_path / "src" / "00_tiny.py"
    source.parent.mkdir()
    header = r'jupyter={"source_hidden": true, "outputs_hidden": true} alt="a wall, \"thick\": 4 cells" tags=["beam"]'
    source.write_text(f"# %% {header}\nplot()\n")
    assert read_percent(source).cells[0].metadata == {
        "jupyter": {"source_hidden": True, "outputs_hidden": True},
        "alt": 'a wall, "thick": 4 cells',
        "tags": ["beam"],
    }
