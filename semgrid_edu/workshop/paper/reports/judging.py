"""The paper's claims judged: quote, rule, labels, every statement with its numbers, and the verdicts (section 4)."""

from types import SimpleNamespace

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from semgrid_edu.workshop.paper.reports import verdicts
from semgrid_edu.workshop.paper.reports.claims import CLAIMS, STATEMENTS, Reading
from semgrid_edu.workshop.paper.reports.deviations import frame_counts
from semgrid_edu.workshop.paper.reports.drop import drop_between_tables, drop_markdown
from semgrid_edu.workshop.paper.reports.forest import draw_scores
from semgrid_edu.workshop.paper.reports.verdicts import verdict, which_hold
from semgrid_edu.workshop.paper.runs.claim_runs import runs_of_claims
from semgrid_edu.workshop.paper.runs.run_counts import RunCounts
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.scoring.score_with_interval import ScoreWithInterval, markdown_table, shown

HOLDS = {True: "yes", False: "no", None: "cannot tell"}
"""How a statement's result is written."""

LABELS = {"lidar": "LIDAR labels", "true": "true labels"}
"""How the labels are written that networks learn from and are scored against."""

READINGS = {
    (trained, judged): f"trained on {LABELS[trained]}, judged by {LABELS[judged]}"
    for trained in LABELS
    for judged in LABELS
}
"""The columns of the table of verdicts."""


def judge_claims(scale: Scale, seeds: int, counted: RunCounts) -> dict:
    """Return the verdicts, from runs that have ended. Parameters are those of `ablations`.

    Returns
    -------
    dict
        "rule": how verdicts are found. "claims": by number the "quote", the "claim", whether it is an "expectation",
        its "judged by", the "networks", a "note" or none, the number of test "drives" that its numbers rest on, and the
        "readings", each with what networks "trained" on, what they are "judged" by, the "statements" and the
        "verdict". "drop": from `drop_between_tables`.
    """
    runs = runs_of_claims(scale, seeds)
    data = dict.fromkeys(CLAIMS, scale.kitti) | {3: scale.chroma_routes, 4: scale.synthia_routes, 6: scale.overturned}
    drives = {number: frame_counts(name)["test"][1] for number, name in data.items()}
    judged = {str(number): _judged(number, runs, counted, seeds, drives[number]) for number in CLAIMS}
    return {"rule": verdicts.__doc__, "claims": judged, "drop": drop_between_tables(runs, counted)}


def _judged(number: int, runs: SimpleNamespace, counted: RunCounts, seeds: int, drives: int) -> dict:
    """Return all that is known about a claim."""
    row = CLAIMS[number]
    expectation, readings = row.get("expectation", False), []
    for trained, labels in row["readings"]:
        found = STATEMENTS[number](Reading(runs, counted, trained, labels))
        listed = [one._asdict() | {"holds": hold} for one, hold in zip(found, which_hold(found), strict=True)]
        said = verdict(found, seeds, drives, expectation)
        readings.append({"trained": trained, "judged": labels, "statements": listed, "verdict": said})
    return {
        **{name: row[name] for name in ("quote", "claim", "networks")},
        "expectation": expectation,
        "judged by": row["judged_by"],
        "note": row.get("note", ""),
        "drives": drives,
        "readings": readings,
    }


def claims_markdown(result: dict) -> str:
    """Return the verdicts as Markdown.

    Parameters
    ----------
    result : dict
        From `judge_claims`.
    """
    sections = [_section(number, one) for number, one in result["claims"].items()]
    rule = f"## The rule\n\n{result['rule']}"
    return "\n\n".join([_verdict_table(result["claims"]), rule, *sections, drop_markdown(result["drop"])])


def _verdict_table(claims: dict[str, dict]) -> str:
    """Return one row per claim, one column per reading."""
    rows = [["", "claim", "stated as", *READINGS.values()]]
    for number, one in claims.items():
        found = {(reading["trained"], reading["judged"]): reading["verdict"] for reading in one["readings"]}
        stated = "expectation" if one["expectation"] else "result"
        rows.append([number, one["claim"], stated, *(found.get(reading, "-") for reading in READINGS)])
    return markdown_table(rows)


def _section(number: str, one: dict) -> str:
    """Return all that is known about a claim; numbers in per cent and points."""
    stated = "The paper states this as an expectation" if one["expectation"] else "The paper states this as a result"
    parts = [
        f"## Claim {number}\n\n> {one['quote']}",
        f"{stated}. Our reading: {one['claim']} What must hold: {one['judged by']}",
        f"Networks: {one['networks']}. Test drives: {one['drives']}. {one['note']}".rstrip(),
    ]
    for reading in one["readings"]:
        words = READINGS[reading["trained"], reading["judged"]].capitalize().replace("lidar", "LIDAR")
        parts += [f"{words}: **{reading['verdict']}**", _statements(reading["statements"])]
    return "\n\n".join(parts)


def _statements(statements: list[dict]) -> str:
    """Return the table of a reading's statements."""
    rows = [["statement", "number", "claimed", "p against it", "holds"]]
    for one in statements:
        claimed = f"{'above' if one['above'] else 'below'} {100 * one['limit']:g}"
        p = "-" if one["p"] is None else f"{one['p']:.3f}"
        tail = [claimed, p, HOLDS[one["holds"]]] if one["judged"] else ["-", "-", "not judged"]
        rows.append([one["what"], shown(one["value"], 2), *tail])
    return markdown_table(rows)


def claims_picture(result: dict) -> Figure:
    """Draw every judged statement's number and limit, claim by claim, as it is judged first.

    Parameters
    ----------
    result : dict
        From `judge_claims`.
    """
    firsts = {number: claim["readings"][0] for number, claim in result["claims"].items()}
    judged = [(number, one) for number, first in firsts.items() for one in first["statements"] if one["judged"]]
    rows = {f"{number}: {one['what']}": _from_limit(one) for number, one in judged}
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
