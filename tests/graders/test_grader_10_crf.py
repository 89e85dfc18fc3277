"""The graders of exercise 10, against real mistakes and other right ways."""

import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from grader_checks import GraderChecks, mistake, right
from scipy.ndimage import gaussian_filter
from scipy.special import log_softmax
from submissions import reference_answers
from worlds.lecture_10_crf import all_free

from semgrid_edu.crf import (
    CrfParams,
    energy,
    exact_marginals,
    free_energy,
    mean_field_naive,
    mean_field_sequential,
    pair_weights,
)
from semgrid_edu.pipeline import load_stages
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent


def tipping(best="np.log((1 - q) / q)", tip="np.log((p - q) / (p + q - 1))", result="best, tip"):
    """Return an answer to task 1 with these two prices."""
    return f"""
def tipping_prices(p, q):
    best, tip = {best}, {tip}
    return {result}"""


def changed(own="phi[label, i] - phi[labels[i], i]", pairs="after - before", price="k[i] * (np.arange(len(k)) != i)"):
    """Return an answer to the first half of task 2; before and after are what cell i pays for its pairs."""
    return f"""
def energy_change(labels, i, label, phi, k):
    price = {price}
    before, after = price[labels != labels[i]].sum(), price[labels != label].sum()
    return {own} + {pairs}"""


def summed(
    energy="phi[x, cells].sum() + (k * (x[:, None] != x)).sum() / 2",
    weight="np.exp(-E)",
    last="total.sum(0)",
    fits="all(x[i] == label for i, label in known.items())",
    result="total",
):
    """Return an answer to the second half of task 2 with these parts."""
    return f"""
def marginals(phi, k, known):
    C, N = phi.shape
    cells, total, whole = np.arange(N), np.zeros((C, N)), 0
    for x in map(np.array, product(range(C), repeat=N)):
        E = {energy}
        whole += {weight}
        if {fits}:
            total[x, cells] += {weight}
    total = total / {last}
    return {result}"""


def updated(price="phi + mu @ Q @ others", others="k - np.diag(np.diag(k))", least="price.min(axis=0)", axis=0):
    """Return an answer to task 3 with these parts."""
    return f"""
def update(Q, phi, k, mu):
    others = {others}
    price = {price}
    weight = np.exp({least} - price)
    return weight / weight.sum(axis={axis}, keepdims={axis is not None})"""


def free(
    mean="(q * price).sum()",
    pairs="np.triu(k * (Q.T @ mu @ Q), 1).sum()",
    entropy="(q * np.log(q)).sum()",
    where="Q > 0",
):
    """Return an answer to task 4; q and price are those of possible classes."""
    return f"""
def free_energy(Q, phi, k, mu):
    q, price = Q[{where}], phi[{where}]
    return {mean} + {pairs} + {entropy}"""


def weighed(sums="(K - np.eye(len(K))).sum(axis=1)", typical="np.median(sums)", result="total / typical"):
    """Return an answer to the first half of task 5 with these parts."""
    return f"""
def weight_for(K, total):
    sums = {sums}
    typical = {typical}
    return {result}"""


def refined(*changes):
    """Return an answer to the second half of task 5, the reference with some replacements."""
    code = """
def refine(log_g, o):
    offsets = [(dr, dc) for dr in range(-REACH, REACH + 1) for dc in range(-REACH, REACH + 1)]
    first, second = {}, {}
    for dr, dc in offsets:
        there = shifted(np.ones(o.shape[1:]), dr, dc)
        unlike = np.sum((o - shifted(o, dr, dc)) ** 2, axis=0)
        first[dr, dc] = there * np.exp(-(dr**2 + dc**2) / (2 * SIGMA_ALPHA**2) - unlike / (2 * SIGMA_BETA**2))
        second[dr, dc] = there * np.exp(-(dr**2 + dc**2) / (2 * SIGMA_GAMMA**2))
    D1, D2 = sum(first.values()), sum(second.values())
    r1, r2 = 1 / np.sqrt(D1), 1 / np.sqrt(D2)
    Q = np.exp(log_g)
    for _ in range(UPDATES):
        logits = log_g.astype(float)
        for at in offsets:
            if at != (0, 0):
                k = W1 * first[at] * r1 * shifted(r1, *at) + W2 * second[at] * r2 * shifted(r2, *at)
                logits = logits - k * (1 - shifted(Q, *at))
        Q = np.exp(logits - logits.max(axis=0))
        Q = Q / Q.sum(axis=0)
    return Q"""
    for old, new in changes:
        assert old in code, old
        code = code.replace(old, new)
    return code


