"""KITTI's timestamps.txt: one line per frame, to the nanosecond (section 4)."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_text

_STAMP = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{9}")


def read_timestamps(path: Path, n_frames: int) -> NDArray[np.datetime64]:
    """Read the times at which a sensor took each frame.

    Parameters
    ----------
    path : Path
        timestamps.txt of the sensor.
    n_frames : int
        Number of frames, and so of lines.

    Returns
    -------
    (n_frames,) datetime64[ns]
        NaT for an empty line, by which KITTI marks a scan that was never recorded.

    Raises
    ------
    DataError
        When the file is missing or damaged, a line isn't a time, the number of lines is wrong, or time runs backwards.
    """
    lines = read_text(path).splitlines()
    times = np.array([_parse(path, number, line) for number, line in enumerate(lines, 1)], dtype="datetime64[ns]")
    if len(times) != n_frames:
        raise DataError(path, f"{n_frames} lines, one per frame", f"{len(times)}")
    known = np.flatnonzero(~np.isnat(times))
    backwards = np.flatnonzero(np.diff(times[known]) <= np.timedelta64(0))
    if backwards.size:
        line = known[backwards[0] + 1]
        raise DataError(path, "increasing times", f"{lines[line]!r} in line {line + 1}, not after the one before")
    return times


def _parse(path: Path, number: int, line: str) -> np.datetime64:
    """Return the time in one line."""
    if not line.strip():
        return np.datetime64("NaT", "ns")
    try:
        if _STAMP.fullmatch(line.strip()):
            return np.datetime64(line.strip(), "ns")
    except ValueError:
        pass
    raise DataError(path, "times like 2011-09-26 13:10:51.168593664", f"{line!r} in line {number}")
