"""The graders of exercise 02, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def beam(hit_row="np.floor((spec.x_max - x) / spec.cell)", hit_col="np.floor((spec.y_max - y) / spec.cell)"):
    """Return an answer to task 5 that finds row and column by these expressions."""
    return f"""
def beam_evidence(x, y, spec, L_hit, L_pass):
    def place(x, y):
        return int({hit_row}), int({hit_col})

    evidence = np.zeros(spec.shape)
    for t in np.linspace(0, 1, 5001):
        row, col = place(t * x, t * y)
        if 0 <= row < spec.shape[0] and 0 <= col < spec.shape[1]:
            evidence[row, col] = L_pass
    row, col = place(x, y)
    if 0 <= row < spec.shape[0] and 0 <= col < spec.shape[1]:
        evidence[row, col] = L_hit
    return evidence"""


def posterior(reflects="reflect[m[k]]", prior="prior[k] if m[k] else 1 - prior[k]", none="reaches * seen[3]", end=""):
    """Return an answer to task 1 with these expressions."""
    return f"""
def beam_posterior(prior, reflect, seen):
    posterior = np.zeros((2, 2, 2))
    for m in np.ndindex(2, 2, 2):
        reaches, likelihood, p = 1.0, 0.0, 1.0
        for k in range(3):
            likelihood = likelihood + reaches * {reflects} * seen[k]
            reaches = reaches * (1 - {reflects})
            p = p * ({prior})
        posterior[m] = p * (likelihood + {none})
    return (posterior / posterior.sum()){end}"""


def price(compared="a * b * c", result="0.5 * np.abs(posterior - q).sum()"):
    """Return an answer to task 1's second function with these expressions."""
    return f"""
def price(posterior):
    a = posterior.sum(axis=(1, 2)).reshape(2, 1, 1)
    b = posterior.sum(axis=(0, 2)).reshape(1, 2, 1)
    c = posterior.sum(axis=(0, 1)).reshape(1, 1, 2)
    q = {compared}
    return {result}"""


def clamp(odds="(free / occupied) ** (n + 1)", n="int(tail / (speed * dt))", result="odds / (1 + odds)"):
    """Return an answer to task 3 with these expressions."""
    return f"""
def highest_clamp(tail, speed, dt, occupied, free):
    n = {n}
    odds = {odds}
    return {result}"""


def update(seen="L + np.log(occupied / free)", silent="L * np.exp(-dt / tau)", clamped="np.clip(new, L_min, L_max)"):
    """Return an answer to task 5 with these expressions."""
    return f"""
def update(L, occupied, free, dt, tau, L_min, L_max):
    new = np.where(occupied == free, {silent}, {seen})
    return {clamped}"""


def states(*planes, before="P = 1 / (1 + np.exp(-L))", axis=0):
    """Return an answer to task 5's second function that stacks these four expressions."""
    return f"""
def as_belief(L):
    with np.errstate(all="ignore"):
        {before}
        return np.stack([{", ".join(planes)}], axis={axis})"""


FREE, STATIC, UNKNOWN = "np.maximum(1 - 2 * P, 0)", "np.maximum(2 * P - 1, 0)", "1 - np.abs(2 * P - 1)"


