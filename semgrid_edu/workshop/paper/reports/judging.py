"""The nine claims judged: every statement with its numbers, and a verdict (section 4)."""

from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from semgrid_edu.workshop.paper.reports import verdicts
from semgrid_edu.workshop.paper.reports.claims import CLAIMS
from semgrid_edu.workshop.paper.reports.deviations import frame_counts
from semgrid_edu.workshop.paper.reports.forest import draw_score
from semgrid_edu.workshop.paper.reports.verdicts import verdict
from semgrid_edu.workshop.paper.runs.claim_runs import runs_of_claims
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, shown

HOLDS = {True: "yes", False: "no", None: "cannot tell"}
"""How a statement's result is written."""


def claim_runs(scale: Scale, seeds: int) -> list[Run]:
    """Return all runs of the claims. Parameters are those of `runs_of_claims`."""
    return runs_of_claims(scale, seeds).all()


def drives_of_claims(scale: Scale) -> dict[int, int]:
    """Return how many drives each claim's numbers rest on.

    Parameters
    ----------
    scale : Scale
        How large they are.

    Returns
    -------
    dict of int to int
        By number of the claim.
    """
    data = dict.fromkeys(CLAIMS, scale.kitti) | {3: scale.chroma_routes, 4: scale.synthia_routes, 6: scale.overturned}
    return {number: frame_counts(name)["test"][1] for number, name in data.items()}


def judge_claims(scale: Scale, seeds: int, root: Path) -> dict:
    """Return the verdicts, from runs that have ended.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds.
    root : Path
        The folder of all runs.

    Returns
    -------
    dict
        "rule": how verdicts are found. "claims": by number the "claim", its "judged by", the number of "drives", the
        "statements" and the "verdict".
    """
    runs, drives = runs_of_claims(scale, seeds), drives_of_claims(scale)
    judged = {}
    for number, claim in CLAIMS.items():
        statements = claim.statements(runs, root)
        judged[str(number)] = {
            "claim": claim.text,
            "judged by": claim.judged_by,
            "drives": drives[number],
            "statements": [one._asdict() | {"holds": one.holds} for one in statements],
            "verdict": verdict(statements, seeds, drives[number]),
        }
    return {"rule": verdicts.__doc__, "claims": judged}


def claims_markdown(result: dict) -> str:
    """Return the verdicts as Markdown.

    Parameters
    ----------
    result : dict
        From `judge_claims`.

    Returns
    -------
    str
    """
    rows = [["", "claim", "verdict"]]
    rows += [[number, one["claim"], one["verdict"]] for number, one in result["claims"].items()]
    sections = [_section(number, one) for number, one in result["claims"].items()]
    return "\n\n".join([markdown_table(rows), f"## The rule\n\n{result['rule']}", *sections])


def _section(number: str, one: dict) -> str:
    """Return all that is known about a claim; numbers in per cent and points."""
    rows = [["statement", "number", "claimed", "holds"]]
    for statement in one["statements"]:
        claimed = f"{'above' if statement['above'] else 'below'} {100 * statement['limit']:g}"
        rows.append([statement["what"], shown(statement["value"], 2), claimed, HOLDS[statement["holds"]]])
    head = f"## Claim {number}: {one['verdict']}\n\n{one['claim']} What must hold: {one['judged by']}"
    return f"{head} Test drives: {one['drives']}.\n\n{markdown_table(rows)}"


def claims_picture(result: dict) -> Figure:
    """Draw every statement's number and limit, claim by claim.

    Parameters
    ----------
    result : dict
        From `judge_claims`.

    Returns
    -------
    Figure
    """
    rows = [(number, one) for number, claim in result["claims"].items() for one in claim["statements"]]
    figure, ax = plt.subplots(figsize=(10, 1.5 + 0.28 * len(rows)), layout="constrained")
    for place, (_, one) in enumerate(rows):
        sign = 1 if one["above"] else -1
        value = {name: _from_limit(part, one["limit"], sign) for name, part in one["value"].items()}
        if sign < 0:
            value["low"], value["high"] = value["high"], value["low"]
        draw_score(ax, place, value)
    ax.axvline(0, color="0.4", linewidth=0.8)
    ax.set_yticks(range(len(rows)), [f"{number}: {one['what']}" for number, one in rows], fontsize="small")
    ax.invert_yaxis()
    ax.grid(axis="x", alpha=0.3)
    ax.set(xlabel="points on the claimed side of the limit (right of 0: as claimed)", xscale="symlog")
    ax.xaxis.set_major_formatter("{x:g}")
    return figure


def _from_limit(part: float | list | None, limit: float, sign: int) -> float | list | None:
    """Return how far a number, or each of several, lies on the claimed side of a limit."""
    if isinstance(part, list):
        return [_from_limit(one, limit, sign) for one in part]
    return None if part is None else sign * (part - limit)
