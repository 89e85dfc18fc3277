"""The graders of exercise 11, against real mistakes and other right ways."""

import numpy as np
import pytest
from grader_checks import GraderChecks, mistake, right

from semgrid_edu.crf import PermutohedralLattice, SeparableGaussian


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Compile the package's filters before a cell of the exercise, which has six seconds, needs them."""
    values = np.zeros((6, 3), np.float32)
    for blur in (PermutohedralLattice.build(np.eye(6)), SeparableGaussian.build((2, 3), 1.0, 1.0, "none")):
        for layout in "CF":
            blur(np.asarray(values, order=layout))


def gaussian(kernel="np.exp(-0.5 * t**2 / sigma**2)", result="rows @ values @ columns", size="size"):
    """Return an answer to task 1 with this kernel of the distance t, and this product."""
    return f"""
def blur_map(values, sigma):
    def matrix(size):
        t = np.subtract.outer(np.arange(size), np.arange(size))
        size = {size}
        t = np.abs(t)
        return {kernel}
    rows, columns = matrix(values.shape[0]), matrix(values.shape[1])
    return {result}"""


def simplex(
    repair="""
    while origin.sum() > 0:
        origin[np.argmin(y - origin)] -= size
    while origin.sum() < 0:
        origin[np.argmax(y - origin)] += size""",
    first="np.rint",
    order="np.argsort(origin - y)",
    steps="order[:0:-1]",
    forward="np.ones(size, int)",
    lost="size",
    weights="np.concatenate([[1 - gaps.sum()], gaps])",
    gaps="(r[:-1] - r[1:])[::-1] / size",
    corners="np.array(corners)",
):
    """Return an answer to task 2 with these parts; r are the sorted residuals."""
    return f"""
def enclosing_simplex(y):
    size = len(y)
    origin = size * {first}(y / size).astype(int)
    early = np.argsort(origin - y){repair}
    order = {order}
    r = np.sort(y - origin)[::-1]
    corners = [origin]
    for smallest in {steps}:
        forward = {forward}
        forward[smallest] -= {lost}
        corners.append(corners[-1] + forward)
    gaps = {gaps}
    return {corners}, {weights}"""


def lattice(
    add="vertices.get(corner, 0) + weight * value",
    blurred="x / 2 + vertices.get(ahead, 0) / 4 + vertices.get(behind, 0) / 4",
    directions="range(size)",
    old="vertices.items()",
    forward="np.ones(size, int)",
    after="",
    read="sum(w * vertices[tuple(c)] for c, w in zip(*s))",
):
    """Return an answer to task 3 with these parts."""
    return f"""
def lattice_filter(simplices, values):
    vertices = {{}}
    for (corners, weights), value in zip(simplices, values):
        for corner, weight in zip(map(tuple, corners), weights):
            vertices[corner] = {add}
    size = len(simplices[0][1])
    for j in {directions}:
        forward = {forward}
        forward[j] -= size
        new = {{}}
        for v, x in {old}:
            ahead, behind = tuple(v + forward), tuple(v - forward)
            new[v] = {blurred}
        vertices = new{after}
    return np.array([{read} for s in simplices])"""


def own(expression, result="blur(Q) - own * Q"):
    """Return an answer to task 4 with this k_ii, shaped (N, 1)."""
    return f"""
def others_say(blur, Q):
    own = {expression}
    return {result}"""


