"""The graders of exercise 10, against real mistakes and other right ways."""

import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from grader_checks import GraderChecks, mistake, right
from scipy.ndimage import gaussian_filter
from scipy.special import log_softmax

from semgrid_edu.crf import (
    CrfParams,
    energy,
    exact_marginals,
    free_energy,
    gram_matrix,
    mean_field_naive,
    mean_field_sequential,
    pair_weights,
)
from semgrid_edu.pipeline import load_stages
from semgrid_edu.stage_models.crf import all_free
from semgrid_edu.workshop.course.nbgrader.autograde import reference_answers
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent


def price(result, apart="np.sum((c_i - c_j) ** 2)", unlike="np.sum((o_i - o_j) ** 2)"):
    """Return an answer to task 1 with these distances and this result."""
    return f"""
def pair_price(c_i, c_j, o_i, o_j, w1, w2, alpha, beta, gamma):
    apart, unlike = {apart}, {unlike}
    return {result}"""


PRICE = "w1 * np.exp(-apart / (2 * alpha**2) - unlike / (2 * beta**2)) + w2 * np.exp(-apart / (2 * gamma**2))"


def total(pairs, own="phi[labels, np.arange(len(labels))].sum()"):
    """Return an answer to the first half of task 2 with these sums."""
    return f"""
def energy(labels, phi, k):
    differ = labels[:, None] != labels
    return {own} + {pairs}"""


def summed(energy="phi[x, cells].sum() + (k * (x[:, None] != x)).sum() / 2", weight="np.exp(-E)", last="total.sum(0)"):
    """Return an answer to the second half of task 2 with these parts."""
    return f"""
def marginals(phi, k):
    C, N = phi.shape
    cells, total = np.arange(N), np.zeros((C, N))
    for x in map(np.array, product(range(C), repeat=N)):
        E = {energy}
        total[x, cells] += {weight}
    return total / {last}"""


def updated(price="phi + (1 - Q) @ others", others="k - np.diag(np.diag(k))", least="price.min(axis=0)", axis=0):
    """Return an answer to task 3 with these parts."""
    return f"""
def update(Q, phi, k):
    others = {others}
    price = {price}
    weight = np.exp({least} - price)
    return weight / weight.sum(axis={axis}, keepdims={axis is not None})"""


def free(
    mean="(q * price).sum()",
    pairs="np.triu(k * (1 - Q.T @ Q), 1).sum()",
    entropy="(q * np.log(q)).sum()",
    where="Q > 0",
):
    """Return an answer to task 4; q and price are those of possible classes."""
    return f"""
def free_energy(Q, phi, k):
    q, price = Q[{where}], phi[{where}]
    return {mean} + {pairs} + {entropy}"""


def scaled(result):
    """Return an answer to the first half of task 5; D are the sums of the rows."""
    return f"""
def normalise(K):
    D = K.sum(axis=1)
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
            "loops over rows, columns and states",
            task="pair-price",
            code="""
import math

def pair_price(c_i, c_j, o_i, o_j, w1, w2, alpha, beta, gamma):
    apart = sum((a - b) ** 2 for a, b in zip(c_i, c_j))
    unlike = sum((a - b) ** 2 for a, b in zip(o_i, o_j))
    near = math.exp(-apart / 2 / alpha**2)
    return w1 * near * math.exp(-unlike / 2 / beta**2) + w2 * math.exp(-apart / 2 / gamma**2)""",
        ),
        right(
            "scaled features and norms",
            task="pair-price",
            code="""
