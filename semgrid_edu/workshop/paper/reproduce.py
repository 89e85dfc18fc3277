"""From a request to results on disk: the plan and its estimate, the runs, the tables (section 4)."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt

from semgrid_edu.errors import ArgumentError
from semgrid_edu.storage.files import atomic_path, check_ours, check_writable, sole_writer, write_json, write_text
from semgrid_edu.storage.provenance import versions
from semgrid_edu.training.devices import choose_device
from semgrid_edu.workshop.paper.data_runs import frame_counts
from semgrid_edu.workshop.paper.experiments import EXPERIMENTS, Experiment, deviations
from semgrid_edu.workshop.paper.run import OUTPUT, Run, estimate, execute_plan, with_needs
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import Scale, scale_named
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table
from semgrid_edu.workshop.workplace import check_workers, usable_cores, workplace


@dataclass(frozen=True, kw_only=True)
class Request:
    """What a command of `semgrid-edu reproduce` was asked for.

    Parameters
    ----------
    experiment : str
        A key of `EXPERIMENTS`, or "all".
    scale : str
        A key of `SCALES`.
    runs : Path
        The folder of all runs.
    out : Path
        The folder of the results.
    seeds : int or None
        Number of seeds; None for the scale's own.
    workers : int or None
        Runs at a time; None for one per core.
    device : str
        The device of the training runs, see `choose_device`.
    """

    experiment: str
    scale: str
    runs: Path
    out: Path
    seeds: int | None = None
    workers: int | None = None
    device: str = "cpu"

    @property
    def chosen(self) -> dict[str, Experiment]:
        """The experiments that were asked for, by name."""
        return EXPERIMENTS if self.experiment == "all" else {self.experiment: EXPERIMENTS[self.experiment]}

    def size(self, experiment: Experiment) -> tuple[Scale, int]:
        """Return the scale and the number of seeds of an experiment.

        Parameters
        ----------
        experiment : Experiment
            One of `chosen`.
        """
        scale = scale_named(self.scale)
        return scale, self.seeds or getattr(scale, experiment.seeds)

    def plan(self) -> list[Run]:
        """Return the runs of all experiments, each after those that it needs."""
        return with_needs(run for one in self.chosen.values() for run in one.runs(*self.size(one)))


def reproduce(request: Request, echo: Callable[[str], None], plan_only: bool = False) -> str:
    """Show the plan, do the runs, and write the results.

    Parameters
    ----------
    request : Request
        What was asked for.
    echo : callable
        Shows text to the user.
    plan_only : bool
        Whether to stop after the plan.

    Returns
    -------
    str
        What went wrong, one line per run; empty when all went well.

    Raises
    ------
    ArgumentError
        When something that was asked for doesn't exist, such as a GPU for each process.
    """
    check_workers(1 if request.workers is None else request.workers)
    choose_device(request.device)
    root = request.runs.resolve()
    if root.exists() and not root.is_dir():
        raise ArgumentError("--runs", "a folder", f"the file {root}")
    scale_named(request.scale)
    for name in request.chosen:
        check_ours(f'"command": "semgrid-edu reproduce {name} ', *result_files(request.out, name))
    check_writable(root / OUTPUT)
    root.mkdir(parents=True, exist_ok=True)
    with nullcontext() if plan_only else sole_writer(root):
        plan = request.plan()
        echo("Estimating the time, which takes a few trial steps of each network ...")
        estimated = estimate(plan, root)
        minutes = sum(estimated.values()) / (request.workers or usable_cores()) / 60
        left = f"left: {len(estimated)} of {len(plan)} runs, about {minutes:.0f} min"
        echo(f"{plan_table(plan, estimated)}\n\n{left}")
        if plan_only:
            return ""
        with workplace(request.workers) as place:
            failed = execute_plan(plan, root, place, request.device)
        for name, experiment in request.chosen.items():
            size = request.size(experiment)
            if failed.keys().isdisjoint(with_needs(experiment.runs(*size))):
                echo(write_result(name, experiment, *size, root, request.out))
        return "\n".join(
            f"{run.name}: {error.strip().splitlines()[-1]} ({run.folder(root) / OUTPUT})"
            for run, error in failed.items()
        )


def plan_table(plan: list[Run], seconds: dict[Run, float]) -> str:
    """Return a plan as a Markdown table: kinds of runs, how many there are and have ended, and their time.

    Parameters
    ----------
    plan : list of Run
        From `with_needs`.
    seconds : dict of Run to float
        From `estimate`.
    """
    rows = [["kind of run", "runs", "done", "steps each", "minutes each"]]
    kinds: dict[tuple[str, int], list[Run]] = {}
    for run in plan:
        kinds.setdefault((run.pace, run.steps), []).append(run)
    for (pace, steps), alike in kinds.items():
        left = [seconds[run] / 60 for run in alike if run in seconds]
        minutes = f"{left[0]:.1f}" if left else "-"
        rows.append([pace, str(len(alike)), str(len(alike) - len(left)), str(steps), minutes])
    return markdown_table(rows)


def write_result(name: str, experiment: Experiment, scale: Scale, seeds: int, root: Path, out: Path) -> str:
    """Compute the result of an experiment whose runs have ended, and write its files.

    The result depends on the runs alone: computed again, its files are the same byte for byte. NAME_counts.npz keeps
    what was read from the runs, so that the result can be computed without them.

    Parameters
    ----------
    name : str
        The experiment's name, which its files have.
    experiment : Experiment
        The experiment.
    scale : Scale
        How large it is.
    seeds : int
        Number of seeds.
    root : Path
        The folder of all runs.
    out : Path
        Takes NAME.json, NAME.md, NAME_times.json, NAME_counts.npz and, of figures, NAME.png.

    Returns
    -------
    str
        The Markdown.
    """
    counted = RunCounts(root)
    scores, words, times, counts, picture = result_files(out, name)
    result = computed_result(name, experiment, scale, seeds, counted)
    text = result_markdown(result, experiment)
    figure = experiment.picture(result, counted) if experiment.picture else None
    write_json(scores, result)
    write_text(words, text)
    write_json(times, times_of(counted.records))
    counted.keep(counts)
    if figure is not None:
        with atomic_path(picture) as path:
            figure.savefig(path, dpi=130)
        plt.close(figure)
    return text


def computed_result(name: str, experiment: Experiment, scale: Scale, seeds: int, counted: RunCounts) -> dict:
    """Return the result of an experiment, and what it was made by and of.

    Parameters
    ----------
    name, experiment, scale, seeds
        As `write_result` takes them.
    counted : RunCounts
        What is known about the runs: from their folders, or from what was kept of them.
    """
    needed = with_needs(experiment.runs(scale, seeds))
    if experiment.rows_without_runs:
        needed = [run for run in needed if counted.knows(run)]
    records = {run: counted.record(run) for run in needed}
    options, beside_gpu = _how_trained(records)
    command = f"semgrid-edu reproduce {name} --scale {scale.name} --seeds {seeds} --runs RUNS --out OUT"
    about = {
        "experiment": name,
        "title": experiment.title,
        "command": command + options,
        "scale": scale.name,
        "seeds": seeds,
        "iterations": [scale.image_iterations, scale.grid_iterations],
        "frames and drives": frame_counts(getattr(scale, experiment.field)),
        "deviations": [*deviations(scale, experiment.field, beside_gpu), *experiment.deviations],
        "commits": sorted({str(record["commit"]) for record in records.values()}),
        "versions": versions("numpy", "torch", "numba", "scipy"),
    }
    return about | experiment.result(scale, seeds, counted)


def _how_trained(records: dict[Run, dict]) -> tuple[str, list[str] | None]:
    """Return the command's options for that, and which runs trained on the CPU if others trained on a GPU."""
    gpus = sorted({record.get("device", "cpu") for record in records.values()} - {"cpu"})
    options = "".join(f" --device {gpu}" for gpu in gpus)
    on_cpu = [run.name for run, record in records.items() if run.is_training and record.get("device", "cpu") == "cpu"]
    return options, on_cpu if gpus else None


