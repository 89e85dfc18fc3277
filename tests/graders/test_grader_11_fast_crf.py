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


def gaussian(
    kernel="np.exp(-0.5 * t**2 / sigma**2)",
    held="np.where(known, values, 0)",
    below="rows @ known.astype(float) @ columns",
    above="rows @ held @ columns",
    result="above / below",
    size="size",
):
    """Return an answer to task 1 with this kernel of the distance t, and these two sums."""
    return f"""
def blur_known(values, known, sigma):
    def matrix(size):
        t = np.subtract.outer(np.arange(size), np.arange(size))
        size = {size}
        t = np.abs(t)
        return {kernel}
    rows, columns = matrix(values.shape[0]), matrix(values.shape[1])
    held = {held}
    above, below = {above}, {below}
    return {result}"""


def missing(
    forward="np.ones(size, int)",
    lost="size",
    directions="range(size)",
    result="1 - found / (2 * size * len(vertices))",
    signs="(1, -1)",
    there="set(map(tuple, vertices.tolist()))",
):
    """Return an answer to task 2 with these parts."""
    return f"""
def missing_share(vertices):
    size, found = vertices.shape[1], 0
    there = {there}
    for j in {directions}:
        forward = {forward}
        forward[j] -= {lost}
        for sign in {signs}:
            found += sum(tuple(v) in there for v in (vertices + sign * forward).tolist())
    return {result}"""