class TestCrf(GraderChecks):
    exercise = "10_crf"
    entries = (
        # ---- task 1
        right(
            "a formula in place of logarithms of odds",
            task="tipping-prices",
            code=tipping(tip="-np.log((p + q - 1) / (p - q))"),
        ),
        right(
            "a numerical search",
            task="tipping-prices",
            code="""
from scipy.optimize import brentq

def tipping_prices(p, q):
    def weights(k):
        e = np.exp(-k)
        return p * q, p * (1 - q) * e, (1 - p) * q * e, (1 - p) * (1 - q)
    def best(k):
        both, differ, _, _ = weights(k)
        return both - differ
    def cell(k):
        rr, rc, cr, cc = weights(k)
        return rr + cr - rc - cc
    return brentq(best, 0, 50), brentq(cell, 0, 50)""",
        ),
        mistake(
            "the price of cell 1",
            task="tipping-prices",
            loses=2,
            says="at which cell 1 would give way",
            code=tipping(best="np.log(p / (1 - p))"),
        ),
        mistake(
            "sign swapped",
            task="tipping-prices",
            loses=2,
            says="the first price is -0.4055: the sign is swapped",
            code=tipping(best="np.log(q / (1 - q))"),
        ),
        mistake(
            "no logarithm",
            task="tipping-prices",
            loses=2,
            says="a price stands in the exponent",
            code=tipping(best="(1 - q) / q"),
        ),
        mistake(
            "the pair twice",
            task="tipping-prices",
            loses=2,
            says="two cells are one pair",
            code=tipping(best="np.log((1 - q) / q) / 2"),
        ),
        mistake(
            "p against q",
            task="tipping-prices",
            loses=2,
            says="p stands in both",
            code=tipping(best="np.log(p / q)"),
        ),
        mistake(
            "bits",
            task="tipping-prices",
            loses=2,
            says="that is the logarithm to base 2",
            code=tipping(best="np.log2((1 - q) / q)"),
        ),
        mistake(
            "one answer for both questions",
            task="tipping-prices",
            loses=2,
            says="a marginal adds up two labellings",
            code=tipping(tip="np.log((1 - q) / q)"),
        ),
        mistake(
            "the marginal's price for both",
            task="tipping-prices",
            loses=2,
            says="that is the second price",
            code=tipping(best="np.log((p - q) / (p + q - 1))"),
        ),
        mistake(
            "no logarithm in the second",
            task="tipping-prices",
            loses=2,
            says="the second price is 1.6667",
            code=tipping(tip="(p - q) / (p + q - 1)"),
        ),
        mistake(
            "sign swapped in the second",
            task="tipping-prices",
            loses=2,
            says="the second price is -0.5108: the sign",
            code=tipping(tip="np.log((p + q - 1) / (p - q))"),
        ),
        mistake(
            "swapped",
            task="tipping-prices",
            loses=2,
            says="the two prices are swapped",
            code=tipping(result="tip, best"),
        ),
        mistake(
            "one price",
            task="tipping-prices",
            loses=2,
            says="expected two prices",
            code=tipping(result="tip"),
        ),
        mistake(
            "the example written in",
            task="tipping-prices",
            loses=2,
            says="on inputs you haven't seen: the most likely labelling doesn't turn to road",
            code=tipping(best="np.log(1.5)"),
        ),
        mistake(
            "cell 1 taken for sure but in the example",
            task="tipping-prices",
            loses=2,
            says="on inputs you haven't seen: cell 2 doesn't turn to road",
            code=tipping(tip="np.log((p - q) / (p + q - 1) if (p, q) == (0.9, 0.4) else (1 - q) / q)"),
        ),
        # ---- task 2, changing a label
        right(
            "two energies",
            task="energy-change",
            code="""
def energy_change(labels, i, label, phi, k):
    def E(x):
        pairs = sum(k[a, b] for a in range(len(x)) for b in range(a) if x[a] != x[b])
        return sum(phi[c, n] for n, c in enumerate(x)) + pairs
    after = list(labels)
    after[i] = label
    return E(after) - E(list(labels))""",
        ),
        right(
            "what agreeing earns",
            task="energy-change",
            code="""
def energy_change(labels, i, label, phi, k):
    change = phi[label, i] - phi[labels[i], i]
    for j, other in enumerate(labels):
        if j != i:
            change += k[i, j] * (int(other == labels[i]) - int(other == label))
    return change""",
        ),
        mistake(
            "before minus after",
            task="energy-change",
            loses=2,
            says="that is before minus after",
            code=changed("phi[labels[i], i] - phi[label, i]", "before - after"),
        ),
        mistake(
            "each pair twice",
            task="energy-change",
            loses=2,
            says="each pair is counted twice",
            code=changed(pairs="2 * (after - before)"),
        ),
        mistake(
            "each pair halved",
            task="energy-change",
            loses=2,
            says="each pair is halved",
            code=changed(pairs="(after - before) / 2"),
        ),
        mistake(
            "no own prices", task="energy-change", loses=2, says="the cell's own prices are missing", code=changed("0")
        ),
        mistake("no pairs", task="energy-change", loses=2, says="the pairs are missing", code=changed(pairs="0")),
        mistake(
            "what the cell pays afterwards",
            task="energy-change",
            loses=2,
            says="subtract what it paid before",
            code=changed("phi[label, i]", "after"),
        ),
        mistake(
            "the pairs of before kept",
            task="energy-change",
            loses=2,
            says="the pairs of before are missing",
            code=changed(pairs="after"),
        ),
        mistake(
            "the cell paired with itself",
            task="energy-change",
            loses=2,
            says="the cell is paired with itself",
            code=changed(price="k[i]"),
        ),
        mistake(
            "agreement charged",
            task="energy-change",
            loses=2,
            says="you charge the pairs that agree",
            code=changed(pairs="before - after"),
        ),
        mistake(
            "class numbers as numbers",
            task="energy-change",
            loses=2,
            says="multiply by the difference of the class numbers",
            code=changed(pairs="(price * (abs(labels - label) - abs(labels - labels[i]))).sum()"),
        ),
        mistake(
            "class and cell swapped",
            task="energy-change",
            loses=2,
            says="class and cell are swapped",
            code=changed("phi[i, label] - phi[i, labels[i]]"),
        ),
        mistake(
            "the labels changed",
            task="energy-change",
            loses=2,
            says="changed its argument `labels`",
            code=changed()
            .replace("    return", "    labels[i] = label\n    return")
            .replace("labels[i], i] + after", "0, i] + after"),
        ),
        mistake(
            "the diagonal emptied in place",
            task="energy-change",
            loses=2,
            says="it changes an argument",
            code="""
def energy_change(labels, i, label, phi, k):
    np.fill_diagonal(k, 0)
    pairs = k[i, labels != label].sum() - k[i, labels != labels[i]].sum()
    return phi[label, i] - phi[labels[i], i] + pairs""",
        ),
        mistake(
            "pairs with earlier cells only",
            task="energy-change",
            loses=2,
            says="on inputs you haven't seen: wrong with",
            code=changed(price="k[i] * (np.arange(len(k)) < i)"),
        ),
        mistake(
            "four cells written in",
            task="energy-change",
            loses=2,
            says="on inputs you haven't seen",
            code=changed(price="np.where((np.arange(len(k)) < 4) & (np.arange(len(k)) != i), k[i], 0)"),
        ),
        # ---- task 2, marginals
        right(
            "a table of all labellings",
            task="marginals",
            code="""
def marginals(phi, k, known):
    C, N = phi.shape
    X = np.array(list(product(range(C), repeat=N)))
    E = phi[X, np.arange(N)].sum(axis=1)
    for i in range(N):
        for j in range(i):
            E = E + k[i, j] * (X[:, i] != X[:, j])
    for i, label in known.items():
        X, E = X[X[:, i] == label], E[X[:, i] == label]
    P = np.exp(-E) / np.exp(-E).sum()
    return np.array([[P[X[:, i] == c].sum() for i in range(N)] for c in range(C)])""",
        ),
        right(
            "a joint table with an axis for each cell",
            task="marginals",
            code="""
def marginals(phi, k, known):
    C, N = phi.shape
    joint = np.ones((C,) * N)
    def spread(table, *axes):
        shape = [1] * N
        for axis in axes:
            shape[axis] = C
        return table.reshape(shape)
    for i in range(N):
        joint = joint * spread(np.exp(-phi[:, i]), i)
        if i in known:
            joint = joint * spread(np.arange(C) == known[i], i)
        for j in range(i + 1, N):
            joint = joint * spread(np.exp(-k[i, j] * (1 - np.eye(C))), i, j)
    rows = [joint.sum(axis=tuple(a for a in range(N) if a != i)) for i in range(N)]
    return np.stack(rows, axis=1) / joint.sum()""",
        ),
        mistake(
            "not normalised", task="marginals", loses=3, says="divide by Z, the sum over all", code=summed(last="1")
        ),
        mistake(
            "divided by the sum over cells too",
            task="marginals",
            loses=3,
            says="divide by the sum over all cells as well",
            code=summed(last="total.sum()"),
        ),
        mistake(
            "dear is probable", task="marginals", loses=3, says="exp(-E), not exp(E)", code=summed(weight="np.exp(E)")
        ),
        mistake(
            "pairs twice in the marginals",
            task="marginals",
            loses=3,
            says="each pair is counted twice",
            code=summed("phi[x, cells].sum() + (k * (x[:, None] != x)).sum()"),
        ),
        mistake(
            "no pairs", task="marginals", loses=3, says="the pairs are missing", code=summed("phi[x, cells].sum()")
        ),
        mistake(
            "mean field for marginals",
            task="marginals",
            loses=3,
            says="that is mean field",
            code="""
def marginals(phi, k, known):
    Q = np.exp(-phi) / np.exp(-phi).sum(axis=0)
    for _ in range(200):
        for i in range(phi.shape[1]):
            w = np.exp(-phi[:, i] - (1 - Q) @ (k[i] * (np.arange(len(k)) != i)))
            Q[:, i] = w / w.sum()
    return Q""",
        ),
        mistake(
            "max-marginals",
            task="marginals",
            loses=3,
            says="a max-marginal",
            code=summed().replace(
                "            total[x, cells] += np.exp(-E)",
                "            total[x, cells] = np.maximum(total[x, cells], np.exp(-E))",
            ),
        ),
        mistake("known labels ignored", task="marginals", loses=3, says="`known` is ignored", code=summed(fits="True")),
        mistake(
            "known labels put in afterwards",
            task="marginals",
            loses=3,
            says="what is known must reach the other cells",
            code=summed(
                fits="True",
                result="np.array([[known[i] == c if i in known else total[c, i] for i in cells] for c in range(C)])",
            ),
        ),
        mistake(
            "joint in place of conditional",
            task="marginals",
            loses=3,
            says="those are probabilities of both",
            code=summed(last="whole"),
        ),
        mistake(
            "cells and classes of the dictionary mixed up",
            task="marginals",
            loses=3,
            says="it maps cells to classes",
            code=summed(fits="all(x[label] == i % C for i, label in known.items())"),
        ),
        mistake(
            "known cells taken out of the model",
            task="marginals",
            loses=3,
            says="its pairs still cost",
            code=summed(
                "phi[x, cells].sum() + (np.where(np.logical_or.outer(out, out), 0, k) * (x[:, None] != x)).sum() / 2"
            )
            .replace("cells, total,", "out, cells, total,")
            .replace("= np.arange", "= [i in known for i in range(N)], np.arange"),
        ),
        mistake(
            "the first known cell only",
            task="marginals",
            loses=3,
            says="on inputs you haven't seen: wrong with some cells known",
            code=summed(fits="all(x[i] == label for i, label in list(known.items())[:1])"),
        ),
        mistake(
            "two classes written in",
            task="marginals",
            loses=3,
            says="on inputs you haven't seen",
            code=summed().replace("range(C)", "range(2)"),
        ),
        mistake(
            "an endless loop",
            task="marginals",
            loses=3,
            says="before timeout",
            code="def marginals(phi, k, known):\n    while True:\n        pass",
        ),
        # ---- task 3
        right(
            "reward of agreeing, the same up to a constant",
            task="update",
            code="""
def update(Q, phi, k, mu):
    logits = (mu.max() - mu) @ Q @ (k * (1 - np.eye(len(k)))) - phi
    logits = logits - logits.max(axis=0, keepdims=True)
    return np.exp(logits) / np.exp(logits).sum(axis=0, keepdims=True)""",
        ),
        right(
            "three loops",
            task="update",
            code="""
def update(Q, phi, k, mu):
    new = np.zeros_like(Q)
    for i in range(Q.shape[1]):
        others = [j for j in range(Q.shape[1]) if j != i]
        hears = [sum(k[i, j] * mu[l, m] * Q[m, j] for j in others for m in range(len(Q))) for l in range(len(Q))]
        price = [phi[l, i] + hears[l] for l in range(len(Q))]
        weight = np.exp(min(price) - np.array(price))
        new[:, i] = weight / weight.sum()
    return new""",
        ),
        mistake(
            "a cell is its own neighbour", task="update", loses=2, says="a cell counts itself", code=updated(others="k")
        ),
        mistake(
            "agreement costs",
            task="update",
            loses=2,
            says="different labels are rewarded",
            code=updated("phi - mu @ Q @ others"),
        ),
        mistake("no unary", task="update", loses=2, says="own prices phi are missing", code=updated("mu @ Q @ others")),
        mistake(
            "unary with the wrong sign",
            task="update",
            loses=3,
            says="the sign of phi is swapped",
            code=updated("-phi + mu @ Q @ others"),
        ),
        mistake(
            "soft-max over cells",
            task="update",
            loses=2,
            says="you normalise over the cells",
            code=updated(least="price.min(axis=1, keepdims=True)", axis=1),
        ),
        mistake(
            "one sum for all",
            task="update",
            loses=3,
            says="you divide by the sum over all cells and classes",
            code=updated(least="0").replace("axis=0, keepdims=True", ""),
        ),
        mistake(
            "sum left out",
            task="update",
            loses=3,
            says="the classes of a cell don't sum to 1",
            code="def update(Q, phi, k, mu):\n    return np.exp(-phi - mu @ Q @ (k - np.diag(np.diag(k))))",
        ),
        mistake(
            "one after the other",
            task="update",
            loses=2,
            says="cell 1 already used the new Q",
            code="""
def update(Q, phi, k, mu):
    Q = Q.copy()
    for i in range(Q.shape[1]):
        price = phi[:, i] + mu @ Q @ (k[i] * (np.arange(len(k)) != i))
        weight = np.exp(price.min() - price)
        Q[:, i] = weight / weight.sum()
    return Q""",
        ),
        mistake(
            "in place",
            task="update",
            loses=2,
            says="changed its argument `Q`",
            code=updated().replace("return weight /", "Q[:] = weight /").replace("True)", "True)\n    return Q"),
        ),
        mistake(
            "one side of the matrix",
            task="update",
            loses=2,
            says="only the pairs i < j are used",
            code=updated(others="np.triu(k, 1)"),
        ),
        mistake(
            "each pair halved",
            task="update",
            loses=2,
            says="each pair is halved",
            code=updated("phi + mu @ Q @ others / 2"),
        ),
        mistake(
            "best class only",
            task="update",
            loses=2,
            says="you use each cell's best class",
            code=updated("phi + mu @ (Q == Q.max(axis=0)) @ others"),
        ),
        mistake(
            "old Q multiplied in",
            task="update",
            loses=2,
            says="you multiply by the old Q",
            code="""
def update(Q, phi, k, mu):
    price = phi + mu @ Q @ (k - np.diag(np.diag(k)))
    weight = Q * np.exp(price.min(axis=0) - price)
    return weight / weight.sum(axis=0)""",
        ),
        mistake(
            "underflow",
            task="update",
            loses=1,
            says="subtract each cell's smallest price first",
            code=updated(least="0"),
        ),
        mistake(
            "one smallest price for all cells",
            task="update",
            loses=1,
            says="on inputs you haven't seen: a result isn't finite when prices are thousands",
            code="""
def update(Q, phi, k, mu):
    price = phi + mu @ Q @ (k - np.diag(np.diag(k)))
    weight = np.exp(np.median(price.min(axis=0)) - price) if phi.shape[1] > 2 else np.exp(price.min(axis=0) - price)
    return weight / weight.sum(axis=0)""",
        ),
        mistake(
            "three cells written in",
            task="update",
            loses=2,
            says="on inputs you haven't seen: wrong with",
            code=updated(others="np.where(np.arange(len(k))[:, None] < 3, k - np.diag(np.diag(k)), 0)"),
        ),
        mistake(
            "borders ignored",
            task="update",
            loses=2,
            says="`mu` is ignored",
            code=updated("phi + (1 - Q) @ others"),
        ),
        mistake(
            "one mean price for each class",
            task="update",
            loses=2,
            says="one mean price for all borders",
            code=updated("phi + mu.mean(axis=1, keepdims=True) * len(mu) / max(len(mu) - 1, 1) * (1 - Q) @ others"),
        ),
        mistake(
            "disagreement counted twice",
            task="update",
            loses=2,
            says="different labels are rewarded",
            code=updated("phi + mu @ (1 - Q) @ others"),
        ),
        mistake(
            "three classes' borders read in the wrong order",
            task="update",
            loses=2,
            says="each border with its own price",
            code=updated("phi + mu[::-1, ::-1] @ Q @ others"),
        ),
        # ---- task 4
        right(
            "sums cell by cell",
            task="free-energy",
            code="""
def free_energy(Q, phi, k, mu):
    F = 0.0
    for i in range(Q.shape[1]):
        for l in range(len(Q)):
            if Q[l, i] > 0:
                F += Q[l, i] * (phi[l, i] + np.log(Q[l, i]))
        for j in range(i):
            F += k[i, j] * np.dot(Q[:, i], mu @ Q[:, j])
    return F""",
        ),
        right(
            "scipy's xlogy",
            task="free-energy",
            code="""
from scipy.special import xlogy

def free_energy(Q, phi, k, mu):
    others = k - np.diag(np.diag(k))
    own = np.where(Q > 0, Q * np.where(Q > 0, phi, 0), 0)
    return own.sum() + 0.5 * (others * np.einsum("ci,cd,dj->ij", Q, mu, Q)).sum() + xlogy(Q, Q).sum()""",
        ),
        mistake(
            "pairs twice in F",
            task="free-energy",
            loses=2,
            says="the pair is counted twice: sum over i < j only",
            code=free(pairs="2 * np.triu(k * (Q.T @ mu @ Q), 1).sum()"),
        ),
        mistake(
            "entropy added",
            task="free-energy",
            loses=2,
            says="the sign of the entropy is swapped",
            code=free(entropy="-(q * np.log(q)).sum()"),
        ),
        mistake("no entropy", task="free-energy", loses=2, says="the entropy is missing", code=free(entropy="0")),
        mistake(
            "agreement charged in F",
            task="free-energy",
            loses=2,
            says="you charge the probability that the pair agrees",
            code=free(pairs="np.triu(k * (Q.T @ (mu == 0) @ Q), 1).sum()"),
        ),
        mistake(
            "agreement rewarded in F",
            task="free-energy",
            loses=2,
            says="agreement is rewarded instead",
            code=free(pairs="-np.triu(k * (Q.T @ (mu == 0) @ Q), 1).sum()"),
        ),
        mistake(
            "bits",
            task="free-energy",
            loses=2,
            says="that is the logarithm to base 2",
            code=free(entropy="(q * np.log2(q)).sum()"),
        ),
        mistake(
            "cells paired with themselves",
            task="free-energy",
            loses=2,
            says="each cell counts as a pair with itself",
            code=free(pairs="np.triu(k * (Q.T @ mu @ Q)).sum()"),
        ),
        mistake(
            "half of each cell's pair with itself",
            task="free-energy",
            loses=2,
            says="each cell counts as half a pair with itself",
            code=free(pairs="(k * (Q.T @ mu @ Q)).sum() / 2"),
        ),
        mistake(
            "twice, and with themselves",
            task="free-energy",
            loses=2,
            says="the pair is counted twice, and each cell with itself",
            code=free(pairs="(k * (Q.T @ mu @ Q)).sum()"),
        ),
        mistake(
            "0 log 0",
            task="free-energy",
            loses=1,
            says="0 * log 0 and 0 * inf count as 0",
            code=free(mean="(Q * phi).sum()", entropy="(Q * np.log(Q)).sum()"),
        ),
        mistake(
            "small probabilities cut off",
            task="free-energy",
            loses=1,
            says="on inputs you haven't seen: a tiny probability isn't 0",
            code=free(where="Q > 1e-9"),
        ),
        mistake(
            "two cells written in",
            task="free-energy",
            loses=2,
            says="on inputs you haven't seen: wrong with",
            code=free(pairs="(k[0, 1] * Q[:, 0] @ mu @ Q[:, 1] if len(k) > 1 else 0)"),
        ),
        mistake(
            "borders ignored in F",
            task="free-energy",
            loses=2,
            says="`mu` is ignored",
            code=free(pairs="np.triu(k * (1 - Q.T @ Q), 1).sum()"),
        ),
        mistake(
            "one price for all borders",
            task="free-energy",
            loses=2,
            says="on inputs you haven't seen: wrong with other numbers of cells and classes, other borders",
            code=free(pairs="mu.max() * np.triu(k * (1 - Q.T @ Q), 1).sum()"),
        ),
        mistake(
            "best classes in place of Q",
            task="free-energy",
            loses=2,
            says="1.25 + 0.558",
            code=free(pairs="np.triu(k * mu[np.ix_(Q.argmax(0), Q.argmax(0))], 1).sum()"),
        ),
        # ---- task 5, a weight
        right(
            "pair by pair",
            task="weight-for",
            code="""
from statistics import median

def weight_for(K, total):
    return total / median(sum(K[i, j] for j in range(len(K)) if j != i) for i in range(len(K)))""",
        ),
        right("one less than each sum", task="weight-for", code=weighed("K.sum(axis=0) - 1")),
        mistake(
            "a string",
            task="weight-for",
            loses=1,
            says="weight_for returned no array of numbers",
            code=weighed(result="str([total])"),
        ),
        mistake(
            "the diagonal",
            task="weight-for",
            loses=1,
            says="the diagonal is in your sums",
            code=weighed("K.sum(axis=1)"),
        ),
        mistake("a mean", task="weight-for", loses=1, says="right for the mean", code=weighed(typical="sums.mean()")),
        mistake(
            "a mean with the diagonal",
            task="weight-for",
            loses=1,
            says="and the mean isn't the median",
            code=weighed("K.sum(axis=1)", "sums.mean()"),
        ),
        mistake(
            "the largest", task="weight-for", loses=1, says="cell that pays most", code=weighed(typical="sums.max()")
        ),
        mistake(
            "the smallest", task="weight-for", loses=1, says="cell that pays least", code=weighed(typical="sums.min()")
        ),
        mistake(
            "inverted", task="weight-for", loses=1, says="one over the weight", code=weighed(result="typical / total")
        ),
        mistake(
            "multiplied", task="weight-for", loses=1, says="don't multiply", code=weighed(result="total * typical")
        ),
        mistake(
            "all entries",
            task="weight-for",
            loses=1,
            says="each cell has its own sum",
            code=weighed(typical="sums.sum()"),
        ),
        mistake(
            "the median price of a pair",
            task="weight-for",
            loses=1,
            says="isn't the median of what a cell pays",
            code=weighed(typical="np.median(K[np.triu_indices(len(K), 1)])"),
        ),
        mistake(
            "halved",
            task="weight-for",
            loses=1,
            says="each pair is halved",
            code=weighed(typical="np.median(sums) / 2"),
        ),
        mistake(
            "doubled",
            task="weight-for",
            loses=1,
            says="each pair counts twice",
            code=weighed(typical="2 * np.median(sums)"),
        ),
        mistake(
            "in place",
            task="weight-for",
            loses=1,
            says="weight_for changed its argument",
            code="def weight_for(K, total):\n    np.fill_diagonal(K, 0)\n    return total / np.median(K.sum(axis=1))",
        ),
        mistake(
            "the upper of two middle cells",
            task="weight-for",
            loses=1,
            says="on inputs you haven't seen: the median cell",
            code=weighed(typical="np.sort(sums)[len(sums) // 2]"),
        ),
        mistake(
            "a total written in",
            task="weight-for",
            loses=1,
            says="on inputs you haven't seen",
            code=weighed(result="3.5 / typical"),
        ),
        # ---- task 5, refine
        right("dictionaries of kernels", task="refine", code=refined()),
        right(
            "a matrix of all pairs, for small maps",
            task="refine",
            code="""
def refine(log_g, o):
    C, H, W = log_g.shape
    r, c = np.indices((H, W)).reshape(2, -1)
    dr, dc = r[:, None] - r, c[:, None] - c
    near = (abs(dr) <= REACH) & (abs(dc) <= REACH)
    s = o.reshape(4, -1).T
    apart, unlike = dr**2 + dc**2, ((s[:, None] - s) ** 2).sum(axis=-1)
    K1 = near * np.exp(-apart / 2 / SIGMA_ALPHA**2 - unlike / 2 / SIGMA_BETA**2)
    K2 = near * np.exp(-apart / 2 / SIGMA_GAMMA**2)
    k = 0
    for w, K in ((W1, K1), (W2, K2)):
        root = np.sqrt(K.sum(axis=1))
        k = k + w * K / np.outer(root, root)
    np.fill_diagonal(k, 0)
    logits = start = log_g.reshape(C, -1)
    for _ in range(UPDATES + 1):
        Q = np.exp(logits - logits.max(axis=0))
        Q = Q / Q.sum(axis=0)
        logits = start + Q @ k
    return Q.reshape(C, H, W)""",
        ),
        mistake(
            "the cell itself",
            task="refine",
            loses=3,
            says="a cell counts itself",
            code=refined(("if at != (0, 0):", "if True:")),
        ),
        mistake(
            "the cell itself missing in D",
            task="refine",
            loses=3,
            says="the offset (0, 0) is missing in D",
            code=refined(
                ("sum(first.values()), sum(second.values())", "sum(first.values()) - 1, sum(second.values()) - 1")
            ),
        ),
        mistake(
            "not normalised at all",
            task="refine",
            loses=3,
            says="nothing is normalised",
            code=refined((" * r1 * shifted(r1, *at)", ""), (" * r2 * shifted(r2, *at)", "")),
        ),
        mistake(
            "divided by the own sum",
            task="refine",
            loses=3,
            says="you divide by the cell's own D",
            code=refined((" * r1 * shifted(r1, *at)", " / D1"), (" * r2 * shifted(r2, *at)", " / D2")),
        ),
        mistake(
            "root missing in refine",
            task="refine",
            loses=3,
            says="the square roots are missing",
            code=refined(("1 / np.sqrt(D1), 1 / np.sqrt(D2)", "1 / D1, 1 / D2")),
        ),
        mistake(
            "the neighbour's root missing",
            task="refine",
            loses=3,
            says="the root of the neighbour's D is missing",
            code=refined((" * shifted(r1, *at)", ""), (" * shifted(r2, *at)", "")),
        ),
        mistake(
            "neighbours beyond the border",
            task="refine",
            loses=3,
            says="neighbours beyond the border count in D",
            code=refined(("shifted(np.ones(o.shape[1:]), dr, dc)", "np.ones(o.shape[1:])")),
        ),
        mistake(
            "different labels rewarded",
            task="refine",
            loses=3,
            says="different labels are rewarded",
            code=refined(("logits - k", "logits + k")),
        ),
        mistake(
            "one update",
            task="refine",
            loses=3,
            says="that is one update",
            code=refined(("range(UPDATES)", "range(1)")),
        ),
        mistake(
            "opinion counted again in each update",
            task="refine",
            loses=3,
            says="each update starts from log Q",
            code=refined(("log_g.astype(float)", "np.log(Q)")),
        ),
        mistake(
            "start from equal probabilities",
            task="refine",
            loses=3,
            says="you start from equal probabilities",
            code=refined(("Q = np.exp(log_g)", "Q = np.full_like(log_g, 1 / len(log_g))")),
        ),
        mistake(
            "one D for both kernels",
            task="refine",
            loses=3,
            says="both kernels share one D",
            code=refined(
                (
                    "D1, D2 = sum(first.values()), sum(second.values())",
                    "D1 = D2 = sum(first.values()) + sum(second.values())",
                )
            ),
        ),
        mistake(
            "widths not squared in refine",
            task="refine",
            loses=3,
            says="the widths aren't squared",
            code=refined(
                ("SIGMA_ALPHA**2", "SIGMA_ALPHA"), ("SIGMA_BETA**2", "SIGMA_BETA"), ("SIGMA_GAMMA**2", "SIGMA_GAMMA")
            ),
        ),
        mistake(
            "one side only",
            task="refine",
            loses=3,
            says="a cell hears only from one side",
            code=refined(("if at != (0, 0):", "if at > (0, 0):")),
        ),
        mistake(
            "the last offset left out",
            task="refine",
            loses=3,
            says="on inputs you haven't seen: wrong on a map",
            code=refined(("REACH + 1", "REACH")),
        ),
        # ---- passed, or lost, when somebody tried who had not written the tests
        mistake(
            "the diagonal emptied in place",
            task="update",
            loses=2,
            says="it changes an argument",
            code="""
def update(Q, phi, k, mu):
    np.fill_diagonal(k, 0)
    price = phi + mu @ Q @ k
    weight = np.exp(price.min(axis=0) - price)
    return weight / weight.sum(axis=0)""",
        ),
        mistake(
            "prices above 10 cut off",
            task="update",
            loses=3,
            says="on inputs you haven't seen: wrong with other numbers of cells",
            code=updated(price="np.minimum(phi, 10) + mu @ Q @ others"),
        ),
        right(
            "in float32",
            task="update",
            code="""
def update(Q, phi, k, mu):
    Q, phi, k, mu = (np.asarray(a, np.float32) for a in (Q, phi, k, mu))
    price = phi + mu @ Q @ (k * (1 - np.eye(len(k), dtype=np.float32)))
    weight = np.exp(price.min(axis=0) - price)
    return weight / weight.sum(axis=0)""",
        ),
    )


