"""Notebooks from percent sources: stable cell ids, executed lectures, nothing of this machine in the file."""

import hashlib
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.files import write_text

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"
"""The lectures and exercises of a checkout; they are not part of the wheel."""

METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}
"""All that a notebook says about where it ran: any Python 3."""

LIVE = "application/vnd.jupyter.widget-view+json"
"""The output of a widget: alive only with a kernel, and named at random."""


def lecture_sources(folder: Path = NOTEBOOKS) -> list[Path]:
    """Return the percent sources of all lectures, in the order of the course.

    Parameters
    ----------
    folder : Path
        The folder of notebooks.

    Raises
    ------
    DataError
        When there are none, as in an installed wheel.
    """
    sources = sorted((folder / "src").glob("[0-9][0-9]_*.py"))
    if not sources:
        raise DataError(folder / "src", "lectures named NN_name.py (run this in a checkout of the project)", "none")
    return sources


def named(sources: list[Path], names: list[str] | None) -> list[Path]:
    """Keep the sources that are named; all of them when no name is given.

    Raises
    ------
    ArgumentError
        When a name isn't that of a lecture or exercise.
    """
    for name in names or []:
        if name not in (known := [source.stem for source in sources]):
            raise ArgumentError("names", f"some of {', '.join(known)}", name)
    return [source for source in sources if not names or source.stem in names]


def read_percent(path: Path) -> NotebookNode:
    """Read a percent source as a notebook that has not run.

    Parameters
    ----------
    path : Path
        A jupytext source in percent format.

    Returns
    -------
    NotebookNode
        Its cell ids depend on the cells' text alone, so two conversions are equal byte for byte.

    Raises
    ------
    DataError
        When there is no such file.
    """
    if not path.is_file():
        raise DataError(path, "a percent source", "no file")
    notebook = jupytext.reads(path.read_text(encoding="utf-8"), fmt="py:percent")
    notebook.metadata = nbformat.from_dict(METADATA)
    notebook.nbformat, notebook.nbformat_minor = 4, 5
    taken: dict[str, int] = {}
    for cell in notebook.cells:
        digest = hashlib.sha256(f"{cell.cell_type}\n{cell.source}".encode()).hexdigest()[:8]
        taken[digest] = taken.get(digest, 0) + 1
        cell.id = digest if taken[digest] == 1 else f"{digest}-{taken[digest]}"
    return notebook


def write_notebook(notebook: NotebookNode, path: Path) -> None:
    """Validate a notebook and write it atomically."""
    nbformat.validate(notebook)
    write_text(path, nbformat.writes(notebook))


def execute(notebook: NotebookNode, folder: Path, timeout: int = 300) -> NotebookNode:
    """Run all cells, and keep only what every reader can see.

    Parameters
    ----------
    notebook : NotebookNode
        Changed in place.
    folder : Path
        The kernel's working directory, where a student would run it.
    timeout : int
        Seconds that one cell may take.

    Returns
    -------
    NotebookNode
        The same notebook, with outputs. The views of widgets are left out: without a kernel they show nothing.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        When a cell raises; it names the cell.
    """
    place = {"metadata": {"path": folder}}
    client = NotebookClient(notebook, timeout=timeout, record_timing=False, resources=place)
    client.execute()
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if LIVE not in output.get("data", {})]
    notebook.metadata = nbformat.from_dict(METADATA)
    return notebook


def build_lecture(source: Path) -> Path:
    """Execute a lecture and write it beside the folder of its source.

    Parameters
    ----------
    source : Path
        `notebooks/src/NN_name.py`.

    Returns
    -------
    Path
        `notebooks/NN_name.ipynb`.
    """
    target = source.parents[1] / f"{source.stem}.ipynb"
    write_notebook(execute(read_percent(source), target.parent), target)
    return target
