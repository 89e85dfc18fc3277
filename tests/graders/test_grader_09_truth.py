"""The graders of exercise 09, where truth comes from, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def opened(
    near="(np.abs(uv - uv[n]) <= reach).all(axis=1)", hides="(Z[n] - Z[near] > gap).any()", result="~hidden", before=""
):
    """Return an answer to task 1 with these parts."""
    return f"""
def open_to_view(uv, Z, reach, gap):
    hidden = np.zeros(len(Z), bool)
    {before}
    for n in range(len(Z)):
        near = {near}
        hidden[n] = {hides}
    return {result}"""


def shares(
    cases="((outline, 1 - calibration), (1 - outline, calibration))",
    counted="range(n // 2 + 1, n + 1)",
    ways="comb(n, m)",
    road="1 - (1 - wrong) ** n",
    car="wrong**n",
    weights="(1 - p_car, p_car)",
    result="majority, standing",
):
    """Return an answer to task 2 with these parts."""
    return f"""
def wrong_shares(n, outline, calibration, p_car):
    majority = standing = 0.0
    for wrong, chance in {cases}:
        majority += chance * sum({ways} * wrong**m * (1 - wrong) ** (n - m) for m in {counted})
        of_road, of_car = {weights}
        standing += chance * (of_road * ({road}) + of_car * ({car}))
    return {result}"""


def audited(
    first="(votes != 255) & (made != votes)",
    second="given & unseen",
    given="(votes == 255) & (made < 10)",
    third="given & (made == c) & ~around",
    around="ndimage.binary_dilation(votes == c, square)",
    square="np.ones((2 * reach + 1, 2 * reach + 1), bool)",
    classes="range(10)",
):
    """Return an answer to task 3 with these parts."""
    return f"""
def audit(votes, unseen, made, reach):
    given, square, far = {given}, {square}, 0
    for c in {classes}:
        around = {around}
        far += ({third}).sum()
    return ({first}).sum(), ({second}).sum(), far"""


def middle(
    start="np.asarray(table) @ o",
    skip="vote is not None",
    factor="np.where(np.arange(2) == vote, same, 1 - same)",
    result="weight[0] / weight.sum()",
):
    """Return an answer to task 4 with these parts."""
    return f"""
def between(left, right, o, same, table):
    weight = {start}
    for vote in (left, right):
        if {skip}:
            weight = weight * {factor}
    return {result}"""


def measured(
    asked="rule(uv, Z, reach, gap)",
    points="frame.points[kept]",
    policy='TruthPolicy(cleanup="none")',
    labelled="made < 10",
    result="labelled.sum(), (labelled & (made != frame.labels.birdseye_on(spec))).sum()",
    kept="numbers[is_open]",
):
    """Return an answer to task 5 with these parts."""
    return f"""
def labels_and_wrong(frame, o, spec, reach, gap, rule=open_to_view):
    numbers, uv, Z = in_view(frame)
    is_open = {asked}
    kept = {kept}
    made = lidar_truth(replace(frame, points={points}), o, spec, {policy})
    labelled = {labelled}
    return {result}"""


class TestTruth(GraderChecks):
    exercise = "09_truth"
    entries = (
        # ---- task 1
        right(
            "a matrix of all pairs",
            task="open-to-view",
            code="""
def open_to_view(uv, Z, reach, gap):
    du, dv = (np.abs(np.subtract.outer(a, a)) for a in uv.T)
    return ~((du <= reach) & (dv <= reach) & (np.subtract.outer(Z, Z) > gap)).any(axis=1)""",
        ),
        right(
            "a picture of smallest depths",
            task="open-to-view",
            code="""
def open_to_view(uv, Z, reach, gap):
    if not len(Z):
        return np.ones(0, bool)
    u, v = (uv - uv.min(axis=0)).T
    picture = np.full((v.max() + 1, u.max() + 1), np.inf)
    np.minimum.at(picture, (v, u), Z)
    nearest = ndimage.minimum_filter(picture, 2 * reach + 1, mode="constant", cval=np.inf)
    return Z - nearest[v, u] <= gap""",
        ),
        right(
            "a list of truth values",
            task="open-to-view",
            code="""
