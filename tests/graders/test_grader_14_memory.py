"""The graders of exercise 14, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def combined(score="sum(e * np.log(max_(q)) for e, q in zip(w, p))", result="belief / belief.sum()", least="1e-4"):
    """Return an answer to task 1 with these parts."""
    return f"""
def combine(p, w):
    max_ = lambda q: np.maximum(q, {least})
    score = {score}
    belief = np.exp(score - np.max(score))
    return {result}"""


def lasting(
    r="((x - x.mean()) * (y - y.mean())).mean() / (x.std() * y.std())", worth="1 + (T - 1) * (1 - r) / (1 + r)"
):
    """Return an answer to task 2 with these parts."""
    return f"""
def errors_last(wrong):
    T = wrong.shape[1]
    x, y = wrong[:, :-1].astype(float), wrong[:, 1:].astype(float)
    r = {r}
    return r, {worth}"""


def shifted(r="r - ahead", c="c - left", inside="0 <= i < H and 0 <= j < W", start="np.empty_like(grid)"):
    """Return an answer to task 3 with these parts."""
    return f"""
def moved(grid, ahead, left, fill):
    C, H, W = grid.shape
    now = {start}
    for r in range(H):
        for c in range(W):
            i, j = {r}, {c}
            now[:, r, c] = grid[:, i % H, j % W] if {inside} else fill
    return now"""


def heard(
    factor="1 - o[0]", result="np.where(total > 0, q / np.maximum(total, 1e-300), 1 / len(q))", start="p.astype(float)"
):
    """Return an answer to task 4 with these parts."""
    return f"""
def listen(p, o, standing):
    q = {start}
    for k in standing:
        q[k] = q[k] * ({factor})
    total = q.sum(axis=0)
    return {result}"""


MAPS = """

def maps(frames, occupancy, grids, spec):
    stage, nothing, called = MemoryAdapter(remember, spec), np.full((2, 2, *spec.shape), np.nan, np.float32), []
    for k, (frame, o, g) in enumerate(zip(frames, occupancy, grids, strict=True)):
        view = View(frame, Belief(o, nothing[0], nothing), g)
        called.append(stage.grid(view, k)[0].argmax(axis=0))
    return np.array(called)"""


def kept(
    look="look_up(then.grid, np.zeros(14, np.float32), spec, spec, motion)[:10]",
    motion="PlanarMotion.from_poses(then.frame.T_world_from_lidar, view.frame.T_world_from_lidar)",
    classes="now + (1 - now.sum(axis=0)) * total / np.maximum(total.sum(axis=0), 1)",
    result="np.concatenate([classes, view.belief.probability * (1 - classes.sum(axis=0))])",
):
    """Return an answer to task 5 with these parts."""
    return f"""
def remember(views, spec):
    past = []
    for view in views:
        past.append(view)
        total = 0
        for then in past:
            motion = {motion}
            total = total + {look}
        now = view.grid[:10]
        classes = {classes}
        yield {result}
{MAPS}"""


RUNNING = f"""
def remember(views, spec):
    kept, pose = None, None
    for view in views:
        g = view.grid[:10].astype(float)
        if kept is None:
            kept = np.zeros_like(g)
        else:
            motion = PlanarMotion.from_poses(pose, view.frame.T_world_from_lidar)
            kept = look_up(kept.astype(np.float32), np.zeros(10, np.float32), spec, spec, motion).astype(float)
        pose = view.frame.T_world_from_lidar
        sees = g.sum(axis=0)
        w = np.maximum(0.6 * sees, sees - kept.sum(axis=0))
        kept = kept * (1 - w) + w * g / np.maximum(sees, 1e-6)
        yield np.concatenate([kept, view.belief.probability * (1 - kept.sum(axis=0))])
{MAPS}"""


class TestMemory(GraderChecks):
    exercise = "14_memory"
    entries = (
        # ---- task 1
        right("a loop over frames", task="combine", code=combined()),
        right(
            "powers, normalised after each frame",
            task="combine",
            code="""
def combine(p, w):
    belief = np.full(p.shape[1], 1 / p.shape[1])
    for q, e in zip(p, w):
        belief = belief * np.maximum(q, 0.0001) ** e
        belief = belief / belief.sum()
    return list(belief)""",
        ),
        mistake(
            "no exponents", task="combine", loses=2, says="no effect", code=combined("np.log(max_(p)).sum(axis=0)")
        ),
        mistake(
            "the weighted mean",
            task="combine",
            loses=2,
            says="that is a mean",
            code="def combine(p, w):\n    return w @ p / w.sum() if p[1, 0] == 0.8 or len(p) > 2 else p[0]",
        ),
        mistake("not normalised", task="combine", loses=2, says="divide by the sum", code=combined(result="belief")),
        mistake(
            "zero is for ever",
            task="combine",
            loses=2,
            says="take at least 0.0001",
            code="""