def pair_price(c_i, c_j, o_i, o_j, w1, w2, alpha, beta, gamma):
    f = np.concatenate([(c_i - c_j) / alpha, (o_i - o_j) / beta])
    return w1 * np.exp(-0.5 * f @ f) + w2 * np.exp(-0.5 * np.linalg.norm((c_i - c_j) / gamma) ** 2)""",
        ),
        mistake(
            "widths not squared",
            task="pair-price",
            loses=2,
            says="the widths aren't squared",
            code=price(PRICE.replace("**2", "")),
        ),
        mistake("no 2", task="pair-price", loses=2, says="the 2 is missing", code=price(PRICE.replace("(2 * ", "("))),
        mistake(
            "2 squared as well",
            task="pair-price",
            loses=2,
            says="you square the 2 as well",
            code=price(
                "w1 * np.exp(-apart / (2 * alpha)**2 - unlike / (2 * beta)**2) + w2 * np.exp(-apart / (2 * gamma)**2)"
            ),
        ),
        mistake(
            "parentheses forgotten",
            task="pair-price",
            loses=2,
            says="multiplies by the width",
            code=price(
                "w1 * np.exp(-apart / 2 * alpha**2 - unlike / 2 * beta**2) + w2 * np.exp(-apart / 2 * gamma**2)"
            ),
        ),
        mistake(
            "distances with a root",
            task="pair-price",
            loses=2,
            says="the distances aren't squared",
            code=price(PRICE, "np.linalg.norm(c_i - c_j)", "np.linalg.norm(o_i - o_j)"),
        ),
        mistake(
            "sign forgotten",
            task="pair-price",
            loses=2,
            says="the minus signs are missing",
            code=price(PRICE.replace("-apart", "apart").replace("- unlike", "+ unlike")),
        ),
        mistake(
            "two exponentials added",
            task="pair-price",
            loses=2,
            says="belong into one exponent",
            code=price(PRICE.replace(" - unlike", ") + w1 * np.exp(-unlike")),
        ),
        mistake(
            "alpha and gamma swapped",
            task="pair-price",
            loses=2,
            says="alpha and gamma are swapped",
            code=price(PRICE.replace("alpha", "a").replace("gamma", "alpha").replace("(2 * a**2)", "(2 * gamma**2)")),
        ),
        mistake(
            "states in both terms",
            task="pair-price",
            loses=2,
            says="the second term ignores the states",
            code=price(PRICE[:-1] + " - unlike / (2 * beta**2))"),
        ),
        mistake(
            "sum before the square",
            task="pair-price",
            loses=2,
            says="square each difference first",
            code=price(PRICE, "np.abs(c_i - c_j).sum() ** 2", "np.abs(o_i - o_j).sum() ** 2"),
        ),
        mistake(
            "the widths of the example written in",
            task="pair-price",
            loses=2,
            says="on inputs you haven't seen",
            code=price(PRICE.replace("alpha", "3").replace("beta", "0.25").replace("gamma", "2")),
        ),
        # ---- task 2, energy
        right(
            "two loops",
            task="energy",
            code="""
def energy(labels, phi, k):
    E = 0
    for i in range(len(labels)):
        E += phi[labels[i], i]
        for j in range(i):
            if labels[i] != labels[j]:
                E += k[i, j]
    return E""",
        ),
        right(
            "one-hot labels",
            task="energy",
            code="""
def energy(labels, phi, k):
    X = np.eye(len(phi))[labels].T
    return (phi * X).sum() + np.triu(k * (1 - X.T @ X), 1).sum()""",
        ),
        mistake(
            "each pair twice",
            task="energy",
            loses=2,
            says="each pair is counted twice",
            code=total("(k * differ).sum()"),
        ),
        mistake(
            "agreement charged",
            task="energy",
            loses=2,
            says="you charge the pairs that agree",
            code=total("np.triu(k * ~differ, 1).sum()"),
        ),
        mistake(
            "agreement charged, with the diagonal",
            task="energy",
            loses=2,
            says="and each cell with itself",
            code=total("(k * ~differ).sum() / 2"),
        ),
        mistake(
            "a chain",
            task="energy",
            loses=2,
            says="only cells that follow one another",
            code=total("sum(k[i, i + 1] for i in range(len(labels) - 1) if differ[i, i + 1])"),
        ),
        mistake(
            "pairs rewarded",
            task="energy",
            loses=2,
            says="the pairs are subtracted",
            code=total("-(k * differ).sum() / 2"),
        ),
        mistake(
            "class and cell swapped",
            task="energy",
            loses=2,
            says="class and cell are swapped",
            code=total("(k * differ).sum() / 2", "phi[np.arange(len(labels)), labels].sum()"),
        ),
        mistake(
            "class numbers as numbers",
            task="energy",
            loses=2,
            says="multiply by the difference of the class numbers",
            code=total("(k * abs(labels[:, None] - labels)).sum() / 2"),
        ),
        mistake(
            "logarithm of a price",
            task="energy",
            loses=2,
            says="`phi` holds prices already",
            code=total("(k * differ).sum() / 2", "-np.log(phi[labels, np.arange(len(labels))]).sum()"),
        ),
        mistake(
            "four cells written in",
            task="energy",
            loses=2,
            says="on inputs you haven't seen",
            code="""