def result_files(out: Path, name: str) -> list[Path]:
    """Return the files of an experiment's result: scores, text, times, counts and picture.

    Parameters
    ----------
    out : Path
        The folder of the results.
    name : str
        The experiment's name.
    """
    return [out / f"{name}{end}" for end in (".json", ".md", "_times.json", "_counts.npz", ".png")]


def times_of(records: dict[str, dict]) -> dict:
    """Return the hours of all runs, one after the other, the dates on which they ended, and the minutes of each.

    Parameters
    ----------
    records : dict of str to dict
        What `Run.record` returns, by run.
    """
    return {
        "hours": round(sum(record["seconds"] for record in records.values()) / 3600, 2),
        "dates": sorted({record["date"] for record in records.values()}),
        "minutes": {name: round(record["seconds"] / 60, 1) for name, record in records.items()},
    }


def result_markdown(result: dict, experiment: Experiment) -> str:
    """Return a result as Markdown, with its command, its commits and what differs from the paper.

    Parameters
    ----------
    result : dict
        What `write_result` writes as JSON.
    experiment : Experiment
        The experiment.
    """
    listed = "\n".join(f"- {line}" for line in result["deviations"])
    return (
        f"# {experiment.title}\n\nScale {result['scale']}, number of seeds: {result['seeds']}. Means over the seeds; "
        "in brackets 95 % intervals over drives and seeds. Per cent.\n\n"
        f"{experiment.markdown(result)}\n\nWhat differs from the paper:\n\n{listed}\n\n"
        f"Made by `{result['command']}`, commit {', '.join(result['commits'])}.\n"
    )
