"""The graders of exercise 06, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def four(top="int(np.floor(v))", left="int(np.floor(u))", weights=None, last="min({} + 1, {} - 1)"):
    """Return an answer to task 1 with these expressions; `weights` uses a = u - left and b = v - top."""
    weights = weights or "[(1 - b) * (1 - a), (1 - b) * a, b * (1 - a), b * a]"
    return f"""
def four_pixels(u, v, h, w):
    top, left = {top}, {left}
    bottom, right = {last.format("top", "h")}, {last.format("left", "w")}
    a, b = u - left, v - top
    return [top, top, bottom, bottom], [left, right, left, right], {weights}"""


def means(
    n="v - np.arange(h)",
    m="u - np.arange(w)",
    kernel="np.maximum(0, 1 - np.abs(t))",
    seen="visible[cell, k]",
    mean="total / max(visible[cell].sum(), 1)",
):
    """Return an answer to task 2 with these distances, this kernel, this condition and this mean."""
    return f"""
def cell_means(s, pixels, visible):
    C, h, w = s.shape
    N, K = visible.shape
    def kernel(t):
        return {kernel}
    result = np.zeros((C, N))
    for cell in range(N):
        total = np.zeros(C)
        for k in range(K):
            if {seen}:
                u, v = pixels[cell, k]
                total = total + np.einsum("cnm,n,m->c", s, kernel({n}), kernel({m}))
        result[:, cell] = {mean}
    return result"""


def boxed(s="rng.normal(size=(h, w))", p_bar="rng.normal(size=n)", right="np.isclose(left, there)", kind=None):
    """Return an answer to task 3: this test for a pair, and these lines that find the kind."""
    kind = (
        kind
        or """
    shares = A * p_bar[:, None]
    total, n_read = shares.sum(axis=0), (A > 0).sum(axis=1)
    got = np.ravel(backward(p_bar))
    if np.allclose(got, total):
        return PAIR
    if np.allclose(got, total / n):
        return MEAN
    last = np.zeros(h * w)
    for share in shares:
        last = np.where(share != 0, share, last)
    return OVERWRITES if np.allclose(got, last) else NEAREST"""
    )
    return f"""
def is_pair(forward, backward, h, w, n):
    rng = np.random.default_rng(3)
    s, p_bar = {s}, {p_bar}
    there, left = np.sum(np.ravel(forward(s)) * p_bar), np.sum(np.asarray(backward(p_bar)) * s)
    return bool({right})


def which_kind(forward, backward, h, w, n):
    A = np.array([np.ravel(forward(one)) for one in np.eye(h * w).reshape(-1, h, w)]).T
    p_bar = np.random.default_rng(3).uniform(1, 2, n)
    {kind}"""


def matrix(
    number="r * w + c", weight="x / seen.sum()", seen="seen[k]", sparse="csr_matrix((x, (i, j)), shape=(N, h * w))"
):
    """Return an answer to task 6 that collects these numbers and weights."""
    return f"""
from scipy.sparse import csr_matrix

def cell_matrix(pixels, visible, h, w, weights_of):
    N, K = visible.shape
    i, j, all_weights = [], [], []
    for cell in range(N):
        seen = visible[cell]
        for k in range(K):
            if {seen}:
                for r, c, x in zip(*weights_of(*pixels[cell, k], h, w)):
                    i.append(cell)
                    j.append(int({number}))
                    all_weights.append({weight})
    x = all_weights
    return {sparse}


def there_and_back(s, p_bar, pixels, visible, weights_of=None):
    A = cell_matrix(pixels, visible, *s.shape[1:], weights_of)
    return (A @ s.reshape(len(s), -1).T).T, (A.T @ p_bar.T).T.reshape(s.shape)"""


def yaw(
    p_bar="p - t[j]",
    u_turns="K[0, 0] * (1 + (X / Z) ** 2)",
    v_turns="K[1, 1] * X * Y / Z**2",
    in_u="(1 - b) * (s[n, m + 1] - s[n, m]) + b * (s[n + 1, m + 1] - s[n + 1, m])",
    in_v="(1 - a) * (s[n + 1, m] - s[n, m]) + a * (s[n + 1, m + 1] - s[n, m + 1])",
    result="total",
):
    """Return an answer to task 4 by the chain rule with these factors."""
    return f"""
