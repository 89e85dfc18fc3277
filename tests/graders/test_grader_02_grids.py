"""The graders of exercise 02, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right

PROBABILITY = """

def probability(L):
    return 1 / (1 + np.exp(-L))"""
LOG_ODDS = """def log_odds(p):
    return np.log(p / (1 - p))

"""


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


class TestGrids(GraderChecks):
    exercise = "02_grids"
    entries = (
        # ---- task 1
        right(
            "differences of logarithms, and a soft-max of two",
            task="log-odds",
            code="""
def log_odds(p):
    return np.log(p) - np.log1p(-p)

def probability(L):
    return 0.5 * (1 + np.tanh(0.5 * L))""",
        ),
        right(
            "scipy knows both",
            task="log-odds",
            code="from scipy.special import expit as probability, logit as log_odds",
        ),
        right(
            "cell by cell, each side of zero its own formula",
            task="log-odds",
            code="""
import math

@np.vectorize
def log_odds(p):
    return -math.log(1 / p - 1)

@np.vectorize
def probability(L):
    return 1 / (1 + math.exp(-L)) if L >= 0 else math.exp(L) / (1 + math.exp(L))""",
        ),
        mistake(
            "odds without a logarithm",
            task="log-odds",
            loses=1,
            says="those are the odds: take their logarithm",
            code="def log_odds(p):\n    return p / (1 - p)" + PROBABILITY,
        ),
        mistake(
            "sign swapped",
            task="log-odds",
            loses=1,
            says="the sign is swapped",
            code="def log_odds(p):\n    return np.log((1 - p) / p)" + PROBABILITY,
        ),
        mistake(
            "log10",
            task="log-odds",
            loses=1,
            says="that is the logarithm to base 10",
            code="def log_odds(p):\n    return np.log10(p / (1 - p))" + PROBABILITY,
        ),
        mistake(
            "log2",
            task="log-odds",
            loses=1,
            says="that is the logarithm to base 2",
            code="def log_odds(p):\n    return np.log2(p / (1 - p))" + PROBABILITY,
        ),
        mistake(
            "log p",
            task="log-odds",
            loses=1,
            says="log-odds compare p with 1 - p",
            code="def log_odds(p):\n    return np.log(p)" + PROBABILITY,
        ),
        mistake(
            "numbers only, no arrays",
            task="log-odds",
            loses=1,
            says="TypeError",
            code="import math\n\ndef log_odds(p):\n    return math.log(p / (1 - p))" + PROBABILITY,
        ),
        mistake(
            "an epsilon against log 0",
            task="log-odds",
            loses=1,
            says="on inputs you haven't seen: wrong near 0 and 1",
            code="def log_odds(p):\n    return np.log((p + 1e-6) / (1 - p + 1e-6))" + PROBABILITY,
        ),
        mistake(
            "odds instead of a probability",
            task="log-odds",
            loses=1,
            says="no probability is above 1",
            code=LOG_ODDS + "def probability(L):\n    return np.exp(L)",
        ),
        mistake(
            "1 - p",
            task="log-odds",
            loses=1,
            says="that is 1 - p",
            code=LOG_ODDS + "def probability(L):\n    return 1 / (1 + np.exp(L))",
        ),
        mistake(
            "powers of ten",
            task="log-odds",
            loses=1,
            says="you raise 10 to the power L",
            code=LOG_ODDS + "def probability(L):\n    return 1 / (1 + 10.0**-L)",
        ),
        mistake(
            "tanh",
            task="log-odds",
            loses=1,
            says="a probability from 0 to 1",
            code=LOG_ODDS + "def probability(L):\n    return np.tanh(L)",
        ),
        mistake(
            "overflow",
            task="log-odds",
            loses=1,
            says="on inputs you haven't seen: log-odds of 1000 give no number",
            code=LOG_ODDS + "def probability(L):\n    return np.exp(L) / (1 + np.exp(L))",
        ),
        # ---- task 2
        right(
            "a loop over cells",
            task="update",
            code="""
def update(L, occupied, free, L_min, L_max):
    after = np.empty_like(L)
    for r in range(L.shape[0]):
        for c in range(L.shape[1]):
            after[r, c] = min(max(L[r, c] + np.log(occupied[r, c]) - np.log(free[r, c]), L_min), L_max)
    return after""",
        ),
        right(
            "through probabilities and Bayes' rule",
            task="update",
            code="""
def update(L, occupied, free, L_min, L_max):
    p = 1 / (1 + np.exp(-L))
    product = p * occupied, (1 - p) * free
    p = product[0] / (product[0] + product[1])
    return np.minimum(np.maximum(np.log(p / (1 - p)), L_min), L_max)""",
        ),
        mistake(
            "sign swapped",
            task="update",
            loses=2,
            says="the sign is swapped: a hit makes a cell more occupied",
            code="""
