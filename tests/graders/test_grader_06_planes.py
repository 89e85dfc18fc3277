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


def plane(n="v - np.arange(h)", m="u - np.arange(w)", kernel="np.maximum(0, 1 - np.abs(t))", seen="visible[r, c]"):
    """Return an answer to task 2 with these distances from rows and columns, this kernel and this condition."""
    return f"""
def sample_plane(s, pixels, visible):
    C, h, w = s.shape
    H, W = visible.shape
    def k(t):
        return {kernel}
    p = np.zeros((C, H, W))
    for r in range(H):
        for c in range(W):
            if {seen}:
                u, v = pixels[r, c]
                p[:, r, c] = np.einsum("cnm,n,m->c", s, k({n}), k({m}))
    return p"""


def back(add="s_bar[k] += p_bar[k, r, c] * x", before="", after="", seen="visible[r, c]", uv="u, v"):
    """Return an answer to task 3 that does `add` for each class k and each visible point (r, c) with weights x."""
    return f"""
def give_back(p_bar, pixels, visible, h, w):
    C, H, W = p_bar.shape
    s_bar, n_read, total = np.zeros((C, h, w)), np.zeros((h, w)), np.zeros((h, w))
    {before or "pass"}
    for r in range(H):
        for c in range(W):
            if {seen}:
                {uv} = pixels[r, c]
                down = np.maximum(0, 1 - np.abs(v - np.arange(h)))
                across = np.maximum(0, 1 - np.abs(u - np.arange(w)))
                x = np.outer(down, across)
                n_read, total = n_read + (x > 0), total + x
                for k in range(C):
                    {add}
    {after or "pass"}
    return s_bar"""


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
        right("a loop over points", task="sample-plane", code=plane()),
        right(
            "gather four rows, no loop",
            task="sample-plane",
            code="""
def sample_plane(s, pixels, visible):
    C, h, w = s.shape
    u, v = pixels[visible].T
    m, n = np.minimum(u.astype(int), w - 2), np.minimum(v.astype(int), h - 2)
    a, b = u - m, v - n
    p = np.zeros((C, *visible.shape))
    p[:, visible] = (1 - b) * ((1 - a) * s[:, n, m] + a * s[:, n, m + 1]) + b * (
        (1 - a) * s[:, n + 1, m] + a * s[:, n + 1, m + 1]
    )
    return p""",
        ),
        right(
            "scipy interpolates",
            task="sample-plane",
            code="""
from scipy.ndimage import map_coordinates

def sample_plane(s, pixels, visible):
    p = np.zeros((len(s), *visible.shape))
    for c, image in enumerate(s):
        p[c, visible] = map_coordinates(image, pixels[visible].T[::-1], order=1)
    return p""",
        ),
        mistake(
            "u and v swapped",
            task="sample-plane",
            loses=2,
            says="u and v are swapped",
            code=plane(n="u - np.arange(h)", m="v - np.arange(w)"),
        ),
        mistake(
            "weights crossed",
            task="sample-plane",
            loses=2,
            says="the weights are crossed",
            code=plane(kernel="np.where(np.abs(t) < 1, np.abs(t), 0) + (t == 0)"),
        ),
        mistake(
            "nearest pixel",
            task="sample-plane",
            loses=2,
            says="that is the nearest pixel",
            code=plane(kernel="(np.abs(t) <= 0.5).astype(float)"),
        ),
        mistake(
            "a kernel of ones",
            task="sample-plane",
            loses=2,
            says="the weights must sum to 1",
            code=plane(kernel="(np.abs(t) < 1).astype(float)"),
        ),
        mistake(
            "the kernel without max",
            task="sample-plane",
            loses=2,
            says="a kernel below zero",
            code=plane(kernel="1 - np.abs(t)"),
        ),
        mistake(
            "half a pixel added",
            task="sample-plane",
            loses=2,
            says="you read half a pixel too far right and down",
            code=plane(n="np.minimum(v + 0.5, h - 1) - np.arange(h)", m="np.minimum(u + 0.5, w - 1) - np.arange(w)"),
        ),
        mistake(
            "points first",
            task="sample-plane",
            loses=3,
            says="expected one value a class and point",
            code=plane().replace("return p", "return p.transpose(1, 2, 0)"),
        ),
        mistake(
            "one class", task="sample-plane", loses=3, says="expected one value a class and point", code=plane() + "[0]"
        ),
        mistake(
            "last row and column left out",
            task="sample-plane",
            loses=2,
            says="point (2, 2) lies on the last pixel",
            code=plane(seen="visible[r, c] and pixels[r, c, 0] < w - 1 and pixels[r, c, 1] < h - 1"),
        ),
        mistake("visible ignored", task="sample-plane", loses=1, says="NaN times 0 is NaN", code=plane(seen="True")),
        mistake(
            "weighed by visible",
            task="sample-plane",
            loses=1,
            says="Leave such points out, don't weigh them",
            code=plane(seen="True").replace("return p", "return p * visible"),
        ),
        mistake(
            "inside the image, so visible",
            task="sample-plane",
            loses=1,
            says="isn't visible (something hides it)",
            code=plane(seen="0 <= pixels[r, c, 0] <= w - 1 and 0 <= pixels[r, c, 1] <= h - 1"),
        ),
        mistake(
            "the width of the example written in",
            task="sample-plane",
            loses=2,
            says="on inputs you haven't seen: wrong values",
            code=plane(m="np.minimum(u, 2) - np.arange(w)"),
        ),
        mistake(
            "pixels overwritten",
            task="sample-plane",
            loses=1,
            says="it changes an argument",
            code=plane().replace("    H, W = visible.shape", "    H, W = visible.shape\n    pixels[~visible] = 0"),
        ),
        # ---- task 3
        right("a loop over points and classes", task="give-back", code=back()),
        right(
            "np.add.at on four pixels",
            task="give-back",
            code="""
def give_back(p_bar, pixels, visible, h, w):
    s_bar = np.zeros((len(p_bar), h, w))
    u, v = pixels[visible].T
    m, n = np.minimum(u.astype(int), w - 2), np.minimum(v.astype(int), h - 2)
    for dn in (0, 1):
        for dm in (0, 1):
            weight = np.abs(1 - dn - (v - n)) * np.abs(1 - dm - (u - m))
            np.add.at(s_bar, (slice(None), n + dn, m + dm), p_bar[:, visible] * weight)
    return s_bar""",
        ),
        right(
            "the transpose of the matrix",
            task="give-back",
            code="""
def give_back(p_bar, pixels, visible, h, w):
    u, v = pixels[visible].T
    down = np.maximum(0, 1 - np.abs(v[:, None] - np.arange(h)))
    across = np.maximum(0, 1 - np.abs(u[:, None] - np.arange(w)))
    A = (down[:, :, None] * across[:, None, :]).reshape(-1, h * w)
    return (A.T @ p_bar[:, visible].T).T.reshape(-1, h, w)""",
        ),
        mistake(
            "assigned, not added",
            task="give-back",
            loses=2,
            says="replaces that of the first",
            code=back("s_bar[k] = np.where(x > 0, p_bar[k, r, c] * x, s_bar[k])"),
        ),
        mistake(
            "+= with repeated indices",
            task="give-back",
            loses=2,
            says="adds once a pixel",
            code="""
def give_back(p_bar, pixels, visible, h, w):
    s_bar = np.zeros((len(p_bar), h, w))
    u, v = pixels[visible].T
    m, n = np.minimum(u.astype(int), w - 2), np.minimum(v.astype(int), h - 2)
    for dn in (0, 1):
        for dm in (0, 1):
            weight = np.abs(1 - dn - (v - n)) * np.abs(1 - dm - (u - m))
            s_bar[:, n + dn, m + dm] += p_bar[:, visible] * weight
    return s_bar""",
        ),
        mistake(
            "divided by the number of points",
            task="give-back",
            loses=2,
            says="a sum has no mean in it",
            code=back(after="s_bar = s_bar / visible.sum()"),
        ),
        mistake(
            "mean over the readers",
            task="give-back",
            loses=2,
            says="you take the mean over a pixel's readers",
            code=back(after="s_bar = s_bar / np.maximum(n_read, 1)"),
        ),
        mistake(
            "divided by the weights",
            task="give-back",
            loses=2,
            says="you divide by the sum of the weights",
            code=back(after="s_bar = s_bar / np.where(total > 0, total, 1)"),
        ),
        mistake(
            "weights squared",
            task="give-back",
            loses=2,
            says="the weights are squared",
            code=back("s_bar[k] += p_bar[k, r, c] * x * x"),
        ),
        mistake(
            "weights without blame",
            task="give-back",
            loses=2,
            says="that is the sum of the weights",
            code=back("s_bar[k] += x"),
        ),
        mistake(
            "sign turned",
            task="give-back",
            loses=2,
            says="the sign is turned",
            code=back("s_bar[k] -= p_bar[k, r, c] * x"),
        ),
        mistake(
            "classes added up",
            task="give-back",
            loses=2,
            says="you add up the classes",
            code=back("s_bar[:] += p_bar[k, r, c] * x"),
        ),
        mistake(
            "u and v swapped", task="give-back", loses=2, says="u counts columns, v counts rows", code=back(uv="v, u")
        ),
        mistake(
            "all to the nearest pixel",
            task="give-back",
            loses=2,
            says="all blame goes to the nearest pixel",
            code=back("s_bar[k, int(v + 0.5), int(u + 0.5)] += p_bar[k, r, c]"),
        ),
        mistake(
            "NaN let in",
            task="give-back",
            loses=1,
            says="Leave it out, don't weigh it",
            code=back("s_bar[k] += visible[r, c] * p_bar[k, r, c] * x", seen="True"),
        ),
        mistake(
            "NaN sent to the first pixel",
            task="give-back",
            loses=1,
            says="the point that isn't visible teaches a pixel",
            code=back(seen="True").replace("= pixels[r, c]", "= np.nan_to_num(pixels[r, c])"),
        ),
        mistake(
            "NaN taken for not visible",
            task="give-back",
            loses=1,
            says="on inputs you haven't seen: points that aren't visible teach somebody",
            code=back(seen="not np.isnan(pixels[r, c]).any()"),
        ),
        mistake(
            "waits for a loss of zero",
            task="give-back",
            loses=3,
            says="no reply before timeout",
            code="""
def give_back(p_bar, pixels, visible, h, w):
    s_bar = np.zeros((len(p_bar), h, w))
    while np.abs(p_bar).sum() > 0:
        s_bar -= 0.01 * s_bar
    return s_bar""",
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
    )
