"""The course site: what is laid out for Sphinx, and what its check finds."""

import json
import re
from importlib.util import find_spec

import ipywidgets
import nbformat
import pytest
from check import problems
from glossary import definition, glossary_page
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from PIL import Image
from stage import CLONE, MODULES, pages, relinked, translated, with_moving_widget
from widgets import MOST_BYTES, RECORDED, notebooks, values_of


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[one](01_bayes.ipynb#toy)", "[one](01_bayes.ipynb#toy)"),
        ("[`exercise`](exercises/01_bayes.ipynb)", "[`exercise`](exercises/01_bayes.ipynb)"),
        ("[elsewhere](https://example.org/a)", "[elsewhere](https://example.org/a)"),
        ("[below](#here)", "[below](#here)"),
        ("[start](../README.md)", "[start](../index.md)"),
        ("[a folder](exercises)", "a folder"),
        ("`a[0](b)` and\n```\n[no](link.md)\n```", "`a[0](b)` and\n```\n[no](link.md)\n```"),
    ],
)
def test_links_lead_to_pages(tmp_path, text, expected):
    assert relinked(text, CLONE / "notebooks", tmp_path) == expected
    assert list(tmp_path.iterdir()) == []


def test_a_linked_file_comes_along(tmp_path):
    text = "[licence](../LICENSE) and ![a picture](../docs/street.png)"
    assert relinked(text, CLONE / "notebooks", tmp_path) == text
    for name in ("LICENSE", "docs/street.png"):
        assert (tmp_path / name).read_bytes() == (CLONE / name).read_bytes()


def test_a_dead_link_is_no_page(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"gone\.ipynb"):
        relinked("[gone](gone.ipynb)", CLONE / "notebooks", tmp_path)


def test_folded_parts_and_words_of_figures_are_kept(tmp_path):
    picture = new_output("display_data", {"image/png": "AA=="}, metadata={"image/png": {"alt": "a street"}})
    cell = new_code_cell("draw()", outputs=[picture], metadata={"jupyter": {"source_hidden": True}, "tags": ["eq-1"]})
    table = new_code_cell("t()", outputs=[new_output("display_data", {"text/markdown": "[a folder](exercises)"})])
    found = translated(
        new_notebook(cells=[cell, table, new_markdown_cell("[up](../README.md)")]), CLONE / "notebooks", tmp_path
    )
    nbformat.validate(found)
    assert found.cells[0].metadata.tags == ["eq-1", "hide-input"]
    assert found.cells[0].metadata.mystnb.image.alt == "a street"
    assert found.cells[1].outputs[0].data["text/markdown"] == "a folder"
    assert found.cells[2].source == "[up](../index.md)"


def test_a_figure_without_words_is_refused(tmp_path):
    cell = new_code_cell("draw()", outputs=[new_output("display_data", {"image/png": "AA=="})])
    with pytest.raises(ValueError, match="alternative text"):
        translated(new_notebook(cells=[cell]), CLONE / "notebooks", tmp_path)


def test_the_check_finds_what_is_dead_or_foreign(tmp_path):
    (tmp_path / "a.html").write_text(
        '<h1 id="top">A</h1><a href="b.html#here">b</a><a href="https://example.org">out</a><img src="p.png" alt="p">'
    )
    (tmp_path / "b.html").write_text('<p id="here"></p><a href="a.html#top"></a><a href="#here"></a>')
    (tmp_path / "p.png").touch()
    assert problems(tmp_path) == []
    (tmp_path / "c.html").write_text(
        '<a href="gone.html"></a><a href="a.html#gone"></a><img src="p.png"><script src="https://example.org/s.js">'
    )
    assert problems(tmp_path) == [
        "c.html: a picture without words",
        "c.html: fetches https://example.org/s.js",
        "c.html: leads to a.html#gone",
        "c.html: leads to gone.html",
    ]


