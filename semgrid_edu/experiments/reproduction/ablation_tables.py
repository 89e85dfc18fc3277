"""The ablations as Markdown (section 4)."""

import numpy as np

from semgrid_edu.experiments.measured import shown
from semgrid_edu.experiments.tables import markdown_table
from semgrid_edu.metrics import METRICS

SECTIONS = {
    "variants": "Networks that are trained differently. Usual: SegNet, 20 planes 0.2 m apart, occupancy grid, "
    "reduction, balancing, labels made with the LIDAR.",
    "calibration": "The usual network, tested with a wrong calibration: degrees of pitch (positive: believed to look "
    "further down) and yaw (to the left), metres of height.",
    "frames": "A quarter of the training frames, against all of them.",
}
"""What each list of rows shows."""


def ablations_markdown(result: dict) -> str:
    """Return the ablations as Markdown.

    Parameters
    ----------
    result : dict
        From `ablations`.

    Returns
    -------
    str
    """
    parts = [f"## {words}\n\n{_rows(result[name])}" for name, words in SECTIONS.items()]
    parts.append(
        f"## Accuracy by distance, cells with a semantic class, true labels\n\n{_distance(result['distance'])}"
    )
    parts.append(f"## Expected calibration error, points\n\n{_sureness(result['sureness'])}")
    return "\n\n".join(parts)


def _rows(rows: list[dict]) -> str:
    """Lay out scores by the true labels over all cells, and differences from the usual network, points."""
    lines = [["", *METRICS, *(f"{name}, difference" for name in METRICS)]]
    for row in rows:
        scores, differences = (row[part]["true"]["all"] for part in ("scores", "differences"))
        ours, gains = (
            [shown(part[name], digits) for name in METRICS] for part, digits in ((scores, 1), (differences, 2))
        )
        lines.append([row["what"], *ours, *gains])
    return markdown_table(lines)


def _distance(rows: list[dict]) -> str:
    lines = [["distance", "pixel accuracy"]]
    return markdown_table(lines + [[row["what"], shown(row["pixel accuracy"])] for row in rows])


def _sureness(rows: list[dict]) -> str:
    lines = [["", "mean", "every seed"]]
    for row in rows:
        errors = 100 * np.array(row["expected calibration error"])
        lines.append([row["what"], f"{errors.mean():.1f}", ", ".join(f"{error:.1f}" for error in errors)])
    return markdown_table(lines)
