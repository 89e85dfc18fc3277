"""Which frames of a drive the demo runs over, and which of them its page shows."""

import re
from typing import NamedTuple

from semgrid_edu.errors import ArgumentError

SHOWN = 40
"""Most frames that the page shows if nobody asks for more, evenly spaced, so that its size stays near 10 MB."""


class ChosenFrames(NamedTuple):
    """Frames of a drive.

    Parameters
    ----------
    run : range
        The numbers of those that every stage runs over; the filter needs each, also those that aren't shown.
    shown : range
        The numbers of those that the page shows, the first of `run` and then one in so many.
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
            FIRST:LAST or FIRST:LAST:STEP. Frames from FIRST up to the one before LAST are run, as Python slices a list,
            and one in STEP is shown. Each number may be left out. All frames by default, of which at most `SHOWN` are
            shown if there is no STEP.

        Returns
        -------
        ChosenFrames

        Raises
        ------
        ArgumentError
            When it isn't such a choice, or chooses no frame.

        Examples
        --------
        >>> ChosenFrames.of(144, "40:120:2")
        ChosenFrames(run=range(40, 120), shown=range(40, 120, 2))
        >>> ChosenFrames.of(144).shown
        range(0, 144, 4)
        """
        match = re.fullmatch(r"(\d*):(\d*)(?::(\d*))?", wanted or ":")
        first, last, step = ((int(part) if part else None) for part in match.groups()) if match else (None, 0, None)
        run = range(n_frames)[first:last]
        if not run or step == 0:
            expected = f"FIRST:LAST or FIRST:LAST:STEP with frames of 0 to {n_frames - 1}, such as 0:{n_frames}:2"
            raise ArgumentError("--frames", expected, repr(wanted))
        return cls(run, run[:: step or -(-len(run) // SHOWN)])

    def told(self, n_frames: int) -> str:
        """Say which frames are shown, as part of a sentence.

        Parameters
        ----------
        n_frames : int
            Number of frames of the drive.

        Returns
        -------
        str
            Empty when all are.
        """
        if len(self.shown) == n_frames:
            return ""
        rate = "" if self.shown.step == 1 else f"one in {self.shown.step} of "
        return f" ({rate}frames {self.run[0]} to {self.run[-1]}; it has {n_frames})"
