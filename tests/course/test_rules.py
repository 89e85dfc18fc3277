"""Each rule on a notebook that keeps it and on one that breaks it; waivers only while they are needed."""

import base64
import io

import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from PIL import Image

from semgrid_edu.plotting import Animation
from semgrid_edu.workshop.course.notebooks.build import lecture_sources, read_percent
from semgrid_edu.workshop.course.notebooks.rules import RULES, WAIVERS, rule_problems

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
    "minutes": [minutes(stated=20, equations=10), [text("a companion may have no minutes yet: its parts say so")]],
    "length": [minutes(stated=1, equations=37)],  # 74 minutes
    "predictions": [
        [text(QUESTION), code("x = 1"), code("print(2)", printed(), jupyter={"outputs_hidden": True})],
        [text(QUESTION + "\n\n## Then something else"), code("print(2)", printed())],
        [text(QUESTION), text("### Then something else"), code("print(2)", printed())],
        [
            text("## Heading\n\n" + QUESTION),
            code("2", printed(), jupyter={"outputs_hidden": True}),
            code("3", printed()),
        ],
    ],
    "plot code": [
        [code(FIGURE, image(), **HIDDEN)],
        [code("def f(x):\n    return x\n\n\n" + FIGURE, image())],
        [code("assert 1 + 1 == 2\n" + FIGURE, image())],
        [code("np.testing.assert_allclose(1, 1)\n" + FIGURE, image())],
        [code("print(2)\n" + FIGURE, printed(), image())],
        [code("%matplotlib inline\n" + FIGURE, image())],
        [code("x = 1")],
    ],
    "alternative texts": [
        [code(FIGURE, image(), **ALT)],
        [code(FIGURE, image(alt="an animation with its own text"))],
        [code()],
    ],
    "resolution": [[code(FIGURE, image(dpi=(110, 110)))], [code(FIGURE, image())], [code("drive[0].image", moving(2))]],
    "animations": [[code("animate()", moving(2))], [code(FIGURE, image())]],
}

BROKEN = {
    "minutes": [minutes(stated=19, equations=10)],
    "length": [minutes(stated=99, equations=38)],  # 76 minutes
    "predictions": [
        [text(QUESTION), code("print(2)", printed())],
        [text("## Heading\n\n" + QUESTION), code("x = 1"), text("Now look."), code("print(2)", printed())],
        [text(QUESTION), code(FIGURE, image(), **HIDDEN)],
    ],
    "plot code": [[code(FIGURE, image())], [code("plotting.animate(frames, 0.1, 'a text')", moving(2))]],
    "alternative texts": [[code(FIGURE, image())], [code(FIGURE, image(), alt="a figure")]],
    "resolution": [[code(FIGURE, image(dpi=(80, 80)))], [code(FIGURE, image(dpi=(109, 109)))]],
    "animations": [[code("animate()", moving(20))], [code("Image('drive.gif')", image("image/gif"))]],
}


def cases(notebooks):
    return [
        pytest.param(rule, cells, id=f"{rule}-{k}") for rule in notebooks for k, cells in enumerate(notebooks[rule])
    ]


def test_every_rule_is_tried():
    assert set(KEPT) == set(BROKEN) == set(RULES)


@pytest.mark.parametrize(("rule", "cells"), cases(KEPT))
def test_a_notebook_that_keeps_the_rule(rule, cells):
    assert [*RULES[rule](new_notebook(cells=cells))] == []


@pytest.mark.parametrize(("rule", "cells"), cases(BROKEN))
def test_a_notebook_that_breaks_the_rule(rule, cells):
    assert len([*RULES[rule](new_notebook(cells=cells))]) == 1


def test_a_problem_names_its_cell_and_the_remedy():
    [problem] = RULES["plot code"](new_notebook(cells=[code(FIGURE, image())]))
    assert problem == "cell 'fig, ax = plt.subplots()' only plots; give it jupyter={\"source_hidden\": true}"


def test_a_waiver_counts_while_it_is_needed_and_no_longer():
    broken, kept = (new_notebook(cells=notebooks["minutes"][0]) for notebooks in (BROKEN, KEPT))
    assert len(rule_problems(broken)) == 1
    assert rule_problems(broken, waived={"minutes"}) == []
    assert rule_problems(kept) == []
    assert "take its waiver out" in rule_problems(kept, waived={"minutes"})[0]


def test_waivers_are_for_lectures_and_rules_that_exist():
    assert set(WAIVERS) <= {source.stem for source in lecture_sources()}
    assert set().union(*WAIVERS.values()) <= set(RULES)


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