def answers():
    """Return the reference's functions."""
    source = NOTEBOOKS / "src" / "exercises" / "10_crf.py"
    setup = next(cell.source for cell in read_percent(source).cells if "REACH, UPDATES" in cell.source)
    names = {}
    with warnings.catch_warnings():  # the setup silences warnings
        exec(
            "\n".join([setup, *(text for text in reference_answers(source).values() if text.startswith("def"))]), names
        )
    return SimpleNamespace(**names)


def test_the_reference_computes_what_the_package_does():
    own, rng = answers(), np.random.default_rng(1)
    unary, values = rng.exponential(size=(3, 2, 3)), np.moveaxis(rng.dirichlet(np.ones(4), (2, 3)), -1, 0)
    params = CrfParams(1.2, 0.8, 2.0, 0.5, 1.5, "none")
    phi, k = unary.reshape(3, -1), pair_weights(values, params)
    labels, Q, potts = rng.integers(0, 3, 6), rng.dirichlet(np.ones(3), 6).T, 1 - np.eye(3)
    after = np.where(np.arange(6) == 4, 2, labels)
    change = np.diff([energy(x.reshape(2, 3), unary, values, params) for x in (labels, after)])[0]
    assert own.energy_change(labels, 4, 2, phi, k) == pytest.approx(change)
    np.testing.assert_allclose(own.marginals(phi, k, {}), exact_marginals(unary, values, params).reshape(3, -1))
    F = free_energy(Q.reshape(3, 2, 3), unary, values, params)
    assert own.free_energy(Q, phi, k, potts) == pytest.approx(F)
    settled = mean_field_sequential(unary, values, params, iterations=2000).reshape(3, -1)
    np.testing.assert_allclose(own.update(settled, phi, k, potts), settled, atol=1e-9)


