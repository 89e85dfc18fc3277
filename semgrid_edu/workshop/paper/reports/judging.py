"""The nine claims judged: every statement with its numbers, and a verdict (section 4)."""

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from semgrid_edu.workshop.paper.reports import verdicts
from semgrid_edu.workshop.paper.reports.claims import CLAIMS, STATEMENTS
from semgrid_edu.workshop.paper.reports.deviations import frame_counts
from semgrid_edu.workshop.paper.reports.forest import draw_scores
from semgrid_edu.workshop.paper.reports.verdicts import verdict
from semgrid_edu.workshop.paper.runs.claim_runs import runs_of_claims
from semgrid_edu.workshop.paper.runs.run_counts import RunCounts
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.scoring.score_with_interval import ScoreWithInterval, markdown_table, shown

HOLDS = {True: "yes", False: "no", None: "cannot tell"}
"""How a statement's result is written."""


def judge_claims(scale: Scale, seeds: int, counted: RunCounts) -> dict:
    """Return the verdicts, from runs that have ended. Parameters are those of `ablations`.

    Returns
    -------
    dict
        "rule": how verdicts are found. "claims": by number the "claim", its "judged by", the number of test "drives"
        that its numbers rest on, the "statements" and the "verdict".
    """
    runs, judged = runs_of_claims(scale, seeds), {}
    data = dict.fromkeys(CLAIMS, scale.kitti) | {3: scale.chroma_routes, 4: scale.synthia_routes, 6: scale.overturned}
    for number, texts in CLAIMS.items():
        found, drives = STATEMENTS[number](runs, counted), frame_counts(data[number])["test"][1]
        judged[str(number)] = {
            "claim": texts["claim"],
            "judged by": texts["judged_by"],
            "drives": drives,
            "statements": [one._asdict() | {"holds": one.holds} for one in found],
            "verdict": verdict(found, seeds, drives),
        }
    return {"rule": verdicts.__doc__, "claims": judged}


def claims_markdown(result: dict) -> str:
    """Return the verdicts as Markdown.

    Parameters
    ----------
    result : dict
        From `judge_claims`.
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
    """
    claims = result["claims"].items()
    rows = {f"{number}: {one['what']}": _from_limit(one) for number, claim in claims for one in claim["statements"]}
    figure, ax = plt.subplots(figsize=(10, 1.5 + 0.28 * len(rows)), layout="constrained")
    draw_scores(ax, rows, fontsize="small")
    ax.axvline(0, color="0.4", linewidth=0.8)
    ax.invert_yaxis()
    ax.set(xlabel="points on the claimed side of the limit (right of 0: as claimed)", xscale="symlog")
    ax.xaxis.set_major_formatter("{x:g}")
    return figure


def _from_limit(statement: dict) -> ScoreWithInterval:
    """Return how far a statement's number lies on the claimed side of its limit."""
    sign, value = 1 if statement["above"] else -1, statement["value"]
    parts = [*(value[name] for name in ("low", "mean", "high")[::sign]), *value["seeds"]]
    low, mean, high, *seeds = (None if part is None else sign * (part - statement["limit"]) for part in parts)
    return {"mean": mean, "low": low, "high": high, "seeds": seeds}