def crf(
    features="np.hstack([place / 3.2, o.reshape(4, -1).T / 0.2])",
    kernels="((4, lattice), (3, spatial))",
    root="np.sqrt(weight / blur(ones))",
    update="-unary + message",
    message="scale * blur((scale * Q).astype(np.float32)) - own * Q",
    rounds="10",
    width="1.2",
    cells="log_g.reshape(C, -1).T",
    back="Q.T.reshape(log_g.shape)",
    axis="1",
    before="",
):
    """Return an answer to task 5 with these parts."""
    return f"""
def refine(log_g, o):
    C, H, W = log_g.shape
    {before}
    place, ones = np.indices((H, W)).reshape(2, -1).T, np.ones((H * W, 1), np.float32)
    lattice = PermutohedralLattice.build({features})
    spatial = SeparableGaussian.build((H, W), {width}, 1, "none")
    parts = []
    for weight, blur in {kernels}:
        scale = {root}
        parts.append((blur, scale, scale**2 * blur.diagonal[:, None]))
    unary = -({cells})
    log_Q = -unary
    for n in range({rounds} + 1):
        Q = np.exp(log_Q - log_Q.max(axis={axis}, keepdims=True))
        Q = Q / Q.sum(axis={axis}, keepdims=True)
        message = 0
        for blur, scale, own in parts:
            message = message + {message}
        log_Q = {update}
    return {back}"""