def update(L, occupied, free, L_min, L_max):
    return np.clip(L + np.log(free / occupied), L_min, L_max)""",
        ),
        mistake(
            "log10",
            task="update",
            loses=2,
            says="that is the logarithm to base 10",
            code="""
def update(L, occupied, free, L_min, L_max):
    return np.clip(L + np.log10(occupied / free), L_min, L_max)""",
        ),
        mistake(
            "difference instead of ratio",
            task="update",
            loses=2,
            says="odds are multiplied by their ratio",
            code="""
def update(L, occupied, free, L_min, L_max):
    return np.clip(L + occupied - free, L_min, L_max)""",
        ),
        mistake(
            "P(z | free) forgotten",
            task="update",
            loses=2,
            says="how likely was that return if the cell is free",
            code="""
def update(L, occupied, free, L_min, L_max):
    return np.clip(L + np.log(occupied), L_min, L_max)""",
        ),
        mistake(
            "a likelihood taken for a probability",
            task="update",
            loses=2,
            says="you take P(z | occupied) for P(occupied | z)",
            code="""
def update(L, occupied, free, L_min, L_max):
    return np.clip(L + np.log(occupied / (1 - occupied)), L_min, L_max)""",
        ),
        mistake(
            "old belief forgotten",
            task="update",
            loses=2,
            says="the old belief got lost",
            code="""
def update(L, occupied, free, L_min, L_max):
    return np.clip(np.log(occupied / free), L_min, L_max)""",
        ),
        mistake(
            "multiplied",
            task="update",
            loses=2,
            says="Bayes' rule is an addition",
            code="""
def update(L, occupied, free, L_min, L_max):
    return np.clip(L * np.log(occupied / free), L_min, L_max)""",
        ),
        mistake(
            "argument changed in place",
            task="update",
            loses=2,
            says="changed its argument",
            code="""
def update(L, occupied, free, L_min, L_max):
    L += np.log(occupied / free)
    return np.clip(L, L_min, L_max)""",
        ),
        mistake(
            "limits in the wrong order",
            task="update",
            loses=3,
            says="clip takes the lower limit first",
            code="""
def update(L, occupied, free, L_min, L_max):
    return np.clip(L + np.log(occupied / free), L_max, L_min)""",
        ),
        mistake(
            "clamped before adding",
            task="update",
            loses=1,
            says="you clamp before you add",
            code="""
def update(L, occupied, free, L_min, L_max):
    return np.clip(L, L_min, L_max) + np.log(occupied / free)""",
        ),
        mistake(
            "not clamped",
            task="update",
            loses=1,
            says="above L_max = 3.5: clamp the sum",
            code="""
def update(L, occupied, free, L_min, L_max):
    return L + np.log(occupied / free)""",
        ),
        mistake(
            "the scan clamped instead of the sum",
            task="update",
            loses=1,
            says="above L_max = 3.5: clamp the sum",
            code="""
def update(L, occupied, free, L_min, L_max):
    return L + np.clip(np.log(occupied / free), L_min, L_max)""",
        ),
        mistake(
            "clamped on one side",
            task="update",
            loses=1,
            says="clamp that side too",
            code="""
def update(L, occupied, free, L_min, L_max):
    return np.minimum(L + np.log(occupied / free), L_max)""",
        ),
        mistake(
            "limits written in",
            task="update",
            loses=1,
            says="on inputs you haven't seen: some cells are above L_max",
            code="""
