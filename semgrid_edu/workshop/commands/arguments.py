"""What every command checks first: its arguments, which drive to use, and doubts about its data."""

import os
import re
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import typer
from typer.core import TyperGroup

from semgrid_edu.errors import ArgumentError, DataError

if TYPE_CHECKING:  # a command that needs no drive starts faster without numpy
    from pathlib import Path

    from semgrid_edu.datasets.frames import FrameSequence

LARGEST = 2**63 - 1
"""The largest integer that a command accepts, because PyTorch's generators accept no larger seed."""

ALIASES = {"view": "camera", "name": "segmenter", "dataset": "data", "test_cameras": "test"}
"""Arguments of functions that have other names among the options of commands."""

SHOWN_DOUBTS = 20
"""Largest number of doubts of a kind that are shown one by one."""


class Commands(TyperGroup):
    """A group of commands that remembers the one asked for, and explains after Ctrl-C or `kill` how to continue."""

    asked, command = "semgrid-edu", None
    """The command that was asked for last, such as "semgrid-edu data make"; by name, and itself."""

    def resolve_command(self, ctx: object, args: list[str]) -> tuple:
        """Find a command, and remember it.

        Parameters
        ----------
        ctx : typer.Context
            The group's context.
        args : list of str
            The arguments after the group's name.
        """
        name, command, rest = super().resolve_command(ctx, args)
        Commands.asked = " ".join(["semgrid-edu", *ctx.command_path.split()[1:], str(name)])
        Commands.command = command
        return name, command, rest

    def invoke(self, ctx: object) -> object:
        """Run a command; `ctx` is the group's context. Parameters are those of `Commands.resolve_command`."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            options = [option for one in self.command.params for option in one.opts]
            how = " with --resume" if "--resume" in options else ""
            sys.exit(f"semgrid-edu: interrupted; run the same command again{how}")


def check_arguments(arguments: Sequence[str]) -> None:
    """Reject arguments that are empty (an unset variable), not UTF-8, or too large.

    Parameters
    ----------
    arguments : sequence of str
        The user's arguments, without the program's name.

    Raises
    ------
    ArgumentError
        When an argument is empty, isn't UTF-8, or is a whole number of more than 63 bits.

    Examples
    --------
    >>> check_arguments(["demo", "--drive", ""])
    Traceback (most recent call last):
    semgrid_edu.errors.ArgumentError: --drive: expected a value, found nothing: is a variable unset?
    """
    for number, argument in enumerate(arguments):
        before = arguments[number - 1] if number else ""
        option, equals, value = argument.partition("=") if argument.startswith("--") else ("", "", argument)
        name = option or (before if before.startswith("--") else f"argument {number + 1}")
        if not value.strip() and (equals or not option):
            raise ArgumentError(name, "a value", "nothing: is a variable unset?")
        try:
            value.encode()
        except UnicodeEncodeError:
            raise ArgumentError(name, "UTF-8, in which results write names down", ascii(value)) from None
        digits = re.fullmatch(r"[+-]?0*(\d*)", value)
        if digits and (len(digits[1]) > 19 or int(digits[1] or 0) > LARGEST):
            raise ArgumentError(name, f"a whole number up to {LARGEST}", value[:60])


def as_typed(error: ArgumentError) -> ArgumentError:
    """Return an error that names the option of the command, such as --image-size, in place of a function's argument.

    Parameters
    ----------
    error : ArgumentError
        The error; it stays as it is if the command has no such option.
    """
    argument, expected, found = error.args
    options = {one.name: one.opts[0] for one in getattr(Commands.command, "params", ()) if one.opts[0].startswith("--")}
    return ArgumentError(options.get(ALIASES.get(argument, argument), argument), expected, found)


def tell(doubts: Iterable[str]) -> None:
    """Write doubts to standard error, one line each; of several processes only the first one does.

    Parameters
    ----------
    doubts : iterable of str
        Doubts from `drive_doubts`, `dataset_doubts` or `weights_doubts`.
    """
    doubts = list(doubts) if os.environ.get("RANK", "0") == "0" else []
    for doubt in doubts[:SHOWN_DOUBTS]:
        typer.echo(f"semgrid-edu: doubtful: {doubt}", err=True)
    if len(doubts) > SHOWN_DOUBTS:
        typer.echo(f"semgrid-edu: doubtful: and {len(doubts) - SHOWN_DOUBTS} more", err=True)


def dataset_doubts(dataset_dir: "str | Path", *splits: str) -> list[str]:
    """List the doubts about the drives of some splits of a data set, before hours of work begin.

    Parameters
    ----------
    dataset_dir : path-like
        The folder of the data set, such as data/minikitti.
    *splits : str
        Such as "train".

    Returns
    -------
    list of str
        One line for each doubt, from `drive_doubts`.
    """
    import semgrid_edu.workshop.paper.datasets  # noqa: F401 (adds the paper's readers to those that dataset.json can name)
    from semgrid_edu.datasets.index import INDEX_FILE, load_index
    from semgrid_edu.workshop.doubts import drive_doubts

    index = load_index(dataset_dir)
    for split in splits:
        if split not in index.splits:
            raise DataError(f"{dataset_dir}/{INDEX_FILE}", f"the split {split}", ", ".join(index.splits) or "none")
    drives = [drive for split in splits for drive, _ in index.drives(split)]
    return [doubt for drive in drives for doubt in drive_doubts(drive)]


def drive_in(path: "Path | None", reader: "Path | None", camera: str | None) -> "FrameSequence | None":
    """Open the drive in a folder, and say what it is; None when there is no folder, for the shipped drives.

    Parameters
    ----------
    path : Path or None
        The folder.
    reader : Path or None
        A Python file with a class that reads it.
    camera : str or None
        The data set's name for the camera; the first camera when left out.

    Raises
    ------
    ArgumentError
        When there is a reader and no folder, or a camera that the reader or the shipped drives don't know.
    DataError
        When there isn't one drive.
    """
    from semgrid_edu.datasets.kitti_raw import VIEWS
    from semgrid_edu.workshop.demo.find_drives import drive_at, read_with

    if path is None and reader is not None:
        raise ArgumentError("--reader", "PATH, the folder that it reads", "no PATH")
    if path is None and camera not in (None, VIEWS[0]):
        raise ArgumentError("--camera", f"{VIEWS[0]}, the only one of the shipped drives", camera)
    if reader is not None and camera is not None:
        raise ArgumentError("--camera", "none: the class in --reader chooses it", camera)
    if path is None:
        return None
    kind, drive = ("a recording", read_with(reader, path)) if reader else drive_at(path, camera)
    typer.echo(f"semgrid-edu: {kind}: {drive.name}, {len(drive)} frames", err=True)
    return drive
