"""A lecture in JupyterLab: it runs from the first cell to the last, and its widget answers."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import nbformat
import pytest

LECTURE = Path(__file__).parents[2] / "notebooks" / "05_pixels.ipynb"
PATIENCE = 300
"""Seconds that a busy machine may take for the whole lecture."""
READY = """() => {
  const context = window.jupyterapp?.shell.currentWidget?.sessionContext, kernel = context?.session?.kernel;
  return context?.isReady && kernel?.connectionStatus === "connected" && kernel.status === "idle";
}"""
"""JupyterLab calls a notebook idle before it is connected to its kernel, and drops without a word what is run then."""
ALL_RAN = """() => [...jupyterapp.shell.currentWidget.content.model.cells].every(
    (cell) => cell.type !== "code" || cell.executionCount)"""
"""The model knows all cells. On the page a folded cell has a prompt without a number, for ever."""
SETTINGS = {
    "notebook-extension/tracker": {"windowingMode": "none"},  # every cell is on the page, also out of sight
    "apputils-extension/notification": {"fetchNews": "false", "checkForUpdates": False},
}


@pytest.fixture
def lab(browser, tmp_path):
    """The address of a JupyterLab that has a copy of the lecture, and settings of its own; needs a browser."""
    places = {f"JUPYTER_{name}_DIR": str(tmp_path / name.lower()) for name in ("CONFIG", "RUNTIME")}
    places |= {f"JUPYTERLAB_{name}_DIR": str(tmp_path / name.lower()) for name in ("SETTINGS", "WORKSPACES")}
    for name, values in SETTINGS.items():
        path = tmp_path / "settings" / "@jupyterlab" / f"{name}.jupyterlab-settings"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(values), encoding="utf-8")
    shutil.copytree(LECTURE.parent / "worlds", tmp_path / "work" / "worlds")  # which the lecture imports
    nbformat.write(without_results(LECTURE), tmp_path / "work" / LECTURE.name)
    options = ["--no-browser", "--allow-root", "--expose-app-in-browser", "--ServerApp.port=0"]
    options += [f"--ServerApp.root_dir={tmp_path / 'work'}"]
    with (tmp_path / "log.txt").open("w") as log:
        server = subprocess.Popen(
            [sys.executable, "-m", "jupyterlab", *options], env=os.environ | places, stdout=log, stderr=log
        )
        try:
            yield address(tmp_path / "runtime", server)
        finally:
            server.terminate()
            server.wait(60)


def without_results(path: Path) -> nbformat.NotebookNode:
    """A notebook as before it first ran, so that no number or picture on the page is an old one."""
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    return notebook


def address(folder: Path, server: subprocess.Popen) -> str:
    """Wait until the server has written where it listens."""
    for _ in range(PATIENCE * 10):
        for path in folder.glob("jpserver-*.json"):
            running = json.loads(path.read_text(encoding="utf-8"))
            return f"{running['url']}lab/tree/{LECTURE.name}?token={running['token']}"
        assert server.poll() is None, "JupyterLab has ended"
        time.sleep(0.1)
    raise AssertionError("JupyterLab doesn't start")


def test_lecture_05_runs_and_its_slider_changes_the_picture(browser, lab):
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    page.set_default_timeout(1000 * PATIENCE)
    page.goto(lab)
    page.wait_for_function(READY)
    page.get_by_role("menuitem", name="Run", exact=True).click()
    page.get_by_role("menuitem", name="Run All Cells", exact=True).click()
    slider, picture = page.locator(".jp-Notebook .widget-slider"), page.locator(".jp-Notebook .widget-output img")
    picture.wait_for()
    page.wait_for_function(ALL_RAN)
    assert page.locator("[data-mime-type='application/vnd.jupyter.error']").count() == 0
    for _ in range(2):
        before, height = picture.get_attribute("src"), slider.locator(".widget-readout").inner_text()
        slider.locator(".noUi-handle").focus()
        page.keyboard.press("ArrowRight")
        page.wait_for_function(
            "(before) => (document.querySelector('.jp-Notebook .widget-output img')?.src ?? before) !== before",
            arg=before,
        )
        assert float(slider.locator(".widget-readout").inner_text()) == pytest.approx(float(height) + 0.05)
    page.close()