def lattice(
    add="vertices.get(corner, 0) + weight * value",
    blurred="x / 2 + vertices.get(ahead, x) / 4 + vertices.get(behind, x) / 4",
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


def own(expression, result="blur(Q) - own * Q", before=""):
    """Return an answer to task 4 with this k_ii, shaped (N, 1)."""
    return f"""
def others_say(blur, Q, shape, reach):
    def ask(period):
        r, c = np.indices(shape).reshape(2, -1) % period
        group = r * period + c
        return blur(np.eye(period**2)[group])[np.arange(len(Q)), group][:, None]
    {before}
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
            "two convolutions with padding, of both sums",
            task="blur-known",
            code="""
def blur_known(values, known, sigma):
    def two_passes(part):
        for _ in range(2):
            n = len(part)
            taps = np.exp(-0.5 * (np.arange(-n + 1, n) / sigma) ** 2)
            part = np.array([np.convolve(column, taps)[n - 1 : 2 * n - 1] for column in part.T])
        return part
    return two_passes(np.where(known, values, 0.0)) / two_passes(np.where(known, 1.0, 0.0))""",
        ),
        right(
            "scipy's one-dimensional correlation, both sums stacked",
            task="blur-known",
            code="""
from scipy.ndimage import correlate1d

def blur_known(values, known, sigma):
    both = np.stack([np.nan_to_num(values * np.where(known, 1, np.nan)), known]).astype(float)
    for axis in (1, 2):
        n = both.shape[axis]
        taps = np.exp(-0.5 * (np.arange(-n, n + 1) / sigma) ** 2)
        both = correlate1d(both, taps, axis=axis, mode="constant")
    return both[0] / both[1]""",
        ),
        mistake(
            "NaN multiplied by 0",
            task="blur-known",
            loses=2,
            says="NaN spreads",
            code=gaussian(held="values * known"),
        ),
        mistake(
            "a sum",
            task="blur-known",
            loses=2,
            says="divide by the sum of the weights of known cells",
            code=gaussian(result="above"),
        ),
        mistake(
            "unknown cells count as 0",
            task="blur-known",
            loses=2,
            says="leave their weights out of the lower sum",
            code=gaussian(below="rows @ np.ones(values.shape) @ columns"),
        ),
        mistake(
            "along rows alone",
            task="blur-known",
            loses=2,
            says="both sums take two passes",
            code=gaussian(above="held @ columns", below="known @ columns"),
        ),
        mistake(
            "means of means",
            task="blur-known",
            loses=2,
            says="that is a mean of the means of rows",
            code=gaussian(
                above="rows @ np.nan_to_num((held @ columns) / (known @ columns))",
                below="rows @ np.ones(values.shape)",
            ),
        ),
        mistake(
            "the plain mean",
            task="blur-known",
            loses=2,
            says="the plain mean of the known cells",
            code=gaussian(result="np.full(values.shape, values[known].mean())"),
        ),
        mistake(
            "only gaps are filled",
            task="blur-known",
            loses=2,
            says="a known cell is blurred as well",
            code=gaussian(result="np.where(known, values, above / below)"),
        ),
        mistake(
            "no factor 2",
            task="blur-known",
            loses=2,
            says="the factor 2 below sigma**2 is missing",
            code=gaussian("np.exp(-(t**2) / sigma**2)"),
        ),
        mistake(
            "sigma taken as the variance",
            task="blur-known",
            loses=2,
            says="you divide by sigma instead of sigma**2",
            code=gaussian("np.exp(-0.5 * t**2 / sigma)"),
        ),
        mistake(
            "distance not squared",
            task="blur-known",
            loses=2,
            says="the distance isn't squared",
            code=gaussian("np.exp(-0.5 * t / sigma**2)"),
        ),
        mistake(
            "the map goes round",
            task="blur-known",
            loses=2,
            says="your blur goes round",
            code=gaussian("np.exp(-0.5 * np.minimum(t, size - t) ** 2 / sigma**2)", size="len(t)"),
        ),
        mistake(
            "the cell itself left out",
            task="blur-known",
            loses=2,
            says="doesn't hear itself",
            code=gaussian(above="rows @ held @ columns - held", below="rows @ known.astype(float) @ columns - known"),
        ),
        mistake(
            "turned",
            task="blur-known",
            loses=2,
            says="is it turned?",
            code=gaussian(result="(above / below).T"),
        ),
        mistake(
            "gaps filled in place",
            task="blur-known",
            loses=2,
            says="changed its argument `values`",
            code=gaussian(held="np.nan_to_num(values, copy=False)"),
        ),
        mistake(
            "finite in place of known",
            task="blur-known",
            loses=2,
            says="on inputs you haven't seen",
            code=gaussian(held="np.where(values > 0, values, 0)"),
        ),
        mistake(
            "all pairs at once",
            task="blur-known",
            loses=2,
            says="on inputs you haven't seen: a map of 60 x 50 cells took far more memory",
            code="""
def blur_known(values, known, sigma):
    place = np.indices(values.shape).reshape(2, -1).T
    square = ((place[:, None] - place[known.ravel()]) ** 2).sum(axis=-1)
    weight = np.exp(-0.5 * square / sigma**2)
    return (weight @ values[known] / weight.sum(axis=1)).reshape(values.shape)""",
        ),
        mistake(
            "cut off at three cells",
            task="blur-known",
            loses=2,
            says="on inputs you haven't seen: wrong means with another width",
            code=gaussian("np.exp(-0.5 * t**2 / sigma**2) * (t <= 3)"),
        ),
        # ---- task 2
        right("a set, neighbour by neighbour", task="missing-share", code=missing()),
        right(
            "rows of numbers, sorted",
            task="missing-share",
            code="""
def missing_share(vertices):
    size, found = vertices.shape[1], 0
    low = vertices.min(axis=0) - size - 1
    units = np.cumprod(np.append(1, np.ptp(vertices, axis=0) + 2 * size + 3))[:size]
    keys = np.sort((vertices - low) @ units)
    for j in range(size):
        ahead = (vertices + 1 - size * (np.arange(size) == j) - low) @ units
        found += 2 * np.isin(ahead, keys).sum()
    return np.array([1 - found / (2 * size * len(vertices))])""",
        ),
        right(
            "one direction of each link, with a fraction",
            task="missing-share",
            code="""
from fractions import Fraction

def missing_share(vertices):
    size = vertices.shape[1]
    there = dict.fromkeys(map(tuple, vertices.tolist()))
    links = sum(tuple(c + 1 - size * (i == j) for i, c in enumerate(v)) in there for v in there for j in range(size))
    return 1 - Fraction(int(links), size * len(there))""",
        ),
        mistake(
            "the share that exists",
            task="missing-share",
            loses=3,
            says="that is the share that exists",
            code=missing(result="found / (2 * size * len(vertices))"),
        ),
        mistake(
            "a number in place of a share",
            task="missing-share",
            loses=3,
            says="that is the number of missing ones: divide",
            code=missing(result="2 * size * len(vertices) - found"),
        ),
        mistake(
            "a number for each vertex",
            task="missing-share",
            loses=3,
            says="missing ones for each vertex",
            code=missing(result="2 * size - found / len(vertices)"),
        ),
        mistake(
            "steps along one coordinate",
            task="missing-share",
            loses=3,
            says="no neighbour is found",
            code=missing(forward="np.zeros(size, int)", lost="-1"),
        ),
        mistake(
            "d taken from a coordinate that also got 1",
            task="missing-share",
            loses=3,
            says="no neighbour is found",
            code=missing(lost="size - 1"),
        ),
        mistake(
            "d directions",
            task="missing-share",
            loses=3,
            says="the last direction is left out",
            code=missing(directions="range(size - 1)", result="1 - found / (2 * (size - 1) * len(vertices))"),
        ),
        mistake(
            "the first direction left out",
            task="missing-share",
            loses=3,
            says="the first direction is left out",
            code=missing(directions="range(1, size)", result="1 - found / (2 * (size - 1) * len(vertices))"),
        ),
        mistake(
            "each link once",
            task="missing-share",
            loses=3,
            says="both ends have a neighbour",
            code=missing(signs="(1,)"),
        ),
        mistake(
            "half of the neighbours",
            task="missing-share",
            loses=3,
            says="each direction has two neighbours",
            code=missing(result="2 - found / (size * len(vertices))"),
        ),
        mistake(
            "vertices that lack any",
            task="missing-share",
            loses=3,
            says="or you count vertices that lack any",
            code="""
def missing_share(vertices):
    there, size = set(map(tuple, vertices.tolist())), vertices.shape[1]
    steps = [s * (1 - size * np.eye(size, dtype=int)[j]) for j in range(size) for s in (1, -1)]
    return np.mean([any(tuple((v + step).tolist()) not in there for step in steps) for v in vertices])""",
        ),
        mistake(
            "three coordinates written in",
            task="missing-share",
            loses=3,
            says="on inputs you haven't seen",
            code=missing(lost="3"),
        ),
        mistake(
            "each with each",
            task="missing-share",
            loses=1,
            says="look each neighbour up in a set",
            code="""
def missing_share(vertices):
    size, found = vertices.shape[1], 0
    for j in range(size):
        ahead = vertices + 1 - size * (np.arange(size) == j)
        found += 2 * (ahead[:, None] == vertices).all(axis=-1).sum()
    return 1 - found / (2 * size * len(vertices))""",
        ),
        mistake(
            "endless loop",
            task="missing-share",
            loses=3,
            says="before timeout",
            code="def missing_share(vertices):\n    while len(vertices):\n        vertices = vertices + 1",
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
        B = np.eye(len(found))
        for v, m in number.items():
            ahead = tuple(x + 1 - size * (k == j) for k, x in enumerate(v))
            if ahead in number:
                B[m, number[ahead]] = B[number[ahead], m] = 1 / 4
                B[m, m] -= 1 / 4
                B[number[ahead], number[ahead]] -= 1 / 4
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
                total = total + (held[w] if w in held else held[v])
            new[v] = total / 4
        held = new
    return np.array([weights @ np.array([held[tuple(c)] for c in corners]) for corners, weights in simplices])""",
        ),
        mistake(
            "the lecture's blur",
            task="lattice-filter",
            loses=3,
            says="that is the lecture's blur",
            code=lattice(blurred="x / 2 + vertices.get(ahead, 0) / 4 + vertices.get(behind, 0) / 4"),
        ),
        mistake(
            "divided by the weights that exist",
            task="lattice-filter",
            loses=3,
            says="you divide by the weights that exist",
            code=lattice(
                blurred="(x / 2 + vertices.get(ahead, 0) / 4 + vertices.get(behind, 0) / 4)"
                " / (1 / 2 + (ahead in vertices) / 4 + (behind in vertices) / 4)"
            ),
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
            code=lattice(blurred="x + vertices.get(ahead, x) / 2 + vertices.get(behind, x) / 2"),
        ),
        mistake(
            "all of the vertex kept",
            task="lattice-filter",
            loses=3,
            says="you blur with (1/4, 1, 1/4)",
            code=lattice(blurred="x + vertices.get(ahead, x) / 4 + vertices.get(behind, x) / 4"),
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
            code=lattice(blurred="x / 2 + vertices.get(ahead, x) / 4"),
        ),
        mistake(
            "the neighbour behind only",
            task="lattice-filter",
            loses=3,
            says="the neighbour behind only",
            code=lattice(blurred="x / 2 + vertices.get(behind, x) / 4"),
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
                old="[(u, vertices.get(u, 0)) for u in {tuple(v + k * forward) for v in vertices for k in (-1, 0, 1)}]",
                blurred="x / 2 + vertices.get(ahead, 0) / 4 + vertices.get(behind, 0) / 4",
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
            says="on inputs you haven't seen: wrong in another number of dimensions",
            code=lattice(directions="range(min(size, 3))"),
        ),
        # ---- task 4
        right("cells reach + 1 apart", task="others-say", code=own("ask(reach + 1)")),
        right("cells 2 reach + 1 apart", task="others-say", code=own("ask(2 * reach + 1)")),
        right(
            "column by column, cells silenced",
            task="others-say",
            code="""
def others_say(blur, Q, shape, reach):
    said = np.array(blur(Q)).reshape(*shape, -1)
    out, n = said.copy(), reach + 1
    for r in range(n):
        for c in range(n):
            some = np.zeros(shape)
            some[r::n, c::n] = 1
            back = np.reshape(blur(some.reshape(-1, 1)), shape)
            own = Q.reshape(*shape, -1)[r::n, c::n] * back[r::n, c::n, None]
            out[r::n, c::n] = said[r::n, c::n] - own
    return out.reshape(Q.shape)""",
        ),
        right(
            "one call for all, nested lists",
            task="others-say",
            code="""
def others_say(blur, Q, shape, reach):
    n, K = reach + 1, Q.shape[1]
    group = [(i // shape[1] % n) * n + i % shape[1] % n for i in range(len(Q))]
    probe = np.array([[float(g == m) for m in range(n * n)] for g in group])
    answer = np.array(blur(np.hstack([Q, probe])))
    return [[answer[i, k] - answer[i, K + g] * Q[i, k] for k in range(K)] for i, g in enumerate(group)]""",
        ),
        mistake(
            "cell by cell",
            task="others-say",
            loses=2,
            says="ask several cells in one column",
            code=own("np.diag(blur(np.eye(len(Q))))[:, None]"),
        ),
        mistake(
            "cells that hear each other",
            task="others-say",
            loses=2,
            says="you subtract the sum of the kernel's row",
            code=own("ask(reach) if reach else 1"),
        ),
        mistake(
            "rows far apart, columns not",
            task="others-say",
            loses=2,
            says="hear each other: how far apart",
            code=own(
                "blur(np.eye(reach + 1)[group])[np.arange(len(Q)), group][:, None]",
                before="group = np.indices(shape)[0].ravel() % (reach + 1)",
            ),
        ),
        mistake(
            "every n-th cell, counted along rows",
            task="others-say",
            loses=2,
            says="hear each other: how far apart",
            code=own(
                "blur(np.eye(2 * reach + 2)[group])[np.arange(len(Q)), group][:, None]",
                before="group = np.arange(len(Q)) % (2 * reach + 2)",
            ),
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
            code=own("ask(reach + 1)", "blur(Q) - own"),
        ),
        mistake(
            "only what the cell tells itself",
            task="others-say",
            loses=2,
            says="that is what the cell tells itself",
            code=own("ask(reach + 1)", "own * Q"),
        ),
        mistake(
            "sign swapped",
            task="others-say",
            loses=2,
            says="the sign is swapped",
            code=own("ask(reach + 1)", "own * Q - blur(Q)"),
        ),
        mistake(
            "the first cell's share for all",
            task="others-say",
            loses=2,
            says="taken for all cells",
            code=own("ask(reach + 1)[0]"),
        ),
        mistake(
            "a mean of all shares",
            task="others-say",
            loses=2,
            says="that is a mean of all k_ii",
            code=own("ask(reach + 1).mean()"),
        ),
        mistake(
            "argument changed",
            task="others-say",
            loses=2,
            says="changed its argument",
            code="""
def others_say(blur, Q, shape, reach):
    n = reach + 1
    r, c = np.indices(shape).reshape(2, -1) % n
    own = blur(np.eye(n * n)[r * n + c])[np.arange(len(Q)), r * n + c]
    said = blur(Q)
    Q *= own[:, None]
    return said - Q""",
        ),
        mistake(
            "a reach of 1 written in",
            task="others-say",
            loses=2,
            says="on inputs you haven't seen",
            code=own("ask(2)"),
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
            "the occupancy changed in place",
            task="refine",
            code=crf(before="o /= 0.2", features="np.hstack([place / 3.2, o.reshape(4, -1).T])"),
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
    )
