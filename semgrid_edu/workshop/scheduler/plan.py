"""A plan: the runs that an experiment needs, in an order in which they can be done, and how long they will take."""

from collections.abc import Iterable, Sequence
from graphlib import TopologicalSorter
from pathlib import Path

from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table


def with_needs(wanted: Iterable[Run]) -> list[Run]:
    """Return runs and all that they need, each once, so that every run comes after those that it needs.

    Parameters
    ----------
    wanted : iterable of Run
        The runs, the most urgent first.

    Returns
    -------
    list of Run
        Otherwise in the order of `wanted`.
    """
    return list(dict.fromkeys(one for run in wanted for one in (*with_needs(run.needs), run)))


def left_to_do(runs: Sequence[Run], root: str | Path) -> list[Run]:
    """Return the runs of a plan that have to be done.

    These are the runs that haven't ended, without those that only ended runs need: data and weights may be deleted as
    soon as all that is read from them has been counted.

    Parameters
    ----------
    runs : sequence of Run
        The runs of a plan, each after those that it needs.
    root : path-like
        The folder of all runs.
    """
    needed = {one for run in runs for one in run.needs}
    left: list[Run] = []
    for run in reversed(runs):
        is_read = run not in needed or any(run in later.needs for later in left)
        if is_read and not run.has_ended(root):
            left.append(run)
    return left[::-1]


def estimate(runs: list[Run], root: str | Path) -> dict[Run, float]:
    """Estimate how long the runs of a plan will take that are left to do, each were it alone.

    Parameters
    ----------
    runs : list of Run
        The runs of a plan.
    root : path-like
        The folder of all runs. What has ended there says how long a step takes; for other kinds of runs, a short trial.

    Returns
    -------
    dict of Run to float
        Seconds.

    Raises
    ------
    DataError
        When what a run recorded is damaged.
    """
    left = left_to_do(runs, root)
    paces: dict[str, list[float]] = {}
    for run in runs:
        if run.is_recorded(root):
            paces.setdefault(run.pace, []).append(run.record(root)["seconds"] / run.steps)
    for run in left:
        if run.pace not in paces:
            paces[run.pace] = [run.trial_seconds]
    return {run: sum(paces[run.pace]) / len(paces[run.pace]) * run.steps for run in left}


def plan_hours(seconds: dict[Run, float], workers: int) -> float:
    """Return how many hours a plan takes: no fewer than its longest chain of runs that need each other.

    Parameters
    ----------
    seconds : dict of Run to float
        From `estimate`.
    workers : int
        Number of runs that are done at the same time.
    """
    longest: dict[Run, float] = {}
    for run in TopologicalSorter({run: run.needs for run in seconds}).static_order():
        longest[run] = seconds.get(run, 0.0) + max((longest.get(one, 0.0) for one in run.needs), default=0.0)
    return max(sum(seconds.values()) / workers, *longest.values(), 0.0) / 3600


def plan_table(runs: list[Run], seconds: dict[Run, float]) -> str:
    """Return a plan as a Markdown table: kinds of runs, how many there are and have ended, and their time.

    Parameters
    ----------
    runs : list of Run
        The runs of the plan.
    seconds : dict of Run to float
        From `estimate`.
    """
    rows = [["kind of run", "runs", "done", "steps each", "minutes each"]]
    kinds: dict[tuple[str, int], list[Run]] = {}
    for run in runs:
        kinds.setdefault((run.pace, run.steps), []).append(run)
    for (pace, steps), alike in kinds.items():
        left = [seconds[run] / 60 for run in alike if run in seconds]
        minutes = f"{left[0]:.1f}" if left else "-"
        rows.append([pace, *map(str, (len(alike), len(alike) - len(left), steps)), minutes])
    return markdown_table(rows)
