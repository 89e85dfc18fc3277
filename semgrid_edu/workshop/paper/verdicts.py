"""Verdicts on the paper's claims, by a rule that is written down before the numbers are (section 4).

A claim is split into statements about numbers, each of the form "this is above (or below) that limit". Each number has
a 95 % interval over drives and seeds, and a one-sided p-value against its statement: how often a number would be so
far on the wrong side if the true value were the limit. Then the claim is

- **reproduced**, when every interval is entirely on the claimed side of its limit;
- **not reproduced**, when at least one number is on the other side by more than chance explains. A claim with many
  statements has many chances to fail by chance. So the p-values are corrected by Holm's method: of m statements that
  may still be true, the one with the smallest p-value is rejected when that is at most 2.5 % / m, then the next of
  m - 1. A claim whose statements are all true is called not reproduced in at most 2.5 % of cases, as by one statement's
  95 % interval;
- **cannot tell** otherwise. Also whenever there are fewer than three seeds or ten drives: then the numbers are too few
  for an interval to be believed, and none is printed.

What the paper states as an expectation and doesn't measure can't be reproduced. Its verdicts are "as expected" and "not
as expected".
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from types import SimpleNamespace

from semgrid_edu.workshop.paper.claims import CLAIMS, STATEMENTS, Reading, Statement
from semgrid_edu.workshop.paper.data_runs import frame_counts
from semgrid_edu.workshop.paper.other_runs import OverturnedRun, TimeRun
from semgrid_edu.workshop.paper.published import NETWORKS
from semgrid_edu.workshop.paper.run import Run
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import Scale, baselines_of, table1_runs, table2_runs
from semgrid_edu.workshop.paper.score_runs import BaselineRun, ScoreRun
from semgrid_edu.workshop.paper.variants import CalibrationError, Variant
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, shown
from semgrid_edu.workshop.scoring.statistics import MIN_DRIVES

REPRODUCED, NOT_REPRODUCED, CANNOT_TELL = "reproduced", "not reproduced", "cannot tell"
"""The three verdicts."""

TOO_SMALL = "cannot tell (too small)"
"""The third one, when there are too few seeds or drives."""

EXPECTED = {REPRODUCED: "as expected", NOT_REPRODUCED: "not as expected"}
"""What the first two are called where the paper states an expectation."""

MIN_SEEDS = 3
"""With fewer seeds, or fewer than `MIN_DRIVES` drives, no verdict."""

ERROR_RATE = 0.025
"""How often a true claim may be called not reproduced: what a 95 % interval leaves on one side."""


def holm(p_values: Sequence[float | None], error_rate: float = ERROR_RATE) -> list[bool]:
    """Return which of several hypotheses are rejected, so that any true one is rejected rarely (Holm 1979).

    Parameters
    ----------
    p_values : sequence of float or None
        One for each hypothesis; None for one that can't be rejected.
    error_rate : float
        How often at least one true hypothesis may be rejected, however the p-values depend on each other.

    Examples
    --------
    >>> holm([0.012, 0.5, 0.001, None], 0.05)
    [True, False, True, False]
    """
    rejected = [False] * len(p_values)
    left = len(p_values)
    for p, number in sorted((p, number) for number, p in enumerate(p_values) if p is not None):
        if p > error_rate / left:
            break
        rejected[number] = True
        left = left - 1
    return rejected


def which_hold(statements: Sequence[Statement]) -> list[bool | None]:
    """Return for each statement True when its interval confirms it, False when Holm's method rejects it, else None.

    Parameters
    ----------
    statements : sequence of Statement
        All statements of a claim. Those that aren't judged are neither counted nor rejected.
    """
    rejected = iter(holm([one.p for one in statements if one.judged]))
    return [False if one.judged and next(rejected) else True if one.confirmed else None for one in statements]


def verdict(statements: Sequence[Statement], seeds: int, drives: int, expectation: bool = False) -> str:
    """Return the verdict on a claim.

    Parameters
    ----------
    statements : sequence of Statement
        All its statements.
    seeds, drives : int
        How many of them the numbers rest on.
    expectation : bool
        Whether the paper states the claim as an expectation.

    Returns
    -------
    str
        `REPRODUCED`, `NOT_REPRODUCED`, `CANNOT_TELL` or `TOO_SMALL`; of an expectation the words of `EXPECTED`.

    Examples
    --------
    >>> gain = Statement("gain", {"mean": 0.02, "low": 0.01, "high": 0.03, "seeds": []}, p=0.999)
    >>> verdict([gain], seeds=3, drives=110), verdict([gain._replace(above=False, p=0.001)], 3, 110)
    ('reproduced', 'not reproduced')
    >>> verdict([gain], seeds=3, drives=110, expectation=True), verdict([gain], seeds=3, drives=2)
    ('as expected', 'cannot tell (too small)')
    """
    if seeds < MIN_SEEDS or drives < MIN_DRIVES:
        return TOO_SMALL
    found = which_hold([one for one in statements if one.judged])
    said = NOT_REPRODUCED if False in found else REPRODUCED if all(found) else CANNOT_TELL
    return EXPECTED.get(said, said) if expectation else said


WRONG_CALIBRATION = CalibrationError(pitch=1.0)
"""The error of calibration that geometry and network are compared with."""

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


def claims_plan(scale: Scale, seeds: int) -> list[Run]:
    """Return all runs of the claims. Parameters are those of `runs_of_claims`."""
    parts = vars(runs_of_claims(scale, seeds)).values()
    return [run for part in parts for run in (chain(*part.values()) if isinstance(part, dict) else part)]


def runs_of_claims(scale: Scale, seeds: int) -> SimpleNamespace:
    """Return the runs of the claims, one per seed in each list.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds. Claims about Table 1 alone have its number of seeds, when that is larger.

    Returns
    -------
    SimpleNamespace
        "networks", those of Table 1 by name, and of these the "usual" one, SegNet, with as many seeds as all others,
        and "usual_of_all_seeds"; "taught_true", SegNet that learns from true labels; "new_routes", Table 2's network on
        routes that nobody has driven in training; "table2" itself; "perfect", SegNet on data without any error, cells
        of 0.2 m; "overturned" and "overturned_blind", cars on their tops: the usual network, and one without the
        occupancy grid; "unreduced", without the 1x1 reduction; "times", of the usual network and of that one;
        "two_stages", "unbalanced" and "one_plane", trained so; "baselines", what learns no fusion; "baselines_off" and
        "usual_off", with the wrong calibration; "baselines_dense", with the depth of every pixel.
    """
    all_seeds = max(seeds, scale.table1_seeds if seeds == scale.seeds else seeds)
    networks = table1_runs(replace(scale, networks=tuple(NETWORKS)), all_seeds)
    usual = networks["segnet"][:seeds]
    scored = partial(scale.scored, scale.kitti, "segnet", crf=False)
    unreduced = scored(all_seeds, variant=Variant(reduces=False))
    taught = (scale.grid_stage(scale.kitti, "segnet", seed, "true") for seed in range(seeds))
    blind = [scale.grid_stage(scale.kitti, "segnet", seed, variant=Variant(occupancy=False)) for seed in range(seeds)]
    routes = scale.arrays(scale.chroma_routes, "test", "lidar")
    lying = scale.arrays(scale.overturned, "test", "true")
    return SimpleNamespace(
        networks=networks,
        usual=usual,
        usual_of_all_seeds=networks["segnet"],
        table2=table2_runs(scale, seeds)["segnet"],
        taught_true=[ScoreRun(network, one.frames) for network, one in zip(taught, usual, strict=True)],
        unreduced=unreduced,
        times=[TimeRun(usual[0].network, unreduced[0].network, usual[0].frames)],
        two_stages=scored(seeds, variant=Variant(end_to_end=False)),
        unbalanced=scored(seeds, variant=Variant(balanced=False)),
        one_plane=scored(seeds, variant=Variant(n_planes=1)),
        new_routes=[ScoreRun(scale.grid_stage(scale.chroma, "segnet", seed), routes) for seed in range(seeds)],
        perfect=scale.fine.scored(scale.synthia_routes, "segnet", seeds, "true", crf=False),
        overturned=[OverturnedRun(run.network, lying) for run in usual],
        overturned_blind=[OverturnedRun(network, lying) for network in blind],
        baselines=baselines_of(usual),
        baselines_off=[BaselineRun(run.network, run.frames, WRONG_CALIBRATION) for run in usual],
        baselines_dense=[BaselineRun(run.network, run.frames, dense=True) for run in usual],
        usual_off=[ScoreRun(run.network, run.frames, crf=False, calibration=WRONG_CALIBRATION) for run in usual],
    )


def judge_claims(scale: Scale, seeds: int, counted: RunCounts) -> dict:
    """Return the verdicts, from runs that have ended. Parameters are those of `ablations`.

    Returns
    -------
    dict
        "rule": how verdicts are found. "claims": by number the "quote", the "claim", whether it is an "expectation",
        its "judged by", the "networks", a "note" or none, the number of test "drives" that its numbers rest on, and the
        "readings", each with what networks "trained" on, what they are "judged" by, the "statements" and the
        "verdict".
    """
    runs = runs_of_claims(scale, seeds)
    data = dict.fromkeys(CLAIMS, scale.kitti) | {3: scale.chroma_routes, 4: scale.synthia_routes, 6: scale.overturned}
    drives = {number: frame_counts(name)["test"][1] for number, name in data.items()}
    judged = {str(number): _judged(number, runs, counted, seeds, drives[number]) for number in CLAIMS}
    return {"rule": __doc__, "claims": judged}


def _judged(number: int, runs: SimpleNamespace, counted: RunCounts, seeds: int, drives: int) -> dict:
    """Return all that is known about a claim."""
    row = CLAIMS[number]
    expectation = row.get("expectation", False)
    readings = []
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
    return "\n\n".join([_verdict_table(result["claims"]), rule, *sections])


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