class TestFastCrf(GraderChecks):
    exercise = "11_fast_crf"
    entries = (
        # ---- task 1
        right(
            "two convolutions with padding",
            task="blur-map",
            code="""
def blur_map(values, sigma):
    for _ in range(2):
        n = len(values)
        taps = np.exp(-0.5 * (np.arange(-n + 1, n) / sigma) ** 2)
        values = np.array([np.convolve(column, taps)[n - 1 : 2 * n - 1] for column in values.T])
    return values""",
        ),
        right(
            "scipy's one-dimensional correlation",
            task="blur-map",
            code="""
from scipy.ndimage import correlate1d

def blur_map(values, sigma):
    for axis in range(2):
        n = values.shape[axis]
        taps = np.exp(-0.5 * (np.arange(-n, n + 1) / sigma) ** 2)
        values = correlate1d(values, taps, axis=axis, mode="constant")
    return values""",
        ),
        right(
            "loops over rows and columns",
            task="blur-map",
            code="""
def blur_map(values, sigma):
    H, W = values.shape
    half, full = np.zeros((H, W)), np.zeros((H, W))
    for r in range(H):
        for s in range(H):
            half[r] += np.exp(-((r - s) ** 2) / (2 * sigma**2)) * values[s]
    for c in range(W):
        for d in range(W):
            full[:, c] += np.exp(-((c - d) ** 2) / (2 * sigma**2)) * half[:, d]
    return full""",
        ),
        mistake(
            "the two passes added",
            task="blur-map",
            loses=2,
            says="the second pass must blur what the first pass left",
            code=gaussian(result="rows @ values + values @ columns"),
        ),
        mistake(
            "rows alone",
            task="blur-map",
            loses=2,
            says="the second pass must blur what the first pass left",
            code=gaussian(result="values @ columns"),
        ),
        mistake(
            "columns alone",
            task="blur-map",
            loses=2,
            says="only columns are blurred",
            code=gaussian(result="rows @ values"),
        ),
        mistake(
            "no factor 2",
            task="blur-map",
            loses=2,
            says="the factor 2 below sigma**2 is missing",
            code=gaussian("np.exp(-(t**2) / sigma**2)"),
        ),
        mistake(
            "sigma taken as the variance",
            task="blur-map",
            loses=2,
            says="you divide by sigma instead of sigma**2",
            code=gaussian("np.exp(-0.5 * t**2 / sigma)"),
        ),
        mistake(
            "distance not squared",
            task="blur-map",
            loses=2,
            says="the distance isn't squared",
            code=gaussian("np.exp(-0.5 * t / sigma**2)"),
        ),
        mistake(
            "normalised",
            task="blur-map",
            loses=2,
            says="that is normalised",
            code="""
from scipy.ndimage import gaussian_filter

def blur_map(values, sigma):
    return gaussian_filter(values, sigma, mode="constant")""",
        ),
        mistake(
            "the map goes round",
            task="blur-map",
            loses=2,
            says="your blur goes round",
            code=gaussian("np.exp(-0.5 * np.minimum(t, size - t) ** 2 / sigma**2)", size="len(t)"),
        ),
        mistake(
            "the cell itself left out",
            task="blur-map",
            loses=2,
            says="doesn't hear itself",
            code=gaussian(result="rows @ values @ columns - values"),
        ),
        mistake(
            "turned",
            task="blur-map",
            loses=2,
            says="is it turned?",
            code=gaussian(result="(rows @ values @ columns).T"),
        ),
        mistake(
            "all pairs at once",
            task="blur-map",
            loses=2,
            says="on inputs you haven't seen: a map of 60 x 50 cells took far more memory",
            code="""
def blur_map(values, sigma):
    place = np.indices(values.shape).reshape(2, -1).T
    square = ((place[:, None] - place) ** 2).sum(axis=-1)
    return (np.exp(-0.5 * square / sigma**2) @ values.ravel()).reshape(values.shape)""",
        ),
        mistake(
            "cut off at three cells",
            task="blur-map",
            loses=2,
            says="on inputs you haven't seen: wrong sums with another width",
            code=gaussian("np.exp(-0.5 * t**2 / sigma**2) * (t <= 3)"),
        ),
        # ---- task 2
        right(
            "ranks instead of loops of repair",
            task="enclosing-simplex",
            code="""
def enclosing_simplex(y):
    n = len(y)
    base = np.rint(y / n).astype(int)
    excess = base.sum()
    rank = np.empty(n, int)
    rank[np.argsort(base * n - y, kind="stable")] = np.arange(n)
    rank += excess
    base[rank < 0] += 1
    base[rank >= n] -= 1
    rank %= n
    r = (y - n * base) / n
    b = np.zeros(n + 1)
    for j in range(n):
        b[n - 1 - rank[j]] += r[j]
        b[n - rank[j]] -= r[j]
    b[0] += 1 + b[n]
    corners = [n * base + np.where(rank < n - m, m, m - n) for m in range(n)]
    return np.array(corners), b[:n]""",
        ),
        right(
            "weights by solving for them",
            task="enclosing-simplex",
            code=simplex(
                weights="np.linalg.lstsq(np.vstack([np.array(corners).T, np.ones(size)]), np.append(y, 1))[0]"
            ),
        ),
        mistake(
            "no repair",
            task="enclosing-simplex",
            loses=2,
            says="Repair the sum after rounding",
            code=simplex(repair=""),
        ),
        mistake(
            "the first coordinate repaired",
            task="enclosing-simplex",
            loses=2,
            says="change the one that was rounded up the farthest",
            code=simplex(repair="\n    origin[0] -= origin.sum()"),
        ),
        mistake(
            "the last coordinate repaired",
            task="enclosing-simplex",
            loses=2,
            says="you changed the last coordinate",
            code=simplex(repair="\n    origin[-1] -= origin.sum()"),
        ),
        mistake(
            "sorted before the repair",
            task="enclosing-simplex",
            loses=2,
            says="after the repair, not before",
            code=simplex(order="early"),
        ),
        mistake(
            "the largest residual steps back",
            task="enclosing-simplex",
            loses=2,
            says="the smallest residual loses d, not the one with the largest",
            code=simplex(steps="order[:-1]"),
        ),
        mistake(
            "a step takes d and gives nothing",
            task="enclosing-simplex",
            loses=2,
            says="corners that don't sum to 0",
            code=simplex(forward="np.zeros(size, int)", lost="size - 1"),
        ),
        mistake(
            "steps the other way",
            task="enclosing-simplex",
            loses=2,
            says="rows are in the order 0, 2, 1",
            code=simplex(forward="-np.ones(size, int)", lost="-size", steps="order[:-1]"),
        ),
        mistake(
            "gaps not divided",
            task="enclosing-simplex",
            loses=1,
            says="divide them by d + 1",
            code=simplex(gaps="(r[:-1] - r[1:])[::-1]"),
        ),
        mistake(
            "gaps in the wrong order",
            task="enclosing-simplex",
            loses=1,
            says="weights of corners 1 and 2 are swapped",
            code=simplex(gaps="(r[:-1] - r[1:]) / size"),
        ),
        mistake(
            "the first corner gets nothing",
            task="enclosing-simplex",
            loses=1,
            says="the first corner gets what the others leave",
            code=simplex(weights="np.concatenate([[0], gaps])"),
        ),
        mistake(
            "only too large sums repaired",
            task="enclosing-simplex",
            loses=2,
            says="on inputs you haven't seen: in 2 dimensions, where rounding leaves a negative sum",
            code=simplex(repair="\n    while origin.sum() > 0:\n        origin[np.argmin(y - origin)] -= size"),
        ),
        mistake(
            "two dimensions only",
            task="enclosing-simplex",
            loses=2,
            says="on inputs you haven't seen",
            code=simplex(lost="3"),
        ),
        mistake(
            "endless loop",
            task="enclosing-simplex",
            loses=2,
            says="no reply before timeout",
            code=simplex(repair="\n    while origin.sum() != 0:\n        origin[np.argmin(y - origin)] += size"),
        ),
        # ---- task 3
        right(
            "a product of matrices",
            task="lattice-filter",
            code="""
def lattice_filter(simplices, values):
    found = sorted({tuple(c) for corners, _ in simplices for c in corners})
    number = {v: m for m, v in enumerate(found)}
    S = np.zeros((len(simplices), len(found)))
    for n, (corners, weights) in enumerate(simplices):
        for c, w in zip(corners, weights):
            S[n, number[tuple(c)]] += w
    held, size = S.T @ values, len(found[0])
    for j in range(size):
        B = np.eye(len(found)) / 2
        for v, m in number.items():
            ahead = tuple(x + 1 - size * (k == j) for k, x in enumerate(v))
            if ahead in number:
                B[m, number[ahead]] = B[number[ahead], m] = 1 / 4
        held = B @ held
    return S @ held""",
        ),
        right(
            "a default dictionary",
            task="lattice-filter",
            code="""
from collections import defaultdict

def lattice_filter(simplices, values):
    held = defaultdict(float)
    for (corners, weights), value in zip(simplices, values):
        for corner, weight in zip(corners, weights):
            held[tuple(corner)] = held[tuple(corner)] + weight * value
    size = len(simplices[0][1])
    for j in range(size):
        new = {}
        for v in held:
            total = 2 * held[v]
            for sign in (-1, 1):
                w = tuple(x + sign * (1 - size * (k == j)) for k, x in enumerate(v))
                if w in held:
                    total = total + held[w]
            new[v] = total / 4
        held = new
    return np.array([weights @ np.array([held[tuple(c)] for c in corners]) for corners, weights in simplices])""",
        ),
        mistake(
            "no blur",
            task="lattice-filter",
            loses=3,
            says="nothing is blurred between splat and slice",
            code=lattice(directions="[]"),
        ),
        mistake(
            "one direction",
            task="lattice-filter",
            loses=3,
            says="you blur along one direction only",
            code=lattice(directions="[0]"),
        ),
        mistake(
            "last direction missing",
            task="lattice-filter",
            loses=3,
            says="you blur along one direction only",
            code=lattice(directions="range(size - 1)"),
        ),
        mistake(
            "halves for the neighbours",
            task="lattice-filter",
            loses=3,
            says="you blur with (1/2, 1, 1/2)",
            code=lattice(blurred="x + vertices.get(ahead, 0) / 2 + vertices.get(behind, 0) / 2"),
        ),
        mistake(
            "all of the vertex kept",
            task="lattice-filter",
            loses=3,
            says="you blur with (1/4, 1, 1/4)",
            code=lattice(blurred="x + vertices.get(ahead, 0) / 4 + vertices.get(behind, 0) / 4"),
        ),
        mistake(
            "a plain mean of the corners",
            task="lattice-filter",
            loses=3,
            says="slice with the weights of splat",
            code=lattice(read="np.mean([vertices[tuple(c)] for c in s[0]], axis=0)"),
        ),
        mistake(
            "the corners summed up",
            task="lattice-filter",
            loses=3,
            says="you slice without weights",
            code=lattice(read="sum(vertices[tuple(c)] for c in s[0])"),
        ),
        mistake(
            "the last point overwrites",
            task="lattice-filter",
            loses=3,
            says="add to it, don't overwrite",
            code=lattice(add="weight * value"),
        ),
        mistake(
            "splat without weights",
            task="lattice-filter",
            loses=3,
            says="you splat without weights",
            code=lattice(add="vertices.get(corner, 0) + value"),
        ),
        mistake(
            "the neighbour ahead only",
            task="lattice-filter",
            loses=3,
            says="the neighbour ahead only",
            code=lattice(blurred="x / 2 + vertices.get(ahead, 0) / 4"),
        ),
        mistake(
            "the neighbour behind only",
            task="lattice-filter",
            loses=3,
            says="the neighbour behind only",
            code=lattice(blurred="x / 2 + vertices.get(behind, 0) / 4"),
        ),
        mistake(
            "blurred in place",
            task="lattice-filter",
            loses=3,
            says="a blur must read old values only",
            code=lattice(old="list(vertices.items())", after="").replace("new = {}", "new = vertices"),
        ),
        mistake(
            "new vertices come into being",
            task="lattice-filter",
            loses=3,
            says="you blur into vertices that don't exist",
            code=lattice(
                old="[(u, vertices.get(u, 0)) for u in {tuple(v + k * forward) for v in vertices for k in (-1, 0, 1)}]"
            ),
        ),
        mistake(
            "the last direction first",
            task="lattice-filter",
            loses=3,
            says="you begin with the last",
            code=lattice(directions="range(size - 1, -1, -1)"),
        ),
        mistake(
            "a step changes one coordinate",
            task="lattice-filter",
            loses=3,
            says="no neighbour is found",
            code=lattice(forward="np.zeros(size, int)").replace("forward[j] -= size", "forward[j] -= 1"),
        ),
        mistake(
            "three directions whatever d is",
            task="lattice-filter",
            loses=3,
            says="on inputs you haven't seen: wrong in 3 dimensions",
            code=lattice(directions="range(min(size, 3))"),
        ),
        # ---- task 4
        right(
            "one cell silenced at a time",
            task="others-say",
            code="""
def others_say(blur, Q):
    out = np.empty_like(Q)
    for i in range(len(Q)):
        silent = Q.copy()
        silent[i] = 0
        out[i] = blur(silent)[i]
    return out""",
        ),
        right(
            "the whole matrix, its diagonal emptied",
            task="others-say",
            code="""
def others_say(blur, Q):
    K = np.array(blur(np.identity(Q.shape[0])))
    K[np.diag_indices(len(Q))] = 0
    return K @ Q""",
        ),
        right(
            "nested lists, and helpers with everyday names",
            task="others-say",
            code="""
def kernel(blur, n):
    return np.diag(blur(np.eye(n)))


def got(all_of_it, before, slips):
    return [[a - k * q for a, q in zip(row, old)] for row, old, k in zip(all_of_it, before, slips)]


def others_say(blur, Q):
    return got(blur(Q).tolist(), Q.tolist(), kernel(blur, len(Q)).tolist())""",
        ),
        mistake(
            "text instead of numbers",
            task="others-say",
            loses=2,
            says="others_say returned no array of numbers but a str",
            code=own("0", "str(blur(Q))"),
        ),
        mistake("nothing subtracted", task="others-say", loses=2, says="nothing is subtracted", code=own("0")),
        mistake("1 for every cell", task="others-say", loses=2, says="as if k_ii were 1", code=own("1")),
        mistake(
            "the row's sum",
            task="others-say",
            loses=2,
            says="you subtract the sum of the kernel's row",
            code=own("blur(np.ones((len(Q), 1)))"),
        ),
        mistake(
            "without Q",
            task="others-say",
            loses=2,
            says="you subtract k_ii without Q",
            code=own("np.diag(blur(np.eye(len(Q))))[:, None]", "blur(Q) - own"),
        ),
        mistake(
            "only what the cell tells itself",
            task="others-say",
            loses=2,
            says="that is what the cell tells itself",
            code=own("np.diag(blur(np.eye(len(Q))))[:, None]", "own * Q"),
        ),
        mistake(
            "sign swapped",
            task="others-say",
            loses=2,
            says="the sign is swapped",
            code=own("np.diag(blur(np.eye(len(Q))))[:, None]", "own * Q - blur(Q)"),
        ),
        mistake(
            "a mean",
            task="others-say",
            loses=2,
            says="you divide by the sum of the kernel's row",
            code=own("np.diag(blur(np.eye(len(Q))))[:, None]", "(blur(Q) - own * Q) / blur(np.ones((len(Q), 1)))"),
        ),
        mistake(
            "the last cell's share for all",
            task="others-say",
            loses=2,
            says="taken for all cells",
            code=own("blur(np.eye(len(Q)))[-1, -1]"),
        ),
        mistake(
            "argument changed",
            task="others-say",
            loses=2,
            says="changed its argument",
            code="""
def others_say(blur, Q):
    out = np.empty_like(Q)
    for i in range(len(Q)):
        row = Q[i].copy()
        Q[i] = 0
        out[i] = blur(Q)[i]
        if i < len(Q) - 1:
            Q[i] = row
    return out""",
        ),
        mistake(
            "three cells only",
            task="others-say",
            loses=2,
            says="on inputs you haven't seen: it raises an error in line",
            code=own("np.diag(blur(np.eye(3)))[:, None]"),
        ),
        # ---- task 5
        right("with damping", task="refine", code=crf(update="log_Q + 0.95 * (-unary + message - log_Q)")),
        right(
            "five features in place of six",
            task="refine",
            code=crf(
                before="B = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 0.4",
                features="np.hstack([place / 3.2, o.reshape(4, -1).T @ B])",
            ),
        ),
        right(
            "a lattice of one's own, of sparse matrices",
            task="refine",
            code="""
from scipy.sparse import csr_array, identity

def lattice(f):
    N, d = f.shape
    n = d + 1
    E = np.zeros((n, d))
    for j in range(d):
        E[: j + 1, j], E[j + 1, j] = 1, -(j + 1)
    y = f @ (n * np.sqrt(2 / 3) * E / np.linalg.norm(E, axis=0)).T
    base = np.rint(y / n).astype(int)
    rank = np.argsort(np.argsort(n * base - y, axis=1), axis=1) + base.sum(axis=1, keepdims=True)
    base += (rank < 0).astype(int) - (rank >= n)
    rank %= n
    r = -np.sort(n * base - y, axis=1) / n
    b = np.concatenate([1 - (r[:, :1] - r[:, -1:]), (r[:, :-1] - r[:, 1:])[:, ::-1]], axis=1)
    corners = np.stack([n * base + np.where(rank < n - m, m, m - n) for m in range(n)], axis=1).reshape(-1, n)
    low = corners[:, :d].min(axis=0) - n
    units = np.append(np.cumprod(np.append(1, corners[:, :d].max(axis=0) - low + n))[:-1], 0)
    found, index = np.unique((corners - np.append(low, 0)) @ units, return_inverse=True)
    M = len(found)
    S = csr_array((b.ravel(), (np.repeat(np.arange(N), n), index.ravel())), (N, M))
    B = identity(M, format="csr")
    for j in range(n):
        wanted = found + (1 - n * (np.arange(n) == j)) @ units
        at = np.minimum(np.searchsorted(found, wanted), M - 1)
        pairs = np.flatnonzero(found[at] == wanted)
        one = csr_array((np.full(len(pairs), 0.25), (pairs, at[pairs])), (M, M))
        B = (identity(M, format="csr") / 2 + one + one.T) @ B
    return lambda v: S @ (B @ (S.T @ v)), np.asarray(((S @ B) * S).sum(axis=1))

def refine(log_g, o):
    C, H, W = log_g.shape
    place = np.indices((H, W)).reshape(2, -1).T
    blur, own = lattice(np.hstack([place / 3.2, o.reshape(4, -1).T / 0.2]))
    g, h = (np.exp(-0.5 * (np.subtract.outer(np.arange(k), np.arange(k)) / 1.2) ** 2) for k in (H, W))
    def spatial(v):
        return np.einsum("rs,swk,wc->rck", g, v.reshape(H, W, -1), h).reshape(H * W, -1)
    ones = np.ones((H * W, 1))
    kernels = [(4, blur, own), (3, spatial, np.ones(H * W))]
    kernels = [(f, np.sqrt(w / f(ones)), w * k[:, None] / f(ones)) for w, f, k in kernels]
    start = log_g.reshape(C, -1).T
    log_Q = start
    for n in range(11):
        Q = np.exp(log_Q - log_Q.max(axis=1, keepdims=True))
        Q /= Q.sum(axis=1, keepdims=True)
        log_Q = start + sum(s * f(s * Q) - k * Q for f, s, k in kernels)
    return Q.T.reshape(C, H, W)""",
        ),
        right(
            "the package's filters, nested lists, everyday names",
            task="refine",
            code="weights, read, loss, gradient, field, before, log_g, o, y, line = [None] * 10\n"
            + crf(back="Q.T.reshape(log_g.shape).tolist()"),
        ),
        mistake(
            "nothing refined",
            task="refine",
            loses=4,
            says="you return the network's own distribution",
            code="def refine(log_g, o):\n    return np.exp(log_g)",
        ),
        mistake(
            "all pairs",
            task="refine",
            loses=1,
            says="you write all pairs down",
            code="""
from scipy.spatial.distance import cdist

def refine(log_g, o):
    place, start, K = np.indices(o.shape[1:]).reshape(2, -1).T, log_g.reshape(len(log_g), -1), 0
    for w, f in ((4, np.hstack([place / 3.2, o.reshape(4, -1).T / 0.2])), (3, place / 1.2)):
        k = np.exp(-0.5 * cdist(f, f, "sqeuclidean"))
        K = K + w * k / np.sqrt(np.outer(k.sum(axis=0), k.sum(axis=0)))
    np.fill_diagonal(K, 0)
    log_Q = start
    for _ in range(11):
        Q = np.exp(log_Q - log_Q.max(axis=0))
        Q /= Q.sum(axis=0)
        log_Q = start + Q @ K
    return Q.reshape(log_g.shape)""",
        ),
        mistake(
            "the cell itself counted",
            task="refine",
            loses=3,
            says="what a cell tells itself isn't subtracted",
            code=crf(message="scale * blur((scale * Q).astype(np.float32))"),
        ),
        mistake(
            "not normalised",
            task="refine",
            loses=3,
            says="the kernels aren't normalised",
            code=crf(root="np.sqrt(weight) * ones"),
        ),
        mistake(
            "normalised twice",
            task="refine",
            loses=3,
            says="you divide by the row sums twice",
            code=crf(root="np.sqrt(weight) / blur(ones)"),
        ),
        mistake(
            "neighbours repel",
            task="refine",
            loses=3,
            says="the sign of the sum is wrong",
            code=crf(update="-unary - message"),
        ),
        mistake(
            "sign of the unary term",
            task="refine",
            loses=3,
            says="is the sign right",
            code=crf(update="unary + message", cells="log_g.reshape(C, -1).T"),
        ),
        mistake(
            "weights swapped",
            task="refine",
            loses=3,
            says="the two weights are swapped",
            code=crf(kernels="((3, lattice), (4, spatial))"),
        ),
        mistake(
            "spatial kernel forgotten",
            task="refine",
            loses=3,
            says="the spatial kernel is missing",
            code=crf(kernels="((4, lattice),)"),
        ),
        mistake(
            "bilateral kernel forgotten",
            task="refine",
            loses=3,
            says="the bilateral kernel is missing",
            code=crf(kernels="((3, spatial),)"),
        ),
        mistake(
            "weights forgotten",
            task="refine",
            loses=3,
            says="both weights are missing",
            code=crf(kernels="((1, lattice), (1, spatial))"),
        ),
        mistake(
            "multiplied by the widths",
            task="refine",
            loses=3,
            says="features are divided by them",
            code=crf(features="np.hstack([place * 3.2, o.reshape(4, -1).T * 0.2])", width="1 / 1.2"),
        ),
        mistake(
            "occupancy forgotten",
            task="refine",
            loses=3,
            says="the bilateral kernel ignores the occupancy",
            code=crf(features="place / 3.2"),
        ),
        mistake(
            "widths swapped",
            task="refine",
            loses=3,
            says="the widths of place are swapped",
            code=crf(features="np.hstack([place / 1.2, o.reshape(4, -1).T / 0.2])", width="3.2"),
        ),
        mistake("one iteration", task="refine", loses=3, says="one iteration isn't ten", code=crf(rounds="1")),
        mistake(
            "iterations added up",
            task="refine",
            loses=3,
            says="you add up all iterations",
            code=crf(update="log_Q + message"),
        ),
        mistake(
            "reshaped, not turned",
            task="refine",
            loses=3,
            says="are classes and cells mixed up?",
            code=crf(cells="log_g.reshape(H * W, C)"),
        ),
        mistake(
            "soft-max over cells", task="refine", loses=3, says="the soft-max runs over classes", code=crf(axis="0")
        ),
        mistake(
            "log Q returned",
            task="refine",
            loses=3,
            says="return Q, not log Q",
            code=crf(back="np.log(Q).T.reshape(log_g.shape)"),
        ),
        mistake(
            "probabilities, not logarithms",
            task="refine",
            loses=3,
            says="you start from probabilities",
            code=crf(cells="np.exp(log_g).reshape(C, -1).T"),
        ),
        mistake(
            "four classes only",
            task="refine",
            loses=3,
            says="on inputs you haven't seen",
            code=crf(cells="log_g.reshape(4, -1).T", back="Q.T.reshape(4, H, W)"),
        ),
        # ---- passed, or lost, when somebody tried who had not written the tests
        mistake("3 iterations", task="refine", loses=3, says="on inputs you haven't seen", code=crf(rounds="3")),
        mistake("5 iterations", task="refine", loses=3, says="on inputs you haven't seen", code=crf(rounds="5")),
        mistake("20 iterations", task="refine", loses=3, says="on inputs you haven't seen", code=crf(rounds="20")),
        mistake(
            "a spatial width of 1",
            task="refine",
            loses=3,
            says="wrong where the kernels are exact",
            code=crf(width="1.0"),
        ),
        mistake(
            "normalised by rows",
            task="refine",
            loses=3,
            says="on inputs you haven't seen",
            code=crf(message="scale**2 * blur(Q.astype(np.float32)) - own * Q"),
        ),
        mistake(
            "a spatial weight of 2.5",
            task="refine",
            loses=3,
            says="wrong where the kernels are exact",
            code=crf(kernels="((4, lattice), (2.5, spatial))"),
        ),
        mistake(
            "nothing of its own subtracted in the spatial kernel",
            task="refine",
            loses=3,
            says="nearer to a mistake",
            code=crf(message="scale * blur((scale * Q).astype(np.float32)) - own * Q * (blur is lattice)"),
        ),
        right(
            "damped as in lecture 10",
            task="refine",
            code=crf(update="log_Q + (-unary + message - log_Q) / (1 + sum(own for _, _, own in parts) / 2)"),
        ),
        mistake(
            "large maps aren't refined, only sharpened",
            task="refine",
            loses=1,
            says="what one cell says doesn't reach any other",
            code=crf()
            + """

_known = refine

def refine(log_g, o):
    sharp = np.exp(2 * log_g)
    return _known(log_g, o) if log_g.shape[2] in (10, 50) or log_g[0].size < 1500 else sharp / sharp.sum(axis=0)""",
        ),
        mistake(
            "repaired once",
            task="enclosing-simplex",
            loses=2,
            says="on inputs you haven't seen",
            code=simplex(
                repair="""
    if origin.sum() > 0:
        origin[np.argmin(y - origin)] -= size
    if origin.sum() < 0:
        origin[np.argmax(y - origin)] += size"""
            ),
        ),
    )
