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


def slope(in_u="(1 - b) * (q - p) + b * (y - x)", in_v="(1 - a) * (x - p) + a * (y - q)", order="{}, {}"):
    """Return an answer to task 4 with these expressions in the four scores p q / x y around the point."""
    return f"""
def slopes(s, u, v):
    n, m = int(v), int(u)
    a, b = u - m, v - n
    p, q, x, y = s[n, m], s[n, m + 1], s[n + 1, m], s[n + 1, m + 1]
    return {order.format(in_u, in_v)}"""


def by_steps(step, ahead=1, behind=1):
    """Return an answer to task 4 by finite differences."""
    return f"""
def read(s, u, v):
    down = np.maximum(0, 1 - np.abs(v - np.arange(s.shape[0])))
    return down @ s @ np.maximum(0, 1 - np.abs(u - np.arange(s.shape[1])))

def slopes(s, u, v):
    in_u = (read(s, u + {ahead * step}, v) - read(s, u - {behind * step}, v)) / {(ahead + behind) * step}
    in_v = (read(s, u, v + {ahead * step}) - read(s, u, v - {behind * step})) / {(ahead + behind) * step}
    return in_u, in_v"""


def places(true="2 * u / (w - 1) - 1", false="(2 * u + 1) / w - 1", size="h, w", pair="across, down"):
    """Return an answer to task 5 with these expressions in u and w."""
    return f"""
def unit_places(pixels, size, align_corners):
    {size} = size
    def place(u, w):
        return {true} if align_corners else {false}
    across, down = place(pixels[..., 0], w), place(pixels[..., 1], h)
    return np.stack([{pair}], axis=-1)"""