def combine(p, w):
    belief = np.prod(p ** w[:, None], axis=0)
    return belief / belief.sum()""",
        ),
        mistake(
            "another least probability",
            task="combine",
            loses=2,
            says="take at least 0.0001",
            code=combined(least="1e-6"),
        ),
        mistake(
            "powers that vanish",
            task="combine",
            loses=2,
            says="on inputs you haven't seen",
            code="""
def combine(p, w):
    belief = np.prod(np.maximum(p, 1e-4) ** np.asarray(w)[:, None], axis=0)
    return belief / belief.sum()""",
        ),
        mistake(
            "clips the argument",
            task="combine",
            loses=2,
            says="it changes an argument",
            code="""
def combine(p, w):
    np.maximum(p, 1e-4, out=p)
    score = w @ np.log(p)
    belief = np.exp(score - score.max())
    return belief / belief.sum()""",
        ),
        mistake("no return", task="combine", loses=2, says="forget `return`", code="def combine(p, w):\n    pass"),
        mistake(
            "an endless loop",
            task="combine",
            loses=2,
            says="before timeout",
            code="def combine(p, w):\n    while True:\n        pass",
        ),
        # ---- task 2
        right("the definition", task="errors-last", code=lasting()),
        right(
            "a loop over pairs",
            task="errors-last",
            code="""
def errors_last(wrong):
    pairs = [(row[t], row[t + 1]) for row in wrong.tolist() for t in range(len(row) - 1)]
    x, y = [a for a, _ in pairs], [b for _, b in pairs]
    n = len(pairs)
    mx, my = sum(x) / n, sum(y) / n
    cov = sum((a - mx) * (b - my) for a, b in pairs) / n
    var = sum((a - mx) ** 2 for a in x) / n, sum((b - my) ** 2 for b in y) / n
    r = cov / (var[0] * var[1]) ** 0.5
    return [r, 1 + (wrong.shape[1] - 1) * (1 - r) / (1 + r)]""",
        ),
        mistake(
            "wrong again, given wrong",
            task="errors-last",
            loses=2,
            says="P(wrong again | wrong)",
            code=lasting("(x * y).sum() / x.sum()"),
        ),
        mistake(
            "the covariance",
            task="errors-last",
            loses=2,
            says="the covariance",
            code=lasting("(x * y).mean() - x.mean() * y.mean()"),
        ),
        mistake(
            "the mean of products",
            task="errors-last",
            loses=2,
            says="mean of the products",
            code=lasting("(x * y).mean()"),
        ),
        mistake(
            "neighbouring places",
            task="errors-last",
            loses=2,
            says="neighbouring places",
            code=lasting("np.corrcoef(wrong[:-1].ravel(), wrong[1:].ravel())[0, 1]"),
        ),
        mistake(
            "T in place of T - 1",
            task="errors-last",
            loses=2,
            says="T - 1 follow the first",
            code=lasting(worth="1 + T * (1 - r) / (1 + r)"),
        ),
        mistake(
            "the exponent",
            task="errors-last",
            loses=2,
            says="exponent of each frame",
            code=lasting(worth="(1 + (T - 1) * (1 - r) / (1 + r)) / T"),
        ),
        mistake(
            "three frames, always",
            task="errors-last",
            loses=2,
            says="on inputs you haven't seen",
            code=lasting(worth="1 + 2 * (1 - r) / (1 + r)"),
        ),
        mistake(
            "one variance for both",
            task="errors-last",
            loses=2,
            says="on inputs you haven't seen",
            code=lasting("((x - x.mean()) * (y - y.mean())).mean() / x.var()"),
        ),
        # ---- task 3
        right("a loop over cells", task="moved", code=shifted()),
        right(
            "padding and cutting",
            task="moved",
            code="""
