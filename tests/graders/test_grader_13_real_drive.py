"""The graders of exercise 13, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def missing(turns="round(step / period)", result="turns - 1"):
    """Return an answer to task 1 with these parts."""
    return f"""
def frames_missing(times, period):
    found = []
    for before, after in zip(times[:-1], times[1:]):
        step = after - before
        turns = {turns}
        found.append({result})
    return found"""


def leaning(
    wall_plane="w[:, 1], np.c_[w[:, 0], w[:, 2]]", sign="-", result="reading - lean, lean", degrees="np.degrees"
):
    """Return an answer to task 2 with these parts."""
    return f"""
def slope_and_lean(ground, wall):
    def slope(z, xy):
        xy = xy - xy.mean(axis=0)
        return np.linalg.solve(xy.T @ xy, xy.T @ (z - z.mean()))[1]

    w = wall
    reading = {degrees}(np.arctan(slope(ground[:, 2], ground[:, :2])))
    lean = {sign}{degrees}(np.arctan(slope({wall_plane})))
    return {result}"""


def judged(
    others="np.eye(4), np.linalg.inv(T)",
    middle="np.median",
    moved="now @ M[:3, :3].T + M[:3, 3]",
    verdict="None if abs(margin) <= 0.05 else margin > 0",
    best="min",
):
    """Return an answer to task 3 with these parts."""
    return f"""
def judge_motion(before, now, T):
    from scipy.spatial import cKDTree

    def error(M):
        return {middle}(cKDTree(before).query({moved})[0])

    margin = {best}(error(M) for M in ({others},)) - error(T)
    return {verdict}"""


def apart(near="abs(r - i) <= margin and abs(c - j) <= margin", share="right / all_"):
    """Return an answer to task 4 with these parts."""
    return f"""
def held_out_score(truths, called, learned, margin):
    right = all_ = 0
    taught = np.argwhere(learned)
    for i, j in np.ndindex(learned.shape):
        if any({near} for r, c in taught):
            continue
        for truth, said in zip(truths[:, i, j], called[:, i, j]):
            if truth != 255:
                all_ += 1
                right += truth == said
    return {share} if all_ else float("nan")"""


def refined(body, before=""):
    """Return an answer to task 5 with this body."""
    return f"{before}\ndef refine(log_g, o):\n    " + "\n    ".join(body.strip().splitlines())


SEMANTIC_ONLY = """
g = np.exp(log_g[:10])
return np.concatenate([g / g.sum(axis=0), np.zeros_like(log_g[10:])])"""

TABLE = """
best = np.array([0, 3, 3, 0])[o.argmax(axis=0)]
return np.moveaxis(np.eye(14)[best], -1, 0) * 0.9 + 0.1 * np.exp(log_g)"""


class TestRealDrive(GraderChecks):
    exercise = "13_real_drive"
    entries = (
        # ---- task 1
        right("a loop and round", task="frames-missing", code=missing()),
        right(
            "half a turn more, then floor",
            task="frames-missing",
            code="""
def frames_missing(times, period):
    steps = np.asarray(times)[1:] - np.asarray(times)[:-1]
    return np.floor(steps / period - 0.5)""",
        ),
        mistake(
            "turns", task="frames-missing", loses=2, says="one turn is no missing frame", code=missing(result="turns")
        ),
        mistake(
            "floor", task="frames-missing", loses=2, says="round to the nearest", code=missing("int(step / period)")
        ),
        mistake(
            "rounds up",
            task="frames-missing",
            loses=2,
            says="round to the nearest",
            code=missing("int(np.ceil(step / period - 1e-9))"),
        ),
        mistake(
            "yes or no",
            task="frames-missing",
            loses=2,
            says="how many are missing",
            code=missing(result="int(turns > 1)"),
        ),
        mistake(
            "the median for the data sheet",
            task="frames-missing",
            loses=2,
            says="one frame is missing in each step",
            code=missing("round(step / np.median(np.diff(times)))"),
        ),
        mistake(
            "ten a second, always",
            task="frames-missing",
            loses=2,
            says="on inputs you haven't seen",
            code=missing("round(step / 0.1)"),
        ),
        mistake("one too many", task="frames-missing", loses=2, says="five steps", code=missing() + " + [0]"),
        mistake(
            "no return",
            task="frames-missing",
            loses=2,
            says="forget `return`",
            code="def frames_missing(t, p):\n    pass",
        ),
        mistake(
            "an endless loop",
            task="frames-missing",
            loses=2,
            says="before timeout",
            code="def frames_missing(times, period):\n    while True:\n        pass",
        ),
        # ---- task 2
        right("normal equations about the mean", task="slope-and-lean", code=leaning()),
        right(
            "planes by their normals",
            task="slope-and-lean",
            code="""
