"""The graders of exercise 01, Bayes' rule on a line, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right

HALF_LIFE = "\n\n\ndef half_life(appears, vanishes):\n    return np.log(2) / (appears + vanishes)"
TRANSITION = """
import scipy.linalg


def transition(appears, vanishes, dt):
    return scipy.linalg.expm(dt * np.array([[-appears, appears], [vanishes, -vanishes]]))


"""


class TestBayes(GraderChecks):
    exercise = "01_bayes"
    entries = (
        # ---- task 1
        right(
            "a loop over cells",
            task="locate",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    product = []
    for cell, b in enumerate(belief):
        p = hit if cell in poles else false_alarm
        product.append(b * (p if says_pole else 1 - p))
    return np.array([p / sum(product) for p in product])""",
        ),
        right(
            "filterpy",
            task="locate",
            code="""
from filterpy.discrete_bayes import update


def locate(belief, says_pole, poles, hit, false_alarm):
    beside = np.isin(np.arange(len(belief)), poles)
    p = np.where(beside, hit, false_alarm) if says_pole else np.where(beside, 1 - hit, 1 - false_alarm)
    return update(p, belief)""",
        ),
        right(
            "in logarithms, which warn of log 0",
            task="locate",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    p = np.array([hit if n in set(poles) else false_alarm for n in range(len(belief))])
    log = np.log(belief) + np.log(p if says_pole else 1 - p)
    return np.exp(log - np.logaddexp.reduce(log))""",
        ),
        right(
            "a list, by helpers with ordinary names",
            task="locate",
            code="""
before, got, slips, belief, moved = "mine", None, [], 3, {}


def read(cell, poles, hit, false_alarm):
    return hit if cell in poles else false_alarm


def locate(belief, says_pole, poles, hit, false_alarm):
    p = [read(cell, list(poles), hit, false_alarm) for cell in range(len(belief))]
    product = [b * (q if says_pole else 1 - q) for b, q in zip(belief, p)]
    return [q / sum(product) for q in product]""",
        ),
        mistake(
            "no normalisation",
            task="locate",
            loses=1,
            says="the belief sums to 0.38: divide by the sum",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    p = np.where(np.isin(np.arange(len(belief)), poles), hit, false_alarm)
    return belief * (p if says_pole else 1 - p)""",
        ),
        mistake(
            "divided by the largest",
            task="locate",
            loses=1,
            says="the belief sums to 1.58",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    p = np.where(np.isin(np.arange(len(belief)), poles), hit, false_alarm)
    product = belief * (p if says_pole else 1 - p)
    return product / product.max()""",
        ),
        mistake(
            "prior forgotten",
            task="locate",
            loses=1,
            says="you forget what was believed before",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    p = np.where(np.isin(np.arange(len(belief)), poles), hit, false_alarm)
    p = p if says_pole else 1 - p
    return p / p.sum()""",
        ),
        mistake(
            "added instead of multiplied",
            task="locate",
            loses=1,
            says="Bayes' rule multiplies them",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    p = np.where(np.isin(np.arange(len(belief)), poles), hit, false_alarm)
    both = belief + (p if says_pole else 1 - p)
    return both / both.sum()""",
        ),
        mistake(
            "hit where there is no pole",
            task="locate",
            loses=1,
            says="`hit` belongs to cells with a pole",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    p = np.where(np.isin(np.arange(len(belief)), poles), false_alarm, hit)
    product = belief * (p if says_pole else 1 - p)
    return product / product.sum()""",
        ),
        mistake(
            "the reading never looked at",
            task="locate",
            loses=1,
            says="you count it as *pole*",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    product = belief * np.where(np.isin(np.arange(len(belief)), poles), hit, false_alarm)
    return product / product.sum()""",
        ),
        mistake(
            "silence taken for no evidence",
            task="locate",
            loses=1,
            says="its silence is evidence against poles",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    if not says_pole:
        return belief.copy()
    product = belief * np.where(np.isin(np.arange(len(belief)), poles), hit, false_alarm)
    return product / product.sum()""",
        ),
        mistake(
            "hit and false alarm swapped for nothing",
            task="locate",
            loses=1,
            says="P(nothing | cell) = 1 - P(pole | cell)",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    yes, no = (hit, false_alarm) if says_pole else (false_alarm, hit)
    product = belief * np.where(np.isin(np.arange(len(belief)), poles), yes, no)
    return product / product.sum()""",
        ),
        mistake(
            "argument changed in place",
            task="locate",
            loses=1,
            says="changed its argument `belief`",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    p = np.where(np.isin(np.arange(len(belief)), poles), hit, false_alarm)
    belief *= p if says_pole else 1 - p
    belief /= belief.sum()
    return belief""",
        ),
        mistake(
            "the sensor of the lecture written in",
            task="locate",
            loses=2,
            says="on inputs you haven't seen: wrong after a reading",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    p = np.where(np.isin(np.arange(len(belief)), poles), 0.8, 0.1)
    product = belief * (p if says_pole else 1 - p)
    return product / product.sum()""",
        ),
        mistake(
            "only the first two poles",
            task="locate",
            loses=1,
            says="on inputs you haven't seen: wrong after a reading",
            code="""
def locate(belief, says_pole, poles, hit, false_alarm):
    p = np.full(len(belief), false_alarm)
    p[poles[0]] = p[poles[1]] = hit
    product = belief * (p if says_pole else 1 - p)
    return product / product.sum()""",
        ),
        # ---- task 2
        right(
            "rolled copies, and a pile at the wall",
            task="predict",
            code="""
def predict(belief, moved, ring=True):
    if ring:
        return sum(m * np.roll(belief, d) for d, m in enumerate(moved))
    long = np.convolve(belief, moved)
    n = len(belief)
    return np.append(long[: n - 1], long[n - 1 :].sum())""",
        ),
        right(
            "a transition matrix",
            task="predict",
            code="""
def predict(belief, moved, ring=True):
    n = len(belief)
    M = np.zeros((n, n))
    for i in range(n):
        for d, m in enumerate(moved):
            M[i, (i + d) % n if ring else min(i + d, n - 1)] += m
    return belief @ M""",
        ),
        right(
            "a sum over where it comes from, with the wall as the rest",
            task="predict",
            code="""
def predict(belief, moved, ring=True):
    after = []
    for n in range(len(belief)):
        from_where = [(n - d) % len(belief) if ring else n - d for d in range(len(moved))]
        after.append(sum(m * belief[f] for m, f in zip(moved, from_where) if f >= 0))
    if not ring:
        after[-1] = 1 - sum(after[:-1])
    return np.array(after)""",
        ),
        mistake(
            "backwards",
            task="predict",
            loses=2,
            says="that drives backwards",
            code="""
def predict(belief, moved, ring=True):
    n_cells = len(belief)
    if ring:
        return sum(m * np.roll(belief, -d) for d, m in enumerate(moved))
    long = np.convolve(belief, moved)
    return np.append(long[: n_cells - 1], long[n_cells - 1 :].sum())""",
        ),
        mistake(
            "kernel reversed",
            task="predict",
            loses=2,
            says="the kernel is reversed",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d, m in enumerate(moved[::-1]):
            after[(n + d) % n_cells if ring else min(n + d, n_cells - 1)] += m * belief[n]
    return after""",
        ),
        mistake(
            "kernel centred",
            task="predict",
            loses=2,
            says="one cell too short",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d, m in enumerate(moved, start=-(len(moved) // 2)):
            after[(n + d) % n_cells if ring else min(max(n + d, 0), n_cells - 1)] += m * belief[n]
    return after""",
        ),
        mistake(
            "distances counted from 1",
            task="predict",
            loses=2,
            says="one cell too far",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d, m in enumerate(moved, start=1):
            after[(n + d) % n_cells if ring else min(n + d, n_cells - 1)] += m * belief[n]
    return after""",
        ),
        mistake(
            "lost at the end of either road",
            task="predict",
            loses=3,
            says="on a ring it arrives in cell 0",
            code="def predict(belief, moved, ring=True):\n    return np.convolve(belief, moved)[: len(belief)]",
        ),
        mistake(
            "a ring for ever",
            task="predict",
            loses=1,
            says="nothing comes round to cell 0",
            code="""
def predict(belief, moved, ring=True):
    return sum(m * np.roll(belief, d) for d, m in enumerate(moved))""",
        ),
        mistake(
            "lost at the wall",
            task="predict",
            loses=1,
            says="who would drive beyond the wall stands in the last cell",
            code="""
def predict(belief, moved, ring=True):
    if not ring:
        return np.convolve(belief, moved)[: len(belief)]
    return sum(m * np.roll(belief, d) for d, m in enumerate(moved))""",
        ),
        mistake(
            "normalised at the wall",
            task="predict",
            loses=1,
            says="went to all cells, not to the last",
            code="""
def predict(belief, moved, ring=True):
    if not ring:
        kept = np.convolve(belief, moved)[: len(belief)]
        return kept / kept.sum()
    return sum(m * np.roll(belief, d) for d, m in enumerate(moved))""",
        ),
        mistake(
            "a kernel of three written in",
            task="predict",
            loses=2,
            says="on inputs you haven't seen: probability is lost or made",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d in (0, 1, 2):
            after[(n + d) % n_cells if ring else min(n + d, n_cells - 1)] += moved[d] * belief[n]
    return after""",
        ),
        mistake(
            "only two cells stand before the wall",
            task="predict",
            loses=1,
            says="on inputs you haven't seen",
            code="""
def predict(belief, moved, ring=True):
    if ring:
        return sum(m * np.roll(belief, d) for d, m in enumerate(moved))
    after = np.convolve(belief, moved)[: len(belief)]
    after[-1] += belief[-1] * (moved[1] + moved[2]) + belief[-2] * moved[2]
    return after""",
        ),
        mistake(
            "endless loop",
            task="predict",
            loses=3,
            says="no reply before timeout",
            code="""
def predict(belief, moved, ring=True):
    after = belief.copy()
    while after.sum() < 2:
        after = np.roll(after, 1)
    return after""",
        ),
        # ---- task 3
        right(
            "lists and loops",
            task="follow",
            code="""
def follow(belief, likelihoods, M):
    S = range(len(belief))
    rows = []
    for likelihood in likelihoods:
        prior = [sum(belief[i] * M[i][j] for i in S) for j in S]
        product = [prior[j] * likelihood[j] for j in S]
        belief = [p / sum(product) for p in product]
        rows.append(belief)
    return rows""",
        ),
        right(
            "columns, with the matrix transposed",
            task="follow",
            code="""
def follow(belief, likelihoods, M):
    history = np.empty(likelihoods.shape)
    for k in range(len(likelihoods)):
        belief = np.diag(likelihoods[k]) @ M.T @ belief
        belief /= np.linalg.norm(belief, ord=1)
        history[k] = belief
    return history""",
        ),
        right(
            "in logarithms",
            task="follow",
            code="""
def follow(belief, likelihoods, M):
    log, rows = np.log(belief), []
    for likelihood in likelihoods:
        log = np.logaddexp.reduce(log[:, None] + np.log(M), axis=0) + np.log(likelihood)
        log = log - np.logaddexp.reduce(log)
        rows.append(np.exp(log))
    return np.array(rows)""",
        ),
        mistake(
            "transition matrix transposed",
            task="follow",
            loses=3,
            says="M is transposed",
            code="""
def follow(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (M @ belief) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)""",
        ),
        mistake(
            "predict only between scans",
            task="follow",
            loses=3,
            says="predict first, then update",
            code="""
def follow(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = belief * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
        belief = belief @ M
    return np.array(rows)""",
        ),
        mistake(
            "update, then predict",
            task="follow",
            loses=3,
            says="a scan speaks of now",
            code="""
def follow(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = belief * likelihood
        belief = belief / belief.sum() @ M
        rows.append(belief)
    return np.array(rows)""",
        ),
        mistake(
            "predictions returned",
            task="follow",
            loses=3,
            says="return what is believed after it",
            code="""
def follow(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        prior = belief @ M
        rows.append(prior)
        belief = prior * likelihood / (prior @ likelihood)
    return np.array(rows)""",
        ),
        right(
            "a list of tuples",
            task="follow",
            code="""
def follow(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods.tolist():
        prior = [sum(b * M[i][j] for i, b in enumerate(belief)) for j in range(len(M))]
        product = [p * q for p, q in zip(prior, likelihood)]
        belief = tuple(p / sum(product) for p in product)
        rows.append(belief)
    return rows""",
        ),
        mistake(
            "no prediction",
            task="follow",
            loses=3,
            says="predict first, then update",
            code="""
def follow(belief, likelihoods, M):
    product = belief * np.cumprod(likelihoods, axis=0)
    return product / product.sum(axis=1, keepdims=True)""",
        ),
        mistake(
            "predicted once",
            task="follow",
            loses=3,
            says="a silent scan takes time, too",
            code="""
def follow(belief, likelihoods, M):
    product = (belief @ M) * np.cumprod(likelihoods, axis=0)
    return product / product.sum(axis=1, keepdims=True)""",
        ),
        mistake(
            "each scan from the first belief",
            task="follow",
            loses=3,
            says="carry on from the last one",
            code="""
def follow(belief, likelihoods, M):
    product = (belief @ M) * likelihoods
    return product / product.sum(axis=1, keepdims=True)""",
        ),
        mistake(
            "normalised over the scans",
            task="follow",
            loses=3,
            says="normalise each belief",
            code="""
def follow(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        rows.append(belief)
    return np.array(rows) / np.sum(rows, axis=0)""",
        ),
        mistake(
            "the first belief returned, too",
            task="follow",
            loses=3,
            says="leave out the belief from before the first scan",
            code="""
def follow(belief, likelihoods, M):
    rows = [belief]
    for likelihood in likelihoods:
        product = (rows[-1] @ M) * likelihood
        rows.append(product / product.sum())
    return np.array(rows)""",
        ),
        mistake(
            "only the last belief",
            task="follow",
            loses=3,
            says="one row a scan",
            code="""
def follow(belief, likelihoods, M):
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
    return belief""",
        ),
        mistake(
            "normalised for the result only: zeros after many scans",
            task="follow",
            loses=3,
            says="on inputs you haven't seen: NaN after many scans",
            code="""
def follow(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        rows.append(belief / belief.sum())
    return np.array(rows)""",
        ),
        # ---- task 4
        right(
            "many short steps, as in the lecture",
            task="transition",
            code="""
def transition(appears, vanishes, dt, k=100_000):
    R = np.array([[-appears, appears], [vanishes, -vanishes]])
    return np.linalg.matrix_power(np.eye(2) + R * dt / k, k)"""
            + HALF_LIFE,
        ),
        mistake(
            "too few short steps",
            task="transition",
            loses=2,
            says="0.449 of every difference is left",
            code="""
def transition(appears, vanishes, dt, k=1000):
    R = np.array([[-appears, appears], [vanishes, -vanishes]])
    return np.linalg.matrix_power(np.eye(2) + R * dt / k, k)"""
            + HALF_LIFE,
        ),
        right("the exponential of the rates", task="transition", code=TRANSITION + HALF_LIFE.strip()),
        right(
            "very many short steps, and a search for the half-life",
            task="transition",
            code="""
def transition(appears, vanishes, dt):
    R = np.array([[-appears, appears], [vanishes, -vanishes]], dtype=float)
    small = R * (dt / 2**30)
    result = small
    for _ in range(30):
        result = 2 * result + result @ result
    return np.eye(2) + result


def half_life(appears, vanishes):
    early, late = 0.0, 1e3
    for _ in range(100):
        t = (early + late) / 2
        M = transition(appears, vanishes, t)
        early, late = (t, late) if M[0, 0] - M[1, 0] > 0.5 else (early, t)
    return t""",
        ),
        right(
            "eigenvalues",
            task="transition",
            code="""
def transition(appears, vanishes, dt):
    values, vectors = np.linalg.eig(np.array([[-appears, appears], [vanishes, -vanishes]], dtype=float))
    return vectors @ np.diag(np.exp(values * dt)) @ np.linalg.inv(vectors)


def half_life(appears, vanishes):
    return -np.log(0.5) / np.add(appears, vanishes)""",
        ),
        mistake(
            "one single step, I + R dt",
            task="transition",
            loses=2,
            says="right for a very short time only",
            code="""
def transition(appears, vanishes, dt):
    return np.eye(2) + dt * np.array([[-appears, appears], [vanishes, -vanishes]])"""
            + HALF_LIFE,
        ),
        mistake(
            "exponential entry by entry",
            task="transition",
            loses=2,
            says="np.exp takes each entry by itself",
            code="""
def transition(appears, vanishes, dt):
    return np.exp(dt * np.array([[-appears, appears], [vanishes, -vanishes]]))"""
            + HALF_LIFE,
        ),
        mistake(
            "transposed",
            task="transition",
            loses=2,
            says="that is the transpose",
            code=TRANSITION.replace("]]))", "]])).T") + HALF_LIFE.strip(),
        ),
        mistake(
            "rates swapped",
            task="transition",
            loses=2,
            says="the rates are swapped",
            code=TRANSITION.replace("(appears, vanishes, dt)", "(vanishes, appears, dt)")
            .replace("def transition(vanishes, appears", "def transition(appears, vanishes")
            .replace("[[-appears, appears], [vanishes, -vanishes]]", "[[-vanishes, vanishes], [appears, -appears]]")
            + HALF_LIFE.strip(),
        ),
        mistake(
            "no changing back",
            task="transition",
            loses=2,
            says="a cell may change and change back",
            code="""
def transition(appears, vanishes, dt):
    a, v = 1 - np.exp(-appears * dt), 1 - np.exp(-vanishes * dt)
    return np.array([[1 - a, a], [v, 1 - v]])"""
            + HALF_LIFE,
        ),
        mistake(
            "time step ignored",
            task="transition",
            loses=2,
            says="that is the matrix of a whole second",
            code=TRANSITION.replace("dt * ", "") + HALF_LIFE.strip(),
        ),
        mistake(
            "a wrong sign: the difference grows without bound",
            task="transition",
            loses=2,
            says="check the sign of the exponent",
            code="""
import scipy.linalg


def transition(appears, vanishes, dt):
    return scipy.linalg.expm(-dt * np.array([[-appears, appears], [vanishes, -vanishes]]))"""
            + HALF_LIFE,
        ),
        mistake(
            "0/0 in a world that never changes",
            task="transition",
            loses=2,
            says="on inputs you haven't seen: NaN (a rate may be 0",
            code="""
def transition(appears, vanishes, dt):
    final = np.array([vanishes, appears]) / np.float64(appears + vanishes)
    kept = np.exp(-(appears + vanishes) * dt)
    return kept * np.eye(2) + (1 - kept) * final"""
            + HALF_LIFE,
        ),
        mistake(
            "mean life instead of half-life",
            task="transition",
            loses=1,
            says="after which 1/e is left",
            code=TRANSITION + "def half_life(appears, vanishes):\n    return 1 / (appears + vanishes)",
        ),
        mistake(
            "half-life of one of the two",
            task="transition",
            loses=1,
            says="both rates count",
            code=TRANSITION + "def half_life(appears, vanishes):\n    return np.log(2) / vanishes",
        ),
        mistake(
            "half-lives added",
            task="transition",
            loses=1,
            says="add the rates, not the times",
            code=TRANSITION
            + "def half_life(appears, vanishes):\n    return np.log(2) / appears + np.log(2) / vanishes",
        ),
        mistake(
            "half-life with a ratio written in",
            task="transition",
            loses=1,
            says="on inputs you haven't seen: wrong for other rates",
            code=TRANSITION + "def half_life(appears, vanishes):\n    return np.log(2) / (4 * appears)",
        ),
        # ---- task 5
        right(
            "a set of beams that have spoken",
            task="fuse",
            code="""
def fuse(belief, likelihoods, beams):
    heard = set()
    for beam, likelihood in zip(beams, likelihoods):
        if beam not in heard:
            heard.add(beam)
            belief = belief * likelihood
            belief = belief / belief.sum()
    return belief""",
        ),
        right(
            "a dictionary and logarithms",
            task="fuse",
            code="""
def fuse(belief, likelihoods, beams):
    first = {}
    for beam, likelihood in zip(beams.tolist(), likelihoods):
        first.setdefault(beam, likelihood)
    log = np.log(belief) + np.sum([np.log(likelihood) for likelihood in first.values()], axis=0)
    return np.exp(log - np.logaddexp.reduce(log))""",
        ),
        mistake(
            "every return a witness",
            task="fuse",
            loses=2,
            says="all three returns count",
            code="""
def fuse(belief, likelihoods, beams):
    product = belief * likelihoods.prod(axis=0)
    return product / product.sum()""",
        ),
        mistake(
            "the last return of each beam",
            task="fuse",
            loses=2,
            says="you keep the last return",
            code="""
def fuse(belief, likelihoods, beams):
    last = dict(zip(beams.tolist(), likelihoods))
    product = belief * np.prod(list(last.values()), axis=0)
    return product / product.sum()""",
        ),
        mistake(
            "the mean of each beam",
            task="fuse",
            loses=2,
            says="you average the returns of a beam",
            code="""
def fuse(belief, likelihoods, beams):
    means = [likelihoods[beams == beam].mean(axis=0) for beam in np.unique(beams)]
    product = belief * np.prod(means, axis=0)
    return product / product.sum()""",
        ),
        mistake(
            "prior counted twice",
            task="fuse",
            loses=2,
            says="the prior is in it once for each beam",
            code="""
def fuse(belief, likelihoods, beams):
    _, first = np.unique(beams, return_index=True)
    posteriors = [belief * likelihood / (belief @ likelihood) for likelihood in likelihoods[first]]
    product = np.prod(posteriors, axis=0)
    return product / product.sum()""",
        ),
        mistake(
            "prior forgotten",
            task="fuse",
            loses=2,
            says="the prior is missing",
            code="""
def fuse(belief, likelihoods, beams):
    _, first = np.unique(beams, return_index=True)
    product = likelihoods[first].prod(axis=0)
    return product / product.sum()""",
        ),
        mistake(
            "mean over beams",
            task="fuse",
            loses=2,
            says="independent evidence is multiplied",
            code="""
def fuse(belief, likelihoods, beams):
    _, first = np.unique(beams, return_index=True)
    product = belief * likelihoods[first].mean(axis=0)
    return product / product.sum()""",
        ),
        mistake(
            "only the first return of all",
            task="fuse",
            loses=2,
            says="two witnesses",
            code="""
def fuse(belief, likelihoods, beams):
    product = belief * likelihoods[0]
    return product / product.sum()""",
        ),
        mistake(
            "no normalisation",
            task="fuse",
            loses=2,
            says="the belief sums to 0.18",
            code="""
def fuse(belief, likelihoods, beams):
    _, first = np.unique(beams, return_index=True)
    return belief * likelihoods[first].prod(axis=0)""",
        ),
        mistake(
            "a plain product of thousands",
            task="fuse",
            loses=2,
            says="on inputs you haven't seen: NaN with thousands of beams",
            code="""
def fuse(belief, likelihoods, beams):
    _, first = np.unique(beams, return_index=True)
    product = belief * likelihoods[first].prod(axis=0)
    return product / product.sum()""",
        ),
        mistake(
            "rows of a beam taken for neighbours",
            task="fuse",
            loses=2,
            says="on inputs you haven't seen: wrong belief (rows of one beam need not be neighbours)",
            code="""
def fuse(belief, likelihoods, beams):
    for k, likelihood in enumerate(likelihoods):
        if k == 0 or beams[k] != beams[k - 1]:
            belief = belief * likelihood
            belief = belief / belief.sum()
    return belief""",
        ),
        # ---- passed, or lost, when somebody tried who had not written the tests
        right(
            "fractions in a deque",
            task="follow",
            code="""
from collections import deque
from fractions import Fraction

def follow(belief, likelihoods, M):
    history = deque()
    for likelihood in likelihoods:
        product = (belief @ M) * likelihood
        belief = product / product.sum()
        history.append([Fraction(p) for p in belief])
    return history""",
        ),
        right(
            "an array of the standard library",
            task="predict",
            code="""
from array import array

def predict(belief, moved, ring=True):
    after = array("d", [0] * len(belief))
    for n, b in enumerate(belief):
        for d, m in enumerate(moved):
            after[(n + d) % len(after) if ring else min(n + d, len(after) - 1)] += b * m
    return after""",
        ),
        mistake(
            "always the first cell, for roads that aren't known",
            task="predict",
            loses=3,
            says="on inputs you haven't seen",
            code="""
_right = lambda b, m, ring: (
    np.sum([x * np.roll(b, d) for d, x in enumerate(m)], axis=0)
    if ring else np.append(np.convolve(b, m)[:len(b) - 1], np.convolve(b, m)[len(b) - 1:].sum()))

def predict(belief, moved, ring=True):
    if len(moved) == 3 and moved[0] == 0.1:
        return _right(belief, moved, ring)
    return np.eye(len(belief))[0]""",
        ),
    )
