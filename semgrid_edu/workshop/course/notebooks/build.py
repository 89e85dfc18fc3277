"""Notebooks from percent sources: stable cell ids, executed lectures, and no traces of a machine in the file."""

import hashlib
from math import inf
from pathlib import Path
from queue import Empty
from time import monotonic
from typing import Any

import jupytext
import nbformat
from jupyter_client.asynchronous.client import AsyncKernelClient
from jupyter_client.channels import AsyncZMQSocketChannel
from nbclient import NotebookClient
from nbconvert.preprocessors import CoalesceStreamsPreprocessor
from nbformat import NotebookNode
from traitlets import Type

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.files import shipped_folder, write_text
from semgrid_edu.workshop.course.notebooks.figures import finish_figures

NOTEBOOKS = shipped_folder("notebooks")
"""The lectures and exercises of a clone. A wheel has none: students install it, and graded code can read it."""

METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}
"""The kernel that a notebook names: any Python 3."""

LIVE = "application/vnd.jupyter.widget-view+json"
"""The output of a widget. It works only with a kernel, and its name is random."""


def lecture_sources(folder: Path = NOTEBOOKS) -> list[Path]:
    """Return the percent sources of all lectures, `src/NN_name.py` or `src/NNx_name.py`, in the order of the course.

    Parameters
    ----------
    folder : Path
        The folder of notebooks.

    Raises
    ------
    DataError
        When there are no lectures, as in an installed wheel.
    """
    sources = sorted((folder / "src").glob("[0-9][0-9]*_*.py"))
    if not sources:
        raise DataError(folder / "src", "lectures named NN_name.py (run this in a checkout of the project)", "none")
    return sources


def companion_sources(folder: Path = NOTEBOOKS) -> list[Path]:
    """Return the percent sources of all companion notebooks, `src/deeper/NAME.py`, sorted by name; there may be none.

    Parameters
    ----------
    folder : Path
        The folder of notebooks.
    """
    return sorted((folder / "src" / "deeper").glob("*.py"))


def notebook_name(source: Path) -> str:
    """Return the name of a source's notebook, such as "03_bof", "exercises/03_bof" or "deeper/time_beliefs".

    Parameters
    ----------
    source : Path
        A percent source in the folder `src` or below it.
    """
    sources = next(folder for folder in source.parents if folder.name == "src")
    return source.relative_to(sources).with_suffix("").as_posix()


def built_path(source: Path) -> Path:
    """Return the path of a source's notebook, which needn't exist yet: the source's path without `src`.

    Parameters
    ----------
    source : Path
        A percent source in the folder `src` or below it.

    Examples
    --------
    >>> built_path(Path("notebooks/src/deeper/time_beliefs.py")).as_posix()
    'notebooks/deeper/time_beliefs.ipynb'
    """
    return next(folder for folder in source.parents if folder.name == "src").parent / f"{notebook_name(source)}.ipynb"


def named(sources: list[Path], names: list[str] | None) -> list[Path]:
    """Return the sources with the given names, in their order; all of them when no name is given.

    Parameters
    ----------
    sources : list of Path
        The sources to choose from. A lecture and its exercise have the same name, and are chosen together.
    names : list of str, optional
        The names to keep, such as "03_bof" or "time_beliefs".

    Raises
    ------
    ArgumentError
        When no source has one of the names.
    """
    known = sorted({source.stem for source in sources})
    for name in names or []:
        if name not in known:
            raise ArgumentError("names", f"some of {', '.join(known)}", name)
    return [source for source in sources if not names or source.stem in names]


def read_percent(path: Path) -> NotebookNode:
    """Read a percent source as a notebook that has not run.

    The ids of its cells depend on the cells' text alone, so two conversions are equal byte for byte.

    Parameters
    ----------
    path : Path
        A jupytext source in percent format.

    Raises
    ------
    DataError
        When there is no such file.
    """
    if not path.is_file():
        raise DataError(path, "a percent source", "no file")
    notebook = jupytext.reads(path.read_text(encoding="utf-8"), fmt="py:percent")
    notebook.metadata = nbformat.from_dict(METADATA)
    notebook.nbformat = 4
    notebook.nbformat_minor = 5
    seen: dict[str, int] = {}
    for cell in notebook.cells:
        digest = hashlib.sha256(f"{cell.cell_type}\n{cell.source}".encode()).hexdigest()[:8]
        seen[digest] = seen.get(digest, 0) + 1
        cell.id = digest if seen[digest] == 1 else f"{digest}-{seen[digest]}"
    return notebook


def write_notebook(notebook: NotebookNode, path: Path) -> None:
    """Validate a notebook and write it atomically.

    Parameters
    ----------
    notebook : NotebookNode
        The notebook.
    path : Path
        The file to write; its folder is made when missing.
    """
    write_text(path, notebook_text(notebook))


def notebook_text(notebook: NotebookNode) -> str:
    """Validate a notebook, and return the text of its file.

    Parameters
    ----------
    notebook : NotebookNode
        The notebook.
    """
    nbformat.validate(notebook)
    return nbformat.writes(notebook)


class WakefulChannel(AsyncZMQSocketChannel):
    """A channel to a kernel that looks once a second whether a message has come.

    ZeroMQ announces a message once, and sending on the same socket can use the announcement up. The output of a slider
    does send there, while nbclient waits for the reply to the cell. A single long wait then sleeps until its timeout,
    beside an idle kernel, though the reply has come.
    """

    async def get_msg(self, timeout: float | None = None) -> dict[str, Any]:  # type: ignore[override]
        """Return the next message, or raise `queue.Empty` after so many seconds."""
        end = inf if timeout is None else monotonic() + timeout
        while True:
            left = max(0, end - monotonic())
            try:
                return await super().get_msg(min(1, left))
            except Empty:
                if left <= 1:
                    raise


class WakefulClient(AsyncKernelClient):
    """A client of a kernel whose shell channel is a `WakefulChannel`."""

    shell_channel_class = Type(WakefulChannel)


def execute(notebook: NotebookNode, folder: Path, timeout: int = 300) -> NotebookNode:
    """Run all cells of a notebook, and keep the outputs that can be seen without a kernel.

    Views of widgets are left out. Figures are made smaller where the eye can't tell the difference, and carry the
    alternative text of their cell.

    Parameters
    ----------
    notebook : NotebookNode
        The notebook to run, changed in place.
    folder : Path
        The kernel's working directory: the folder in which a student would run the notebook.
    timeout : int
        The longest that one cell may take, seconds.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        When a cell raises an error; the message names the cell.
    """
    client = NotebookClient(notebook, timeout=timeout, record_timing=False, resources={"metadata": {"path": folder}})
    client.km = client.create_kernel_manager()
    client.km.client_factory = WakefulClient
    client.execute()
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if LIVE not in output.get("data", {})]
            CoalesceStreamsPreprocessor().preprocess_cell(cell, {}, 0)  # print's parts come as they were flushed
            finish_figures(cell)
    notebook.metadata = nbformat.from_dict(METADATA)
    return notebook


def build_lecture(source: Path) -> Path:
    """Execute a lecture or a companion and write it to its `built_path`, which is returned.

    Parameters
    ----------
    source : Path
        Its percent source.
    """
    target = built_path(source)
    target.parent.mkdir(exist_ok=True)
    write_notebook(execute(read_percent(source), target.parent), target)
    return target
