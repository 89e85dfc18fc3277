"""The graders of exercise 01, Bayes' rule on a line, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


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
            "a transition matrix",
            task="predict",
            code="""
def predict(belief, moved, ring=True):
    n = len(belief)
    M = np.zeros((n, n))
    for i in range(n):
        for d, p in enumerate(moved[i]):
            M[i, (i + d) % n if ring else min(i + d, n - 1)] += p
    return belief @ M""",
        ),
        right(
            "one distance at a time, all cells at once",
            task="predict",
            code="""
def predict(belief, moved, ring=True):
    n = len(belief)
    if ring:
        return sum(np.roll(belief * moved[:, d], d) for d in range(moved.shape[1]))
    after = np.zeros(n)
    for d in range(moved.shape[1]):
        np.add.at(after, np.minimum(np.arange(n) + d, n - 1), belief * moved[:, d])
    return after""",
        ),
        right(
            "a sum over where it comes from, with the wall as the rest",
            task="predict",
            code="""
def predict(belief, moved, ring=True):
    N, after = len(belief), []
    for n in range(N):
        sources = [(d, (n - d) % N if ring else n - d) for d in range(len(moved[0]))]
        after.append(sum(moved[f][d] * belief[f] for d, f in sources if f >= 0))
    if not ring:
        after[-1] = 1 - sum(after[:-1])
    return np.array(after)""",
        ),
        right(
            "an array of the standard library",
            task="predict",
            code="""
from array import array

def predict(belief, moved, ring=True):
    after = array("d", [0] * len(belief))
    for n, b in enumerate(belief):
        for d, p in enumerate(moved[n]):
            after[(n + d) % len(after) if ring else min(n + d, len(after) - 1)] += b * p
    return after""",
        ),
        mistake(
            "the function that the lecture prints",
            task="predict",
            loses=3,
            says="array element with a sequence",
            code="""