class TestPlanes(GraderChecks):
    exercise = "06_planes"
    entries = (
        # ---- task 1
        right("floor, and the last neighbour held back", task="four-pixels", code=four()),
        right(
            "the first neighbour held back",
            task="four-pixels",
            code=four(top="min(int(v), h - 2)", left="min(int(u), w - 2)"),
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
        right("the four scores, with int", task="slopes", code=slope()),
        right("finite differences, a small step", task="slopes", code=by_steps(1e-6)),
        right(
            "the slope of the kernel",
            task="slopes",
            code="""
def slopes(s, u, v):
    dn, dm = v - np.arange(s.shape[0]), u - np.arange(s.shape[1])
    def k(t):
        return np.maximum(0, 1 - np.abs(t))
    def k_slope(t):
        return np.where(np.abs(t) < 1, -np.sign(t), 0)
    return k(dn) @ s @ k_slope(dm), k_slope(dn) @ s @ k(dm)""",
        ),
        mistake("u and v swapped", task="slopes", loses=2, says="the two are swapped", code=slope(order="{1}, {0}")),
        mistake(
            "sign turned",
            task="slopes",
            loses=2,
            says="the sign is turned",
            code=slope("(1 - b) * (p - q) + b * (x - y)", "(1 - a) * (p - x) + a * (q - y)"),
        ),
        mistake(
            "weights crossed",
            task="slopes",
            loses=2,
            says="the rows' weights are crossed",
            code=slope("b * (q - p) + (1 - b) * (y - x)", "a * (x - p) + (1 - a) * (y - q)"),
        ),
        mistake("upper row alone", task="slopes", loses=2, says="that is row 0 alone", code=slope("q - p", "x - p")),
        mistake("lower row alone", task="slopes", loses=2, says="that is row 1 alone", code=slope("y - x", "y - q")),
        mistake(
            "rows added",
            task="slopes",
            loses=2,
            says="you add the differences of both rows",
            code=slope("(q - p) + (y - x)", "(x - p) + (y - q)"),
        ),
        mistake(
            "mean of the rows",
            task="slopes",
            loses=2,
            says="you take the mean of both rows",
            code=slope("((q - p) + (y - x)) / 2", "((x - p) + (y - q)) / 2"),
        ),
        mistake(
            "slope of the nearest pixel",
            task="slopes",
            loses=2,
            says="that is the slope of the nearest pixel",
            code="""
def slopes(s, u, v):
    def read(u, v):
        return s[round(v), round(u)]
    return (read(u + 1e-6, v) - read(u - 1e-6, v)) / 2e-6, (read(u, v + 1e-6) - read(u, v - 1e-6)) / 2e-6""",
        ),
        mistake(
            "the value",
            task="slopes",
            loses=2,
            says="that is the value itself",
            code=slope(*["(1 - b) * ((1 - a) * p + a * q) + b * ((1 - a) * x + a * y)"] * 2),
        ),
        mistake(
            "numpy's gradient at the nearest pixel",
            task="slopes",
            loses=2,
            says="that is row 1 alone",
            code="""
def slopes(s, u, v):
    in_v, in_u = np.gradient(s)
    return in_u[round(v), round(u)], in_v[round(v), round(u)]""",
        ),
        mistake(
            "right in u, crossed in v",
            task="slopes",
            loses=2,
            says="in v: expected",
            code=slope(in_v="a * (x - p) + (1 - a) * (y - q)"),
        ),
        mistake(
            "two steps, divided by one",
            task="slopes",
            loses=2,
            says="there are two steps",
            code=by_steps(1e-6).replace("2e-06", "1e-6"),
        ),
        mistake(
            "a step of a tenth of a pixel",
            task="slopes",
            loses=2,
            says="on inputs you haven't seen: wrong close to a pixel's centre",
            code=by_steps(0.1),
        ),
        # ---- task 5
        right("u and v by themselves", task="unit-places", code=places()),
        right(
            "from the edge, or from the centre",
            task="unit-places",
            code="""
def unit_places(pixels, size, align_corners):
    w_h = np.array([size[1], size[0]], float)
    if align_corners:
        share = pixels / (w_h - 1)
    else:
        share = (pixels + 0.5) / w_h
    return -1 + 2 * share""",
        ),
        right(
            "from the middle of the image",
            task="unit-places",
            code="""
def unit_places(pixels, size, align_corners):
    w_h = np.array(size)[::-1]
    middle = (w_h - 1) / 2
    return (pixels - middle) / (middle if align_corners else w_h / 2)""",
        ),
        right(
            "nested lists, and helpers with everyday names",
            task="unit-places",
            code="""
weights, read, loss, slips, before, s, pixels, rows, cols = "these were names of the test cells before".split() + [0]


def got(places, size, align_corners):
    if np.ndim(places) > 1:
        return [got(part, size, align_corners) for part in places]
    lasts = [n - 1 if align_corners else n for n in size[::-1]]
    return [2 * (x + 0.5 * (not align_corners)) / n - 1 for x, n in zip(places, lasts)]


def unit_places(pixels, size, align_corners):
    return got(pixels.tolist(), size, align_corners)""",
        ),
        mistake(
            "rows of different lengths",
            task="unit-places",
            loses=2,
            says="unit_places returned no array of numbers but a list",
            code="def unit_places(pixels, size, align_corners):\n    return [[1.0], [0.5, 0.0]]",
        ),
        mistake(
            "w steps from centre to centre",
            task="unit-places",
            loses=1,
            says="from the first centre to the last there are w - 1 steps",
            code=places(true="2 * u / w - 1"),
        ),
        mistake(
            "the half forgotten",
            task="unit-places",
            loses=1,
            says="half a pixel from the edge: add that half first",
            code=places(false="2 * u / w - 1"),
        ),
        mistake(
            "one formula for both: centres",
            task="unit-places",
            loses=1,
            says="here -1 and 1 are the edges",
            code=places(false="2 * u / (w - 1) - 1"),
        ),
        mistake(
            "one formula for both: edges",
            task="unit-places",
            loses=1,
            says="here -1 and 1 are the centres",
            code=places(true="(2 * u + 1) / w - 1"),
        ),
        mistake(
            "the two exchanged",
            task="unit-places",
            loses=2,
            says="that is the other convention",
            code=places(true="(2 * u + 1) / w - 1", false="2 * u / (w - 1) - 1"),
        ),
        mistake(
            "from 0 to 1",
            task="unit-places",
            loses=2,
            says="not from 0 to 1",
            code=places(true="u / (w - 1)", false="(u + 0.5) / w"),
        ),
        mistake(
            "height and width swapped",
            task="unit-places",
            loses=2,
            says="height and width are swapped",
            code=places(size="w, h"),
        ),
        mistake(
            "down before across",
            task="unit-places",
            loses=2,
            says="u and v changed places",
            code=places(pair="down, across"),
        ),
        mistake(
            "the half has the wrong sign",
            task="unit-places",
            loses=1,
            says="the half has the wrong sign",
            code=places(false="(2 * u - 1) / w - 1"),
        ),
        mistake(
            "edges, but w - 1",
            task="unit-places",
            loses=1,
            says="from edge to edge there are w pixels",
            code=places(false="(2 * u + 1) / (w - 1) - 1"),
        ),
        mistake(
            "pixels as a table of two columns",
            task="unit-places",
            loses=2,
            says="on inputs you haven't seen: the shape changed",
            code=places().replace("pixels[..., 0]", "pixels[:, 0]").replace("pixels[..., 1]", "pixels[:, 1]"),
        ),
    )
