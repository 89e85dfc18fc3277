"""Settings of Sphinx for the course site; `stage.py` copies this file to the sources that it lays out."""

from pathlib import Path

import semgrid_edu

project = "semgrid_edu"
author = copyright = "the semgrid_edu developers, BSD 3-clause"
version = release = semgrid_edu.__version__
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_copybutton",
]
exclude_patterns = ["files"]

nb_execution_mode = "off"
nb_merge_streams = True
nb_render_markdown_format = "myst"
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 4
autodoc_typehints = "none"
numpydoc_show_class_members = False

html_title = "semgrid_edu"
html_theme = "pydata_sphinx_theme"
html_theme_options = {
    "show_prev_next": True,
    "header_links_before_dropdown": 9,
    "navigation_with_keys": False,
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "navbar_persistent": ["search-button"],  # a field beside nine sections takes a second line
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_sidebars = {"index": [], "graphs": [], "gallery": [], "glossary": []}
html_static_path = ["static"]
html_extra_path = ["extra"]
html_css_files = ["site.css"]
html_js_files = [("moving.js", {"defer": "defer"})]
# Summaries would be fetched, which a browser refuses for files.
html_show_search_summary = False
html_search_scorer = str(Path(__file__).with_name("scorer.js"))
html_show_sourcelink = html_copy_source = False
# MathJax 4 fetches its fonts from elsewhere; this file of version 3.2.2 needs nothing else.
mathjax_path = "tex-svg.js"
html_context = {"default_mode": "auto"}
