"""The demo's way through a drive: every stage over every frame, then the page and its picture."""

from pathlib import Path

from tqdm.auto import tqdm

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.demo.overview import save_overview
from semgrid_edu.demo.page import Summary, page_html
from semgrid_edu.demo.record import Record
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.networks import load_net
from semgrid_edu.pipeline import run_pipeline
from semgrid_edu.storage.files import write_text

SHOWN = 40
"""The page holds no more frames than this, evenly spaced, so that it stays near 10 MB."""


def write_demo(drive: KittiRawDrive, weights: str | Path, out: str | Path) -> Path:
    """Run every stage over a drive and write a page that shows it.

    Parameters
    ----------
    drive : KittiRawDrive
        With camera images.
    weights : path-like
        Of the network, as `save_net` wrote them.
    out : path-like
        The folder to write index.html and overview.png to; made when missing.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    ArgumentError
        When the drive has no images.
    DataError
        When a file of the drive, or the weights, can't be read.
    """
    net = load_net(weights, drive.camera)
    Path(out).mkdir(parents=True, exist_ok=True)  # a folder that can't be made shall be known before the work
    label_set = LABEL_SETS[net.architecture.label_set]
    record = Record(net.architecture.grid, label_set, every=-(-len(drive) // SHOWN))
    for result in tqdm(run_pipeline(drive, net), total=len(drive), desc=drive.folder.name, unit="frame"):
        record.add(result)
    summary = Summary(
        title=drive.folder.name,
        spec=record.spec,
        camera=drive.camera,
        network_size=net.architecture.image_size,
        classes=record.classes(),
        metrics=record.metrics(),
        labelled=record.labelled,
        milliseconds=record.milliseconds(),
    )
    save_overview(record.liveliest, record.spec, label_set, Path(out) / "overview.png")
    page = Path(out) / "index.html"
    write_text(page, page_html(summary, record.views))
    return page