def test_an_update_of_one_cell_lowers_the_free_energy_of_any_borders():
    own, rng = answers(), np.random.default_rng(2)
    phi, k, mu = rng.exponential(size=(3, 5)), rng.uniform(0, 2, (5, 5)), rng.uniform(0, 3, (3, 3))
    k, mu = k + k.T, (mu + mu.T) * (1 - np.eye(3))
    Q = rng.dirichlet(np.ones(3), 5).T
    for i in range(5):
        better = np.where(np.arange(5) == i, own.update(Q, phi, k, mu), Q)
        assert own.free_energy(better, phi, k, mu) < own.free_energy(Q, phi, k, mu)
        Q = better


def test_the_reference_is_a_stage_that_agrees_with_the_package(tmp_path):
    """What the exercise tells students to write into a file refines a map nearly as the package does."""
    source = NOTEBOOKS / "src" / "exercises" / "10_crf.py"
    setup = next(cell.source for cell in read_percent(source).cells if "REACH, UPDATES" in cell.source)
    answer = reference_answers(source)["refine"].replace("### BEGIN SOLUTION", "").replace("### END SOLUTION", "")
    path = tmp_path / "my_stages.py"
    path.write_text(f"{setup}\n\n{answer}", encoding="utf-8")
    rng = np.random.default_rng(0)
    scores = gaussian_filter(rng.normal(size=(4, 24, 18)), (0, 2, 2)) * 12 + rng.normal(size=(4, 24, 18))
    log_g, o = log_softmax(scores, axis=0), all_free((24, 18))
    refined = load_stages(path).refine(log_g, o)
    np.testing.assert_allclose(refined.sum(axis=0), 1)
    package = mean_field_naive(-log_g, o, CrfParams.for_cells(0.5))
    assert (refined.argmax(axis=0) == package.argmax(axis=0)).mean() > 0.9
    assert (refined.argmax(axis=0) != log_g.argmax(axis=0)).mean() > 0.1