def slope_and_lean(ground, wall):
    def normal(points):
        return np.linalg.svd(points - points.mean(axis=0))[2][2]

    n, m = normal(ground), normal(wall)
    reading, lean = np.degrees(np.arctan(-n[1] / n[2])), np.degrees(np.arctan(m[2] / m[1]))
    return [reading - lean, lean]""",
        ),
        mistake(
            "the reading",
            task="slope-and-lean",
            loses=3,
            says="the whole reading",
            code=leaning(result="reading, lean"),
        ),
        mistake("the wall's sign", task="slope-and-lean", loses=3, says="the sign of the lean", code=leaning(sign="")),
        mistake(
            "added",
            task="slope-and-lean",
            loses=3,
            says="taken off the reading",
            code=leaning(result="reading + lean, lean"),
        ),
        mistake(
            "the other order",
            task="slope-and-lean",
            loses=3,
            says="the order",
            code=leaning(result="lean, reading - lean"),
        ),
        mistake("radians", task="slope-and-lean", loses=3, says="degrees are asked for", code=leaning(degrees="1 * ")),
        mistake(
            "the wall as z over x and y",
            task="slope-and-lean",
            loses=3,
            says="a slope of 2 and a lean of 3",
            code=leaning(wall_plane="w[:, 2], w[:, :2]"),
        ),
        mistake(
            "a sign that follows the side of the wall",
            task="slope-and-lean",
            loses=3,
            says="on inputs you haven't seen",
            code=leaning(sign="np.sign(w[:, 1].mean()) * "),
        ),
        # ---- task 3
        right("a tree for each motion", task="judge-motion", code=judged()),
        right(
            "all pairs",
            task="judge-motion",
            code="""
def judge_motion(before, now, T):
    errors = []
    for M in (T, np.eye(4), np.linalg.inv(T)):
        moved = (np.c_[now, np.ones(len(now))] @ M.T)[:, :3]
        errors.append(np.median([np.linalg.norm(before - p, axis=1).min() for p in moved]))
    if errors[0] < min(errors[1:]) - 0.05:
        return True
    return False if min(errors[1:]) < errors[0] - 0.05 else None""",
        ),
        mistake("the mean", task="judge-motion", loses=3, says="the poses are right", code=judged(middle="np.mean")),
        mistake(
            "two answers", task="judge-motion", loses=3, says="nothing can be told", code=judged(verdict="margin > 0")
        ),
        mistake(
            "one of the others is enough",
            task="judge-motion",
            loses=3,
            says="nothing moves",
            code=judged(best="max"),
        ),
        mistake(
            "only backwards is tried",
            task="judge-motion",
            loses=3,
            says="nothing moves",
            code=judged(others="np.linalg.inv(T)"),
        ),
        mistake(
            "the inverse moves",
            task="judge-motion",
            loses=3,
            says="1 m ahead, and so it is",
            code=judged(moved="now @ np.linalg.inv(M)[:3, :3].T + np.linalg.inv(M)[:3, 3]"),
        ),
        mistake(
            "no rotation",
            task="judge-motion",
            loses=3,
            says="on inputs you haven't seen",
            code=judged(moved="now + M[:3, 3]"),
        ),
        mistake(
            "words",
            task="judge-motion",
            loses=3,
            says="True, False or None",
            code=judged(verdict="'right' if margin > 0 else 'wrong'"),
        ),
        # ---- task 4
        right("cell by cell", task="held-out", code=apart()),
        right(
            "a dilation",
            task="held-out",
            code="""