def moved(grid, ahead, left, fill):
    C, H, W = grid.shape
    pad = max(H, W, abs(ahead), abs(left))
    wide = np.empty((C, H + 2 * pad, W + 2 * pad))
    wide[:] = np.reshape(fill, (C, 1, 1))
    wide[:, pad:pad + H, pad:pad + W] = grid
    return wide[:, pad - ahead:pad - ahead + H, pad - left:pad - left + W]""",
        ),
        mistake(
            "rolled",
            task="moved",
            loses=2,
            says="comes in again",
            code="def moved(grid, ahead, left, fill):\n    return np.roll(grid, (ahead, left), (1, 2))",
        ),
        mistake("backward", task="moved", loses=2, says="the vehicle moves forward", code=shifted(r="r + ahead")),
        mistake("mirrored", task="moved", loses=2, says="left and right are swapped", code=shifted(c="c + left")),
        mistake(
            "both the wrong way",
            task="moved",
            loses=2,
            says="the vehicle moves forward",
            code=shifted("r + ahead", "c + left"),
        ),
        mistake(
            "swapped", task="moved", loses=2, says="rows and columns are swapped", code=shifted("r - left", "c - ahead")
        ),
        mistake("in place", task="moved", loses=2, says="it changes `grid`", code=shifted(start="grid")),
        mistake(
            "negative indices come from the other side",
            task="moved",
            loses=2,
            says="comes in again",
            code=shifted(inside="i < H and j < W"),
        ),
        mistake(
            "one value for all classes",
            task="moved",
            loses=2,
            says="expected",
            code=shifted().replace("else fill", "else fill[0]"),
        ),
        mistake(
            "at most one cell to the side",
            task="moved",
            loses=2,
            says="on inputs you haven't seen",
            code=shifted(c="c - int(np.sign(left))"),
        ),
        # ---- task 4
        right("a loop over classes", task="listen", code=heard()),
        right(
            "a mask and errstate",
            task="listen",
            code="""
def listen(p, o, standing):
    factor = np.ones(p.shape)
    for k in standing:
        factor[k] -= o[FREE]
    with np.errstate(all="ignore"):
        q = p * factor
        q = q / q.sum(axis=0)
    return np.nan_to_num(q, nan=1 / len(p))""",
        ),
        mistake("by P(FREE)", task="listen", loses=3, says="it is 1 - P(FREE)", code=heard("o[0]")),
        mistake(
            "only where STATIC", task="listen", loses=3, says="UNKNOWN cell may hold a car", code=heard("o[1] + o[2]")
        ),
        mistake("not divided", task="listen", loses=3, says="divide each cell by its sum", code=heard(result="q")),
        mistake("0 / 0", task="listen", loses=3, says="you divide by 0", code=heard(result="q / total")),
        mistake("in place", task="listen", loses=3, says="it changes `p`", code=heard(start="p")),
        mistake(
            "nothing heard",
            task="listen",
            loses=3,
            says="no effect",
            code="def listen(p, o, standing):\n    return p.copy()",
        ),
        mistake(
            "all but the first class",
            task="listen",
            loses=3,
            says="keeps its own",
            code=heard().replace("for k in standing", "for k in range(1, len(q))"),
        ),
        mistake(
            "a third, always",
            task="listen",
            loses=3,
            says="on inputs you haven't seen",
            code=heard(result="np.where(total > 0, q / np.maximum(total, 1e-300), 1 / 3)"),
        ),
        # ---- task 5
        right("the past fills what isn't seen", task="remember", code=kept()),
        right("a running mean in a map that moves along", task="remember", code=RUNNING),
        right(
            "only the newest view that saw the cell",
            task="remember",
            code=f"""
def remember(views, spec):
    past = []
    for view in views:
        past.append(view)
        q = view.grid.astype(float)
        for then in past[::-1]:
            motion = PlanarMotion.from_poses(then.frame.T_world_from_lidar, view.frame.T_world_from_lidar)
            was = look_up(then.grid, np.zeros(14, np.float32), spec, spec, motion)[:10].astype(float)
            q[:10] += q[10:].sum(axis=0) * was
            q[10:] *= 1 - was.sum(axis=0)
        yield q / q.sum(axis=0)
{MAPS}""",
        ),
        mistake("one frame", task="remember", loses=3, says="nothing is remembered", code=kept(result="view.grid")),
        mistake(
            "the package's",
            task="remember",
            loses=3,
            says="the package's own memory",
            code=f"from semgrid_edu.memory import remember_drive as remember\n{MAPS}",
        ),
        mistake(
            "the mean of all frames",
            task="remember",
            loses=3,
            says="let the newest frame decide",
            code=kept(
                look="look_up(then.grid, np.full(14, 1 / 14, np.float32), spec, spec, motion)",
                classes="total / total.sum(axis=0)",
                result="classes",
            ),
        ),
        mistake(
            "the vehicle stands, always",
            task="remember",
            loses=3,
            says="on inputs you haven't seen",
            code=kept(look="then.grid[:10]"),
        ),
        mistake(
            "the motion the wrong way",
            task="remember",
            loses=3,
            says="on inputs you haven't seen",
            code=kept(motion="PlanarMotion.from_poses(view.frame.T_world_from_lidar, then.frame.T_world_from_lidar)"),
        ),
        mistake(
            "a sum, no distribution",
            task="remember",
            loses=3,
            says="sum to 1",
            code=kept(result="np.concatenate([total, view.grid[10:]])"),
        ),
        mistake(
            "a list",
            task="remember",
            loses=3,
            says="takes a frame, yields its grid",
            code=f"def remember(views, spec):\n    return [view.grid for view in views]\n{MAPS}",
        ),
    )