def energy(labels, phi, k):
    n = min(4, len(labels))
    own = sum(phi[labels[i], i] for i in range(n))
    return own + sum(k[i, j] for i in range(n) for j in range(i) if labels[i] != labels[j])""",
        ),
        # ---- task 2, marginals
        right(
            "a table of all labellings",
            task="marginals",
            code="""
def marginals(phi, k):
    C, N = phi.shape
    X = np.array(list(product(range(C), repeat=N)))
    E = phi[X, np.arange(N)].sum(axis=1)
    for i in range(N):
        for j in range(i):
            E = E + k[i, j] * (X[:, i] != X[:, j])
    P = np.exp(-E) / np.exp(-E).sum()
    return np.array([[P[X[:, i] == c].sum() for i in range(N)] for c in range(C)])""",
        ),
        right(
            "a joint table with an axis for each cell",
            task="marginals",
            code="""
def marginals(phi, k):
    C, N = phi.shape
    joint = np.ones((C,) * N)
    def spread(table, *axes):
        shape = [1] * N
        for axis in axes:
            shape[axis] = C
        return table.reshape(shape)
    for i in range(N):
        joint = joint * spread(np.exp(-phi[:, i]), i)
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
def marginals(phi, k):
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
                "total[x, cells] += np.exp(-E)", "total[x, cells] = np.maximum(total[x, cells], np.exp(-E))"
            ),
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
            code="def marginals(phi, k):\n    while True:\n        pass",
        ),
        # ---- task 3
        right(
            "reward of agreeing, the same up to a constant",
            task="update",
            code="""
def update(Q, phi, k):
    logits = Q @ (k * (1 - np.eye(len(k)))) - phi
    logits = logits - logits.max(axis=0, keepdims=True)
    return np.exp(logits) / np.exp(logits).sum(axis=0, keepdims=True)""",
        ),
        right(
            "three loops",
            task="update",
            code="""
def update(Q, phi, k):
    new = np.zeros_like(Q)
    for i in range(Q.shape[1]):
        price = [phi[l, i] + sum(k[i, j] * (1 - Q[l, j]) for j in range(Q.shape[1]) if j != i) for l in range(len(Q))]
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
            code=updated("phi + Q @ others", others="k - np.diag(np.diag(k))").replace("+ Q", "- (1 - Q)"),
        ),
        mistake(
            "no unary", task="update", loses=2, says="own prices phi are missing", code=updated("(1 - Q) @ others")
        ),
        mistake(
            "unary with the wrong sign",
            task="update",
            loses=3,
            says="the sign of phi is swapped",
            code=updated("-phi + (1 - Q) @ others"),
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
            code="def update(Q, phi, k):\n    return np.exp(-phi - (1 - Q) @ (k - np.diag(np.diag(k))))",
        ),
        mistake(
            "one after the other",
            task="update",
            loses=2,
            says="cell 1 already used the new Q",
            code="""
def update(Q, phi, k):
    Q = Q.copy()
    for i in range(Q.shape[1]):
        price = phi[:, i] + (1 - Q) @ (k[i] * (np.arange(len(k)) != i))
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
            code=updated("phi + (1 - Q) @ others / 2"),
        ),
        mistake(
            "best class only",
            task="update",
            loses=2,
            says="you use each cell's best class",
            code=updated("phi + (1 - (Q == Q.max(axis=0))) @ others"),
        ),
        mistake(
            "old Q multiplied in",
            task="update",
            loses=2,
            says="you multiply by the old Q",
            code="""
def update(Q, phi, k):
    price = phi + (1 - Q) @ (k - np.diag(np.diag(k)))
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
def update(Q, phi, k):
    price = phi + (1 - Q) @ (k - np.diag(np.diag(k)))
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
        # ---- task 4
        right(
            "sums cell by cell",
            task="free-energy",
            code="""
def free_energy(Q, phi, k):
    F = 0.0
    for i in range(Q.shape[1]):
        for l in range(len(Q)):
            if Q[l, i] > 0:
                F += Q[l, i] * (phi[l, i] + np.log(Q[l, i]))
        for j in range(i):
            F += k[i, j] * (1 - np.dot(Q[:, i], Q[:, j]))
    return F""",
        ),
        right(
            "scipy's xlogy",
            task="free-energy",
            code="""
from scipy.special import xlogy

def free_energy(Q, phi, k):
    others = k - np.diag(np.diag(k))
    own = np.where(Q > 0, Q * np.where(Q > 0, phi, 0), 0)
    return own.sum() + 0.5 * (others * (1 - np.einsum("ci,cj->ij", Q, Q))).sum() + xlogy(Q, Q).sum()""",
        ),
        mistake(
            "pairs twice in F",
            task="free-energy",
            loses=2,
            says="the pair is counted twice: sum over i < j only",
            code=free(pairs="2 * np.triu(k * (1 - Q.T @ Q), 1).sum()"),
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
            code=free(pairs="np.triu(k * (Q.T @ Q), 1).sum()"),
        ),
        mistake(
            "agreement rewarded in F",
            task="free-energy",
            loses=2,
            says="agreement is rewarded instead",
            code=free(pairs="-np.triu(k * (Q.T @ Q), 1).sum()"),
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
            code=free(pairs="np.triu(k * (1 - Q.T @ Q)).sum()"),
        ),
        mistake(
            "half of each cell's pair with itself",
            task="free-energy",
            loses=2,
            says="each cell counts as half a pair with itself",
            code=free(pairs="(k * (1 - Q.T @ Q)).sum() / 2"),
        ),
        mistake(
            "twice, and with themselves",
            task="free-energy",
            loses=2,
            says="the pair is counted twice, and each cell with itself",
            code=free(pairs="(k * (1 - Q.T @ Q)).sum()"),
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
            code=free(pairs="(k[0, 1] * (1 - Q[:, 0] @ Q[:, 1]) if len(k) > 1 else 0)"),
        ),
        # ---- task 5, normalisation
        right(
            "entry by entry",
            task="normalise",
            code="""
def normalise(K):
    D = [sum(row) for row in K]
    return np.array([[K[i, j] / (D[i] * D[j]) ** 0.5 for j in range(len(K))] for i in range(len(K))])""",
        ),
        right("diagonal matrices", task="normalise", code=scaled("np.diag(D**-0.5) @ K @ np.diag(D**-0.5)")),
        right(
            "nested lists, and helpers with everyday names",
            task="normalise",
            code="""
weights, read, loss, slips, before, k, Q, phi = "these were names of the test cells, too".split()


def got(K):
    return [float(sum(row)) ** 0.5 for row in K]


def normalise(K):
    return [[entry / a / b for entry, b in zip(row, got(K))] for row, a in zip(K, got(K))]""",
        ),
        mistake(
            "a string",
            task="normalise",
            loses=1,
            says="normalise returned no array of numbers but a str",
            code="def normalise(K):\n    return str(K)",
        ),
        mistake(
            "root forgotten",
            task="normalise",
            loses=1,
            says="the square roots are missing",
            code=scaled("K / np.outer(D, D)"),
        ),
        mistake(
            "rows only", task="normalise", loses=1, says="you divide each row by its sum", code=scaled("K / D[:, None]")
        ),
        mistake(
            "columns only", task="normalise", loses=1, says="you divide each column by its sum", code=scaled("K / D")
        ),
        mistake(
            "one root",
            task="normalise",
            loses=1,
            says="you divide by one root only",
            code=scaled("K / np.sqrt(D)[:, None]"),
        ),
        mistake(
            "multiplied",
            task="normalise",
            loses=1,
            says="you multiply by the roots",
            code=scaled("K * np.sqrt(np.outer(D, D))"),
        ),
        mistake(
            "diagonal left out of D",
            task="normalise",
            loses=1,
            says="the diagonal is missing in the row sums",
            code=scaled("K / np.sqrt(np.outer(D - 1, D - 1))"),
        ),
        mistake(
            "lengths of rows",
            task="normalise",
            loses=1,
            says="those are lengths of rows",
            code=scaled("K / np.outer(np.linalg.norm(K, axis=1), np.linalg.norm(K, axis=1))"),
        ),
        mistake(
            "in place",
            task="normalise",
            loses=1,
            says="normalise changed its argument",
            code="def normalise(K):\n    root = np.sqrt(K.sum(axis=1))\n    K /= np.outer(root, root)\n    return K",
        ),
        mistake(
            "three cells written in",
            task="normalise",
            loses=1,
            says="on inputs you haven't seen: wrong with",
            code=scaled("K / np.sqrt(np.outer(K[:, :3].sum(axis=1), K[:, :3].sum(axis=1)))"),
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
def update(Q, phi, k):
    np.fill_diagonal(k, 0)
    price = phi + (1 - Q) @ k
    weight = np.exp(price.min(axis=0) - price)
    return weight / weight.sum(axis=0)""",
        ),
        mistake(
            "the diagonal emptied in place",
            task="energy",
            loses=2,
            says="it changes an argument",
            code="""
def energy(x, phi, k):
    np.fill_diagonal(k, 0)
    return sum(phi[label, i] for i, label in enumerate(x)) + 0.5 * (k * (x[:, None] != x)).sum()""",
        ),
        mistake(
            "prices above 10 cut off",
            task="update",
            loses=3,
            says="on inputs you haven't seen: wrong with 6 cells",
            code=updated(price="np.minimum(phi, 10) + (1 - Q) @ others"),
        ),
        right(
            "in float32",
            task="update",
            code="""
def update(Q, phi, k):
    Q, phi, k = (np.asarray(a, np.float32) for a in (Q, phi, k))
    price = phi + (1 - Q) @ (k * (1 - np.eye(len(k), dtype=np.float32)))
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
    places, states = np.indices((2, 3)).reshape(2, -1).T, values.reshape(4, -1).T
    pair = places[0], places[4], states[0], states[4]
    phi, k = unary.reshape(3, -1), pair_weights(values, params)
    assert own.pair_price(*pair, 1.2, 0.8, 2.0, 0.5, 1.5) == pytest.approx(k[0, 4])
    labels, Q = rng.integers(0, 3, 6), rng.dirichlet(np.ones(3), 6).T
    assert own.energy(labels, phi, k) == pytest.approx(energy(labels.reshape(2, 3), unary, values, params))
    np.testing.assert_allclose(own.marginals(phi, k), exact_marginals(unary, values, params).reshape(3, -1))
    assert own.free_energy(Q, phi, k) == pytest.approx(free_energy(Q.reshape(3, 2, 3), unary, values, params))
    settled = mean_field_sequential(unary, values, params, iterations=2000).reshape(3, -1)
    np.testing.assert_allclose(own.update(settled, phi, k), settled, atol=1e-9)
    spatial = CrfParams(w_bilateral=0, w_spatial=1, sigma_gamma=1.5)
    K = gram_matrix(values, replace(spatial, normalization="none"))
    np.testing.assert_allclose(own.normalise(K), gram_matrix(values, spatial))


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