def held_out_score(truths, called, learned, margin):
    from scipy.ndimage import binary_dilation

    near = binary_dilation(learned, np.ones((3, 3)), iterations=margin) if margin else learned
    counted = np.broadcast_to(~near, truths.shape) & (truths != 255)
    return np.mean(truths[counted] == called[counted]) if counted.any() else np.nan""",
        ),
        mistake(
            "learned cells count", task="held-out", loses=3, says="learned from count, too", code=apart(near="False")
        ),
        mistake(
            "no margin",
            task="held-out",
            loses=3,
            says="neighbours of learned cells",
            code=apart(near="abs(r - i) <= 0 and abs(c - j) <= 0"),
        ),
        mistake(
            "a margin of two cells at most",
            task="held-out",
            loses=3,
            says="on inputs you haven't seen",
            code=apart(near="abs(r - i) <= min(margin, 2) and abs(c - j) <= min(margin, 2)"),
        ),
        mistake(
            "no corners",
            task="held-out",
            loses=3,
            says="at the corners",
            code=apart(near="abs(r - i) + abs(c - j) <= margin"),
        ),
        mistake(
            "frame by frame",
            task="held-out",
            loses=3,
            says="all frames together",
            code="""
def held_out_score(truths, called, learned, margin):
    from scipy.ndimage import maximum_filter

    near = maximum_filter(learned.astype(int), 2 * margin + 1, mode="constant") > 0
    each = [np.mean((t == c)[(t != 255) & ~near]) for t, c in zip(truths, called)]
    return np.mean(each)""",
        ),
        mistake(
            "zero where nothing is left",
            task="held-out",
            loses=3,
            says="the score is NaN",
            code=apart().replace('float("nan")', "0.0"),
        ),
        # ---- task 5
        right("only classes that a label can have", task="refine", code=refined(SEMANTIC_ONLY)),
        right(
            "the same, cell by cell",
            task="refine",
            code=refined("""
out = np.zeros(log_g.shape)
for i, j in np.ndindex(log_g.shape[1:]):
    p = np.exp(log_g[:10, i, j] - log_g[:10, i, j].max())
    out[:10, i, j] = p / p.sum()
return out"""),
        ),
        mistake("as it was", task="refine", loses=4, says="as it was", code=refined("return np.exp(log_g)")),
        mistake("logarithms", task="refine", loses=4, says="negative", code=refined("return log_g - 0.1")),
        mistake(
            "not normalised",
            task="refine",
            loses=4,
            says="don't sum to 1",
            code=refined("return np.exp(log_g[:]) * np.r_[np.ones(10), np.zeros(4)][:, None, None]"),
        ),
        mistake(
            "a table of states", task="refine", loses=2, says="class accuracy is clearly lost", code=refined(TABLE)
        ),
        mistake(
            "a blur",
            task="refine",
            loses=2,
            says="class accuracy is clearly lost",
            code=refined("""
from scipy.ndimage import gaussian_filter
g = gaussian_filter(np.exp(log_g), (0, 0.7, 0.7))
return g / g.sum(axis=0)"""),
        ),
        mistake(
            "the size of the real street by heart",
            task="refine",
            loses=2,
            says="expected shape",
            code=refined("""
out = np.zeros((14, 142, 62))
out[:10, : log_g.shape[1], : log_g.shape[2]] = np.exp(log_g[:10]) / np.exp(log_g[:10]).sum(axis=0)
return out"""),
        ),
        mistake(
            "overwrites the map",
            task="refine",
            loses=2,
            says="on inputs you haven't seen: it changes an argument",
            code=refined("""
log_g[10:] = -50
return np.exp(log_g) / np.exp(log_g).sum(axis=0)"""),
        ),
    )