def open_to_view(uv, Z, reach, gap):
    closest = [Z[np.abs(uv - at).max(axis=1) <= reach].min() for at in uv]
    return [bool(z - c <= gap) for z, c in zip(Z, closest)]""",
        ),
        mistake(
            "the same pixel only, the lecture's rule",
            task="open-to-view",
            loses=2,
            says="return 4 lies two columns and two rows",
            code=opened(near="(uv == uv[n]).all(axis=1)"),
        ),
        mistake(
            "a disc in place of a square",
            task="open-to-view",
            loses=2,
            says="return 4 lies two columns and two rows",
            code=opened(near="np.linalg.norm(uv - uv[n], axis=1) <= reach"),
        ),
        mistake(
            "rows ignored",
            task="open-to-view",
            loses=2,
            says="the closer one is three rows away",
            code=opened(near="np.abs(uv - uv[n])[:, 0] <= reach"),
        ),
        mistake(
            "the reach excluded",
            task="open-to-view",
            loses=2,
            says="return 4 lies two columns and two rows",
            code=opened(near="(np.abs(uv - uv[n]) < reach).all(axis=1)"),
        ),
        mistake(
            "a reach too large by one",
            task="open-to-view",
            loses=2,
            says="the closer one is three columns away",
            code=opened(near="(np.abs(uv - uv[n]) <= reach + 1).all(axis=1)"),
        ),
        mistake(
            "columns or rows",
            task="open-to-view",
            loses=2,
            says="the closer one is three columns away",
            code=opened(near="(np.abs(uv - uv[n]) <= reach).any(axis=1)"),
        ),
        mistake(
            "no gap",
            task="open-to-view",
            loses=2,
            says="closer by 0.4 m only",
            code=opened(hides="(Z[n] > Z[near]).any()"),
        ),
        mistake(
            "the gap included",
            task="open-to-view",
            loses=2,
            says="which is not more than the gap",
            code=opened(hides="(Z[n] - Z[near] >= gap).any()"),
        ),
        mistake(
            "whatever lies at another depth",
            task="open-to-view",
            loses=2,
            says="only a closer return hides",
            code=opened(hides="(np.abs(Z[n] - Z[near]) > gap).any()"),
        ),
        mistake(
            "hidden in place of open",
            task="open-to-view",
            loses=2,
            says="True means that a return is NOT hidden",
            code=opened(result="hidden"),
        ),
        mistake(
            "what is hidden hides nothing",
            task="open-to-view",
            loses=2,
            says="return 7 is hidden by return 8",
            code="""
def open_to_view(uv, Z, reach, gap):
    is_open = np.ones(len(Z), bool)
    for n in np.argsort(Z):
        near = (np.abs(uv - uv[n]) <= reach).all(axis=1) & is_open
        is_open[n] = not (Z[n] - Z[near] > gap).any()
    return is_open""",
        ),
        mistake(
            "the nearest pixel alone is asked",
            task="open-to-view",
            loses=2,
            says="return 8 is hidden by return 9",
            code=opened(
                before="others = np.arange(len(Z))",
                near="[min((others != n).nonzero()[0], key=lambda m: np.abs(uv[m] - uv[n]).max())]",
                hides="(np.abs(uv[near] - uv[n]) <= reach).all() and (Z[n] - Z[near] > gap).any()",
            ),
        ),
        mistake(
            "a gap of half a metre written in",
            task="open-to-view",
            loses=2,
            says="on inputs you haven't seen",
            code=opened(hides="(Z[n] - Z[near] > 0.5).any()"),
        ),
        # ---- task 2
        right(
            "all outcomes",
            task="wrong-shares",
            code="""
from itertools import product

def wrong_shares(n, outline, calibration, p_car):
    total = np.zeros(2)
    for car in (0, 1):
        for off in (0, 1):
            for swaps in product((0, 1), repeat=n):
                k = sum(swaps)
                p = (p_car if car else 1 - p_car) * (calibration if off else 1 - calibration)
                p *= outline**k * (1 - outline) ** (n - k)
                cars = sum(car ^ off ^ s for s in swaps)
                total += p * np.array([(2 * cars > n) != car, (cars > 0) != car])
    return total""",
        ),
        right(
            "scipy's binomial distribution",
            task="wrong-shares",
            code="""
from scipy.stats import binom

