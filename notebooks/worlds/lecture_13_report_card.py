"""The report card of a drive: every check with its reading and one of three verdicts, in one figure."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.frame import Frame
from semgrid_edu.metrics import METRICS
from semgrid_edu.workshop.course.street import motion_between, piece_confusions
from semgrid_edu.workshop.scoring.calibration import expected_calibration_error, reliability
from semgrid_edu.workshop.scoring.statistics import drive_interval, paired_interval
from worlds import lecture_13_checks as checks
from worlds.lecture_13_faults import YAWS, image_mirrored
from worlds.lecture_13_scan_borders import edge_contrast

TURNED, LEANS, SHIFTED, FARTHER, OVERSURE = 0.5, 1.0, 0.05, 1.0, 0.05
"""Limits: a camera turned by more (degrees), ground that leans by more (degrees), a motion that fits worse than another
by more (metres), ground that comes into view later by more (metres), probabilities that are further from the shares of
right cells."""

BINS = 8
"""Number of bins for the expected calibration error."""

MARKS = {True: ("passes", "#1b9e77", "o"), False: ("ALARM", "#d95f02", "X"), None: ("can't tell", "0.55", "s")}
"""Word, colour and mark of each verdict."""


class Line(NamedTuple):
    """One line of a report card.

    Parameters
    ----------
    check : str
        What was checked.
    reading : str
        What was measured.
    verdict : bool or None
        Whether the reading passes; None when this drive can't tell.
    unseen : str
        What this check can't see, even when it passes.
    """

    check: str
    reading: str
    verdict: bool | None
    unseen: str = ""


def border_verdict(contrast: NDArray, turns: NDArray, null: float = 1.0) -> bool | None:
    """Judge where borders in scan and image agree best.

    Parameters
    ----------
    contrast : (n,) float
        From `edge_contrast`.
    turns : (n,) float
        The turns of the camera that were tried, degrees.
    null : float
        The largest contrast of borders that have nothing to do with the image, see `image_mirrored`.

    Returns
    -------
    bool or None
        None when the best turn is the first or the last one that was tried, so that a better one may lie beyond, or
        when even the best contrast isn't above the null level.
    """
    best = contrast.argmax()
    if best in (0, len(turns) - 1) or contrast[best] <= null:
        return None
    return bool(abs(turns[best]) <= TURNED)


def motion_verdict(errors: dict[str, float]) -> bool | None:
    """Judge the motion of the poses against the other motions that were tried.

    Parameters
    ----------
    errors : dict of str to float
        From `axes_errors`, metres.

    Returns
    -------
    bool or None
        None if another motion fits equally well, within 5 cm: a stopped vehicle, or for the mirror one that drives
        straight.
    """
    margin = min(error for name, error in errors.items() if name != "as the poses say") - errors["as the poses say"]
    return None if abs(margin) <= SHIFTED else margin > 0


def check_lines(drive: FrameSequence, frames: Sequence[Frame]) -> list[Line]:
    """Put a drive through the checks that need neither network nor labels.

    Parameters
    ----------
    drive : FrameSequence
        The drive.
    frames : sequence of Frame
        Its frames with scan and image, more than five.
    """
    times = [frame.time for frame in frames]
    errors = checks.axes_errors(frames, thin=3)
    contrast = np.mean([edge_contrast(frame, YAWS) for frame in frames[::3]], axis=0)
    null = np.mean([edge_contrast(image_mirrored(frame), YAWS) for frame in frames[::3]], axis=0).max()
    ground = np.mean([checks.ground_plane(frame.points, frame.camera.lidar_height) for frame in frames], axis=0)
    problems = len(drive.problems())
    gaps = len(checks.time_gaps(times))
    best = YAWS[contrast.argmax()]
    far = float(np.linalg.norm(motion_between(frames[0], frames[-1])[:3, 3]))
    borders = f"best at {best:+.2f}°, contrast {contrast.max():.2f}"
    lean = [bool(abs(angle) <= LEANS) for angle in ground[1:]]
    cause = "whether LIDAR or street"
    return [
        Line("files", f"{problems} problems", problems == 0, "wrong numbers in whole files"),
        Line(
            "gaps in time",
            f"{gaps}; a step takes {1000 * np.median(np.diff(times)):.0f} ms",
            False if gaps else None,
            "steps that are all too long",
        ),
        _clock_line(drive),
        Line("borders", borders, border_verdict(contrast, YAWS, null), "roll; pitch, or names it yaw"),
        Line("ground ahead", f"rises by {ground[1]:+.1f}°", lean[0], cause),
        Line("ground to the left", f"rises by {ground[2]:+.1f}°", lean[1], cause),
        Line(
            "motion",
            f"{errors['as the poses say']:.2f} m off; {far:.1f} m driven",
            motion_verdict(errors),
            "swapped sides, if straight on",
        ),
    ]


def geometry_verdicts(
    frames: Sequence[Frame], every: int = 4, thin: int = 1, turns: NDArray = YAWS
) -> dict[str, bool | None]:
    """Return the verdicts of the checks that need neither network nor labels, by name.

    Parameters
    ----------
    frames : sequence of Frame
        Successive frames with scans and images, more than five.
    every : int
        Images and ground are checked in each frame of this number.
    thin : int
        As `axes_errors` takes it.
    turns : (n,) float
        Turns of the camera that are tried, degrees.
    """
    some = frames[::every]
    contrast, null = (
        np.mean([edge_contrast(change(frame), turns) for frame in some], axis=0)
        for change in (lambda frame: frame, image_mirrored)
    )
    tilt = np.mean([checks.ground_plane(frame.points, frame.camera.lidar_height).pitch for frame in some])
    return {
        "gaps": False if len(checks.time_gaps([frame.time for frame in frames])) else None,
        "borders": border_verdict(contrast, turns, null.max()),
        "tilt": bool(abs(tilt) <= LEANS),
        "motion": motion_verdict(checks.axes_errors(frames, thin=thin)),
    }


def view_line(begins: float, learned: float) -> Line:
    """Judge whether the camera sees the ground from about where the network's camera saw it.

    Parameters
    ----------
    begins, learned : float
        How far ahead the ground comes into view, here and where the network learned, metres.
    """
    reading = f"from {begins:.0f} m; learned from {learned:.0f} m"
    return Line("ground in view", reading, bool(begins <= learned + FARTHER), "other differences of cameras")


def _clock_line(drive: FrameSequence) -> Line:
    """Judge the delays between sensors: if all are zero, one clock was written into every file."""
    if not isinstance(drive, KittiRawDrive):
        return Line("clocks", "one time for each frame", None, "how late a sensor is")
    late = np.concatenate([*checks.sensor_delays(drive).values()])
    largest = 1000 * np.nanmax(np.abs(late))
    return Line(
        "clocks",
        f"up to {largest:.0f} ms apart",
        bool(largest < 50) if largest else None,
        "stamps that are wrong alike",
    )


def map_lines(name: str, truths: NDArray, grids: NDArray, rivals: Mapping[str, NDArray], pieces: NDArray) -> list[Line]:
    """Judge a map by its labels: against each trivial map, and whether it knows how sure to be.

    Parameters
    ----------
    name : str
        What the map is called.
    truths : (F, H, W) int
        True classes, 255 where a cell doesn't count.
    grids : (F, C, H, W) float
        The semantic grids.
    rivals : mapping of str to (F, H, W) int
        The trivial maps by name.
    pieces : (F, H, W) int
        From `street_pieces`.
    """
    ours = piece_confusions(truths, grids.argmax(axis=1), pieces)
    accuracy = METRICS["pixel accuracy"]
    lines = []
    right = 100 * drive_interval(ours, accuracy).mean
    for rival, called in rivals.items():
        low, gain, high = paired_interval(ours, piece_confusions(truths, called, pieces), accuracy)
        points = [f"{round(100 * value) + 0:+d}" for value in (low, gain, high)]  # no -0
        reading = f"{right:.0f} % right, {points[1]} points ({points[0]} to {points[2]})"
        lines.append(
            Line(f"{name} against {rival}", reading, None if low <= 0 <= high else bool(gain > 0), "other streets")
        )
    error = expected_calibration_error(reliability(np.moveaxis(grids, 1, 0), truths, BINS))
    return [
        *lines,
        Line(f"{name}: how sure", f"off by {100 * error:.0f} points", bool(error <= OVERSURE), "other streets"),
    ]


def draw_report_card(lines: Sequence[Line], ax: Axes) -> Axes:
    """Draw a report card, one row a line.

    Parameters
    ----------
    lines : sequence of Line
        The lines.
    ax : Axes
        Where to draw.
    """
    for row, line in enumerate(lines):
        word, colour, mark = MARKS[line.verdict]
        ax.plot(0.02, row, mark, color=colour, markersize=9)
        for x, text in ((0.05, word), (0.17, line.check), (0.41, line.reading), (0.75, line.unseen)):
            ax.text(x, row, text, va="center", fontsize=9, color=colour if text == word else "black")
    for x, title in ((0.17, "check"), (0.41, "reading"), (0.75, "what it can't see")):
        ax.text(x, -1, title, va="center", fontsize=9, fontweight="bold")
    ax.set(xlim=(0, 1.05), ylim=(len(lines) - 0.4, -1.5))
    ax.axis("off")
    return ax
