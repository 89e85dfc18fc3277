"""Lay out the sources of the course site, for Sphinx: `python docs/site/stage.py FOLDER`."""

import base64
import html
import re
import shutil
import sys
from functools import cache
from importlib import import_module
from inspect import signature
from pathlib import Path

import matplotlib
import nbformat
from glossary import glossary_page
from matplotlib import pyplot as plt
from nbformat import NotebookNode
from widgets import RECORDED, stand_in, widget_cell

sys.path.append(str(Path(__file__).resolve().parents[2] / "notebooks"))

from worlds.lecture_00_equations import equation_table, notebook_link
from worlds.lecture_00_ledger import STAGES, ledger, ledger_table, stage_table
from worlds.lecture_02_cell import read_scans

HERE = Path(__file__).resolve().parent
CLONE = HERE.parents[1]
PAGES = (
    "*.md",
    "docs/*.md",
    "docs/results/**/*.md",
    "benchmarks/*.md",
    "data_samples/**/README.md",
    "notebooks/README.md",
    "notebooks/instructor/README.md",
    "notebooks/*.ipynb",
    "notebooks/deeper/*.ipynb",
    "notebooks/exercises/*.ipynb",
)
"""What becomes a page, at the same place as in the clone."""
SECTIONS = ("lectures", "companions", "exercises", "graphs", "glossary", "results", "api", "gallery", "guides")
"""The pages of the site's bar."""
MODULES = (
    *("camera", "crf", "datasets", "errors", "frame", "graphical", "grid", "labels", "memory", "metrics"),
    *("networks", "occupancy", "pipeline", "planes", "plotting", "storage", "training"),
)
"""The modules and rooms of the book, each a page of the reference."""
LINK = re.compile(r"```.*?```|`[^`\n]*`|(!?\[(?:[^\[\]]|\[[^\]]*\])*\])\(([^()\s#:]+)(#[^()\s]*)?\)", re.DOTALL)
"""Code, or a Markdown link to a file beside the page: its text, the file and the anchor."""
HIDDEN = {"source_hidden": "hide-input", "outputs_hidden": "hide-output"}
"""JupyterLab's folded parts of a cell, and the tags by which myst-nb folds them."""


def stage(folder: Path) -> None:
    """Write all sources of the site into a new folder.

    Parameters
    ----------
    folder : Path
        The folder; what it held is deleted.
    """
    shutil.rmtree(folder, ignore_errors=True)
    for source in pages():
        target = folder / source.relative_to(CLONE)
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.suffix == ".ipynb":
            notebook = with_moving_widget(nbformat.read(source, as_version=4), source)
            nbformat.write(translated(notebook, source.parent, folder), target)
        else:
            target.write_text(relinked(source.read_text(encoding="utf-8"), source.parent, folder), encoding="utf-8")
    (folder / "glossary.md").write_text(glossary_page(), encoding="utf-8")
    contents = "\n".join(SECTIONS)
    index = (folder / "README.md").rename(folder / "index.md")
    index.write_text(
        f"{index.read_text(encoding='utf-8')}\n```{{toctree}}\n:hidden:\n{contents}\n```\n", encoding="utf-8"
    )
    shutil.copytree(HERE / "pages", folder, dirs_exist_ok=True)
    for name in ("conf.py", "scorer.js"):
        shutil.copy(HERE / name, folder)
    (folder / "static").mkdir()
    for name in ("site.css", "moving.js", "tex-svg.js"):
        shutil.copy(HERE / name, folder / "static")
    shutil.copytree(RECORDED, folder / "extra" / "widgets", ignore=shutil.ignore_patterns("*.json"))
    write_graphs(folder)
    write_reference(folder)
    write_gallery(folder)
    copy_demo(folder)


@cache
def pages() -> tuple[Path, ...]:
    """Return the files of the clone that become pages."""
    return tuple(path for pattern in PAGES for path in sorted(CLONE.glob(pattern)))


def with_moving_widget(notebook: NotebookNode, source: Path) -> NotebookNode:
    """Put what stands in for a notebook's widget below its cell, where its pictures have been recorded.

    Parameters
    ----------
    notebook : NotebookNode
        A notebook; it is changed.
    source : Path
        Where it lies in the clone.
    """
    cell = widget_cell(notebook)
    if cell is not None and (RECORDED / source.stem / "controls.json").exists():
        way = "../" * (len(source.relative_to(CLONE).parts) - 1)
        notebook.cells.insert(notebook.cells.index(cell) + 1, stand_in(notebook, source.stem, way))
    return notebook


