"""The demo: run every stage over every frame of a drive, then write the page and its picture."""

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, nullcontext
from importlib.util import find_spec
from itertools import tee
from pathlib import Path
from typing import NamedTuple

from tqdm.auto import tqdm

from semgrid_edu.datasets.drive_files import first_sound, sound_frames
from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.datasets.samples import real_drive, real_weights, sample_drive, sample_weights, segnet_real_weights
from semgrid_edu.errors import ArgumentError, DataError, needed
from semgrid_edu.fast import load_net
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.pipeline import FrameResult, Stages, run_pipeline
from semgrid_edu.storage.files import check_new_folder, check_ours, write_text
from semgrid_edu.storage.reading import read_json
from semgrid_edu.workshop.demo.details import story_data
from semgrid_edu.workshop.demo.overview import save_overview
from semgrid_edu.workshop.demo.page import page_html
from semgrid_edu.workshop.demo.record import Record
from semgrid_edu.workshop.demo.rerun import APPLICATION, rerun_recording
from semgrid_edu.workshop.demo.save import saved_drive
from semgrid_edu.workshop.demo.stages_file import Comparison, load_stages

SHOWN = 40
"""How many frames the page shows at most by default, evenly spaced, so that its size stays near 10 MB."""


class ChosenFrames(NamedTuple):
    """Frames of a drive.

    Parameters
    ----------
    run : range
        The numbers of those that are run; the filter needs each of them, also those that aren't shown.
    shown : range
        The numbers of those that the page shows: the first of `run`, then every so many.
    """

    run: range
    shown: range

    @classmethod
    def of(cls, n_frames: int, wanted: str | None = None) -> "ChosenFrames":
        """Choose frames.

        Parameters
        ----------
        n_frames : int
            Number of frames of the drive, at least one.
        wanted : str, optional
            FIRST:LAST or FIRST:LAST:STEP, as in a Python slice: the frames from FIRST up to LAST, without it, are run,
            and one in STEP is shown. Each number may be left out. By default all frames are run, and without STEP at
            most `SHOWN` are shown.

        Raises
        ------
        ArgumentError
            When it has another form, chooses no frame, or a frame that the drive doesn't have.

        Examples
        --------
        >>> ChosenFrames.of(144, "40:120:2")
        ChosenFrames(run=range(40, 120), shown=range(40, 120, 2))
        >>> ChosenFrames.of(144).shown
        range(0, 144, 4)
        """
        match = re.fullmatch(r"(\d{0,18}):(\d{0,18})(?::(\d{0,18}))?", wanted or ":", re.ASCII)
        first, last, step = ((int(part) if part else None) for part in match.groups()) if match else (None, 0, None)
        run = range(n_frames)[first:last]
        if not run or step == 0 or (last or 0) > n_frames:
            expected = f"FIRST:LAST or FIRST:LAST:STEP with frames of 0 to {n_frames - 1}, such as 0:{n_frames}:2"
            raise ArgumentError("--frames", expected, repr(wanted))
        return cls(run, run[:: step or -(-len(run) // SHOWN)])

    def told(self, n_frames: int) -> str:
        """Return which frames are shown, as part of a sentence.

        Parameters
        ----------
        n_frames : int
            Number of frames of the drive.

        Returns
        -------
        str
            Empty if all are.
        """
        if len(self.shown) == n_frames:
            return ""
        rate = "" if self.shown.step == 1 else f"one in {self.shown.step} of "
        return f" ({rate}frames {self.run[0]} to {self.run[-1]}; it has {n_frames})"


CARD = "card.json"
"""A model card beside weights.

Its "other_streets" says how well the network does on other real streets, its "learned_drives" from which drives it has
learned, by the names of their folders.
"""

POOR = (
    "Expect poor semantics here. The truth is not known for this drive, and no card beside the weights says how well "
    "the network does on real streets. A network that has learned from simulated streets alone takes many things in "
    "real images for something else, and then the image scores, the semantic grid and the refined grid are wrong there."
)
"""What to expect on a drive without labels, with weights that have no card."""

IMAGE_TO_MAP = {"segment", "sample", "fuse"}
"""Stages that are made for one network: for its image size, its planes, and whether it sees return heights."""

STORIES = 200_000
"""How many cells have a story at most, in all frames together: a story takes about 55 bytes of the page."""


def write_demo(
    drive: FrameSequence,
    weights: str | Path | None,
    out: str | Path,
    stages: str | Path | None = None,
    frames: str | None = None,
    switch: str = "",
    force: bool | None = None,
    memory: bool = False,
    skipped: Callable[[str], None] | None = None,
    save: str | Path | None = None,
    rerun: str | Path | None = None,
) -> Path:
    """Run every stage over a drive and write a page that shows it.

    Parameters
    ----------
    drive : FrameSequence
        The drive, with its `camera`; it has to have camera images.
    weights : path-like, or None
        The network's weights, as `save_net` wrote them. None for the shipped network for real drives: `real_weights()`,
        or `segnet_real_weights()` for a student's `segment`, `sample` or `fuse`, which are made for the paper's system.
    out : path-like
        The folder to write index.html and overview.png to; made when missing.
    stages : path-like, optional
        A Python file with a student's stages, see `load_stages`. The page then shows a second run with these stages
        beside the package's.
    frames : str, optional
        Which frames to run over and to show, such as "40:120:2", see `ChosenFrames.of`.
    switch : str
        The link from the page to another one, as HTML.
    force : bool, optional
        Whether to replace an index.html that isn't a demo's, see `check_ours`.
    memory : bool
        Whether classes are remembered over frames, and that map is shown too. A `remember` among the stages shows it in
        any case.
    skipped : callable, optional
        Is called with a line for each damaged frame, which is left out. By default a damaged frame ends the drive.
    save : path-like, optional
        A new or empty folder for arrays, maps and an animation of the frames that are run, see `saved_drive`.
    rerun : path-like, optional
        A file for a recording of them, see `rerun_recording`. Both hold the results of a student's stages, if given.

    Returns
    -------
    Path
        The page, index.html.

    Raises
    ------
    ArgumentError
        When the drive has no images, or not the frames that are asked for.
    DataError
        When a file of the drive, the weights, their card or the stages can't be read. If it is a file of a later frame,
        the page of the frames before it is written first, and `save` and `rerun` hold these.
    StageError
        When a stage of the file raises an error, or returns what the next one can't use.
    """
    chosen = ChosenFrames.of(len(drive), frames)
    mine = load_stages(stages) if stages is not None else Stages()
    weights = weights or (segnet_real_weights() if IMAGE_TO_MAP & set(mine.given) else real_weights())
    net = load_net(weights, drive.camera)
    card = _card_beside(weights)
    known = card.get("other_streets", "")
    page, picture = _check_page(out, force)
    _check_handed_out(out, save, rerun, force)
    first = first_sound(drive.__getitem__, chosen.run if skipped else chosen.run[:1])
    if first.image is None:
        raise DataError(drive.folder, f"images of {getattr(drive, 'view', 'its camera')}", "none")
    memory = memory or mine.remember is not None
    runs = [Stages.fast(net, keep_steps=True, memory=memory)]
    comparison = None
    if stages is not None:
        runs.append(mine.over(runs[0]))
        comparison = Comparison(Path(stages).name, mine.given, memory)
    spec = net.architecture.grid
    label_set = LABEL_SETS[net.architecture.label_set]
    stories = _stories_every(len(chosen.shown), spec)
    record = Record(spec, label_set, chosen.shown, comparison, net, stories, memory)
    left_out: dict[int, str] = {}

    def leave_out(k: int, error: DataError) -> None:
        left_out[k] = f"frame {k}: {error}"
        skipped(left_out[k])
        record.leave_out()

    frames_read = sound_frames(drive, chosen.run, leave_out if skipped else None)
    with ExitStack() as written:
        takers = []
        if save is not None:
            numbers = (k for k in chosen.run if k not in left_out)  # as the run goes on
            saving = saved_drive(save, spec, label_set, weights, numbers, Path(stages or "").name)
            takers.append(written.enter_context(saving))
        if rerun is not None:
            takers.append(written.enter_context(rerun_recording(rerun, spec, label_set, drive.camera)))
        results = _handed_out(run_side_by_side(frames_read, *runs), takers)
        written.enter_context(compile_bar())
        broken = _record_all(tqdm(results, total=len(chosen.run), desc=drive.folder.name, unit="frame"), record)
    words = {"expected": known or ("" if record.labelled else POOR), "credit": drive.credit}
    save_overview(record, picture, " ".join(filter(None, words.values())))
    story = story_data(net, drive.camera, record.layout) | {"start": record.start}
    words |= {"choice": chosen.told(len(drive)), "broken": str(broken or ""), "switch": switch}
    words |= {"left_out": [*left_out.values()], "learned": drive.folder.name in card.get("learned_drives", [])}
    html = page_html(record, drive.folder.name, drive.camera, net.architecture.image_size, story, **words)
    write_text(page, html)
    if broken:
        beside = "".join(f", as {path} does" for path in (save, rerun) if path is not None)
        found = f"{broken.args[2]}; {page} shows the frames before it{beside}"
        raise DataError(broken.path, broken.args[1], found) from broken
    return page


REAL = "<b>A real street</b> · <a href='simulated/index.html'>a simulated street</a>"
SIMULATED = "<a href='../index.html'>A real street</a> · <b>a simulated street</b>"


def write_both_streets(out: str | Path, weights: str | Path | None = None, **options: object) -> Path:
    """Write the pages of the two shipped drives, the real street and in `simulated/` the simulated one.

    Parameters
    ----------
    out : path-like
        The folder to write to; made when missing.
    weights : path-like, optional
        The network for both; when left out, each street has one that has learned from such streets.
    **options
        `stages`, `frames`, `force`, `memory`, `skipped`, `save` and `rerun` of `write_demo`. What the last two name
        for the real street has, for the simulated one, a folder `simulated/` as well.

    Returns
    -------
    Path
        The page of the real street, which leads to the other one.
    """
    second = Path(out) / "simulated"
    others = {name: options.get(name) for name in ("save", "rerun")}
    if others["save"]:
        others["save"] = Path(others["save"]) / second.name
    if others["rerun"]:
        others["rerun"] = Path(others["rerun"]).parent / second.name / Path(others["rerun"]).name
    _check_page(out, options.get("force"))  # all of them before the first page is made
    _check_page(second, options.get("force"))
    _check_handed_out(second, None, others["rerun"], options.get("force"))
    page = write_demo(real_drive(), weights, out, switch=REAL, **options)
    write_demo(sample_drive(), weights or sample_weights(), second, switch=SIMULATED, **options | others)
    return page


def run_side_by_side(frames: Iterable[Frame], *several: Stages) -> Iterator[tuple[FrameResult, ...]]:
    """Send each frame through several sets of stages, to compare them.

    Parameters
    ----------
    frames : iterable of Frame
        The frames in the order of time; each is read once.
    *several : Stages
        Complete sets of stages, such as `Stages.fast(net)` and `mine.over(Stages.fast(net))`.

    Yields
    ------
    tuple of FrameResult
        One result for each set of stages, in their order.
    """
    streams = tee(frames, len(several))
    yield from zip(*(run_pipeline(*one) for one in zip(streams, several, strict=True)), strict=True)


def compile_bar() -> AbstractContextManager:
    """Return a context with a bar that counts the functions numba compiles: without it, the first run looks dead."""
    if find_spec("numba") is None:
        return nullcontext()  # the book's stages run, which need no compiler
    from numba.core.event import Listener, install_listener

    class CompileBar(Listener):
        bar: tqdm | None = None

        def on_start(self, event: object) -> None:
            if self.bar is None:
                self.bar = tqdm(desc="compiling, only the first time", unit=" functions")

        def on_end(self, event: object) -> None:
            self.bar.update()

    return install_listener("numba:compile", CompileBar())


def _check_page(out: str | Path, force: bool | None) -> tuple[Path, Path]:
    """Return where page and picture go, after checking that no other file would be overwritten."""
    files = Path(out) / "index.html", Path(out) / "overview.png"
    check_ours("<h1>From a laser scan and a picture to a map with meaning</h1>", *files, force=force)
    return files


def _check_handed_out(out: str | Path, save: str | Path | None, rerun: str | Path | None, force: bool | None) -> None:
    """Check that what is handed out beside the page can be written, and wouldn't replace anything else."""
    if rerun is not None:
        if Path(rerun).suffix != ".rrd":
            raise ArgumentError("--rerun", "a file that ends in .rrd", rerun)
        needed("rerun")
        check_ours(APPLICATION, rerun, force=force)
    if save is None:
        return
    for other in filter(None, (out, rerun)):
        if Path(other).resolve().is_relative_to(Path(save).resolve()):
            raise ArgumentError("--save", f"a folder of its own, not one that holds {other}", save)
    check_new_folder(save)


def _handed_out(
    results: Iterable[tuple[FrameResult, ...]], takers: list[Callable[[FrameResult], None]]
) -> Iterator[tuple[FrameResult, ...]]:
    """Pass results on, and give the last of each frame, a student's if there is one, to what is written beside."""
    for of_frame in results:
        for take in takers:
            take(of_frame[-1])
        yield of_frame


def _card_beside(weights: str | Path) -> dict[str, object]:
    """Return the card beside the weights; empty without one."""
    card = Path(weights).with_name(CARD)
    if not card.exists():
        return {}
    content = read_json(card)
    known = content.get("other_streets", "")
    learned = content.get("learned_drives", [])
    if not isinstance(known, str):
        raise DataError(card, "other_streets: a text", repr(known)[:200])
    if not (isinstance(learned, list) and all(isinstance(name, str) for name in learned)):
        raise DataError(card, "learned_drives: a list of names of folders", repr(learned)[:200])
    return content


def _record_all(results: Iterable[tuple[FrameResult, ...]], record: Record) -> DataError | None:
    """Record the frames up to one that can't be read, and return its error; raise it if that is the first frame."""
    try:
        for of_frame in results:
            record.add(*of_frame)
    except DataError as error:
        if not record.views:
            raise
        return error
    return None


def _stories_every(n_shown: int, spec: GridSpec) -> int:
    """Return n such that the page tells the stories of one in n shown frames."""
    return max(1, -(-n_shown * spec.shape[0] * spec.shape[1] // STORIES))