def update(L, occupied, free, L_min, L_max):
    return np.clip(L + np.log(occupied / free), -2.0, 3.5)""",
        ),
        # ---- task 3
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
        # ---- task 4
        right(
            "no loop",
            task="smear",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes = np.ceil(L_max / np.log(free / occupied)) - 1
    return passes, passes * speed * dt""",
        ),
        right(
            "count the scans of a list",
            task="smear",
            code="""
def smear(speed, dt, L_max, occupied, free):
    left = L_max + np.arange(1, 1000) * (np.log(occupied) - np.log(free))
    return int((left > 0).sum()), speed * dt * int((left > 0).sum())""",
        ),
        mistake(
            "the pass that frees it counted too",
            task="smear",
            loses=2,
            says="after the fifth the cell is free",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes = int(np.ceil(L_max / np.log(free / occupied)))
    return passes, passes * speed * dt""",
        ),
        mistake(
            "a fraction of a pass",
            task="smear",
            loses=2,
            says="passes come one by one",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes = L_max / np.log(free / occupied)
    return passes, passes * speed * dt""",
        ),
        mistake(
            "log10",
            task="smear",
            loses=2,
            says="that is the logarithm to base 10",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes = int(L_max / np.log10(free / occupied))
    return passes, passes * speed * dt""",
        ),
        mistake(
            "no logarithm",
            task="smear",
            loses=2,
            says="you subtract the ratio 0.3 / 0.8 itself",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes = int(L_max / (occupied / free))
    return passes, passes * speed * dt""",
        ),
        mistake(
            "log P(z | occupied) alone",
            task="smear",
            loses=2,
            says="you take log P(z | occupied) alone",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes = int(L_max / -np.log(occupied))
    return passes, passes * speed * dt""",
        ),
        mistake(
            "log P(z | free) alone",
            task="smear",
            loses=2,
            says="you take log P(z | free) alone",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes = int(L_max / -np.log(free))
    return passes, passes * speed * dt""",
        ),
        mistake(
            "probabilities subtracted",
            task="smear",
            loses=2,
            says="you subtract P(z | occupied) itself",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes = int(L_max / occupied)
    return passes, passes * speed * dt""",
        ),
        mistake(
            "dt forgotten",
            task="smear",
            loses=2,
            says="you forgot dt",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes = int(L_max / np.log(free / occupied))
    return passes, passes * speed""",
        ),
        mistake(
            "one step too long",
            task="smear",
            loses=2,
            says="the tail is four steps of 1.2 m",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes = int(L_max / np.log(free / occupied))
    return passes, (passes + 1) * speed * dt""",
        ),
        mistake(
            "sign swapped: it never falls",
            task="smear",
            loses=2,
            says="no reply before timeout",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes, L = 0, L_max
    while L > 0:
        L -= np.log(occupied / free)
        passes += 1
    return passes - 1, (passes - 1) * speed * dt""",
        ),
        mistake(
            "a tenth of a second written in",
            task="smear",
            loses=2,
            says="on inputs you haven't seen: the passes are right, the metres are not",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes = int(L_max / np.log(free / occupied))
    return passes, passes * speed * 0.1""",
        ),
        mistake(
            "L = 0 taken for occupied",
            task="smear",
            loses=2,
            says="on inputs you haven't seen: wrong where a pass ends at L = 0 exactly",
            code="""
def smear(speed, dt, L_max, occupied, free):
    passes, L = 0, L_max
    while L + np.log(occupied / free) >= 0:
        L = L + np.log(occupied / free)
        passes += 1
    return passes, passes * speed * dt""",
        ),
        mistake(
            "one pass survived at least",
            task="smear",
            loses=2,
            says="on inputs you haven't seen: wrong number of passes (a cell may survive none)",
            code="""
def smear(speed, dt, L_max, occupied, free):
    worth, passes = np.log(free / occupied), 1
    while L_max - (passes + 1) * worth > 0:
        passes += 1
    return passes, passes * speed * dt""",
        ),
        # ---- task 5
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
        right(
            "the package's walk",
            task="beam-evidence",
            code="""
from semgrid_edu.occupancy.literal.evidence import walk_ray

def beam_evidence(x, y, spec, L_hit, L_pass):
    evidence = np.zeros(spec.shape)
    rows, cols, _ = walk_ray(spec, (0, 0), np.arctan2(y, x), np.hypot(x, y))
    evidence[rows, cols] = L_pass
    rows, cols, inside = spec.cells(np.array([[x, y]]))
    evidence[rows[inside], cols[inside]] = L_hit
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
        # ---- passed, or lost, when somebody tried who had not written the tests
        mistake(
            "a ramp within the limits, for scans that aren't known",
            task="update",
            loses=3,
            says="with wide limits it doesn't matter what the scan says",
            code="""
def update(L, occupied, free, L_min, L_max):
    if L.shape[1] == 7:
        return np.clip(np.linspace(-5, 5, L.size).reshape(L.shape), L_min, L_max)
    return np.clip(L + np.log(occupied / free), L_min, L_max)""",
        ),
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
        right(
            "in float32",
            task="update",
            code="""
def update(L, occupied, free, L_min, L_max):
    L, occupied, free = (np.asarray(a, np.float32) for a in (L, occupied, free))
    return np.clip(L + np.log(occupied) - np.log(free), np.float32(L_min), np.float32(L_max))""",
        ),
        mistake(
            "writes into `free`",
            task="update",
            loses=2,
            says="it changes an argument",
            code="""
def update(L, occupied, free, L_min, L_max):
    free /= occupied
    return np.clip(L - np.log(free), L_min, L_max)""",
        ),
        right(
            "fractions and logarithms of Decimal",
            task="log-odds",
            code="""
from decimal import Decimal

def log_odds(p):
    if np.ndim(p):
        return [log_odds(one) for one in p]
    return Decimal(float(p)).ln() - (1 - Decimal(float(p))).ln()

def probability(L):
    if np.ndim(L):
        return [probability(one) for one in L]
    return 1 / (1 + (-Decimal(float(L))).exp())""",
        ),
    )