def translated(notebook: NotebookNode, place: Path, folder: Path) -> NotebookNode:
    """Say in myst-nb's words what a notebook says in JupyterLab's: folded parts, alternative texts, links.

    Parameters
    ----------
    notebook : NotebookNode
        A notebook; it is changed.
    place : Path
        Its folder in the clone.
    folder : Path
        The folder of the site's sources.
    """
    for cell in notebook.cells:
        folded = cell.metadata.get("jupyter", {})
        tags = [tag for name, tag in HIDDEN.items() if folded.get(name)]
        cell.metadata["tags"] = [*cell.metadata.get("tags", []), *tags]
        if cell.cell_type == "markdown":
            cell.source = relinked(cell.source, place, folder)
        for output in cell.get("outputs", []):
            if "text/markdown" in output.get("data", {}):
                output.data["text/markdown"] = relinked(output.data["text/markdown"], place, folder)
            if "image/png" in output.get("data", {}):
                cell.metadata["mystnb"] = {"image": {"alt": alternative_text(output)}}
    return notebook


def alternative_text(output: NotebookNode) -> str:
    """Return what a figure shows, in words.

    Parameters
    ----------
    output : NotebookNode
        A cell's output with a picture.

    Raises
    ------
    ValueError
        When it has no alternative text.
    """
    if text := output.metadata.get("image/png", {}).get("alt"):
        return text
    raise ValueError("a figure without alternative text")


def relinked(text: str, place: Path, folder: Path) -> str:
    """Let the links of a page lead to pages of the site, or to copies of files; a folder's name is left without a link.

    Parameters
    ----------
    text : str
        Markdown.
    place : Path
        The page's folder in the clone.
    folder : Path
        The folder of the site's sources, which takes the copies.

    Raises
    ------
    FileNotFoundError
        When a link leads nowhere.
    """

    def follow(link: re.Match) -> str:
        words, file, anchor = link.groups()
        if not file:
            return link[0]
        target = (place / file).resolve()
        name = target.relative_to(CLONE)
        if target.is_dir():
            return words[1:-1]
        if name == Path("README.md"):
            return f"{words}({file.removesuffix('README.md')}index.md)"
        if target not in pages():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(target, folder / name)
            anchor = None
        return f"{words}({file}{anchor or ''})"

    return LINK.sub(follow, text)


def write_graphs(folder: Path) -> None:
    """Write the page of graphs: each stage drawn with its cut edges, the ledger, and the register of equations.

    Parameters
    ----------
    folder : Path
        The folder of the site's sources.
    """
    (folder / "graphs").mkdir()
    parts = [
        "# Graphs, ledger, equations",
        "Each stage is exact inference in some model. Dashed edges are those that the system cuts. The numbers on them",
        "are the price on a toy world small enough for exact inference: exact answer, arrow, the system's answer.",
    ]
    for entry in STAGES:
        one_cell = "scans" in signature(entry.build).parameters
        graph = entry.build(read_scans("#.")) if one_cell else entry.build()
        ax = graph.draw()
        ax.figure.savefig(folder / "graphs" / f"{entry.id}.png", dpi=110, bbox_inches="tight")
        plt.close(ax.figure)
        cuts = "; ".join(f"{edge.edge}: {edge.cost}" for edge in graph.cut) or "no edge is cut"
        words = f"Graph of {graph.title}. Nodes {', '.join(graph.model.names)}. Cut: {cuts}"
        shown = f"![{words.replace('[', '(').replace(']', ')')}](graphs/{entry.id}.png)"
        parts += [
            "",
            f"## {entry.title}",
            "",
            f"Belongs to lecture {in_notebooks(notebook_link(entry.lecture))}.",
            "",
            shown,
        ]
        parts += ["", *(f"- `{edge.edge}`: {edge.cost}" for edge in graph.cut)]
    tables = {
        "The ledger of cut edges": ledger_table(ledger()),
        "Checked by": in_notebooks(stage_table()),
        "Equations of the paper": in_notebooks(equation_table()),
    }
    for title, table in tables.items():
        parts += ["", f"## {title}", "", table]
    (folder / "graphs.md").write_text("\n".join(parts), encoding="utf-8")


