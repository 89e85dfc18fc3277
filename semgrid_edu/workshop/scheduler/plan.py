"""A plan: the runs that an experiment needs, in an order in which they can be done, and how long they will take."""

from collections.abc import Iterable
from dataclasses import dataclass
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
    ordered: dict[Run, None] = {}

    def add(run: Run) -> None:
        for needed in run.needs:
            add(needed)
        ordered.setdefault(run)

    for run in wanted:
        add(run)
    return list(ordered)


@dataclass(frozen=True)
class TimeEstimate:
    """How long the runs of a plan will take.

    Parameters
    ----------
    seconds : dict of Run to float
        The time of each run that hasn't ended, were it alone.
    measured : int
        How many of these times come from runs that have ended here; the others come from short trials.
    """

    seconds: dict[Run, float]
    measured: int

    def hours(self, workers: int) -> float:
        """Return the time of the whole plan: no shorter than its longest chain of runs that need each other.

        Parameters
        ----------
        workers : int
            Number of runs that are done at the same time.

        Returns
        -------
        float
            Hours.
        """
        longest: dict[Run, float] = {}
        for run in TopologicalSorter({run: run.needs for run in self.seconds}).static_order():
            longest[run] = self.seconds.get(run, 0.0) + max((longest.get(one, 0.0) for one in run.needs), default=0.0)
        return max(sum(self.seconds.values()) / workers, *longest.values(), 0.0) / 3600


def estimate(runs: list[Run], root: str | Path) -> TimeEstimate:
    """Estimate how long runs will take.

    Parameters
    ----------
    runs : list of Run
        The runs of a plan.
    root : path-like
        The folder of all runs. What has ended there says how long a step takes; for other kinds of runs, a short trial.

    Returns
    -------
    TimeEstimate
        Of the runs that haven't ended.

    Raises
    ------
    DataError
        When what a run recorded is damaged.
    """
    paces: dict[str, list[float]] = {}
    for run in runs:
        if run.has_ended(root):
            paces.setdefault(run.pace, []).append(run.record(root)["seconds"] / run.steps)
    known = {pace: sum(times) / len(times) for pace, times in paces.items()}
    left = [run for run in runs if not run.has_ended(root)]
    measured = sum(run.pace in known for run in left)
    for run in left:
        if run.pace not in known:
            known[run.pace] = run.probe()
    return TimeEstimate({run: known[run.pace] * run.steps for run in left}, measured)


def plan_table(runs: list[Run], estimated: TimeEstimate) -> str:
    """Return a plan as a table to print: kinds of runs, how many there are and have ended, and their time.

    Parameters
    ----------
    runs : list of Run
        The runs of the plan.
    estimated : TimeEstimate
        Their times.

    Returns
    -------
    str
        Markdown.
    """
    rows = [["kind of run", "runs", "done", "steps each", "minutes each"]]
    kinds: dict[tuple[str, int], list[Run]] = {}
    for run in runs:
        kinds.setdefault((run.pace, run.steps), []).append(run)
    for (pace, steps), alike in kinds.items():
        left = [estimated.seconds[run] for run in alike if run in estimated.seconds]
        minutes = f"{left[0] / 60:.1f}" if left else "-"
        rows.append([pace, str(len(alike)), str(len(alike) - len(left)), str(steps), minutes])
    return markdown_table(rows)