def yaw_slope(s, points, K, t):
    total = 0.0
    for j, (X, Y, Z) in enumerate(points):
        u, v = K[0, 0] * X / Z + K[0, 2], K[1, 1] * Y / Z + K[1, 2]
        n, m = int(v), int(u)
        a, b = u - m, v - n
        p = (1 - b) * ((1 - a) * s[n, m] + a * s[n, m + 1]) + b * ((1 - a) * s[n + 1, m] + a * s[n + 1, m + 1])
        in_u, in_v = {in_u}, {in_v}
        total += ({p_bar}) * (in_u * ({u_turns}) + in_v * ({v_turns}))
    return {result}"""


def by_steps(step):
    """Return an answer to task 4 by finite differences of the whole loss."""
    return f"""
def yaw_slope(s, points, K, t):
    def loss(angle):
        X, Y, Z = points.T
        X, Z = X * np.cos(angle) + Z * np.sin(angle), Z * np.cos(angle) - X * np.sin(angle)
        u, v = K[0, 0] * X / Z + K[0, 2], K[1, 1] * Y / Z + K[1, 2]
        down = np.maximum(0, 1 - np.abs(v[:, None] - np.arange(s.shape[0])))
        across = np.maximum(0, 1 - np.abs(u[:, None] - np.arange(s.shape[1])))
        return 0.5 * ((np.einsum("jn,nm,jm->j", down, s, across) - t) ** 2).sum()
    return (loss({step}) - loss(-{step})) / (2 * {step})"""


def probe(at="1.0", ramp="np.tile(np.arange(w, dtype=float), (h, 1))", swap="False"):
    """Return an answer to task 5 that reads two places of this ramp."""
    return f"""
def swaps(sampler, h, w):
    first, second = sampler(np.tile(np.arange(w, dtype=float), (h, 1)), np.array([1.0, 2.0]), np.array([1.0, 1.0]))
    return bool(abs(first - second) < 1e-6)

def convention(sampler, h, w):
    if not {swap} and swaps(sampler, h, w):
        return convention(lambda image, u, v: sampler(image, v, u), h, w)
    at = {at}
    read = float(np.ravel(sampler({ramp}, np.array([at]), np.array([1.0])))[0])
    places = {{CENTRES: at, CORNERS: at - 0.5, STRETCHED: at * (w - 1) / w}}
    return min(places, key=lambda kind: abs(places[kind] - read))"""


class TestPlanes(GraderChecks):
    exercise = "06_planes"
    entries = (
        # ---- task 1
        right("floor, and the last neighbour held back", task="four-pixels", code=four()),
        right(
            "the first neighbour held back",
            task="four-pixels",
            code=four(top="max(min(int(v), h - 2), 0)", left="max(min(int(u), w - 2), 0)"),
        ),
        right(
            "ask every pixel for its kernel",
            task="four-pixels",
            code="""
