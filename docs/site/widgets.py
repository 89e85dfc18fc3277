"""Record what the notebooks' widgets show, for the site, which has no kernel: `python docs/site/widgets.py NAME ...`.

A notebook's code runs up to its widget. Then each control goes through its values while the others stay where they
begin, and each picture is kept in docs/site/widgets/NAME, beside a table of controls and values.
"""

import contextlib
import hashlib
import html
import io
import json
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import ipywidgets
import matplotlib
import nbformat
import numpy as np
from matplotlib import pyplot as plt
from PIL import Image

CLONE = Path(__file__).resolve().parents[2]
RECORDED = CLONE / "docs" / "site" / "widgets"
MOST_BYTES = 1_000_000
"""What all pictures of a widget may take."""
MOST_VALUES = 13
"""Pictures of one control, when it has more values than that."""
WIDTH, QUALITY = 760, 80
"""Widest picture, pixels, and its quality as WebP, 0..100."""


def widget_cell(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode | None:
    """Return the cell of a notebook that makes its widget; none when it has no widget.

    Parameters
    ----------
    notebook : NotebookNode
        A notebook.
    """
    return next((cell for cell in notebook.cells if cell.cell_type == "code" and "interact(" in cell.source), None)


def version_of(cell: nbformat.NotebookNode) -> str:
    """Return a number that changes with a cell's code: recorded pictures belong to one version of it.

    Parameters
    ----------
    cell : NotebookNode
        The widget's cell.
    """
    return hashlib.sha256(cell.source.encode()).hexdigest()[:12]


def record(path: Path) -> int:
    """Record the widget of a notebook.

    Parameters
    ----------
    path : Path
        The notebook.

    Returns
    -------
    int
        The bytes that its pictures take.

    Raises
    ------
    ValueError
        When they are too many for a page.
    """
    notebook, folder = nbformat.read(path, as_version=4), RECORDED / path.stem
    show, controls = widget_of(path, notebook)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    start, table = {name: control.value for name, control in controls.items()}, []
    for number, (name, control) in enumerate(controls.items()):
        values, said = values_of(control), []
        for k, value in enumerate(values):
            picture, words = shown(show, start | {name: value})
            picture.save(folder / f"{number}-{k}.webp", quality=QUALITY, method=6)
            said.append(", ".join(filter(None, [label(value), words])))
        table.append({"name": control.description or name, "values": said, "start": values.index(control.value)})
    known = {"cell": version_of(widget_cell(notebook)), "controls": table}
    (folder / "controls.json").write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    size = sum(file.stat().st_size for file in folder.iterdir())
    if size > MOST_BYTES:
        raise ValueError(f"{folder}: {size} bytes of pictures, {MOST_BYTES} are allowed")
    return size


def widget_of(path: Path, notebook: nbformat.NotebookNode) -> tuple[Callable, dict[str, Any]]:
    """Run a notebook up to its widget.

    Parameters
    ----------
    path : Path
        Where the notebook lies; its code runs there.
    notebook : NotebookNode
        The notebook.

    Returns
    -------
    show : callable
        What draws the picture.
    controls : dict of str to Widget
        The widget's controls by the names of its arguments.
    """
    asked, namespace = [], {"__name__": "__main__"}
    ipywidgets.interact = lambda show, **controls: asked.append((show, controls))
    plt.show = lambda: None  # pictures stay open, to be saved
    sys.path.insert(0, str(path.parent))  # where a kernel looks for modules beside the notebook
    with contextlib.chdir(path.parent), contextlib.redirect_stdout(io.StringIO()):
        for cell in notebook.cells:
            if cell.cell_type == "code" and not asked:
                plt.close("all")
                exec(compile(cell.source, path.name, "exec"), namespace)
    return asked[0]


def values_of(control: Any) -> list:
    """Return the values through which a control goes, where it begins among them.

    Parameters
    ----------
    control : Widget
        A slider or a choice.
    """
    if hasattr(control, "options"):
        return list(control.options)
    low, high, step = control.min, control.max, control.step
    count = round((high - low) / step) + 1
    steps = low + step * np.unique(np.rint(np.linspace(0, count - 1, min(count, MOST_VALUES))))
    values = 10.0**steps if isinstance(control, ipywidgets.FloatLogSlider) else steps
    reached = {type(control.value)(value) for value in values.round(6)}
    return sorted(reached | {control.value} if count > MOST_VALUES else reached)


def shown(show: Callable, values: dict[str, Any]) -> tuple[Image.Image, str]:
    """Return the picture for some values, and what is printed beside it.

    Parameters
    ----------
    show : callable
        What draws the picture.
    values : dict of str to object
        Its arguments.
    """
    plt.close("all")
    with contextlib.redirect_stdout(io.StringIO()) as said:
        show(**values)
    file = io.BytesIO()
    plt.savefig(file, dpi=110)
    picture = Image.open(file).convert("RGB")
    picture.thumbnail((WIDTH, picture.height))
    return picture, said.getvalue().strip()


def label(value: object) -> str:
    """Return a value as it stands beside the slider.

    Parameters
    ----------
    value : object
        A number, or a choice.
    """
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def stand_in(notebook: nbformat.NotebookNode, name: str, way: str) -> nbformat.NotebookNode:
    """Return a text cell whose slider moves through a widget's recorded pictures; static/moving.js moves them.

    Parameters
    ----------
    notebook : NotebookNode
        A notebook that has a widget.
    name : str
        Its name.
    way : str
        The way from its page to the site's folder, such as "../".

    Raises
    ------
    ValueError
        When the pictures were recorded from another version of the widget's cell.
    """
    known = json.loads((RECORDED / name / "controls.json").read_text(encoding="utf-8"))
    if known["cell"] != version_of(widget_cell(notebook)):
        raise ValueError(f"the widget of {name} has changed: python docs/site/widgets.py {name}")
    sliders = "".join(_slider(number, control) for number, control in enumerate(known["controls"]))
    first = known["controls"][0]
    source = f"{way}widgets/{name}/0-{first['start']}.webp"
    words = "What the widget shows: " + ", ".join(f"{c['name']} = {c['values'][c['start']]}" for c in known["controls"])
    note = "Without a kernel: one control moves at a time, the others stand where they begin."
    picture = f'<img src="{source}" alt="{html.escape(words)}">'
    return nbformat.v4.new_markdown_cell(f'<div class="moving">{sliders}{picture}<p>{note}</p></div>')


def _slider(number: int, control: dict[str, Any]) -> str:
    """Return the slider of one control, with its values for the script."""
    values, start = control["values"], control["start"]
    data = html.escape(json.dumps(values))
    place = f'min="0" max="{len(values) - 1}" value="{start}" name="{number}" data-values="{data}"'
    name = html.escape(control["name"])
    return f'<label><b>{name}</b><input type="range" {place}><output>{html.escape(values[start])}</output></label>'


def notebooks(names: list[str]) -> Iterator[Path]:
    """Find notebooks that have widgets.

    Parameters
    ----------
    names : list of str
        Names without ending; empty for all.
    """
    for path in sorted([*CLONE.glob("notebooks/*.ipynb"), *CLONE.glob("notebooks/deeper/*.ipynb")]):
        if (not names or path.stem in names) and widget_cell(nbformat.read(path, as_version=4)):
            yield path


if __name__ == "__main__":
    matplotlib.use("agg")
    for path in notebooks(sys.argv[1:]):
        print(f"{path.stem}: {record(path) / 1000:.0f} kB", flush=True)