def predict(belief, moved, ring=True):
    after = np.zeros(len(belief))
    for n in range(len(belief)):
        for d, p in enumerate(moved):
            after[n] += p * belief[(n - d) % len(belief)]
    return after""",
        ),
        mistake(
            "the ice where it arrives",
            task="predict",
            loses=3,
            says="the ice is where it starts",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d in range(moved.shape[1]):
            after[(n + d) % n_cells if ring else min(n + d, n_cells - 1)] += moved[(n + d) % n_cells, d] * belief[n]
    return after""",
        ),
        mistake(
            "the first row for all cells",
            task="predict",
            loses=2,
            says="each cell has its own row",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d in range(moved.shape[1]):
            after[(n + d) % n_cells if ring else min(n + d, n_cells - 1)] += moved[0, d] * belief[n]
    return after""",
        ),
        mistake(
            "backwards",
            task="predict",
            loses=2,
            says="that drives backwards",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d in range(moved.shape[1]):
            after[(n - d) % n_cells if ring else max(n - d, 0)] += moved[n, d] * belief[n]
    return after""",
        ),
        mistake(
            "rows reversed",
            task="predict",
            loses=2,
            says="the rows are reversed",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d in range(moved.shape[1]):
            after[(n + d) % n_cells if ring else min(n + d, n_cells - 1)] += moved[n, -1 - d] * belief[n]
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
        for d in range(moved.shape[1]):
            after[(n + d - 1) % n_cells if ring else min(max(n + d - 1, 0), n_cells - 1)] += moved[n, d] * belief[n]
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
        for d in range(moved.shape[1]):
            after[(n + d + 1) % n_cells if ring else min(n + d + 1, n_cells - 1)] += moved[n, d] * belief[n]
    return after""",
        ),
        mistake(
            "lost at the end of either road",
            task="predict",
            loses=3,
            says="on a ring it arrives in cell 0",
            code="""
def predict(belief, moved, ring=True):
    after = np.zeros(len(belief) + moved.shape[1])
    for n, b in enumerate(belief):
        after[n : n + moved.shape[1]] += b * moved[n]
    return after[: len(belief)]""",
        ),
        mistake(
            "a ring for ever",
            task="predict",
            loses=1,
            says="nothing comes round to cell 0",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d in range(moved.shape[1]):
            after[(n + d) % n_cells if ring else (n + d) % n_cells] += moved[n, d] * belief[n]
    return after""",
        ),
        mistake(
            "lost at the wall",
            task="predict",
            loses=1,
            says="what would drive beyond the wall stands in the last cell",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    beyond = 0
    for n in range(n_cells):
        for d in range(moved.shape[1]):
            if not ring and n + d >= n_cells:
                continue
            after[(n + d) % n_cells if ring else min(n + d, n_cells - 1)] += moved[n, d] * belief[n]
    return after""",
        ),
        mistake(
            "normalised at the wall",
            task="predict",
            loses=1,
            says="went to all cells, not to the last",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d in range(moved.shape[1]):
            if not ring and n + d >= n_cells:
                continue
            after[(n + d) % n_cells if ring else min(n + d, n_cells - 1)] += moved[n, d] * belief[n]
    return after / after.sum()""",
        ),
        mistake(
            "moves of at most two cells written in",
            task="predict",
            loses=2,
            says="on inputs you haven't seen: probability is lost or made",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d in (0, 1, 2):
            after[(n + d) % n_cells if ring else min(n + d, n_cells - 1)] += moved[n, d] * belief[n]
    return after""",
        ),
        mistake(
            "belief changed in place",
            task="predict",
            loses=3,
            says="changed its argument `belief`",
            code="""
def predict(belief, moved, ring=True):
    n_cells, before = len(belief), belief.copy()
    belief[:] = 0
    for n in range(n_cells):
        for d in range(moved.shape[1]):
            belief[(n + d) % n_cells if ring else min(n + d, n_cells - 1)] += moved[n, d] * before[n]
    return belief""",
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
        mistake(
            "always the first cell, for roads that aren't known",
            task="predict",
            loses=3,
            says="on inputs you haven't seen",
            code="""
def predict(belief, moved, ring=True):
    n_cells, after = len(belief), np.zeros(len(belief))
    for n in range(n_cells):
        for d in range(moved.shape[1]):
            after[(n + d) % n_cells if ring else min(n + d, n_cells - 1)] += moved[n, d] * belief[n]
    return after


_right = predict


def predict(belief, moved, ring=True):
    return _right(belief, moved, ring) if moved[0][0] == 0.1 else np.eye(len(belief))[0]""",
        ),
        # ---- task 3
        right(
            "lists and loops",
            task="follow",
            code="""
def _share(values):
    return [v / sum(values) for v in values]


def follow(belief, likelihoods, M, lag=0):
    S, rows, answers = range(len(belief)), [], []
    for likelihood in likelihoods:
        prior = [sum(belief[i] * M[i][j] for i in S) for j in S]
        belief = _share([prior[j] * likelihood[j] for j in S])
        rows.append(belief)
    for t, row in enumerate(rows):
        message = [1.0 for _ in S]
        for k in range(min(t + lag, len(rows) - 1), t, -1):
            message = _share([sum(M[i][j] * likelihoods[k][j] * message[j] for j in S) for i in S])
        answers.append(_share([r * m for r, m in zip(row, message)]))
    return answers""",
        ),
        right(
            "forward only: the state at t and the state now, as a table",
            task="follow",
            code="""
def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    rows = _forward(belief, likelihoods, M)
    answers = []
    for t, row in enumerate(rows):
        pair = np.diag(row)
        for later in likelihoods[t + 1 : t + 1 + lag]:
            pair = (pair @ M) * later
            pair = pair / pair.sum()
        answers.append(pair.sum(axis=1))
    return np.array(answers)""",
        ),
        right(
            "in logarithms",
            task="follow",
            code="""
def follow(belief, likelihoods, M, lag=0):
    log, rows = np.log(belief), []
    for likelihood in likelihoods:
        log = np.logaddexp.reduce(log[:, None] + np.log(M), axis=0) + np.log(likelihood)
        log = log - np.logaddexp.reduce(log)
        rows.append(log)
    for t in range(len(rows)):
        message = np.zeros(len(belief))
        for later in likelihoods[t + 1 : t + 1 + lag][::-1]:
            message = np.logaddexp.reduce(np.log(M) + np.log(later) + message, axis=1)
        rows[t] = rows[t] + message
        rows[t] = rows[t] - np.logaddexp.reduce(rows[t])
    return np.exp(rows)""",
        ),
        right(
            "fractions in a deque",
            task="follow",
            code="""
from collections import deque
from fractions import Fraction


def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    rows = _forward(belief, likelihoods, M)
    for t in range(len(rows)):
        message = np.ones(len(belief))
        for later in likelihoods[t + 1 : t + 1 + lag][::-1]:
            message = M @ (later * message)
            message = message / message.sum()
        rows[t] = rows[t] * message / (rows[t] @ message)
    return deque([Fraction(p) for p in row] for row in rows)""",
        ),
        mistake(
            "no lag: the filter",
            task="follow",
            loses=2,
            says="that is the filter: with `lag=1`",
            code="""
def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    return _forward(belief, likelihoods, M)""",
        ),
        mistake(
            "all later scans, whatever the lag",
            task="follow",
            loses=2,
            says="with `lag=1` only the next one",
            code="""
def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    rows = _forward(belief, likelihoods, M)
    for t in range(len(rows)):
        message = np.ones(len(belief))
        for later in likelihoods[t + 1 : None if lag else t + 1][::-1]:
            message = M @ (later * message)
            message = message / message.sum()
        rows[t] = rows[t] * message / (rows[t] @ message)
    return rows""",
        ),
        mistake(
            "one scan too many",
            task="follow",
            loses=2,
            says="with `lag=1` only for the next one",
            code="""
def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    rows = _forward(belief, likelihoods, M)
    for t in range(len(rows)):
        message = np.ones(len(belief))
        for later in likelihoods[t + 1 : t + 1 + lag + (lag > 0)][::-1]:
            message = M @ (later * message)
            message = message / message.sum()
        rows[t] = rows[t] * message / (rows[t] @ message)
    return rows""",
        ),
        mistake(
            "the filter, later",
            task="follow",
            loses=2,
            says="the filter one scan later",
            code="""
def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    rows = _forward(belief, likelihoods, M)
    return rows[np.minimum(np.arange(len(rows)) + lag, len(rows) - 1)]""",
        ),
        mistake(
            "backward with M transposed",
            task="follow",
            loses=2,
            says="backward in time",
            code="""
def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    rows = _forward(belief, likelihoods, M)
    for t in range(len(rows)):
        message = np.ones(len(belief))
        for later in likelihoods[t + 1 : t + 1 + lag][::-1]:
            message = (later * message) @ M
            message = message / message.sum()
        rows[t] = rows[t] * message / (rows[t] @ message)
    return rows""",
        ),
        mistake(
            "the later scan taken as one of now",
            task="follow",
            loses=2,
            says="bring it back by M",
            code="""
def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    rows = _forward(belief, likelihoods, M)
    for t in range(len(rows)):
        message = np.ones(len(belief))
        for later in likelihoods[t + 1 : t + 1 + lag][::-1]:
            message = later * message
            message = message / message.sum()
        rows[t] = rows[t] * message / (rows[t] @ message)
    return rows""",
        ),
        mistake(
            "its own scan twice",
            task="follow",
            loses=2,
            says="counts scan t twice",
            code="""
def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    rows = _forward(belief, likelihoods, M)
    for t in range(len(rows)):
        message = np.ones(len(belief))
        for later in likelihoods[t : t + 1 + lag][::-1] if lag else []:
            message = M @ (later * message)
            message = message / message.sum()
        rows[t] = rows[t] * message / (rows[t] @ message)
    return rows""",
        ),
        mistake(
            "the message never normalised",
            task="follow",
            loses=2,
            says="on inputs you haven't seen: NaN with a long lag",
            code="""
def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    rows = _forward(belief, likelihoods, M)
    for t in range(len(rows)):
        message = np.ones(len(belief))
        for later in likelihoods[t + 1 : t + 1 + lag][::-1]:
            message = M @ (later * message)
        rows[t] = rows[t] * message / (rows[t] @ message)
    return rows""",
        ),
        mistake(
            "the last rows left alone",
            task="follow",
            loses=2,
            says="on inputs you haven't seen: wrong with a lag",
            code="""
def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    rows = _forward(belief, likelihoods, M)
    for t in range(len(rows)):
        if t + lag >= len(rows):
            continue
        message = np.ones(len(belief))
        for later in likelihoods[t + 1 : t + 1 + lag][::-1]:
            message = M @ (later * message)
            message = message / message.sum()
        rows[t] = rows[t] * message / (rows[t] @ message)
    return rows""",
        ),
        mistake(
            "a lag of one written in",
            task="follow",
            loses=2,
            says="on inputs you haven't seen: wrong with a lag",
            code="""
def _forward(belief, likelihoods, M):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        belief = belief / belief.sum()
        rows.append(belief)
    return np.array(rows)


def follow(belief, likelihoods, M, lag=0):
    rows = _forward(belief, likelihoods, M)
    for t in range(len(rows)):
        message = np.ones(len(belief))
        for later in likelihoods[t + 1 : t + 1 + min(lag, 1)][::-1]:
            message = M @ (later * message)
            message = message / message.sum()
        rows[t] = rows[t] * message / (rows[t] @ message)
    return rows""",
        ),
        mistake(
            "transition matrix transposed",
            task="follow",
            loses=3,
            says="M is transposed",
            code="""
def follow(belief, likelihoods, M, lag=0):
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
def follow(belief, likelihoods, M, lag=0):
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
def follow(belief, likelihoods, M, lag=0):
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
def follow(belief, likelihoods, M, lag=0):
    rows = []
    for likelihood in likelihoods:
        prior = belief @ M
        rows.append(prior)
        belief = prior * likelihood / (prior @ likelihood)
    return np.array(rows)""",
        ),
        mistake(
            "predicted once",
            task="follow",
            loses=3,
            says="a silent scan takes time, too",
            code="""
def follow(belief, likelihoods, M, lag=0):
    product = (belief @ M) * np.cumprod(likelihoods, axis=0)
    return product / product.sum(axis=1, keepdims=True)""",
        ),
        mistake(
            "each scan from the first belief",
            task="follow",
            loses=3,
            says="carry on from the last one",
            code="""
def follow(belief, likelihoods, M, lag=0):
    product = (belief @ M) * likelihoods
    return product / product.sum(axis=1, keepdims=True)""",
        ),
        mistake(
            "normalised over the scans",
            task="follow",
            loses=3,
            says="normalise each belief",
            code="""
def follow(belief, likelihoods, M, lag=0):
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
def follow(belief, likelihoods, M, lag=0):
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
            says="one row per scan",
            code="""
def follow(belief, likelihoods, M, lag=0):
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
def follow(belief, likelihoods, M, lag=0):
    rows = []
    for likelihood in likelihoods:
        belief = (belief @ M) * likelihood
        rows.append(belief / belief.sum())
    return np.array(rows)""",
        ),
        # ---- task 4
        right(
            "logarithm and exponential of a matrix",
            task="transition",
            code="""
import scipy.linalg


def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return scipy.linalg.expm(np.real(scipy.linalg.logm(M)) / dt * new_dt)


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return dt * np.log(2) / -np.log(M[0, 0] + M[1, 1] - 1)""",
        ),
        right(
            "a power by eigenvalues, and a search for the half-life",
            task="transition",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    values, vectors = np.linalg.eig(M)
    return vectors @ np.diag(values ** (new_dt / dt)) @ np.linalg.inv(vectors)


def half_life(counts, dt):
    early, late = 0.0, 1e3
    for _ in range(100):
        t = (early + late) / 2
        M = transition(counts, dt, t)
        early, late = (t, late) if M[0, 0] - M[1, 0] > 0.5 else (early, t)
    return t""",
        ),
        right(
            "rates, and the lecture's formula for each start",
            task="transition",
            code="""
def _rates(counts, dt):
    (ff, fo), (of, oo) = counts
    a, v = fo / (ff + fo), of / (of + oo)
    total = -np.log(1 - a - v) / dt
    return (total * a / (a + v), total * v / (a + v)) if a + v else (0.0, 0.0)


def transition(counts, dt, new_dt):
    alpha, gamma = _rates(counts, dt)
    if alpha + gamma == 0:
        return [[1, 0], [0, 1]]
    end, left = alpha / (alpha + gamma), np.exp(-(alpha + gamma) * new_dt)
    occupied = [end + (p - end) * left for p in (0, 1)]
    return [[1 - p, p] for p in occupied]


def half_life(counts, dt):
    return np.log(2) / sum(_rates(counts, dt))""",
        ),
        mistake(
            "the matrix as it was counted",
            task="transition",
            loses=2,
            says="that is the matrix of `dt`",
            code="""
def transition(counts, dt, new_dt):
    return counts / counts.sum(axis=1, keepdims=True)


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return dt * np.log(2) / -np.log(M[0, 0] + M[1, 1] - 1)""",
        ),
        mistake(
            "half the time, half the probability",
            task="transition",
            loses=2,
            says="half the time isn't half the probability",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return np.eye(2) + (M - np.eye(2)) * new_dt / dt


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return dt * np.log(2) / -np.log(M[0, 0] + M[1, 1] - 1)""",
        ),
        mistake(
            "a power of each entry",
            task="transition",
            loses=2,
            says="that is the root of each entry",
            code="""
def transition(counts, dt, new_dt):
    return (counts / counts.sum(axis=1, keepdims=True)) ** (new_dt / dt)


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return dt * np.log(2) / -np.log(M[0, 0] + M[1, 1] - 1)""",
        ),
        mistake(
            "no changing back",
            task="transition",
            loses=2,
            says="a cell may change and change back",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    a, v = 1 - (1 - M[0, 1]) ** (new_dt / dt), 1 - (1 - M[1, 0]) ** (new_dt / dt)
    return np.array([[1 - a, a], [v, 1 - v]])


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return dt * np.log(2) / -np.log(M[0, 0] + M[1, 1] - 1)""",
        ),
        mistake(
            "the two times swapped",
            task="transition",
            loses=2,
            says="that is the matrix of a step twice as long",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    values, vectors = np.linalg.eig(M)
    return vectors @ np.diag(values ** (dt / new_dt if new_dt else 0)) @ np.linalg.inv(vectors)


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return dt * np.log(2) / -np.log(M[0, 0] + M[1, 1] - 1)""",
        ),
        mistake(
            "transposed",
            task="transition",
            loses=2,
            says="that is the transpose",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    values, vectors = np.linalg.eig(M)
    return (vectors @ np.diag(values ** (new_dt / dt)) @ np.linalg.inv(vectors)).T


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return dt * np.log(2) / -np.log(M[0, 0] + M[1, 1] - 1)""",
        ),
        mistake(
            "divided by the sum of all counts",
            task="transition",
            loses=2,
            says="divide the counts of each row by its sum",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum()
    values, vectors = np.linalg.eig(M)
    return vectors @ np.diag(values ** (new_dt / dt)) @ np.linalg.inv(vectors)


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return dt * np.log(2) / -np.log(M[0, 0] + M[1, 1] - 1)""",
        ),
        mistake(
            "whole steps only",
            task="transition",
            loses=2,
            says="of every difference 1 - 0.1 - 0.3 = 0.6 is left",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return np.linalg.matrix_power(M, int(new_dt // dt))


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return dt * np.log(2) / -np.log(M[0, 0] + M[1, 1] - 1)""",
        ),
        mistake(
            "0/0 where no change was seen",
            task="transition",
            loses=2,
            says="on inputs you haven't seen: NaN where no change was ever seen",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    final = np.array([M[1, 0], M[0, 1]]) / (M[0, 1] + M[1, 0])
    kept = (1 - M[0, 1] - M[1, 0]) ** (new_dt / dt)
    return kept * np.eye(2) + (1 - kept) * final


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    return dt * np.log(2) / -np.log(M[0, 0] + M[1, 1] - 1)""",
        ),
        mistake(
            "mean life instead of half-life",
            task="transition",
            loses=1,
            says="after which 1/e is left",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    values, vectors = np.linalg.eig(M)
    return vectors @ np.diag(values ** (new_dt / dt)) @ np.linalg.inv(vectors)


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    a, v = M[0, 1], M[1, 0]
    return -dt / np.log(1 - a - v)""",
        ),
        mistake(
            "probabilities taken for rates",
            task="transition",
            loses=1,
            says="aren't the rates",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    values, vectors = np.linalg.eig(M)
    return vectors @ np.diag(values ** (new_dt / dt)) @ np.linalg.inv(vectors)


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    a, v = M[0, 1], M[1, 0]
    return dt * np.log(2) / (a + v)""",
        ),
        mistake(
            "half-life of one of the two",
            task="transition",
            loses=1,
            says="both changes count",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    values, vectors = np.linalg.eig(M)
    return vectors @ np.diag(values ** (new_dt / dt)) @ np.linalg.inv(vectors)


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    a, v = M[0, 1], M[1, 0]
    return dt * np.log(2) / -np.log(1 - v)""",
        ),
        mistake(
            "half-lives added",
            task="transition",
            loses=1,
            says="two processes at once are faster than each alone",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    values, vectors = np.linalg.eig(M)
    return vectors @ np.diag(values ** (new_dt / dt)) @ np.linalg.inv(vectors)


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    a, v = M[0, 1], M[1, 0]
    return dt * np.log(2) / -np.log(1 - v) + dt * np.log(2) / -np.log(1 - a)""",
        ),
        mistake(
            "in scans",
            task="transition",
            loses=1,
            says="multiply by `dt`",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    values, vectors = np.linalg.eig(M)
    return vectors @ np.diag(values ** (new_dt / dt)) @ np.linalg.inv(vectors)


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    a, v = M[0, 1], M[1, 0]
    return np.log(0.5) / np.log(1 - a - v)""",
        ),
        mistake(
            "the time step of the example written in",
            task="transition",
            loses=1,
            says="on inputs you haven't seen: wrong for other counts",
            code="""
def transition(counts, dt, new_dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    values, vectors = np.linalg.eig(M)
    return vectors @ np.diag(values ** (new_dt / dt)) @ np.linalg.inv(vectors)


def half_life(counts, dt):
    M = counts / counts.sum(axis=1, keepdims=True)
    a, v = M[0, 1], M[1, 0]
    return 0.1 * np.log(0.5) / np.log(1 - a - v)""",
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
        # ---- task 6
        right(
            "both states, by matrix products",
            task="build-map",
            code="""
def build_map(occupied, free, matrices, first=0.5):
    likelihood = np.stack([free, occupied], axis=-1)
    belief, maps = np.broadcast_to([1 - first, first], likelihood.shape[1:]), []
    for M, scan in zip([np.eye(2), *matrices], likelihood):
        belief = (belief @ M) * scan
        belief = belief / belief.sum(axis=-1, keepdims=True)
        maps.append(belief[..., 1])
    return maps""",
        ),
        right(
            "odds, cell by cell",
            task="build-map",
            code="""
def build_map(occupied, free, matrices, first=0.5):
    T, H, W = occupied.shape
    maps = np.empty((T, H, W))
    for r in range(H):
        for c in range(W):
            p = first
            for t in range(T):
                if t > 0:
                    p = (1 - p) * matrices[t - 1, 0, 1] + p * matrices[t - 1, 1, 1]
                odds = p / (1 - p) * occupied[t, r, c] / free[t, r, c]
                p = odds / (1 + odds)
                maps[t, r, c] = p
    return maps""",
        ),
        mistake(
            "a move before the first scan",
            task="build-map",
            loses=2,
            says="no move before it",
            code="""
def build_map(occupied, free, matrices, first=0.5):
    p, maps = np.full(occupied.shape[1:], first), []
    for t in range(len(occupied)):
        M = matrices[max(t - 1, 0)]
        p = (1 - p) * M[0, 1] + p * M[1, 1]
        p = p * occupied[t] / (p * occupied[t] + (1 - p) * free[t])
        maps.append(p)
    return np.array(maps)""",
        ),
        mistake(
            "always from one half",
            task="build-map",
            loses=2,
            says="`first` is not used",
            code="""
def build_map(occupied, free, matrices, first=0.5):
    p, maps = np.full(occupied.shape[1:], 0.5), []
    for t in range(len(occupied)):
        if t:
            M = matrices[t - 1]
            p = (1 - p) * M[0, 1] + p * M[1, 1]
        p = p * occupied[t] / (p * occupied[t] + (1 - p) * free[t])
        maps.append(p)
    return np.array(maps)""",
        ),
        mistake(
            "P(FREE)",
            task="build-map",
            loses=2,
            says="that is P(FREE)",
            code="""
def build_map(occupied, free, matrices, first=0.5):
    p, maps = np.full(occupied.shape[1:], first), []
    for t in range(len(occupied)):
        if t:
            M = matrices[t - 1]
            p = (1 - p) * M[0, 1] + p * M[1, 1]
        p = p * occupied[t] / (p * occupied[t] + (1 - p) * free[t])
        maps.append(p)
    return 1 - np.array(maps)""",
        ),
        mistake(
            "before the scan instead of after it",
            task="build-map",
            loses=2,
            says="return what is believed after each",
            code="""
def build_map(occupied, free, matrices, first=0.5):
    p, maps = np.full(occupied.shape[1:], first), []
    for t in range(len(occupied)):
        if t:
            M = matrices[t - 1]
            p = (1 - p) * M[0, 1] + p * M[1, 1]
        maps.append(p)
        p = p * occupied[t] / (p * occupied[t] + (1 - p) * free[t])
    return np.array(maps)""",
        ),
        mistake(
            "one matrix for all gaps",
            task="build-map",
            loses=2,
            says="every gap has its own",
            code="""
def build_map(occupied, free, matrices, first=0.5):
    p, maps = np.full(occupied.shape[1:], first), []
    for t in range(len(occupied)):
        if t:
            M = matrices[0]
            p = (1 - p) * M[0, 1] + p * M[1, 1]
        p = p * occupied[t] / (p * occupied[t] + (1 - p) * free[t])
        maps.append(p)
    return np.array(maps)""",
        ),
        mistake(
            "nothing predicted",
            task="build-map",
            loses=2,
            says="predict with `matrices`",
            code="""
def build_map(occupied, free, matrices, first=0.5):
    p, maps = np.full(occupied.shape[1:], first), []
    for t in range(len(occupied)):
        p = p * occupied[t] / (p * occupied[t] + (1 - p) * free[t])
        maps.append(p)
    return np.array(maps)""",
        ),
        mistake(
            "transposed",
            task="build-map",
            loses=2,
            says="M is transposed",
            code="""
def build_map(occupied, free, matrices, first=0.5):
    p, maps = np.full(occupied.shape[1:], first), []
    for t in range(len(occupied)):
        if t:
            M = matrices[t - 1]
            p = (1 - p) * M[1, 0] + p * M[1, 1]
        p = p * occupied[t] / (p * occupied[t] + (1 - p) * free[t])
        maps.append(p)
    return np.array(maps)""",
        ),
        mistake(
            "three scans written in",
            task="build-map",
            loses=2,
            says="on inputs you haven't seen",
            code="""
def build_map(occupied, free, matrices, first=0.5):
    p, maps = np.full(occupied.shape[1:], first), []
    for t in range(3):
        if t:
            M = matrices[t - 1]
            p = (1 - p) * M[0, 1] + p * M[1, 1]
        p = p * occupied[t] / (p * occupied[t] + (1 - p) * free[t])
        maps.append(p)
    return np.array(maps)""",
        ),
    )
