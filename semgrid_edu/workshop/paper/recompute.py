"""Results recomputed from the counts kept beside them, and compared with what is written (section 4).

All numbers, words and times are compared; the versions of the libraries aren't, nor are the pictures, which are drawn
from the same numbers. Numbers may differ by a billionth of their size, because libraries and machines add up in
different orders.
"""

import json
import math
from collections.abc import Callable, Iterator
from itertools import zip_longest
from pathlib import Path

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_bytes, read_json
from semgrid_edu.workshop.paper.experiments import EXPERIMENTS
from semgrid_edu.workshop.paper.reproduce import computed_result, result_files, result_markdown, times_of
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import Scale, scale_named

NOT_COMPARED = "versions"
"""The part of a result with the versions of the libraries."""

TOLERANCE = 1e-9
"""By how much a number may differ, as a share of its size."""

NOTHING = "nothing"
"""Shown for a part that is missing."""

MOST_SEEDS = 1000
"""The largest number of seeds that `semgrid-edu reproduce` takes."""


def check_results(folder: Path, echo: Callable[[str], None]) -> bool:
    """Compute all results in a folder again, and name what differs; return whether nothing does.

    Parameters
    ----------
    folder : Path
        What `semgrid-edu reproduce` wrote: of each experiment NAME.json, NAME.md, NAME_times.json and NAME_counts.npz.
    echo : callable
        Shows text to the user.

    Raises
    ------
    DataError
        When the folder has no results, or one of their files is missing or damaged.
    """
    names = [name for name in EXPERIMENTS if result_files(folder, name)[0].exists()]
    if not names:
        raise DataError(folder, "results such as table1.json", "none")
    differing = {name: list(differences_in(folder, name)) for name in names}
    for name, lines in differing.items():
        counts = result_files(folder, name)[3].name
        found = f"differs in {len(lines)} place{'s' * (len(lines) > 1)}" if lines else "as written"
        if later := _rows_without_runs(folder, name):
            found += f"; no runs yet (`semgrid-edu reproduce {name}` makes them): {', '.join(later)}"
        echo("\n".join([f"{name}, computed again from {counts}: {found}", *lines]))
    return not any(differing.values())


def differences_in(folder: Path, name: str) -> Iterator[str]:
    """Yield the places where what is written about an experiment differs from its counts, one line each.

    Parameters
    ----------
    folder : Path
        The folder of the results.
    name : str
        A key of `EXPERIMENTS`.
    """
    scores, words, times, *_ = result_files(folder, name)
    experiment = EXPERIMENTS[name]
    written, scale, seeds, counted = _read(folder, name)
    result = computed_result(name, experiment, scale, seeds, counted)
    yield from differences(written, json.loads(json.dumps(result)), scores.name)  # as it comes back from its file
    yield from differences(read_json(times), times_of(counted.records), times.name)
    lines = [read_bytes(words).decode(errors="replace").splitlines(), result_markdown(result, experiment).splitlines()]
    for number, (ours, computed) in enumerate(zip_longest(*lines), start=1):
        if ours != computed:
            yield f"{words.name}, line {number}"


def _read(folder: Path, name: str) -> tuple[dict, Scale, int, RunCounts]:
    """Return what is written about an experiment, its scale, its number of seeds and its counts."""
    scores, _, _, counts, _ = result_files(folder, name)
    written = read_json(scores)
    counted = RunCounts(counts)
    size = written.get("scale"), written.get("seeds")
    if not isinstance(size[0], str) or type(size[1]) is not int or not 1 <= size[1] <= MOST_SEEDS:
        raise DataError(scores, "a result of `semgrid-edu reproduce` with its scale and seeds", f"{size}")
    return written, scale_named(size[0]), size[1], counted


def _rows_without_runs(folder: Path, name: str) -> list[str]:
    """Return the rows that were added after an experiment's counts were kept."""
    found = EXPERIMENTS[name].rows_without_runs
    return found(*_read(folder, name)[1:]) if found else []


def differences(written: object, computed: object, place: str) -> Iterator[str]:
    """Yield the places at which two pieces of JSON differ, with both values.

    Parameters
    ----------
    written, computed : object
        What `json.loads` returns.
    place : str
        What the whole is called.
    """
    if isinstance(written, dict) and isinstance(computed, dict):
        for name in sorted(written.keys() | computed.keys()):
            if name != NOT_COMPARED:
                yield from differences(written.get(name, NOTHING), computed.get(name, NOTHING), f"{place}, {name}")
    elif isinstance(written, list) and isinstance(computed, list):
        for number, pair in enumerate(zip_longest(written, computed, fillvalue=NOTHING)):
            yield from differences(*pair, f"{place}, {_named(pair[0], number)}")
    elif not _alike(written, computed):
        yield f"{place}: {written} is written, {computed} is computed"


def _named(part: object, number: int) -> str:
    """Return the name of an entry of a list: its "what", else its number."""
    return str(part["what"]) if isinstance(part, dict) and "what" in part else str(number)


def _alike(written: object, computed: object) -> bool:
    """Return whether two values are the same, numbers but for rounding."""
    if isinstance(written, float) and isinstance(computed, (int, float)):
        return math.isclose(written, computed, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
    return type(written) is type(computed) and written == computed
