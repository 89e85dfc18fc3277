"""Reading time, against notebooks counted by hand."""

import base64
import io

import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from PIL import Image

from semgrid_edu.workshop.course.notebooks.minutes import (
    ReadingTime,
    minutes_table,
    reading_time,
    section_times,
    stated_minutes,
)
from semgrid_edu.workshop.course.notebooks.minutes import time_of_text as time_of


def png(size=(4, 3), **options):
    stored = io.BytesIO()
    Image.new("RGB", size, "red").save(stored, "PNG", **options)
    return base64.b64encode(stored.getvalue()).decode()


def figure(**options):
    return new_output("display_data", data={"image/png": png(**options), "text/plain": "<Figure>"})


NOTEBOOK = new_notebook(
    cells=[
        new_markdown_cell("# 00 · Two words\n\n**Time.** 12 minutes."),  # 00, Two, words, Time., 12, minutes.
        new_code_cell("import numpy as np\n\n# a comment\nx = 1", outputs=[figure()]),
        new_markdown_cell(
            "Before.\n\n## A section\n\nThree more words:\n\n$$ a = b $$\n\n**Predict before you run.** Really?\n\n"
            "<details><summary>Answer</summary>Yes.</details>"
        ),
        new_code_cell("plot()\nshow()", metadata={"jupyter": {"source_hidden": True}}, outputs=[figure(), figure()]),
    ]
)


def test_a_notebook_counted_by_hand():
    # Before. | A section | Three more words: | Predict before you run. Really? | Answer Yes.
    opening = ReadingTime(words=6 + 1, figures=1, lines=3, numerals=2)
    section = ReadingTime(words=2 + 3 + 5 + 2, equations=1, figures=2, predictions=1, sections=1)
    assert section_times(NOTEBOOK) == {"(header)": opening, "A section": section}
    assert reading_time(NOTEBOOK).minutes == pytest.approx(19 / 130 + 4 + 3 * 1.5 + 3 + 3 / 8)
    assert stated_minutes(NOTEBOOK) == 12


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Five words, and nothing - else.", 5),
        ("- a *list*\n- of `code and more`, $p(x) < 1$ and $y > 2$", 7),
        ("| head | two |\n|---|:-:|\n| 0.5 | `a` |", 4),
        ("[linked text](../far/away.ipynb#part) and <https://nowhere.org>", 3),
        ("```\nnot one word\n```\nafter", 1),
        ("![a figure that is described](map.png) here", 1),
        ("state-of-the-art l'image (0.44 m) …", 4),
    ],
)
def test_words_are_what_is_read_aloud(text, words):
    assert time_of(text).words == words


@pytest.mark.parametrize(
    ("text", "equations"),
    [
        ("inline $a$ and $b$", 0),
        ("$$ a $$ text $$\nb\n$$", 2),
        (r"$$\begin{align} a &= b \\ c &= d \end{align}$$", 1),
        ("\\begin{align*}\na &= b \\\\\nc &= d\n\\end{align*}\nthen \\[ x \\]", 2),
    ],
)
def test_displayed_equations(text, equations):
    assert time_of(text).equations == equations


def test_figures_in_the_text_count_too():
    assert time_of('![one](a.png) and <img src="b.png" alt="two words">').figures == 2


def test_each_kind_of_work_has_its_price():
    everything = ReadingTime(words=130, equations=1, figures=1, predictions=1, lines=8, numerals=80, sections=10)
    assert everything.parts == {"prose": 1, "equations": 4, "figures": 1.5, "predictions": 3, "code": 1}
    assert (everything + everything).minutes == 21


@pytest.mark.parametrize(
    ("text", "numerals"),
    [
        ("Of 27,445 cells .23 are wrong, +16 points (+8 to +24) for $p = 0.7$.", 6),
        ("x1 and y_2 are names; `f(3)`, [07](07_far.ipynb) and $$a = 5$$ don't count", 0),
    ],
)
def test_numerals_of_the_text(text, numerals):
    assert time_of(text).numerals == numerals


def test_the_table_of_one_notebook_has_its_sections(tmp_path):
    source = tmp_path / "src" / "00_tiny.py"
    source.parent.mkdir()
    source.write_text("# %% [markdown]\n# **Time.** 3 minutes\n#\n# ## Section\n# $$x$$\n\n# %%\na = 1\n")
    header, *rows = minutes_table([source]).splitlines()
    assert header.split()[:2] == ["stated", "computed"]
    assert [row.split()[-1] for row in rows] == ["(header)", "Section", "00_tiny"]
    assert rows[-1].split()[:2] == ["3", "4.2"]
