"""Notebooks from percent sources: stable cell ids, executed lectures, nothing of this machine in the file."""

import hashlib
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode

from semgrid_edu.course.figures import finish_figures
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


def companion_sources(folder: Path = NOTEBOOKS) -> list[Path]:
    """Return the percent sources of all companion notebooks, by name; there may be none."""
    return sorted((folder / "src" / "deeper").glob("*.py"))


def notebook_name(source: Path) -> str:
    """Return the name of a source's notebook, such as "03_bof", "exercises/03_bof" or "deeper/graphical_models"."""
    sources = next(folder for folder in source.parents if folder.name == "src")
    return source.relative_to(sources).with_suffix("").as_posix()


def built_path(source: Path) -> Path:
    """Return where the notebook of a source belongs: the same place without `src`.

    Examples
    --------
    >>> built_path(Path("notebooks/src/deeper/graphical_models.py")).as_posix()
    'notebooks/deeper/graphical_models.ipynb'
    """
    sources = next(folder for folder in source.parents if folder.name == "src")
    return sources.parent / f"{notebook_name(source)}.ipynb"


def named(sources: list[Path], names: list[str] | None) -> list[Path]:
    """Keep the sources that are named; all of them when no name is given.

    Parameters
    ----------
    sources : list of Path
        A lecture and its exercise have the same name, and are chosen together.
    names : list of str, optional
        Such as "03_bof" or "graphical_models".

    Raises
    ------
    ArgumentError
        When a name isn't that of any source.
    """
    known = sorted({source.stem for source in sources})
    for name in names or []:
        if name not in known:
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
        The same notebook, with outputs. The views of widgets are left out: without a kernel they show nothing. Figures
        are made smaller where nobody sees the difference, and carry the alternative text of their cell.

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
            finish_figures(cell)
    notebook.metadata = nbformat.from_dict(METADATA)
    return notebook


def build_lecture(source: Path) -> Path:
    """Execute a lecture or a companion, write it, and return where `built_path` puts it."""
    target = built_path(source)
    target.parent.mkdir(exist_ok=True)
    write_notebook(execute(read_percent(source), target.parent), target)
    return target
