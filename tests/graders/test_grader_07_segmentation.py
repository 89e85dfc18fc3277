"""The graders of exercise 07, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def field(start="1", adds="(kernel - 1) * rate * jump", then="jump *= stride", result="field, jump"):
    """Return an answer to task 1 that adds and multiplies like this."""
    return f"""
def receptive_field(layers):
    field, jump = {start}, 1
    for kernel, stride, rate in layers:
        field += {adds}
        {then}
    return {result}"""


MAX_POOL = """
def max_pool(image):
    h, w = image.shape
    pooled, indices = np.zeros((h // 2, w // 2)), np.zeros((h // 2, w // 2), int)
    for v in range(h // 2):
        for u in range(w // 2):
            window = image[2 * v : 2 * v + 2, 2 * u : 2 * u + 2]
            n, m = np.unravel_index(window.argmax(), (2, 2))
            pooled[v, u] = window[n, m]
            indices[v, u] = INDEX
    return pooled, indices
"""
UNPOOL = """
def unpool(pooled, indices, shape):
    image = np.zeros(shape)
    for value, index in zip(pooled.ravel(), indices.ravel()):
        image[index // shape[1], index % shape[1]] = value
    return image
"""


def pool(index="(2 * v + n) * w + 2 * u + m", unpool=UNPOOL):
    """Return an answer to task 2 with this index, or another way back."""
    return MAX_POOL.replace("INDEX", index) + unpool


ATROUS = """
def atrous(image, kernel, rate):
    h, w = image.shape
    out = np.zeros((h, w))
    for v in range(h):
        for u in range(w):
            for n in range(3):
                for m in range(3):
                    y, x = v + rate * (n - 1), u + rate * (m - 1)
                    if 0 <= y < h and 0 <= x < w:
                        out[v, u] += kernel[n, m] * image[y, x]
    return out
"""


def loss(softmax="np.exp(scores) / np.exp(scores).sum(axis=0)", result="-np.log(p).mean()"):
    """Return an answer to task 5 with another soft-max or another mean; none survives large scores."""
    return f"""
def cross_entropy(scores, truth):
    P = {softmax}
    v, u = np.nonzero(truth != 255)
    p = P[truth[v, u], v, u]
    return {result}"""


def enlarging(places="2 * np.arange(len(values)) + 0.5", result="up + fine"):
    """Return an answer to task 4 in which the values belong to these places, or that ends like this."""
    return f"""
def add_skip(coarse, fine):
    def enlarge(values):
        return np.interp(np.arange(2 * len(values)), {places}, values)

    up = np.apply_along_axis(enlarge, 2, np.apply_along_axis(enlarge, 1, coarse))
    C, H, W = fine.shape
    whole, up = up, up[:, :H, :W]
    return {result}"""


class TestSegmentation(GraderChecks):
    exercise = "07_segmentation"
    entries = (
        # ---- task 1
        right(
            "from the last layer back to the first",
            task="field",
            code="""
def receptive_field(layers):
    field = 1
    for kernel, stride, rate in reversed(layers):
        field = (field - 1) * stride + rate * (kernel - 1) + 1
    return field, int(np.prod([stride for _, stride, _ in layers]))""",
        ),
        right(
            "no loop",
            task="field",
            code="""
def receptive_field(layers):
    kernel, stride, rate = np.array(layers, int).reshape(-1, 3).T
    jumps = np.cumprod([1, *stride])
    return 1 + int(((kernel - 1) * rate * jumps[:-1]).sum()), int(jumps[-1])""",
        ),
        right(
            "recursion",
            task="field",
            code="""
def receptive_field(layers):
    if not layers:
        return 1, 1
    field, jump = receptive_field(layers[:-1])
    kernel, stride, rate = layers[-1]
    return field + (kernel - 1) * rate * jump, jump * stride""",
        ),
        mistake(
            "jump forgotten",
            task="field",
            loses=2,
            says="the jump is forgotten",
            code=field(adds="(kernel - 1) * rate"),
        ),
        mistake(
            "a layer's own stride counted in it",
            task="field",
            loses=2,
            says="a layer's own stride counts from the next layer on",
            code=field(adds="(kernel - 1) * rate * jump * stride"),
        ),
        mistake(
            "kernel instead of kernel - 1",
            task="field",
            loses=2,
            says="a kernel of 3 adds its two neighbours",
            code=field(adds="kernel * rate * jump"),
        ),
        mistake(
            "rate forgotten",
            task="field",
            loses=2,
            says="the rate is forgotten",
            code=field(adds="(kernel - 1) * jump"),
        ),
        mistake("field starts at 0", task="field", loses=2, says="start with a field of 1", code=field(start="0")),
        mistake(
            "strides added",
            task="field",
            loses=2,
            says="strides multiply",
            code=field(then="jump += stride"),
        ),
        mistake(
            "rate applied to the stride",
            task="field",
            loses=2,
            says="it is no part of the jump",
            code=field(then="jump *= stride * rate"),
        ),
        mistake(
            "kernels added up",
            task="field",
            loses=2,
            says="you add up the kernels",
            code="def receptive_field(layers):\n    return sum(k for k, _, _ in layers), 4",
        ),
        mistake(
            "a kernel of 3 with rate 2 taken for one of 6",
            task="field",
            loses=2,
            says="spans 5 pixels, not 6",
            code=field(adds="(kernel * rate - 1) * jump"),
        ),
        mistake(
            "field only",
            task="field",
            loses=2,
            says="return two numbers",
            code=field(result="field"),
        ),
        mistake(
            "jump of one stride",
            task="field",
            loses=2,
            says="so outputs lie 4 pixels apart",
            code=field(result="field, 2"),
        ),
        mistake(
            "from the last layer to the first, by the formula of the first to the last",
            task="field",
            loses=2,
            says="you walk from the last layer to the first",
            code=field().replace("in layers", "in layers[::-1]"),
        ),
        mistake(
            "rate and stride swapped",
            task="field",
            loses=2,
            says="each layer is (kernel, stride, rate)",
            code=field().replace("kernel, stride, rate in", "kernel, rate, stride in"),
        ),
        mistake(
            "jump first",
            task="field",
            loses=2,
            says="return the field first, then the jump",
            code=field(result="jump, field"),
        ),
        mistake(
            "pixels counted without the holes",
            task="field",
            loses=2,
            says="on inputs you haven't seen: wrong field (from the first pixel to the last",
            code="""
def receptive_field(layers):
    seen, jump = {0}, 1
    for kernel, stride, rate in reversed(layers):
        seen = {stride * place + rate * k for place in seen for k in range(kernel)}
        jump *= stride
    return len(seen), jump""",
        ),
        mistake(
            "strides are 2 or nothing",
            task="field",
            loses=2,
            says="on inputs you haven't seen: wrong jump",
            code=field(then="jump *= 2 if stride > 1 else 1"),
        ),
        mistake(
            "waits for the list to be empty",
            task="field",
            loses=2,
            says="No reply from kernel before timeout",
            code="""
def receptive_field(layers):
    field, jump = 1, 1
    while layers:
        kernel, stride, rate = layers[0]
        field += (kernel - 1) * rate * jump
        jump *= stride
    return field, jump""",
        ),
        # ---- task 2
        right("loops", task="pool", code=pool()),
        right(
            "four shifted maps",
            task="pool",
            code="""
def max_pool(image):
    places = np.arange(image.size).reshape(image.shape)
    corners = [(n, m) for n in (0, 1) for m in (0, 1)]
    values = np.stack([image[n::2, m::2] for n, m in corners])
    best = values.argmax(axis=0)[None]
    places = np.stack([places[n::2, m::2] for n, m in corners])
    return np.take_along_axis(values, best, 0)[0], np.take_along_axis(places, best, 0)[0]

def unpool(pooled, indices, shape):
    image = np.zeros(shape[0] * shape[1])
    np.put(image, indices, pooled)
    return image.reshape(shape)""",
        ),
        right(
            "lists of numbers",
            task="pool",
            code="""
def max_pool(image):
    h, w = image.shape
    best = [
        [max((image[v + n, u + m], (v + n) * w + u + m) for n in (0, 1) for m in (0, 1)) for u in range(0, w, 2)]
        for v in range(0, h, 2)
    ]
    return [[value for value, _ in row] for row in best], [[place for _, place in row] for row in best]

def unpool(pooled, indices, shape):
    image = [[0.0] * shape[1] for _ in range(shape[0])]
    for value, index in zip(np.ravel(pooled), np.ravel(indices)):
        image[index // shape[1]][index % shape[1]] = value
    return image""",
        ),
        mistake(
            "decimals cut off",
            task="pool",
            loses=1,
            says="on inputs you haven't seen: a maximum isn't where its index says, or isn't what it was",
            code=pool(unpool=UNPOOL.replace("np.zeros(shape)", "np.zeros(shape, int)")),
        ),
        mistake(
            "index in the window",
            task="pool",
            loses=2,
            says="that is the index in the window",
            code=pool("2 * n + m"),
        ),
        mistake(
            "row times height",
            task="pool",
            loses=2,
            says="you multiply the row by the height",
            code=pool("(2 * v + n) * h + 2 * u + m"),
        ),
        mistake(
            "column by column",
            task="pool",
            loses=2,
            says="you count column by column",
            code=pool("(2 * u + m) * h + 2 * v + n"),
        ),
        mistake(
            "width of the pooled map",
            task="pool",
            loses=2,
            says="you multiply the row by the width of the pooled map",
            code=pool("(2 * v + n) * (w // 2) + 2 * u + m"),
        ),
        mistake(
            "counted from 1",
            task="pool",
            loses=2,
            says="you count from 1",
            code=pool("(2 * v + n) * w + 2 * u + m + 1"),
        ),
        mistake(
            "the window's corner",
            task="pool",
            loses=2,
            says="that is the window's first number",
            code=pool("2 * v * w + 2 * u"),
        ),
        mistake(
            "windows that overlap",
            task="pool",
            loses=2,
            says="your windows overlap",
            code="""
def max_pool(image):
    h, w = image.shape
    pooled = np.array([[image[v : v + 2, u : u + 2].max() for u in range(w - 1)] for v in range(h - 1)])
    return pooled, np.zeros_like(pooled)
"""
            + UNPOOL,
        ),
        mistake(
            "mean pooling",
            task="pool",
            loses=2,
            says="that is the mean of the window",
            code=pool().replace("window[n, m]", "window.mean()"),
        ),
        mistake(
            "minima",
            task="pool",
            loses=2,
            says="those are the minima",
            code=pool().replace("argmax", "argmin"),
        ),
        mistake(
            "a maximum that starts at 0",
            task="pool",
            loses=2,
            says="on inputs you haven't seen: wrong maxima (a map may be negative everywhere)",
            code=pool().replace("= window[n, m]", "= max(0, window[n, m])"),
        ),
        mistake(
            "spread over the window",
            task="pool",
            loses=1,
            says="a maximum goes to one place, not to its whole window",
            code=pool(
                unpool="def unpool(pooled, indices, shape):\n    return pooled.repeat(2, axis=0).repeat(2, axis=1)"
            ),
        ),
        mistake(
            "into the window's corner",
            task="pool",
            loses=1,
            says="2 lies at (0, 0), a corner of its window",
            code=pool(
                unpool="""
def unpool(pooled, indices, shape):
    image = np.zeros(shape)
    image[::2, ::2] = pooled
    return image"""
            ),
        ),
        mistake(
            "row by the height",
            task="pool",
            loses=1,
            says="divide by the width",
            code=pool(
                unpool="""
def unpool(pooled, indices, shape):
    image = np.zeros((6, 6))
    for value, index in zip(pooled.ravel(), indices.ravel()):
        image[index // shape[0], index % shape[0]] = value
    return image[: shape[0], : shape[1]]"""
            ),
        ),
        mistake(
            "twice the pooled size whatever is asked for",
            task="pool",
            loses=1,
            says="on inputs you haven't seen: not the shape that was asked for",
            code=pool(
                unpool="""
def unpool(pooled, indices, shape):
    image = np.zeros((2 * pooled.shape[0], 2 * pooled.shape[1]))
    rows, columns = np.divmod(indices, shape[1])
    inside = (rows < image.shape[0]) & (columns < image.shape[1])
    image[rows[inside], columns[inside]] = pooled[inside]
    return image"""
            ),
        ),
        # ---- task 3
        right("four loops", task="atrous", code=ATROUS),
        right(
            "a larger kernel with zeros, and scipy",
            task="atrous",
            code="""
from scipy.ndimage import correlate

def atrous(image, kernel, rate):
    spread = np.zeros((2 * rate + 1, 2 * rate + 1))
    spread[::rate, ::rate] = kernel
    return correlate(image, spread, mode="constant")""",
        ),
        mistake(
            "rate taken for a stride",
            task="atrous",
            loses=3,
            says="you take the rate for a stride",
            code=ATROUS.replace("rate * (n - 1), u + rate * (m - 1)", "n - 1, u + m - 1").replace(
                "return out", "return out[::rate, ::rate]"
            ),
        ),
        mistake(
            "padded by 1",
            task="atrous",
            loses=3,
            says="pad by rate, not by 1",
            code="""
def atrous(image, kernel, rate):
    padded = np.pad(image, 1)
    h, w = padded.shape[0] - 2 * rate, padded.shape[1] - 2 * rate
    return sum(
        kernel[n, m] * padded[rate * n : rate * n + h, rate * m : rate * m + w] for n in range(3) for m in range(3)
    )""",
        ),
        mistake(
            "not padded",
            task="atrous",
            loses=3,
            says="the border is missing",
            code="""
def atrous(image, kernel, rate):
    h, w = image.shape[0] - 2 * rate, image.shape[1] - 2 * rate
    return sum(
        kernel[n, m] * image[rate * n : rate * n + h, rate * m : rate * m + w] for n in range(3) for m in range(3)
    )""",
        ),
        mistake(
            "rate ignored",
            task="atrous",
            loses=3,
            says="the pixel's neighbour answers",
            code=ATROUS.replace("rate *", "1 *"),
        ),
        mistake(
            "kernel turned round",
            task="atrous",
            loses=3,
            says="the kernel is turned round: for the output at (0, 1)",
            code=ATROUS.replace("kernel[n, m]", "kernel[2 - n, 2 - m]"),
        ),
        mistake(
            "rows of the kernel turned round",
            task="atrous",
            loses=3,
            says="the kernel is turned round from top to bottom",
            code=ATROUS.replace("kernel[n, m]", "kernel[2 - n, m]"),
        ),
        mistake(
            "columns of the kernel turned round",
            task="atrous",
            loses=3,
            says="the kernel is turned round from left to right",
            code=ATROUS.replace("kernel[n, m]", "kernel[n, 2 - m]"),
        ),
        mistake(
            "rate on the rows only",
            task="atrous",
            loses=3,
            says="the pixel's neighbour answers",
            code=ATROUS.replace("u + rate * (m - 1)", "u + (m - 1)"),
        ),
        mistake(
            "one hole too many",
            task="atrous",
            loses=3,
            says="is the rate applied to rows and to columns?",
            code=ATROUS.replace("rate *", "(rate + 1) *"),
        ),
        mistake(
            "kernel transposed",
            task="atrous",
            loses=3,
            says="rows and columns of the kernel are swapped",
            code=ATROUS.replace("kernel[n, m]", "kernel[m, n]"),
        ),
        mistake(
            "kernel not centred",
            task="atrous",
            loses=3,
            says="the middle weight, 5, meets the pixel",
            code=ATROUS.replace("(n - 1), u + rate * (m - 1)", "n, u + rate * m"),
        ),
        mistake(
            "border repeated",
            task="atrous",
            loses=3,
            says="outside, everything is zero",
            code=ATROUS.replace(
                "if 0 <= y < h and 0 <= x < w:",
                "y, x = np.clip(y, 0, h - 1), np.clip(x, 0, w - 1)\n                    if True:",
            ),
        ),
        mistake(
            "np.roll: what leaves on the right comes back on the left",
            task="atrous",
            loses=3,
            says="outside, everything is zero",
            code="""
def atrous(image, kernel, rate):
    return sum(
        kernel[n, m] * np.roll(image, (-rate * (n - 1), -rate * (m - 1)), axis=(0, 1))
        for n in range(3)
        for m in range(3)
    )""",
        ),
        mistake(
            "rate 2 written in",
            task="atrous",
            loses=3,
            says="on inputs you haven't seen: wrong with rate 1",
            code=ATROUS.replace("rate *", "2 *"),
        ),
        # ---- task 4
        right(
            "scipy's spline of order 1",
            task="skip",
            code="""
from scipy.ndimage import map_coordinates

def add_skip(coarse, fine):
    C, H, W = fine.shape
    places = np.stack(np.meshgrid((np.arange(H) - 0.5) / 2, (np.arange(W) - 0.5) / 2, indexing="ij"))
    return np.array([map_coordinates(s, places, order=1, mode="nearest") for s in coarse]) + fine""",
        ),
        right(
            "three quarters of the near, one of the far",
            task="skip",
            code="""
def double(values):
    before = np.concatenate([values[:, :1], values[:, :-1]], axis=1)
    after = np.concatenate([values[:, 1:], values[:, -1:]], axis=1)
    both = np.stack([0.75 * values + 0.25 * before, 0.75 * values + 0.25 * after], axis=2)
    return both.reshape(values.shape[0], -1, values.shape[2])

def add_skip(coarse, fine):
    up = double(double(coarse).swapaxes(1, 2)).swapaxes(1, 2)
    return fine + up[:, : fine.shape[1], : fine.shape[2]]""",
        ),
        right("np.interp along both axes", task="skip", code=enlarging()),
        mistake(
            "nearest",
            task="skip",
            loses=3,
            says="each value is repeated (nearest)",
            code="""
def add_skip(coarse, fine):
    return coarse.repeat(2, axis=1).repeat(2, axis=2)[:, : fine.shape[1], : fine.shape[2]] + fine""",
        ),
        mistake(
            "value i at pixel 2i",
            task="skip",
            loses=3,
            says="you put value i at column 2i",
            code=enlarging("2 * np.arange(len(values))"),
        ),
        mistake(
            "align_corners",
            task="skip",
            loses=3,
            says="(align_corners)",
            code=enlarging("np.linspace(0, 2 * len(values) - 1, len(values))"),
        ),
        mistake(
            "stretched to the fine map's size",
            task="skip",
            loses=3,
            says="double it to eight, then cut one off",
            code="""
from scipy.ndimage import map_coordinates

def add_skip(coarse, fine):
    C, H, W = fine.shape
    rows, cols = (np.arange(H) + 0.5) * coarse.shape[1] / H - 0.5, (np.arange(W) + 0.5) * coarse.shape[2] / W - 0.5
    places = np.stack(np.meshgrid(rows, cols, indexing="ij"))
    return np.array([map_coordinates(s, places, order=1, mode="nearest") for s in coarse]) + fine""",
        ),
        mistake(
            "cropped at the wrong end",
            task="skip",
            loses=3,
            says="the first column is cut off",
            code=enlarging(result="whole[:, -H:, -W:] + fine"),
        ),
        mistake(
            "not cropped",
            task="skip",
            loses=3,
            says="a column too many",
            code=enlarging(result="whole + np.pad(fine, ((0, 0), (0, whole.shape[1] - H), (0, whole.shape[2] - W)))"),
        ),
        mistake(
            "zeros outside",
            task="skip",
            loses=3,
            says="before the first place, 1/2, the value stays at 4",
            code="""
def add_skip(coarse, fine):
    def enlarge(values):
        places = 2 * np.arange(-1, len(values) + 1) + 0.5
        return np.interp(np.arange(2 * len(values)), places, [0, *values, 0])

    rows = np.apply_along_axis(enlarge, 1, coarse) if coarse.shape[1] > 1 else coarse.repeat(2, axis=1)
    up = np.apply_along_axis(enlarge, 2, rows)
    return up[:, : fine.shape[1], : fine.shape[2]] + fine""",
        ),
        mistake("the mean of both", task="skip", loses=3, says="a skip adds", code=enlarging(result="(up + fine) / 2")),
        mistake("fine forgotten", task="skip", loses=3, says="the coarse map alone", code=enlarging(result="up")),
        mistake(
            "multiplied",
            task="skip",
            loses=3,
            says="it doesn't multiply them",
            code=enlarging(result="up * np.where(fine == 0, 1, fine)"),
        ),
        mistake(
            "coarse forgotten",
            task="skip",
            loses=3,
            says="the coarse scores got lost",
            code=enlarging(result="fine + 0"),
        ),
        mistake(
            "added in place",
            task="skip",
            loses=2,
            says="add_skip changed its argument",
            code=enlarging(result="np.add(fine, up, out=fine)"),
        ),
        mistake(
            "rows repeated, columns interpolated",
            task="skip",
            loses=3,
            says="rows are interpolated too",
            code=enlarging().replace("np.apply_along_axis(enlarge, 1, coarse)", "coarse.repeat(2, axis=1)"),
        ),
        mistake(
            "one or two classes written in",
            task="skip",
            loses=3,
            says="on inputs you haven't seen: not the shape of the fine map",
            code=enlarging(result="(up + fine)[:2]"),
        ),
        # ---- task 5
        right(
            "a loop, the largest score subtracted",
            task="loss",
            code="""
def cross_entropy(scores, truth):
    losses = []
    for v in range(truth.shape[0]):
        for u in range(truth.shape[1]):
            if truth[v, u] != 255:
                s = scores[:, v, u] - scores[:, v, u].max()
                losses.append(np.log(np.exp(s).sum()) - s[truth[v, u]])
    return sum(losses) / len(losses)""",
        ),
        right(
            "scipy's log-soft-max and a one-hot truth",
            task="loss",
            code="""
from scipy.special import log_softmax

def cross_entropy(scores, truth):
    true = np.arange(len(scores))[:, None, None] == truth
    return -log_softmax(scores, axis=0)[true].mean()""",
        ),
        right(
            "how far the others lead",
            task="loss",
            code="""
def cross_entropy(scores, truth):
    labelled = truth != 255
    true = np.take_along_axis(scores, np.where(labelled, truth, 0)[None], axis=0)
    return np.logaddexp.reduce(scores - true, axis=0)[labelled].mean()""",
        ),
        mistake(
            "no protection against large scores",
            task="loss",
            loses=1,
            says="subtract the pixel's largest score",
            code=loss(),
        ),
        mistake(
            "logarithm of a probability that is zero",
            task="loss",
            loses=1,
            says="don't take the logarithm of P",
            code=loss("np.exp(scores - scores.max(axis=0)) / np.exp(scores - scores.max(axis=0)).sum(axis=0)"),
        ),
        mistake(
            "one largest score for the whole image",
            task="loss",
            loses=1,
            says="on inputs you haven't seen: no number: subtract each pixel's own largest score",
            code="""
def cross_entropy(scores, truth):
    s = scores - scores.max() + 600
    log_P = s - np.log(np.exp(s).sum(axis=0))
    v, u = np.nonzero(truth != 255)
    return -log_P[truth[v, u], v, u].mean()""",
        ),
        mistake(
            "divided by all pixels",
            task="loss",
            loses=3,
            says="you divide by all four pixels",
            code=loss(result="-np.log(p).sum() / truth.size"),
        ),
        mistake("sum", task="loss", loses=3, says="that is the sum", code=loss(result="-np.log(p).sum()")),
        mistake("sign", task="loss", loses=3, says="the sign is swapped", code=loss(result="np.log(p).mean()")),
        mistake(
            "log10",
            task="loss",
            loses=3,
            says="that is the logarithm to base 10",
            code=loss(result="-np.log10(p).mean()"),
        ),
        mistake(
            "log2", task="loss", loses=3, says="that is the logarithm to base 2", code=loss(result="-np.log2(p).mean()")
        ),
        mistake(
            "no logarithm", task="loss", loses=3, says="that is the mean of P(true class)", code=loss(result="p.mean()")
        ),
        mistake("1 - P", task="loss", loses=3, says="that is the mean of 1 - P", code=loss(result="(1 - p).mean()")),
        mistake(
            "no soft-max",
            task="loss",
            loses=3,
            says="those are the scores themselves",
            code=loss("scores", "-p.mean()"),
        ),
        mistake(
            "mean over classes",
            task="loss",
            loses=3,
            says="you average over classes",
            code=loss(result="np.mean([-np.log(p[truth[v, u] == c]).mean() for c in set(truth[v, u])])"),
        ),
        mistake(
            "logarithm of the mean",
            task="loss",
            loses=3,
            says="you take the logarithm of the mean",
            code=loss(result="-np.log(p.mean())"),
        ),
        mistake(
            "soft-max over rows",
            task="loss",
            loses=3,
            says="the soft-max runs over the rows",
            code=loss("np.exp(scores) / np.exp(scores).sum(axis=1, keepdims=True)"),
        ),
        mistake(
            "soft-max over columns",
            task="loss",
            loses=3,
            says="the soft-max runs over the columns",
            code=loss("np.exp(scores) / np.exp(scores).sum(axis=-1, keepdims=True)"),
        ),
        mistake(
            "soft-max over everything",
            task="loss",
            loses=3,
            says="the soft-max runs over the whole image",
            code=loss("np.exp(scores) / np.exp(scores).sum()"),
        ),
        mistake(
            "unlabelled is class 0",
            task="loss",
            loses=3,
            says="you count the unlabelled pixel as class 0",
            code=loss().replace(
                "v, u = np.nonzero(truth != 255)",
                "truth = np.where(truth == 255, 0, truth)\n    v, u = np.nonzero(truth < 255)",
            ),
        ),
        mistake(
            "unlabelled clipped to the last class",
            task="loss",
            loses=3,
            says="you count the unlabelled pixel as the last class",
            code=loss().replace(
                "v, u = np.nonzero(truth != 255)",
                "truth = np.clip(truth, 0, len(P) - 1)\n    v, u = np.nonzero(truth < 255)",
            ),
        ),
        mistake(
            "unlabelled not ignored",
            task="loss",
            loses=3,
            says="index 255 is out of bounds",
            code=loss().replace("truth != 255", "truth >= 0"),
        ),
        mistake(
            "three labelled pixels written in",
            task="loss",
            loses=3,
            says="on inputs you haven't seen: wrong loss",
            code=loss(result="-np.log(p).sum() / 3"),
        ),
    )