def four_pixels(u, v, h, w):
    table = np.outer(np.maximum(0, 1 - np.abs(v - np.arange(h))), np.maximum(0, 1 - np.abs(u - np.arange(w))))
    chosen = np.argsort(table.ravel())[-4:]
    return chosen // w, chosen % w, table.ravel()[chosen]""",
        ),
        mistake(
            "rows and columns swapped",
            task="four-pixels",
            loses=2,
            says="rows and columns are swapped",
            code=four(top="int(np.floor(u))", left="int(np.floor(v))").replace(
                "a, b = u - left, v - top", "a, b = v - left, u - top"
            ),
        ),
        mistake(
            "half a pixel taken off",
            task="four-pixels",
            loses=3,
            says="so take no half off",
            code=four().replace("(u, v, h, w):", "(u, v, h, w):\n    u, v = u - 0.5, v - 0.5"),
        ),
        mistake(
            "half a pixel added",
            task="four-pixels",
            loses=2,
            says="you add half a pixel",
            code=four().replace("(u, v, h, w):", "(u, v, h, w):\n    u, v = u + 0.5, v + 0.5"),
        ),
        mistake(
            "weights crossed",
            task="four-pixels",
            loses=2,
            says="the nearer pixel has the larger one",
            code=four(weights="[b * a, b * (1 - a), (1 - b) * a, (1 - b) * (1 - a)]"),
        ),
        mistake(
            "weights across crossed",
            task="four-pixels",
            loses=2,
            says="the weights across are crossed",
            code=four(weights="[(1 - b) * a, (1 - b) * (1 - a), b * a, b * (1 - a)]"),
        ),
        mistake(
            "weights down crossed",
            task="four-pixels",
            loses=2,
            says="the weights down are crossed",
            code=four(weights="[b * (1 - a), b * a, (1 - b) * (1 - a), (1 - b) * a]"),
        ),
        mistake(
            "weights added",
            task="four-pixels",
            loses=2,
            says="you add the weights across and down: multiply them",
            code=four(weights="[(1 - b) + (1 - a), (1 - b) + a, b + (1 - a), b + a]"),
        ),
        mistake(
            "mean of the weights",
            task="four-pixels",
            loses=2,
            says="you take a mean of the weights",
            code=four(weights="[(2 - b - a) / 4, (1 - b + a) / 4, (b + 1 - a) / 4, (b + a) / 4]"),
        ),
        mistake(
            "as the crow flies",
            task="four-pixels",
            loses=2,
            says="the distance as the crow flies",
            code=four(weights="[max(0, 1 - np.hypot(a - i, b - j)) for j in (0, 1) for i in (0, 1)]"),
        ),
        mistake(
            "nearest pixel",
            task="four-pixels",
            loses=2,
            says="that is the nearest one, but a point reads four",
            code="""
def four_pixels(u, v, h, w):
    return [round(v)] * 4, [round(u)] * 4, [1, 0, 0, 0]""",
        ),
        mistake(
            "floor and ceil",
            task="four-pixels",
            loses=1,
            says="all weights are 0. Where u is an integer",
            code="""
def four_pixels(u, v, h, w):
    left, right, top, bottom = int(np.floor(u)), int(np.ceil(u)), int(np.floor(v)), int(np.ceil(v))
    a, b, x, y = u - left, v - top, right - u, bottom - v
    weights = [y * x, y * a, b * x, b * a]
    return [top, top, bottom, bottom], [left, right, left, right], weights""",
        ),
        mistake(
            "a pixel beyond the last",
            task="four-pixels",
            loses=1,
            says="take one that exists",
            code=four(last="{} + 1"),
        ),
        mistake(
            "limits of the example written in",
            task="four-pixels",
            loses=2,
            says="on inputs you haven't seen: wrong weights",
            code=four(top="min(int(v), 2)", left="min(int(u), 3)", last="min({} + 1, 3)"),
        ),
        mistake(
            "two borders, but not both at once",
            task="four-pixels",
            loses=1,
            says="on inputs you haven't seen: a pixel that doesn't exist",
            code="""
def four_pixels(u, v, h, w):
    left, top = int(u), int(v)
    right, bottom = left + 1, top + 1
    a, b = u - left, v - top
    if right == w:
        right = left
    elif bottom == h:
        bottom = top
    weights = [(1 - b) * (1 - a), (1 - b) * a, b * (1 - a), b * a]
    return [top, top, bottom, bottom], [left, right, left, right], weights""",
        ),
        mistake(
            "pixel -1 in an image of one column",
            task="four-pixels",
            loses=1,
            says="on inputs you haven't seen",
            code=four(top="min(int(v), h - 2)", left="min(int(u), w - 2)"),
        ),
        # ---- task 2
        right("a loop over cells and points", task="cell-means", code=means()),
        right(
            "scipy interpolates all, then sums",
            task="cell-means",
            code="""
from scipy.ndimage import map_coordinates

def cell_means(s, pixels, visible):
    values = np.zeros((len(s), *visible.shape))
    for c, image in enumerate(s):
        values[c, visible] = map_coordinates(image, pixels[visible].T[::-1], order=1)
    return values.sum(axis=2) / np.maximum(visible.sum(axis=1), 1)""",
        ),
        right(
            "np.nanmean where there is something",
            task="cell-means",
            code="""
def cell_means(s, pixels, visible):
    u, v = np.where(visible[..., None], pixels, np.nan).transpose(2, 0, 1)
    down = np.maximum(0, 1 - np.abs(v[..., None] - np.arange(s.shape[1])))
    across = np.maximum(0, 1 - np.abs(u[..., None] - np.arange(s.shape[2])))
    values = np.einsum("ikn,cnm,ikm->cik", down, s, across)
    return np.nan_to_num(np.nanmean(values, axis=2))""",
        ),
        mistake(
            "the sum",
            task="cell-means",
            loses=2,
            says="that is the sum of its two points",
            code=means(mean="total"),
        ),
        mistake(
            "read once, in the middle",
            task="cell-means",
            loses=3,
            says="you read once, at the mean place",
            code=means(mean="np.einsum('cnm,n,m->c', s, kernel(y - np.arange(h)), kernel(x - np.arange(w)))").replace(
                "        total = np.zeros(C)",
                "        total = np.zeros(C)\n        x, y = pixels[cell].mean(axis=0)",
            ),
        ),
        mistake(
            "the first point",
            task="cell-means",
            loses=2,
            says="that is its first point alone",
            code=means(seen="visible[cell, k] and k == np.argmax(visible[cell])", mean="total"),
        ),
        mistake(
            "u and v swapped",
            task="cell-means",
            loses=2,
            says="u and v are swapped",
            code=means(n="u - np.arange(h)", m="v - np.arange(w)"),
        ),
        mistake(
            "weights crossed",
            task="cell-means",
            loses=2,
            says="the weights are crossed",
            code=means(kernel="np.where(np.abs(t) < 1, np.abs(t), 0) + (t == 0)"),
        ),
        mistake(
            "a kernel of ones",
            task="cell-means",
            loses=2,
            says="the weights of a point must sum to 1",
            code=means(kernel="(np.abs(t) < 1).astype(float)"),
        ),
        mistake(
            "the kernel without max",
            task="cell-means",
            loses=2,
            says="a kernel below zero",
            code=means(kernel="1 - np.abs(t)"),
        ),
        mistake(
            "half a pixel added",
            task="cell-means",
            loses=2,
            says="you read half a pixel too far right and down",
            code=means(n="np.minimum(v + 0.5, h - 1) - np.arange(h)", m="np.minimum(u + 0.5, w - 1) - np.arange(w)"),
        ),
        mistake(
            "cells first",
            task="cell-means",
            loses=3,
            says="expected one value for each class and cell",
            code=means().replace("return result", "return result.T"),
        ),
        mistake(
            "divided by all points",
            task="cell-means",
            loses=1,
            says="divide by the number of VISIBLE points",
            code=means(mean="total / K"),
        ),
        mistake(
            "nothing by nothing",
            task="cell-means",
            loses=1,
            says="nothing divided by nothing is NaN",
            code=means(mean="total / visible[cell].sum()"),
        ),
        mistake("visible ignored", task="cell-means", loses=1, says="NaN times 0 is NaN", code=means(seen="True")),
        mistake(
            "inside the image, so visible",
            task="cell-means",
            loses=1,
            says="lies in the image, but isn't visible",
            code=means(
                seen="0 <= pixels[cell, k, 0] <= w - 1 and 0 <= pixels[cell, k, 1] <= h - 1",
                mean="total / max(((pixels[cell] >= 0) & (pixels[cell] <= [w - 1, h - 1])).all(axis=1).sum(), 1)",
            ),
        ),
        mistake(
            "last row and column left out",
            task="cell-means",
            loses=2,
            says="(2, 2) lies on the last pixel",
            code=means(seen="visible[cell, k] and pixels[cell, k, 0] < w - 1 and pixels[cell, k, 1] < h - 1"),
        ),
        mistake(
            "the width of the example written in",
            task="cell-means",
            loses=2,
            says="on inputs you haven't seen: wrong means",
            code=means(m="np.minimum(u, 2) - np.arange(w)"),
        ),
        mistake(
            "pixels overwritten",
            task="cell-means",
            loses=1,
            says="it changes an argument",
            code=means().replace("    N, K = visible.shape", "    N, K = visible.shape\n    pixels[~visible] = 0"),
        ),
        mistake(
            "waits for a sum of zero",
            task="cell-means",
            loses=3,
            says="no reply before timeout",
            code="""
def cell_means(s, pixels, visible):
    result = np.ones((len(s), len(pixels)))
    while np.abs(result).sum() > 0:
        result = result + 0.01 * result
    return result""",
        ),
        # ---- task 3
        right("a random test, and what is left over", task="which-kind", code=boxed()),
        right(
            "the whole matrix both ways",
            task="which-kind",
            code="""
def is_pair(forward, backward, h, w, n):
    return which_kind(forward, backward, h, w, n) == PAIR


def which_kind(forward, backward, h, w, n):
    A = np.array([np.ravel(forward(one)) for one in np.eye(h * w).reshape(-1, h, w)]).T
    units = np.array([np.ravel(backward(one)) for one in np.eye(n)])
    together = np.ravel(backward(np.ones(n)))
    if np.allclose(units, A) and np.allclose(together, A.sum(axis=0)):
        return PAIR
    if np.allclose(units * n, A):
        return MEAN
    nearest = np.allclose(np.sort(units, axis=1)[:, :-1], 0) and np.allclose(units.sum(axis=1), 1)
    return NEAREST if nearest else OVERWRITES""",
        ),
        mistake(
            "an image of ones",
            task="which-kind",
            loses=1,
            says="the backward pass is NEAREST, and you call it a pair",
            code=boxed(s="np.ones((h, w))"),
        ),
        mistake(
            "the last point alone",
            task="which-kind",
            loses=1,
            says="do two points share a pixel in your test?",
            code=boxed(p_bar="np.eye(n)[-1]"),
        ),
        mistake(
            "always a pair",
            task="which-kind",
            loses=1,
            says="and you call it a pair",
            code=boxed(right="True"),
        ),
        mistake(
            "the sign of the difference",
            task="which-kind",
            loses=1,
            says="the test is p_bar . forward(s)",
            code=boxed(right="np.isclose(left, -there)"),
        ),
        mistake(
            "mean and overwriting confused",
            task="which-kind",
            loses=2,
            says="the backward pass is OVERWRITES, and you find MEAN",
            code=boxed(
                kind="return PAIR if is_pair(forward, backward, h, w, n) else MEAN if np.count_nonzero("
                "backward(p_bar)) > n else NEAREST"
            ),
        ),
        mistake(
            "never the nearest",
            task="which-kind",
            loses=2,
            says="the backward pass is NEAREST, and you find OVERWRITES",
            code=boxed().replace("return OVERWRITES if np.allclose(got, last) else NEAREST", "return OVERWRITES"),
        ),
        mistake(
            "a square image taken for granted",
            task="which-kind",
            loses=1,
            says="on inputs you haven't seen",
            code=boxed(s="rng.normal(size=(h, h))"),
        ),
        mistake(
            "five points taken for granted",
            task="which-kind",
            loses=2,
            says="on inputs you haven't seen: the wrong kind",
            code=boxed().replace("total / n)", "total / 5)"),
        ),
        # ---- task 4
        right("the chain rule, point by point", task="yaw-slope", code=yaw()),
        right("finite differences, a small step", task="yaw-slope", code=by_steps(1e-7)),
        mistake(
            "steps across a kink",
            task="yaw-slope",
            loses=3,
            says="does a step cross it?",
            code=by_steps(2e-4),
        ),
        mistake(
            "wanted minus read",
            task="yaw-slope",
            loses=3,
            says="the sign is turned",
            code=yaw(p_bar="t[j] - p"),
        ),
        mistake(
            "the half forgotten",
            task="yaw-slope",
            loses=3,
            says="the half of the loss is missing",
            code=yaw(p_bar="2 * (p - t[j])"),
        ),
        mistake(
            "v forgotten",
            task="yaw-slope",
            loses=3,
            says="v is missing",
            code=yaw(v_turns="0"),
        ),
        mistake(
            "f_u alone",
            task="yaw-slope",
            loses=3,
            says="Z changes too",
            code=yaw(u_turns="K[0, 0]"),
        ),
        mistake(
            "v the other way",
            task="yaw-slope",
            loses=3,
            says="v moves the other way",
            code=yaw(v_turns="-K[1, 1] * X * Y / Z**2"),
        ),
        mistake(
            "slopes swapped",
            task="yaw-slope",
            loses=3,
            says="the slopes in u and v are swapped",
            code=yaw(
                in_u="(1 - a) * (s[n + 1, m] - s[n, m]) + a * (s[n + 1, m + 1] - s[n, m + 1])",
                in_v="(1 - b) * (s[n, m + 1] - s[n, m]) + b * (s[n + 1, m + 1] - s[n + 1, m])",
            ),
        ),
        mistake(
            "a mean over points",
            task="yaw-slope",
            loses=3,
            says="the loss is a sum, no mean",
            code=yaw(result="total / len(points)"),
        ),
        mistake(
            "the sign of the error alone",
            task="yaw-slope",
            loses=3,
            says="wrong slope",
            code=yaw(p_bar="np.sign(p - t[j])"),
        ),
        mistake(
            "one focal length",
            task="yaw-slope",
            loses=3,
            says="on inputs you haven't seen: wrong slope",
            code=yaw(v_turns="K[0, 0] * X * Y / Z**2"),
        ),
        # ---- task 5
        right("one place on a ramp", task="convention", code=probe()),
        right(
            "where a single bright column lies",
            task="convention",
            code="""
def swaps(sampler, h, w):
    image = np.zeros((h, w))
    image[:, :2] = 1
    low, high = sampler(image, np.array([0.0, 3.0]), np.array([0.0, 0.0]))
    return bool(abs(low - high) < 1e-6)


def convention(sampler, h, w):
    if swaps(sampler, h, w):
        return convention(lambda image, u, v: sampler(image, v, u), h, w)
    image = np.zeros((h, w))
    image[:, 2] = 1
    places = {CENTRES: 2.0, CORNERS: 2.5, STRETCHED: 2.0 * w / (w - 1)}
    return max(places, key=lambda kind: sampler(image, np.array([places[kind]]), np.array([1.0]))[0])""",
        ),
        mistake(
            "never corners",
            task="convention",
            loses=2,
            says="the sampler is CORNERS",
            code=probe().replace("CORNERS: at - 0.5, ", ""),
        ),
        mistake(
            "at zero",
            task="convention",
            loses=2,
            says="the sampler is CORNERS",
            code=probe(at="0.0"),
        ),
        mistake(
            "corners and stretched exchanged",
            task="convention",
            loses=2,
            says="the sampler is",
            code=probe(at="w - 2.0").replace("CORNERS: at - 0.5, STRETCHED", "STRETCHED: at - 0.5, CORNERS"),
        ),
        mistake(
            "height for width",
            task="convention",
            loses=2,
            says="the sampler is",
            code=probe(at="w - 2.0").replace("at * (w - 1) / w", "at * (h - 1) / h"),
        ),
        mistake(
            "widths below a hundred",
            task="convention",
            loses=2,
            says="on inputs you haven't seen: the wrong convention",
            code=probe(at="min(w, 40) - 2.0").replace(
                "np.tile(np.arange(w, dtype=float), (h, 1)), np.array([at])",
                "np.tile(np.minimum(np.arange(w), 20.0), (h, 1)), np.array([at])",
            ),
        ),
        mistake(
            "never swaps",
            task="convention",
            loses=1,
            says="a sampler that takes v for u",
            code=probe() + "\n\n\ndef swaps(sampler, h, w):\n    return False",
        ),
        mistake(
            "swaps seen, but not undone",
            task="convention",
            loses=1,
            says="convention is wrong for a sampler that swaps",
            code=probe(swap="True").replace("np.array([at]), np.array([1.0])", "np.array([at]), np.array([3.0])"),
        ),
        # ---- task 6
        right("point by point", task="cell-matrix", code=matrix()),
        right(
            "a full matrix",
            task="cell-matrix",
            code=matrix(sparse="full").replace(
                "    x = all_weights\n",
                "    full = np.zeros((N, h * w))\n    np.add.at(full, (i, j), all_weights)\n",
            ),
        ),
        mistake(
            "the sum over points",
            task="cell-matrix",
            loses=3,
            says="that is the sum over a cell's points",
            code=matrix(weight="x"),
        ),
        mistake(
            "divided by all points",
            task="cell-matrix",
            loses=3,
            says="you divide by all points of a cell",
            code=matrix(weight="x / K"),
        ),
        mistake(
            "n * h + m",
            task="cell-matrix",
            loses=3,
            says="Is the number of a pixel n * w + m?",
            code=matrix(number="min(r * h + c, h * w - 1)"),
        ),
        mistake(
            "columns first",
            task="cell-matrix",
            loses=3,
            says="Is the number of a pixel n * w + m?",
            code=matrix(number="c * h + r"),
        ),
        mistake(
            "entries that meet replace each other",
            task="cell-matrix",
            loses=3,
            says="not the means of the visible points",
            code=matrix(sparse="full").replace(
                "    x = all_weights\n",
                "    full = np.zeros((N, h * w))\n    full[i, j] = all_weights\n",
            ),
        ),
        mistake(
            "the sizes of the example written in",
            task="cell-matrix",
            loses=3,
            says="on inputs you haven't seen",
            code=matrix(number="r * 80 + c"),
        ),
        mistake(
            "in the image, so visible",
            task="cell-matrix",
            loses=3,
            says="on inputs you haven't seen: wrong means",
            code=matrix(
                seen="np.isfinite(pixels[cell, k]).all() and 0 <= pixels[cell, k, 0] <= w - 1 and "
                "0 <= pixels[cell, k, 1] <= h - 1",
                weight="x / max(seen.sum(), 1)",
            ),
        ),
    )