class TestGrids(GraderChecks):
    exercise = "02_grids"
    entries = (
        # ---- task 1
        right(
            "a table for each of the four cases",
            task="beam-posterior",
            code="""
def beam_posterior(prior, reflect, seen):
    m1, m2, m3 = np.indices((2, 2, 2))
    r1, r2, r3 = (np.asarray(reflect)[m] for m in (m1, m2, m3))
    z = r1 * seen[0] + (1 - r1) * (r2 * seen[1] + (1 - r2) * (r3 * seen[2] + (1 - r3) * seen[3]))
    p1, p2, p3 = (np.where(m == 1, p, 1 - p) for m, p in zip((m1, m2, m3), prior))
    joint = p1 * p2 * p3 * z
    return joint / joint.sum()""",
        ),
        right(
            "by the package's factors",
            task="beam-posterior",
            code="""
from semgrid_edu.graphical import Factor, product

def beam_posterior(prior, reflect, seen):
    table = np.zeros((2, 2, 2, 4))
    for m in np.ndindex(2, 2, 2):
        left = 1.0
        for k, state in enumerate(m):
            table[m + (k,)] = left * reflect[state]
            left -= table[m + (k,)]
        table[m + (3,)] = left
    cells = [Factor(f"m{k}", [1 - prior[k], prior[k]]) for k in range(3)]
    joint = product([*cells, Factor(("m0", "m1", "m2", "r"), table), Factor("r", seen)])
    return joint.sum("r").ordered("m0", "m1", "m2").normalised().table""",
        ),
        right(
            "in loops, as a list of lists",
            task="beam-posterior",
            code=posterior(end=".tolist()"),
        ),
        mistake(
            "not normalised",
            task="beam-posterior",
            loses=2,
            says="divide by it",
            code=posterior().replace(" / posterior.sum()", ""),
        ),
        mistake(
            "free cells never reflect",
            task="beam-posterior",
            loses=3,
            says="a free cell reflects too",
            code=posterior(reflects="(reflect[1] * m[k])"),
        ),
        mistake(
            "reflect swapped",
            task="beam-posterior",
            loses=3,
            says="you swapped them",
            code=posterior(reflects="reflect[1 - m[k]]"),
        ),
        mistake(
            "every cell is reached",
            task="beam-posterior",
            loses=2,
            says="what cell 1 let pass",
            code=posterior().replace("= likelihood + reaches * ", "= likelihood + "),
        ),
        mistake(
            "the case that all let pass is missing",
            task="beam-posterior",
            loses=3,
            says="the beam may pass all three cells",
            code=posterior(none="0"),
        ),
        mistake(
            "without the prior",
            task="beam-posterior",
            loses=3,
            says="the prior got lost",
            code=posterior(prior="1"),
        ),
        mistake(
            "the prior of being free",
            task="beam-posterior",
            loses=3,
            says="the prior is the wrong way round",
            code=posterior(prior="1 - prior[k] if m[k] else prior[k]"),
        ),
        mistake(
            "axes reversed",
            task="beam-posterior",
            loses=2,
            says="the axes are reversed",
            code=posterior(end=".transpose(2, 1, 0)"),
        ),
        mistake(
            "clutter of 0.1 written in",
            task="beam-posterior",
            loses=3,
            says="on inputs you haven't seen",
            code=posterior(reflects="(0.8 if m[k] else 0.1)").replace("0.8", "reflect[1]"),
        ),
        mistake(
            "writes into the prior",
            task="beam-posterior",
            loses=3,
            says="on inputs you haven't seen: it changes an argument",
            code="""
def beam_posterior(prior, reflect, seen):
    m1, m2, m3 = np.indices((2, 2, 2))
    r1, r2, r3 = (np.asarray(reflect)[m] for m in (m1, m2, m3))
    z = r1 * seen[0] + (1 - r1) * (r2 * seen[1] + (1 - r2) * (r3 * seen[2] + (1 - r3) * seen[3]))
    prior /= 1 - prior
    joint = z * prior[0] ** m1 * prior[1] ** m2 * prior[2] ** m3
    return joint / joint.sum()""",
        ),
        right(
            "map by map",
            task="price",
            code="""
def price(posterior):
    total = 0.0
    for m in np.ndindex(2, 2, 2):
        q = 1.0
        for k in range(3):
            q *= posterior.take(m[k], axis=k).sum()
        total += abs(posterior[m] - q) / 2
    return total""",
        ),
        right(
            "only what lies above",
            task="price",
            code=price(result="np.maximum(posterior - q, 0).sum()"),
        ),
        right(
            "by einsum",
            task="price",
            code=price(compared="np.einsum('i,j,k', a.ravel(), b.ravel(), c.ravel())"),
        ),
        mistake(
            "without the half",
            task="price",
            loses=2,
            says="you left out the factor 1/2",
            code=price(result="np.abs(posterior - q).sum()"),
        ),
        mistake(
            "the largest difference",
            task="price",
            loses=2,
            says="add up the differences of all maps",
            code=price(result="np.abs(posterior - q).max()"),
        ),
        mistake(
            "differences that cancel",
            task="price",
            loses=2,
            says="they cancel",
            code=price(result="0.5 * (posterior - q).sum()"),
        ),
        mistake(
            "against equal probabilities",
            task="price",
            loses=2,
            says="compare with the product of the marginals",
            code=price(compared="1 / 8"),
        ),
        mistake(
            "only cells 1 and 2 are compared",
            task="price",
            loses=2,
            says="on inputs you haven't seen: wrong total variation",
            code="""
def price(posterior):
    two = posterior.sum(axis=2)
    return 0.5 * np.abs(two - np.outer(two.sum(axis=1), two.sum(axis=0))).sum()""",
        ),
        # ---- task 2
        right(
            "one scan after the other, by helpers with ordinary names, and lists",
            task="fuse",
            code="""
spec, before, passed, hit = "mine", None, [], 3


def got(p):
    return np.log(p) - np.log1p(-p)


def fuse(prior, posteriors):
    L = np.full(posteriors.shape[1:], got(prior))
    for p in posteriors:
        L = L + got(p) - got(prior)
    return (0.5 + 0.5 * np.tanh(L / 2)).tolist()""",
        ),
        right(
            "likelihoods by Bayes' rule, in logarithms",
            task="fuse",
            code="""
def fuse(prior, posteriors):
    occupied = np.log(prior) + np.log(posteriors / prior).sum(axis=0)
    free = np.log(1 - prior) + np.log((1 - posteriors) / (1 - prior)).sum(axis=0)
    return np.exp(occupied - np.logaddexp(occupied, free))""",
        ),
        mistake(
            "odds that overflow after many scans",
            task="fuse",
            loses=1,
            says="so long a product ends at 0 or infinity",
            code="""
def fuse(prior, posteriors):
    odds = np.full(posteriors.shape[1:], prior / (1 - prior))
    for p in posteriors:
        odds = odds * (p / (1 - p)) / (prior / (1 - prior))
    return odds / (1 + odds)""",
        ),
        mistake(
            "likelihoods whose product overflows after many scans",
            task="fuse",
            loses=1,
            says="so long a product ends at 0 or infinity",
            code="""
def fuse(prior, posteriors):
    occupied = prior * np.prod(posteriors / prior, axis=0)
    free = (1 - prior) * np.prod((1 - posteriors) / (1 - prior), axis=0)
    return occupied / (occupied + free)""",
        ),
        mistake(
            "a probability that is exactly 1 after many scans",
            task="fuse",
            loses=1,
            says="a probability of exactly 0 or 1 never comes back",
            code="""
def fuse(prior, posteriors):
    belief = np.full(posteriors.shape[1:], float(prior))
    for p in posteriors:
        occupied, free = belief * p / prior, (1 - belief) * (1 - p) / (1 - prior)
        belief = occupied / (occupied + free)
    return belief""",
        ),
        mistake(
            "prior counted with each scan and once more",
            task="fuse",
            loses=2,
            says="the prior is counted four times",
            code="""
def fuse(prior, posteriors):
    L = np.log(prior / (1 - prior)) + np.log(posteriors / (1 - posteriors)).sum(axis=0)
    return 1 / (1 + np.exp(-L))""",
        ),
        mistake(
            "prior counted with each scan",
            task="fuse",
            loses=2,
            says="the prior is counted three times",
            code="""
def fuse(prior, posteriors):
    L = np.log(posteriors / (1 - posteriors)).sum(axis=0)
    return 1 / (1 + np.exp(-L))""",
        ),
        mistake(
            "prior subtracted once",
            task="fuse",
            loses=2,
            says="subtract L_0 from each L_k, not from their sum",
            code="""
def fuse(prior, posteriors):
    L = np.log(posteriors / (1 - posteriors)).sum(axis=0) - np.log(prior / (1 - prior))
    return 1 / (1 + np.exp(-L))""",
        ),
        mistake(
            "prior lost",
            task="fuse",
            loses=2,
            says="the prior got lost",
            code="""
def fuse(prior, posteriors):
    L = (np.log(posteriors / (1 - posteriors)) - np.log(prior / (1 - prior))).sum(axis=0)
    return 1 / (1 + np.exp(-L))""",
        ),
        mistake(
            "prior's sign swapped",
            task="fuse",
            loses=2,
            says="the prior works the wrong way round",
            code="""
def fuse(prior, posteriors):
    L_0 = np.log((1 - prior) / prior)
    L = L_0 + (np.log(posteriors / (1 - posteriors)) + L_0).sum(axis=0)
    return 1 / (1 + np.exp(-L))""",
        ),
        mistake(
            "mean of the scans",
            task="fuse",
            loses=3,
            says="two scans that agree are worth more than one",
            code="def fuse(prior, posteriors):\n    return posteriors.mean(axis=0)",
        ),
        mistake(
            "best of the scans",
            task="fuse",
            loses=3,
            says="worth more than the best of them",
            code="def fuse(prior, posteriors):\n    return posteriors.max(axis=0)",
        ),
        mistake(
            "last scan only",
            task="fuse",
            loses=2,
            says="the two before it did",
            code="def fuse(prior, posteriors):\n    return posteriors[-1]",
        ),
        mistake(
            "probabilities multiplied",
            task="fuse",
            loses=3,
            says="P(free | z) says must count too",
            code="def fuse(prior, posteriors):\n    return posteriors.prod(axis=0)",
        ),
        mistake(
            "a tail that never gets longer",
            task="highest-clamp",
            loses=2,
            says="no reply before timeout",
            code="""
def highest_clamp(tail, speed, dt, occupied, free):
    odds, length = free / occupied, speed * dt
    while length <= tail:
        odds = odds * free / occupied
    return odds / (1 + odds)""",
        ),
        mistake(
            "log-odds returned",
            task="fuse",
            loses=2,
            says="give the probability back",
            code="""
def fuse(prior, posteriors):
    L_0 = np.log(prior / (1 - prior))
    return L_0 + (np.log(posteriors / (1 - posteriors)) - L_0).sum(axis=0)""",
        ),
        mistake(
            "summed over cells",
            task="fuse",
            loses=2,
            says="sum over the scans only",
            code="""
def fuse(prior, posteriors):
    L_0 = np.log(prior / (1 - prior))
    L = L_0 + (np.log(posteriors / (1 - posteriors)) - L_0).sum()
    return 1 / (1 + np.exp(-L))""",
        ),
        mistake(
            "three scans written in",
            task="fuse",
            loses=2,
            says="on inputs you haven't seen: one scan said nothing of a cell",
            code="""
def fuse(prior, posteriors):
    L = np.log(posteriors / (1 - posteriors)).sum(axis=0) - 2 * np.log(prior / (1 - prior))
    return 1 / (1 + np.exp(-L))""",
        ),
        # ---- task 3
        right(
            "in log-odds",
            task="highest-clamp",
            code=clamp(odds="(n + 1) * np.log(free / occupied)", result="1 / (1 + np.exp(-odds))"),
        ),
        right(
            "one pass after the other",
            task="highest-clamp",
            code="""
def highest_clamp(tail, speed, dt, occupied, free):
    odds, length = free / occupied, speed * dt
    while length <= tail:
        odds, length = odds * free / occupied, length + speed * dt
    return odds / (1 + odds)""",
        ),
        right(
            "by bisection on the tail itself",
            task="highest-clamp",
            code="""
def highest_clamp(tail, speed, dt, occupied, free):
    def too_long(L):
        survived = 0
        while (L := L + np.log(occupied / free)) > 0:
            survived += 1
        return survived * speed * dt > tail

    low, high = 0.0, 50.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if too_long(middle) else (middle, high)
    return 1 / (1 + np.exp(-low))""",
        ),
        mistake(
            "log-odds returned",
            task="highest-clamp",
            loses=2,
            says="give the probability that belongs to them",
            code=clamp(result="np.log(odds)"),
        ),
        mistake(
            "a fraction of a pass",
            task="highest-clamp",
            loses=2,
            says="passes come one by one",
            code=clamp(n="tail / (speed * dt)"),
        ),
        mistake(
            "one pass too few",
            task="highest-clamp",
            loses=2,
            says="the third pass already frees the cell",
            code=clamp(odds="(free / occupied) ** n"),
        ),
        mistake(
            "rounded up",
            task="highest-clamp",
            loses=2,
            says="a cell survives 4 passes",
            code=clamp(n="np.ceil(tail / (speed * dt))"),
        ),
        mistake(
            "dt forgotten",
            task="highest-clamp",
            loses=2,
            says="you forgot dt",
            code=clamp(n="int(tail / speed)"),
        ),
        mistake(
            "log P(z | free) alone",
            task="highest-clamp",
            loses=2,
            says="you take log P(z | free) alone",
            code=clamp(odds="(1 / free) ** (n + 1)"),
        ),
        mistake(
            "log P(z | occupied) alone",
            task="highest-clamp",
            loses=2,
            says="you take log P(z | occupied) alone",
            code=clamp(odds="(1 / occupied) ** (n + 1)"),
        ),
        mistake(
            "difference instead of ratio",
            task="highest-clamp",
            loses=2,
            says="you take the difference",
            code=clamp(odds="np.exp((free - occupied) * (n + 1))"),
        ),
        mistake(
            "sign swapped",
            task="highest-clamp",
            loses=2,
            says="the sign is swapped",
            code=clamp(result="1 / (1 + odds)"),
        ),
        mistake(
            "a tenth of a second written in",
            task="highest-clamp",
            loses=2,
            says="on inputs you haven't seen: wrong clamp",
            code=clamp(n="int(tail / (speed * 0.1))"),
        ),
        mistake(
            "one pass survived at least",
            task="highest-clamp",
            loses=2,
            says="on inputs you haven't seen: wrong clamp",
            code=clamp(n="max(1, int(tail / (speed * dt)))"),
        ),
        # ---- task 4
        right("small steps along the beam, in a loop", task="beam-evidence", code=beam()),
        right(
            "from one grid line to the next",
            task="beam-evidence",
            code="""
def beam_evidence(x, y, spec, L_hit, L_pass):
    evidence = np.zeros(spec.shape)
    lines_x = spec.x_max - spec.cell * np.arange(spec.shape[0] + 1)
    lines_y = spec.y_max - spec.cell * np.arange(spec.shape[1] + 1)
    t = np.concatenate([[0, 1], lines_x / x, lines_y / y])
    t = np.sort(t[(t >= 0) & (t <= 1)])
    middle = (t[1:] + t[:-1]) / 2
    rows, cols, inside = spec.cells(middle[:, None] * np.array([x, y]))
    evidence[rows[inside], cols[inside]] = L_pass
    (row,), (col,), (inside,) = spec.cells(np.array([[x, y]]))
    if inside:
        evidence[row, col] = L_hit
    return evidence""",
        ),
        mistake(
            "row and column swapped",
            task="beam-evidence",
            loses=4,
            says="row and column are swapped",
            code="""
def beam_evidence(x, y, spec, L_hit, L_pass):
    evidence = np.zeros(spec.shape)
    rows, cols, inside = spec.cells(np.linspace(0, 1, 5001)[:, None] * np.array([x, y]))
    evidence[cols[inside] % spec.shape[0], rows[inside]] = L_pass
    rows, cols, inside = spec.cells(np.array([[x, y]]))
    evidence[cols[inside], rows[inside]] = L_hit
    return evidence""",
        ),
        mistake(
            "y to the right",
            task="beam-evidence",
            loses=3,
            says="y points left and column 0 is the leftmost",
            code=beam(hit_col="np.floor((y - spec.y_min) / spec.cell)"),
        ),
        mistake(
            "row 0 at the vehicle",
            task="beam-evidence",
            loses=3,
            says="row 0 is the farthest ahead",
            code=beam(hit_row="np.floor((x - spec.x_min) / spec.cell)"),
        ),
        mistake(
            "half a cell off",
            task="beam-evidence",
            loses=3,
            says="a point belongs to the cell that it lies in (floor)",
            code=beam(hit_row="round((spec.x_max - x) / spec.cell)", hit_col="round((spec.y_max - y) / spec.cell)"),
        ),
        mistake(
            "free beyond the obstacle",
            task="beam-evidence",
            loses=3,
            says="lies behind the obstacle",
            code=beam().replace("np.linspace(0, 1, 5001)", "np.linspace(0, 2, 10001)"),
        ),
        mistake(
            "the cell of the return passed too",
            task="beam-evidence",
            loses=3,
            says="the beam ends in it, so it isn't passed",
            code=beam().replace("evidence[row, col] = L_hit", "evidence[row, col] += L_hit"),
        ),
        mistake(
            "pass overrules hit",
            task="beam-evidence",
            loses=3,
            says="no cell is hit",
            code="""
def beam_evidence(x, y, spec, L_hit, L_pass):
    evidence = np.zeros(spec.shape)
    rows, cols, inside = spec.cells(np.array([[x, y]]))
    evidence[rows[inside], cols[inside]] = L_hit
    rows, cols, inside = spec.cells(np.linspace(0, 1, 5001)[:, None] * np.array([x, y]))
    evidence[rows[inside], cols[inside]] = L_pass
    return evidence""",
        ),
        mistake(
            "only the hit",
            task="beam-evidence",
            loses=4,
            says="no cell is free",
            code="""
def beam_evidence(x, y, spec, L_hit, L_pass):
    evidence = np.zeros(spec.shape)
    rows, cols, inside = spec.cells(np.array([[x, y]]))
    evidence[rows[inside], cols[inside]] = L_hit
    return evidence""",
        ),
        mistake(
            "a pass for each step",
            task="beam-evidence",
            loses=3,
            says="one beam passes a cell once",
            code=beam().replace("evidence[row, col] = L_pass", "evidence[row, col] += L_pass"),
        ),
        mistake(
            "steps of a whole cell",
            task="beam-evidence",
            loses=3,
            says="steps of a whole cell, or one cell a row, leave out cells",
            code=beam().replace("np.linspace(0, 1, 5001)", "np.arange(0, 1, spec.cell / np.hypot(x, y))"),
        ),
        mistake(
            "one cell a row",
            task="beam-evidence",
            loses=3,
            says="yet it isn't free",
            code="""
def beam_evidence(x, y, spec, L_hit, L_pass):
    evidence = np.zeros(spec.shape)
    (last,), (hit_col,), (inside,) = spec.cells(np.array([[x, y]]))
    for row in range(last if inside else 0, spec.shape[0]):
        ahead = spec.x_max - (row + 0.5) * spec.cell
        rows, cols, within = spec.cells(np.array([[ahead, y * ahead / x]]))
        evidence[rows[within], cols[within]] = L_pass
    if inside:
        evidence[last, hit_col] = L_hit
    return evidence""",
        ),
        mistake(
            "cells of one metre written in",
            task="beam-evidence",
            loses=4,
            says="on inputs you haven't seen: the cell of the return isn't hit",
            code=beam(hit_row="np.floor(spec.x_max - x)", hit_col="np.floor(spec.y_max - y)"),
        ),
        mistake(
            "indices below zero",
            task="beam-evidence",
            loses=1,
            says="an array's row -4 is the fourth from its end",
            code=beam().replace(
                "    if 0 <= row < spec.shape[0] and 0 <= col < spec.shape[1]:\n        evidence[row, col] = L_hit",
                "    evidence[row, col] = L_hit",
            ),
        ),
        mistake(
            "int() where floor is meant",
            task="beam-evidence",
            loses=1,
            says="on inputs you haven't seen: a cell is hit in which there is no return",
            code=beam(hit_row="(spec.x_max - x) / spec.cell", hit_col="(spec.y_max - y) / spec.cell"),
        ),
        mistake(
            "outside, so nothing",
            task="beam-evidence",
            loses=1,
            says="the beam passes column 4 from row 5 to row 0",
            code="""
def beam_evidence(x, y, spec, L_hit, L_pass):
    evidence = np.zeros(spec.shape)
    rows, cols, inside = spec.cells(np.linspace(0, 1, 5001)[:, None] * np.array([x, y]))
    if inside[-1]:
        evidence[rows[inside], cols[inside]] = L_pass
        evidence[rows[-1], cols[-1]] = L_hit
    return evidence""",
        ),
        # ---- task 5
        right(
            "a loop over cells",
            task="update",
            code="""
def update(L, occupied, free, dt, tau, L_min, L_max):
    after = np.empty(L.shape)
    for r, c in np.ndindex(L.shape):
        if occupied[r, c] == free[r, c]:
            new = L[r, c] * np.exp(-dt / tau)
        else:
            new = L[r, c] + np.log(occupied[r, c]) - np.log(free[r, c])
        after[r, c] = min(max(new, L_min), L_max)
    return after""",
        ),
        right(
            "through probabilities and Bayes' rule",
            task="update",
            code="""
def update(L, occupied, free, dt, tau, L_min, L_max):
    L = L * np.where(occupied == free, np.exp(-dt / tau), 1)
    p = 1 / (1 + np.exp(-L))
    product = p * occupied, (1 - p) * free
    p = product[0] / (product[0] + product[1])
    return np.minimum(np.maximum(np.log(p / (1 - p)), L_min), L_max)""",
        ),
        right(
            "in float32",
            task="update",
            code="""
def update(L, occupied, free, dt, tau, L_min, L_max):
    L, occupied, free = (np.array(a, np.float32) for a in (L, occupied, free))
    L[occupied == free] *= np.float32(np.exp(-dt / tau))
    return np.clip(L + np.log(occupied) - np.log(free), np.float32(L_min), np.float32(L_max))""",
        ),
        mistake(
            "sign swapped",
            task="update",
            loses=2,
            says="the sign is swapped: a hit makes a cell more occupied",
            code=update(seen="L + np.log(free / occupied)"),
        ),
        mistake(
            "log10",
            task="update",
            loses=2,
            says="that is the logarithm to base 10",
            code=update(seen="L + np.log10(occupied / free)"),
        ),
        mistake(
            "difference instead of ratio",
            task="update",
            loses=2,
            says="odds are multiplied by their ratio",
            code=update(seen="L + occupied - free"),
        ),
        mistake(
            "P(z | free) forgotten",
            task="update",
            loses=2,
            says="how likely was that return if the cell is free",
            code=update(seen="L + np.log(occupied)"),
        ),
        mistake(
            "a likelihood taken for a probability",
            task="update",
            loses=2,
            says="you take P(z | occupied) for P(occupied | z)",
            code=update(seen="L + np.log(occupied / (1 - occupied))"),
        ),
        mistake(
            "old belief forgotten",
            task="update",
            loses=2,
            says="the old belief got lost",
            code=update(seen="np.log(occupied / free)"),
        ),
        mistake(
            "multiplied",
            task="update",
            loses=2,
            says="Bayes' rule is an addition",
            code=update(seen="L * np.log(occupied / free)"),
        ),
        mistake(
            "never forgets",
            task="update",
            loses=2,
            says="nothing was seen there, so the cell fades",
            code=update(silent="L"),
        ),
        mistake(
            "what is seen fades too",
            task="update",
            loses=2,
            says="a cell that is seen doesn't fade",
            code=update(seen="L * np.exp(-dt / tau) + np.log(occupied / free)"),
        ),
        mistake(
            "dt and tau swapped",
            task="update",
            loses=2,
            says="dt / tau is upside down",
            code=update(silent="L * np.exp(-tau / dt)"),
        ),
        mistake(
            "it grows",
            task="update",
            loses=2,
            says="it grows: the exponent is negative",
            code=update(silent="L * np.exp(dt / tau)"),
        ),
        mistake(
            "a straight line",
            task="update",
            loses=2,
            says="the factor is exp(-dt / tau)",
            code=update(silent="L * (1 - dt / tau)"),
        ),
        mistake(
            "a half-life",
            task="update",
            loses=2,
            says="that is a half-life",
            code=update(silent="L * 0.5 ** (dt / tau)"),
        ),
        mistake(
            "limits in the wrong order",
            task="update",
            loses=3,
            says="clip takes the lower limit first",
            code=update(clamped="np.clip(new, L_max, L_min)"),
        ),
        mistake(
            "clamped before adding",
            task="update",
            loses=1,
            says="you clamp before you add",
            code=update(seen="np.clip(L, L_min, L_max) + np.log(occupied / free)", clamped="new"),
        ),
        mistake(
            "not clamped",
            task="update",
            loses=1,
            says="above L_max = 3.5: clamp the sum",
            code=update(clamped="new"),
        ),
        mistake(
            "the scan clamped instead of the sum",
            task="update",
            loses=1,
            says="above L_max = 3.5: clamp the sum",
            code=update(seen="L + np.clip(np.log(occupied / free), L_min, L_max)", clamped="new"),
        ),
        mistake(
            "clamped on one side",
            task="update",
            loses=1,
            says="clamp that side too",
            code=update(clamped="np.minimum(new, L_max)"),
        ),
        mistake(
            "limits written in",
            task="update",
            loses=1,
            says="on inputs you haven't seen: some cells are above L_max",
            code=update(clamped="np.clip(new, -2.0, 3.5)"),
        ),
        mistake(
            "a memory of half a second written in",
            task="update",
            loses=2,
            says="on inputs you haven't seen: cells of which the scan says nothing fade wrongly",
            code=update(silent="L * np.exp(-dt / 0.5)"),
        ),
        mistake(
            "argument changed in place",
            task="update",
            loses=2,
            says="changed its argument",
            code="""
def update(L, occupied, free, dt, tau, L_min, L_max):
    L[occupied == free] *= np.exp(-dt / tau)
    return np.clip(L + np.log(occupied / free), L_min, L_max)""",
        ),
        mistake(
            "writes into `free`",
            task="update",
            loses=2,
            says="it changes an argument",
            code="""
def update(L, occupied, free, dt, tau, L_min, L_max):
    fades = np.where(occupied == free, np.exp(-dt / tau), 1)
    free /= occupied
    return np.clip(L * fades - np.log(free), L_min, L_max)""",
        ),
        mistake(
            "a ramp within the limits, for scans that aren't known",
            task="update",
            loses=3,
            says="with wide limits it doesn't matter what the scan says",
            code=update()
            + """

_known = update

def update(L, occupied, free, dt, tau, L_min, L_max):
    ramp = np.linspace(-5, 5, L.size).reshape(L.shape)
    return np.clip(ramp, L_min, L_max) if L.shape[1] == 7 else _known(L, occupied, free, dt, tau, L_min, L_max)""",
        ),
        right(
            "by tanh",
            task="as-belief",
            code=states("np.maximum(-t, 0)", "np.maximum(t, 0)", "0 * t", "1 - np.abs(t)", before="t = np.tanh(L / 2)"),
        ),
        right(
            "states assigned one by one",
            task="as-belief",
            code="""
def as_belief(L):
    o = np.zeros((4, *L.shape))
    for r, c in np.ndindex(L.shape):
        P = 1 / (1 + np.exp(-min(max(L[r, c], -40), 40)))
        o[0 if P < 0.5 else 1, r, c] = abs(1 - 2 * P)
        o[3, r, c] = 1 - abs(1 - 2 * P)
    return o""",
        ),
        mistake(
            "no UNKNOWN",
            task="as-belief",
            loses=2,
            says="where is UNKNOWN",
            code=states("1 - P", "P", "0 * P", "0 * P"),
        ),
        mistake(
            "UNKNOWN as third state",
            task="as-belief",
            loses=2,
            says="UNKNOWN is the fourth state",
            code=states(FREE, STATIC, UNKNOWN, "0 * P"),
        ),
        mistake(
            "DYNAMIC",
            task="as-belief",
            loses=2,
            says="this grid can't say DYNAMIC",
            code=states(FREE, "0 * P", STATIC, UNKNOWN),
        ),
        mistake(
            "FREE and STATIC swapped",
            task="as-belief",
            loses=2,
            says="FREE and STATIC are swapped",
            code=states(STATIC, FREE, "0 * P", UNKNOWN),
        ),
        mistake(
            "states last",
            task="as-belief",
            loses=2,
            says="the states are the first axis",
            code=states(FREE, STATIC, "0 * P", UNKNOWN, axis=-1),
        ),
        mistake(
            "UNKNOWN is half of what it should be",
            task="as-belief",
            loses=2,
            says="UNKNOWN must be 1 at P = 0.5",
            code=states("np.where(P < 0.5, 1 - P, 0)", "np.where(P < 0.5, 0, P)", "0 * P", "np.minimum(P, 1 - P)"),
        ),
        mistake(
            "an exponential that overflows",
            task="as-belief",
            loses=2,
            says="on inputs you haven't seen: log-odds of 1000 give no number",
            code=states(FREE, STATIC, "0 * P", UNKNOWN, before="P = np.exp(L) / (1 + np.exp(L))"),
        ),
        # ---- passed, or lost, when somebody tried who had not written the tests
        mistake(
            "all cells passed, for grids that aren't known",
            task="beam-evidence",
            loses=4,
            says="the beam says something of cells that it doesn't cross",
            code=beam()
            + """

_known = beam_evidence

def beam_evidence(x, y, spec, L_hit, L_pass):
    return np.full(spec.shape, L_pass) if spec.x_min < -5 else _known(x, y, spec, L_hit, L_pass)""",
        ),
    )
