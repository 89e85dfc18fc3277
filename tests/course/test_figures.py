"""Figures get small where nobody sees it, keep their resolution, and carry their alternative texts."""

import base64
import io

import cv2
import matplotlib.pyplot as plt
import numpy as np
import pytest
from bs4 import BeautifulSoup
from nbconvert import HTMLExporter
from nbformat.v4 import new_code_cell, new_notebook, new_output
from PIL import Image

from semgrid_edu.plotting import animate
from semgrid_edu.workshop.course.notebooks.figures import (
    JUST_NOTICEABLE,
    cielab,
    finish_figures,
    palette_png,
    resolution,
)


def stored(pixels, **options):
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG", **options)
    return file.getvalue()


def opened(png):
    image = Image.open(io.BytesIO(png))
    return image.mode, np.asarray(image.convert("RGB"))


@pytest.fixture
def chart():
    """A figure as a lecture has them: opaque, 110 dots per inch, lines and text with soft edges."""
    fig, ax = plt.subplots(figsize=(4, 3), dpi=110)
    ax.plot([0, 1, 4, 9], label="squares")
    ax.legend()
    file = io.BytesIO()
    fig.savefig(file)
    plt.close(fig)
    return file.getvalue()


def test_a_chart_shrinks_and_looks_the_same(chart):
    small = palette_png(chart)
    mode, pixels = opened(small)
    assert mode == "P"
    assert len(small) < 0.7 * len(chart)
    before, after = (cv2.cvtColor(np.float32(p) / 255, cv2.COLOR_RGB2LAB) for p in (opened(chart)[1], pixels))
    assert np.percentile(np.linalg.norm(after - before, axis=-1), 99) < JUST_NOTICEABLE
    assert resolution(small) == resolution(chart) == 110
    assert palette_png(chart) == small


def test_few_colours_stay_exactly():
    pixels = np.random.default_rng(0).integers(0, 6, (9, 9, 3)).astype(np.uint8).repeat(20, 0).repeat(20, 1) * 51
    pixels[::2] += 1  # twice as many colours, 162 at most, each beside one that is hardly different
    mode, after = opened(palette_png(stored(pixels)))
    assert mode == "P"
    np.testing.assert_array_equal(after, pixels)


def test_a_photograph_keeps_all_its_colours():
    row, column = np.mgrid[:200, :200]
    pixels = np.stack([row, column, (3 * row + 5 * column) % 200], axis=-1).astype(np.uint8)
    mode, after = opened(palette_png(stored(np.dstack([pixels, np.full((200, 200), 255, np.uint8)]))))
    assert mode == "RGB"
    np.testing.assert_array_equal(after, pixels)


def test_a_small_marker_keeps_its_colour():
    """Of 40,000 pixels 9 are red, far fewer than one in a hundred: the rest alone would allow the palette."""
    grey = np.random.default_rng(0).integers(100, 130, (200, 200, 3)).astype(np.uint8)
    grey[50:53, 50:53] = (255, 0, 0)
    shift = cielab(opened(palette_png(stored(grey)))[1][51, 51]) - cielab(np.uint8([255, 0, 0]))
    assert np.linalg.norm(shift) < 10


def test_transparent_pictures_and_animations_are_left_alone():
    glass = stored(np.full((9, 9, 4), 100, np.uint8))
    moving = animate([np.full((9, 9, 3), k, np.uint8) for k in (0, 99)], 0.1, "grey that gets lighter").png
    assert palette_png(glass) == glass
    assert palette_png(moving) == moving


def test_cielab_of_colours_from_the_books():
    rgb = np.uint8([[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255], [0, 0, 0]])
    lab = [[53.24, 80.09, 67.20], [87.73, -86.18, 83.18], [32.30, 79.19, -107.86], [100, 0, 0], [0, 0, 0]]
    np.testing.assert_allclose(cielab(rgb), lab, atol=0.03)


def shown(png, **metadata):
    output = new_output("display_data", data={"image/png": base64.b64encode(png).decode()})
    return new_code_cell("plot()", metadata=metadata, outputs=[output])


def test_the_cells_text_reaches_nbconverts_page(chart):
    cell = shown(chart, alt='squares of 0 to 3, "growing"')
    finish_figures(cell)
    assert cell.outputs[0].metadata["image/png"].alt == 'squares of 0 to 3, "growing"'
    page, _ = HTMLExporter(template_name="classic").from_notebook_node(new_notebook(cells=[cell]))
    assert BeautifulSoup(page, "html.parser").img["alt"] == 'squares of 0 to 3, "growing"'
    assert cell.outputs[0].data["image/png"][:60] in page


def test_resolution_is_what_the_file_says():
    pixels = np.zeros((9, 9, 3), np.uint8)
    assert resolution(stored(pixels)) is None
    assert resolution(stored(pixels, dpi=(80, 80))) == 80