def in_notebooks(text: str) -> str:
    """Let links that work in the folder of notebooks work one folder above it; code is named without a link.

    Parameters
    ----------
    text : str
        Markdown.
    """
    text = re.sub(r"\[([^\]]*)\]\((\.\./[^)]*|[^)]*\.py)\)", r"\1", text)
    return re.sub(r"\]\((?!http)", "](notebooks/", text)


def write_reference(folder: Path) -> None:
    """Write one page of the reference for each module of the book, which autodoc fills from docstrings.

    Parameters
    ----------
    folder : Path
        The folder of the site's sources.
    """
    (folder / "api").mkdir()
    for name in MODULES:
        title = f"semgrid_edu.{name}"
        module = import_module(title)
        things = {one: getattr(module, one) for one in getattr(module, "__all__", ())}
        elsewhere = [one for one, it in things.items() if not getattr(it, "__module__", title).startswith(title)]
        text = f"{title}\n{'=' * len(title)}\n\n.. automodule:: {title}\n   :members:\n"
        text += f"   :exclude-members: {', '.join(elsewhere)}\n" if elsewhere else ""
        (folder / "api" / f"{name}.rst").write_text(text, encoding="utf-8")
    names = "\n".join(f"api/{name}" for name in MODULES)
    first = {name: import_module(f"semgrid_edu.{name}").__doc__.splitlines()[0] for name in MODULES}
    lines = "\n".join(f"- [semgrid_edu.{name}](api/{name}.rst): {words}" for name, words in first.items())
    text = f"# Reference\n\nThe modules of the book, from their docstrings.\n\n{lines}\n\n"
    contents = f"```{{toctree}}\n:hidden:\n:maxdepth: 1\n{names}\n```\n"
    (folder / "api.md").write_text(text + contents, encoding="utf-8")


def write_gallery(folder: Path) -> None:
    """Write the gallery: each figure of each notebook with its words, for those who teach.

    Parameters
    ----------
    folder : Path
        The folder of the site's sources; pictures go to what is copied as it is.
    """
    pictures = folder / "extra" / "figures"
    pictures.mkdir(parents=True)
    parts = [
        "# All figures",
        "For your slides: each figure in full size behind its small picture, with its words. BSD 3-clause; where the",
        "real street is shown, PandaSet by Hesai and Scale AI, CC BY 4.0, cut and reduced.",
    ]
    for path in (path for path in pages() if path.suffix == ".ipynb"):
        outputs = [o for cell in nbformat.read(path, as_version=4).cells for o in cell.get("outputs", [])]
        figures = [output for output in outputs if "image/png" in output.get("data", {})]
        if figures:
            parts += ["", f"## [{title(path)}]({path.relative_to(CLONE)})", ""]
        for number, figure in enumerate(figures, 1):
            name, words = f"{path.stem}-{number}.png", html.escape(alternative_text(figure))
            (pictures / name).write_bytes(base64.b64decode(figure.data["image/png"]))
            image = f'<img src="figures/{name}" alt="{words}" loading="lazy">'
            parts += [f'<figure><a href="figures/{name}">{image}</a><figcaption>{words}</figcaption></figure>', ""]
    (folder / "gallery.md").write_text("\n".join(parts), encoding="utf-8")


def title(path: Path) -> str:
    """Return the first heading of a notebook.

    Parameters
    ----------
    path : Path
        The notebook.
    """
    first = next(cell.source for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "markdown")
    return first.splitlines()[0].lstrip("# ")


def copy_demo(folder: Path) -> None:
    """Put the demo's pages on the site, linked from the first page, where `make demo` has made them.

    Parameters
    ----------
    folder : Path
        The folder of the site's sources.
    """
    demo = CLONE / "out" / "demo"
    if demo.exists():
        shutil.copytree(demo, folder / "extra" / "demo")
        link = '<a href="demo/index.html">The demo, running: click a cell and read why it got its class.</a>'
        with (folder / "index.md").open("a", encoding="utf-8") as page:
            page.write(f"\n<p>{link}</p>\n")


if __name__ == "__main__":
    matplotlib.use("agg")
    stage(Path(sys.argv[1]))
