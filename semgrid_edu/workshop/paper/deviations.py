"""In what an experiment differs from the paper's: the list below every table (section 4)."""

from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.paper.data_runs import RECIPE_OF
from semgrid_edu.workshop.paper.scales import Scale
from semgrid_edu.workshop.simulation.sensors.rig import KITTI_AHEAD

_TEXTS = table_beside(__file__)


def frame_counts(data: str) -> dict[str, tuple[int, int]]:
    """Return by split the numbers of labelled frames and of drives of a data set.

    Parameters
    ----------
    data : str
        A key of `RECIPE_OF`.
    """
    labelled: dict[str, list[int]] = {}
    for route in RECIPE_OF[data].routes:
        labelled.setdefault(route.split, []).append(len(route.labelled))
    return {split: (sum(frames), len(frames)) for split, frames in labelled.items()}


def deviations(scale: Scale, field: str, beside_gpu: list[str] | None = None) -> list[str]:
    """Return in what an experiment differs from the paper's, one sentence each.

    Parameters
    ----------
    scale : Scale
        How large it is.
    field : str
        On which data: "kitti", "chroma" or "synthia".
    beside_gpu : list of str, optional
        The training runs that were done on the CPU when others were done on a GPU; None when all were done on the CPU.
    """
    data = getattr(scale, field)
    preset = _TEXTS[scale.preset]
    counts = frame_counts(data)
    numbers = {
        "data": data,
        "frames": " and ".join(f"{frames} to {split} in {n} drives" for split, (frames, n) in counts.items()),
        "drives": counts["test"][1],
        "image_steps": scale.image_iterations,
        "grid_steps": scale.grid_iterations,
    }
    lines = [*_TEXTS[field]["data"]]
    if RECIPE_OF[data].rig == KITTI_AHEAD and not RECIPE_OF[data].dense:
        lines.append(_TEXTS["scanner"]["columns"])
    lines += [*_TEXTS[field]["labels"], *preset["networks"]]
    if beside_gpu is not None:
        names = dict.fromkeys(name.rsplit("-seed", 1)[0] for name in beside_gpu)
        on_cpu = f" Trained on the CPU, in float32: {', '.join(names)}." if names else ""
        lines.append(_TEXTS["gpu"]["all"] + on_cpu)
    lines += [*(preset["chosen"] if field == "kitti" else ()), *_TEXTS[field]["numbers"]]
    return [line.format(**numbers) for line in lines]