def test_the_glossary_quotes_the_sentence_with_the_term():
    text = "A **prior** is what you believed. It is *updated*, see eq. (1) there. Then\nit is a *posterior*."
    text += "\n\n- **Skip.** It goes on."
    assert definition([text], "prior") == "A **prior** is what you believed."
    assert definition([text], "updated", -1) == "A **prior** is what you believed. It is *updated*, see eq. (1) there."
    assert definition([text], "updated", 2).endswith("it is a *posterior*.")
    assert definition([text], "Skip") == "**Skip.** It goes on."
    with pytest.raises(ValueError, match="nowhere emphasised"):
        definition([text], "believed")


def test_every_term_is_in_its_lecture():
    page = glossary_page()
    assert page.count("](notebooks/") > 60
    assert page.count("](") == page.count("](notebooks/")


@pytest.mark.parametrize(
    "folder", sorted(file.parent for file in RECORDED.glob("*/controls.json")), ids=lambda folder: folder.name
)
def test_recorded_widgets_are_of_the_present_notebook_and_small(folder):
    (path,) = notebooks([folder.name])
    cells = with_moving_widget(nbformat.read(path, as_version=4), path).cells
    (moving,) = (cell for cell in cells if 'class="moving"' in cell.source)
    assert sum(file.stat().st_size for file in folder.iterdir()) <= MOST_BYTES
    pictures = len(list(folder.glob("*.webp")))
    known = json.loads((folder / "controls.json").read_text(encoding="utf-8"))
    assert sum(len(control["values"]) for control in known["controls"]) == pictures > 5
    assert moving.source.count('type="range"') == len(known["controls"])


@pytest.mark.parametrize(
    ("control", "expected"),
    [
        (ipywidgets.IntSlider(value=2, min=1, max=4), [1, 2, 3, 4]),
        (ipywidgets.Dropdown(options=["a", "b"]), ["a", "b"]),
        (ipywidgets.FloatLogSlider(value=1, min=-1, max=1, step=1), [0.1, 1, 10]),
    ],
)
def test_a_control_goes_through_its_values(control, expected):
    assert values_of(control) == expected


def test_a_long_slider_keeps_its_ends_and_where_it_begins():
    values = values_of(ipywidgets.FloatSlider(value=0.07, min=0, max=1, step=0.01))
    assert (values[0], values[-1]) == (0, 1)
    assert 0.07 in values
    assert len(values) <= 14


def test_the_animation_of_the_readme_moves_is_small_and_has_words():
    with Image.open(CLONE / "docs" / "street.png") as moving:
        assert moving.n_frames == 10
    assert (CLONE / "docs" / "street.png").stat().st_size <= 600_000
    assert re.search(r"!\[[^\]]{40,}\]\(docs/street\.png\)", (CLONE / "README.md").read_text(encoding="utf-8"))


def test_each_module_of_the_reference_can_be_imported():
    assert [name for name in MODULES if find_spec(f"semgrid_edu.{name}") is None] == []


def test_contents_name_pages_and_links_lead_to_headings():
    named = {str(path.relative_to(CLONE).with_suffix("")) for path in pages()}
    contents = "".join(path.read_text(encoding="utf-8") for path in (CLONE / "docs" / "site" / "pages").glob("*.md"))
    assert set(re.findall(r"<((?:docs|benchmarks|data_samples|notebooks)/[^>]*)>$", contents, re.MULTILINE)) <= named
    texts = {path: path.read_text(encoding="utf-8") for path in pages() if path.suffix == ".md"}
    anchors = {path: set(map(anchor, re.findall(r"^#+ (.*)$", text, re.MULTILINE))) for path, text in texts.items()}
    for path, text in texts.items():
        for file, heading in re.findall(r"\]\(([^():#\s]*\.md)?#([^()\s]+)\)", text):
            assert heading in anchors[(path.parent / file).resolve() if file else path], (path, heading)


def anchor(heading: str) -> str:
    """What follows # in a link to a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
