"""Results on disk: JSON with all that made them, Markdown with every deviation, and a picture (section 4)."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt

from semgrid_edu.storage.files import atomic_path, write_json, write_text
from semgrid_edu.storage.provenance import versions
from semgrid_edu.workshop.paper.reports.deviations import deviations, frame_counts
from semgrid_edu.workshop.paper.reports.experiments import Experiment
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.scheduler.plan import with_needs
from semgrid_edu.workshop.scheduler.runs import Run


def write_result(name: str, experiment: Experiment, scale: Scale, seeds: int, root: Path, out: Path) -> str:
    """Compute the result of an experiment whose runs have ended, and write its files.

    The result depends on the runs alone: computed again, its files are the same byte for byte. How long the runs took
    stands beside it, in a file of its own.

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
        Takes NAME.json, NAME.md, NAME.png and NAME_times.json.

    Returns
    -------
    str
        The Markdown.
    """
    runs = with_needs(experiment.runs(scale, seeds))
    records = [run.record(root) for run in runs]
    processes = max(record.get("processes", 1) for record in records)
    command = f"semgrid-edu reproduce {name} --scale {scale.name} --seeds {seeds} --runs RUNS --out OUT"
    made_by = {
        "experiment": name,
        "title": experiment.title,
        "command": command + (f" --processes {processes}" if processes > 1 else ""),
        "scale": scale.name,
        "seeds": seeds,
        "iterations": [scale.image_iterations, scale.grid_iterations],
        "frames and drives": frame_counts(getattr(scale, experiment.field)),
        "deviations": [*deviations(scale, experiment.field), *experiment.deviations],
        "commits": sorted({str(record["commit"]) for record in records}),
        "versions": versions("numpy", "torch", "numba", "scipy"),
    }
    result = made_by | experiment.result(scale, seeds, root)
    text = result_markdown(result, experiment)
    write_json(out / f"{name}.json", result)
    write_text(out / f"{name}.md", text)
    write_json(out / f"{name}_times.json", times(runs, root))
    figure = experiment.picture(result, root)
    with atomic_path(out / f"{name}.png") as path:
        figure.savefig(path, dpi=130)
    plt.close(figure)
    return text


def times(runs: Sequence[Run], root: Path) -> dict:
    """Return how long runs took, together and each by itself.

    Parameters
    ----------
    runs : sequence of Run
        Runs that have ended.
    root : Path
        The folder of all runs.

    Returns
    -------
    dict
        "hours" of all runs, one after the other; "minutes" of each run; the "dates" on which they ended.

    Raises
    ------
    DataError
        When a run hasn't ended, or what it recorded is damaged.
    """
    ended = {run.name: run.record(root) for run in runs}
    return {
        "hours": round(sum(record["seconds"] for record in ended.values()) / 3600, 2),
        "dates": sorted({record["date"] for record in ended.values()}),
        "minutes": {name: round(record["seconds"] / 60, 1) for name, record in ended.items()},
    }


def result_markdown(result: dict, experiment: Experiment) -> str:
    """Return a result as Markdown, with all that made it.

    Parameters
    ----------
    result : dict
        What `write_result` writes as JSON.
    experiment : Experiment
        The experiment.

    Returns
    -------
    str
    """
    listed = "\n".join(f"- {line}" for line in result["deviations"])
    return (
        f"# {experiment.title}\n\nScale {result['scale']}, number of seeds: {result['seeds']}. Means over the seeds; "
        "in brackets 95 % intervals over drives and seeds. Per cent.\n\n"
        f"{experiment.markdown(result)}\n\nWhat differs from the paper:\n\n{listed}\n\n"
        f"Made by `{result['command']}`, commit {', '.join(result['commits'])}.\n"
    )