def wrong_shares(n, outline, calibration, p_car):
    chance = np.array([1 - calibration, calibration])
    wrong = binom(n, np.array([outline, 1 - outline]))
    standing = (1 - p_car) * (1 - wrong.pmf(0)) + p_car * wrong.pmf(n)
    return [float(chance @ wrong.sf(n // 2)), float(chance @ standing)]""",
        ),
        mistake(
            "no calibration",
            task="wrong-shares",
            loses=2,
            says="majority: 0.0280: the calibration is ignored",
            code=shares(cases="((outline, 1.0),)"),
        ),
        mistake(
            "a camera that is off makes all returns wrong",
            task="wrong-shares",
            loses=2,
            says="outlines err too: then a return is right with probability",
            code=shares(cases="((outline, 1 - calibration), (1.0, calibration))"),
        ),
        mistake(
            "errors added",
            task="wrong-shares",
            loses=2,
            says="both errors can't be added",
            code=shares(cases="((outline, 1.0), (1.0, calibration))"),
        ),
        mistake(
            "a camera for each return",
            task="wrong-shares",
            loses=2,
            says="it is off for all of them together",
            code=shares(cases="((outline * (1 - calibration) + (1 - outline) * calibration, 1.0),)"),
        ),
        mistake(
            "how often it is right",
            task="wrong-shares",
            loses=2,
            says="that is how often the label is right",
            code=shares(result="1 - majority, 1 - standing"),
        ),
        mistake(
            "all wrong but one",
            task="wrong-shares",
            loses=2,
            says="go up to m = n",
            code=shares(counted="range(n // 2 + 1, n)"),
        ),
        mistake(
            "no outlines",
            task="wrong-shares",
            loses=2,
            says="that holds without errors of outlines",
            code=shares(cases="((0.0, 1 - calibration), (1.0, calibration))"),
        ),
        mistake(
            "all must be wrong",
            task="wrong-shares",
            loses=2,
            says="more than half is enough",
            code=shares(counted="[n]"),
        ),
        mistake(
            "swapped",
            task="wrong-shares",
            loses=2,
            says="the two numbers are swapped",
            code=shares(result="standing, majority"),
        ),
        mistake(
            "one number",
            task="wrong-shares",
            loses=2,
            says="expected two numbers",
            code=shares(result="majority"),
        ),
        mistake(
            "road and car swapped",
            task="wrong-shares",
            loses=2,
            says="the probabilities of road and car are swapped",
            code=shares(weights="(p_car, 1 - p_car)"),
        ),
        mistake(
            "road alone",
            task="wrong-shares",
            loses=2,
            says="that is a cell of road",
            code=shares(weights="(1, 0)"),
        ),
        mistake(
            "cars alone",
            task="wrong-shares",
            loses=2,
            says="that is a cell of a car",
            code=shares(weights="(0, 1)"),
        ),
        mistake(
            "three returns written in",
            task="wrong-shares",
            loses=2,
            says="on inputs you haven't seen",
            code=shares(road="1 - (1 - wrong) ** 3", car="wrong**3"),
        ),
        mistake(
            "ways not counted",
            task="wrong-shares",
            loses=2,
            says="majority",
            code=shares(ways="1"),
        ),
        # ---- task 3
        right(
            "a loop over cells",
            task="audit",
            code="""
def audit(votes, unseen, made, reach):
    counts = [0, 0, 0]
    for r, c in np.ndindex(votes.shape):
        if votes[r, c] != 255:
            counts[0] += int(made[r, c] != votes[r, c])
        elif made[r, c] <= 9:
            counts[1] += int(unseen[r, c])
            part = votes[max(0, r - reach) : r + reach + 1, max(0, c - reach) : c + reach + 1]
            counts[2] += int(made[r, c] not in part)
    return counts""",
        ),
        right(
            "distances to each class",
            task="audit",
            code="""
def audit(votes, unseen, made, reach):
    free = votes == 255
    far = np.zeros(votes.shape, bool)
    for c in np.unique(made[made < 10]):
        mine = np.argwhere(votes == c)
        for r, k in np.argwhere(free & (made == c)):
            far[r, k] = not len(mine) or np.abs(mine - [r, k]).max(axis=1).min() > reach
    return np.array([(~free & (made != votes)).sum(), (free & unseen & (made < 10)).sum(), far.sum()])""",
        ),
        mistake(
            "every changed cell",
            task="audit",
            loses=2,
            says="leave 255 out",
            code=audited(first="made != votes"),
        ),
        mistake(
            "votes lost only when they become unknown",
            task="audit",
            loses=2,
            says="has become ROAD",
            code=audited(first="(votes != 255) & (made >= 10)"),
        ),
        mistake(
            "unseen cells with a vote",
            task="audit",
            loses=2,
            says="neither breaks the rule",
            code=audited(second="unseen & (made < 10)"),
        ),
        mistake(
            "unseen cells that stay unknown",
            task="audit",
            loses=2,
            says="neither breaks the rule",
            code=audited(second="unseen & (votes == 255)"),
        ),
        mistake(
            "seen in place of unseen",
            task="audit",
            loses=2,
            says="cells that break rules 1, 2 and 3",
            code=audited(second="given & ~unseen"),
        ),
        mistake(
            "labels of the finished map vouch",
            task="audit",
            loses=2,
            says="doesn't vouch for itself",
            code=audited(around="ndimage.binary_dilation(made == c, square)"),
        ),
        mistake(
            "any vote vouches",
            task="audit",
            loses=2,
            says="a vote of the same class is needed",
            code=audited(around="ndimage.binary_dilation(votes != 255, square)"),
        ),
        mistake(
            "cells with a vote in rule 3",
            task="audit",
            loses=2,
            says="rule 3 is about cells without one",
            code=audited(third="(made == c) & ~around"),
        ),
        mistake(
            "a cross in place of a square",
            task="audit",
            loses=2,
            says="that is within the reach",
            code=audited(around="ndimage.binary_dilation(votes == c, iterations=max(reach, 1))"),
        ),
        mistake(
            "a cell that breaks two rules counted once",
            task="audit",
            loses=2,
            says="Or did you leave out cell (2, 5)",
            code=audited(third="given & (made == c) & ~around & ~unseen"),
        ),
        mistake(
            "the reach written in",
            task="audit",
            loses=2,
            says="on inputs you haven't seen: rule 3",
            code=audited(square="np.ones((3, 3), bool)"),
        ),
        mistake(
            "classes of the example only",
            task="audit",
            loses=2,
            says="on inputs you haven't seen: rule 3",
            code=audited(classes="(ROAD, SIDEWALK, VEGETATION, CAR)"),
        ),
        # ---- task 4
        right(
            "all eight worlds",
            task="between",
            code="""
def between(left, right, o, same, table):
    total = [0.0, 0.0]
    for a in (0, 1):
        for b in (0, 1):
            for c in (0, 1):
                if left in (None, a) and right in (None, c):
                    p = (same if a == b else 1 - same) * (same if b == c else 1 - same)
                    total[b] += p * sum(o[s] * table[b][s] for s in range(4))
    return total[0] / sum(total)""",
        ),
        right(
            "log-odds",
            task="between",
            code="""
def between(left, right, o, same, table):
    odds = np.log((table[0] @ o) / (table[1] @ o))
    for vote in (left, right):
        odds += 0 if vote is None else (1 - 2 * vote) * np.log(same / (1 - same))
    return np.array([1 / (1 + np.exp(-odds))])""",
        ),
        mistake(
            "no occupancy",
            task="between",
            loses=2,
            says="one vote for road",
            code=middle(start="np.ones(2)"),
        ),
        mistake(
            "the most probable state taken for certain",
            task="between",
            loses=2,
            says="you take the most probable state for certain",
            code=middle(start="np.asarray(table)[:, np.argmax(o)]"),
        ),
        mistake(
            "P(car)",
            task="between",
            loses=2,
            says="one vote for road, the middle cell STATIC",
            code=middle(result="weight[1] / weight.sum()"),
        ),
        mistake(
            "no vote counts as road",
            task="between",
            loses=2,
            says="it says nothing, not road",
            code=middle(skip="True", factor="np.where(np.arange(2) == (vote or 0), same, 1 - same)"),
        ),
        mistake(
            "no vote counts as car",
            task="between",
            loses=2,
            says="it says nothing, not car",
            code=middle(
                skip="True", factor="(np.array([same, 1 - same]) if vote == 0 else np.array([1 - same, same]))"
            ),
        ),
        mistake(
            "a vote of road taken for none",
            task="between",
            loses=2,
            says="one vote for road",
            code=middle(skip="vote"),
        ),
        mistake(
            "neighbours averaged",
            task="between",
            loses=2,
            says="both votes count, multiply",
            code="""
def between(left, right, o, same, table):
    weight, seen = np.asarray(table) @ o, [v for v in (left, right) if v is not None]
    if seen:
        weight = weight * np.mean([np.where(np.arange(2) == v, same, 1 - same) for v in seen], axis=0)
    return weight[0] / weight.sum()""",
        ),
        mistake(
            "only the left one",
            task="between",
            loses=2,
            says="only one neighbour counts",
            code=middle().replace("(left, right)", "(left,)"),
        ),
        mistake(
            "the votes taken over",
            task="between",
            loses=2,
            says="one vote for road",
            code="def between(left, right, o, same, table):\n    return 1.0 if left == 0 else 0.0",
        ),
        mistake(
            "against the vote",
            task="between",
            loses=2,
            says="one vote for road, the middle cell STATIC",
            code=middle(factor="np.where(np.arange(2) != vote, same, 1 - same)"),
        ),
        mistake(
            "not normalised",
            task="between",
            loses=2,
            says="one vote for road, the middle cell STATIC",
            code=middle(result="weight[0]"),
        ),
        mistake(
            "the lecture's numbers written in",
            task="between",
            loses=2,
            says="on inputs you haven't seen",
            code=middle(factor="np.where(np.arange(2) == vote, 0.9, 0.1)"),
        ),
        mistake(
            "votes always for road",
            task="between",
            loses=2,
            says="on inputs you haven't seen",
            code=middle(factor="np.array([same, 1 - same])"),
        ),
        # ---- task 5
        right(
            "hidden returns deleted, those out of view kept",
            task="labels-and-wrong",
            code="""
def labels_and_wrong(frame, o, spec, reach, gap, rule=open_to_view):
    numbers, uv, Z = in_view(frame)
    gone = numbers[~np.asarray(rule(uv, Z, reach, gap))]
    other = replace(frame, points=np.delete(frame.points, gone, axis=0))
    made = lidar_truth(other, o, spec, TruthPolicy(cleanup="none"))
    stands = frame.labels.birdseye_on(spec)
    cells = [(m, s) for m, s in zip(made.ravel(), stands.ravel()) if m < 10]
    return [len(cells), sum(m != s for m, s in cells)]""",
        ),
        right(
            "points out of view dropped, votes compared where there are any",
            task="labels-and-wrong",
            code="""
def labels_and_wrong(frame, o, spec, reach, gap, rule=open_to_view):
    numbers, uv, Z = in_view(frame)
    keep = np.zeros(len(frame.points), bool)
    keep[numbers] = rule(uv, Z, reach, gap)
    made = lidar_truth(replace(frame, points=frame.points[keep]), o, spec, TruthPolicy(cleanup="none"))
    votes, stands = made[made < 10], frame.labels.birdseye_on(spec)[made < 10]
    return np.array([votes.size, np.count_nonzero(votes != stands)])""",
        ),
        mistake(
            "cleaned up",
            task="labels-and-wrong",
            loses=3,
            says="the clean-up is in your map",
            code=measured(policy="TruthPolicy()"),
        ),
        mistake(
            "the rule isn't asked",
            task="labels-and-wrong",
            loses=3,
            says="do you use `rule`?",
            code=measured(asked="np.ones(len(Z), bool)"),
        ),
        mistake(
            "one's own rule in place of the one handed over",
            task="labels-and-wrong",
            loses=3,
            says="a rule that hides",
            code=measured(asked="open_to_view(uv, Z, reach, gap)"),
        ),
        mistake(
            "hidden ones kept",
            task="labels-and-wrong",
            loses=3,
            says="a rule that hides nothing must leave the number of labels",
            code=measured(asked="~rule(uv, Z, reach, gap)"),
        ),
        mistake(
            "all cells are labelled",
            task="labels-and-wrong",
            loses=3,
            says="10 to 13 are no labels",
            code=measured(labelled="made < 14"),
        ),
        mistake(
            "right labels counted",
            task="labels-and-wrong",
            loses=3,
            says="that is the number of right labels",
            code=measured(result="labelled.sum(), (labelled & (made == frame.labels.birdseye_on(spec))).sum()"),
        ),
        mistake(
            "all cells compared",
            task="labels-and-wrong",
            loses=3,
            says="leave the number of wrong labels as it is",
            code=measured(result="labelled.sum(), (made != frame.labels.birdseye_on(spec)).sum()"),
        ),
        mistake(
            "numbers among those in view taken for numbers of the scan",
            task="labels-and-wrong",
            loses=3,
            says="a rule that hides nothing must leave the number of labels",
            code=measured(kept="np.flatnonzero(is_open)"),
        ),
        mistake(
            "reach and gap written in",
            task="labels-and-wrong",
            loses=3,
            says="another reach changes nothing",
            code=measured(asked="rule(uv, Z, 2, 0.5)"),
        ),
        mistake(
            "reach and gap swapped",
            task="labels-and-wrong",
            loses=3,
            says="on inputs you haven't seen",
            code=measured(asked="rule(uv, Z, gap, reach)"),
        ),
        mistake(
            "a loop without an end",
            task="labels-and-wrong",
            loses=3,
            says="before timeout",
            code="""
def labels_and_wrong(frame, o, spec, reach, gap, rule=open_to_view):
    while True:
        reach = reach + 0""",
        ),
    )
