"""The graders of exercise 07, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def chain(largest="2 * sum(rates) + 1", to_see="(field - 1) // 2", result="rates"):
    """Return an answer to task 1 that takes this for the largest rate without a gap, or ends like this."""
    return f"""
def fewest_rates(field):
    to_see, rates = {to_see}, []
    while sum(rates) < to_see:
        rates.append(min({largest}, to_see - sum(rates)))
    return {result}"""


def probing(
    linear="np.allclose(box(one + other), box(one) + box(other))",
    moves="np.allclose(box(np.roll(dot, 1, axis=1)), np.roll(box(dot), 1, axis=1))",
    empty="np.mean(box(1 + one) == 0) > 0.5",
):
    """Return an answer to task 4 that asks for these properties."""
    return f"""
def name_mechanism(box, size):
    one, other = np.random.default_rng(1).random((2, size, size))
    dot = np.zeros((size, size))
    dot[size // 2, size // 2] = 1
    if {linear}:
        return ATROUS if {moves} else STRIDED
    return INDICES if {empty} else SKIPS"""


COLLEAGUE = """
def loss_and_gradient(scores, truth):
    P = np.exp(scores) / np.exp(scores).sum(axis=1, keepdims=True)
    true = np.clip(truth, 0, len(scores) - 1)
    one_hot = np.arange(len(scores))[:, None, None] == true
    return -np.log(P[one_hot]).sum() / truth.size, P - one_hot"""


MAX_POOL = """
def max_pool(maps, kernel, stride):
    C, h, w = maps.shape
    shape = C, DOWN, ACROSS
    pooled, indices = np.zeros(shape), np.zeros(shape, int)
    for c in range(C):
        for v in range(shape[1]):
            for u in range(shape[2]):
                top, left = stride * v, stride * u
                window = maps[c, top : top + kernel, left : left + kernel]
                n, m = np.unravel_index(window.argmax(), window.shape)
                pooled[c, v, u] = window[n, m]
                indices[c, v, u] = INDEX
    return RESULT
"""
LECTURE_POOL = """
def max_pool(maps, kernel, stride):
    pooled, indices = [], []
    for image in maps:
        h, w = image.shape
        windows = image[: h // 2 * 2, : w // 2 * 2].reshape(h // 2, 2, w // 2, 2).swapaxes(1, 2)
        windows = windows.reshape(h // 2, w // 2, 4)
        row, column = np.divmod(windows.argmax(axis=-1), 2)
        v, u = np.ogrid[: h // 2, : w // 2]
        pooled.append(windows.max(axis=-1))
        indices.append((2 * v + row) * w + 2 * u + column)
    return np.array(pooled), np.array(indices)
"""
UNPOOL = """
def unpool(values, indices, shape):
    maps = np.zeros(shape)
    for c in range(shape[0]):
        for value, index in zip(values[c].ravel(), indices[c].ravel()):
            maps[c, index // shape[2], index % shape[2]] += value
    return maps
"""


def pool(
    index="(top + n) * w + left + m",
    down="(h - kernel) // stride + 1",
    across="(w - kernel) // stride + 1",
    result="pooled, indices",
    unpool=UNPOOL,
):
    """Return an answer to task 2 with this index, this number of windows, this result, or another way back."""
    parts = {"INDEX": index, "DOWN": down, "ACROSS": across, "RESULT": result}
    code = MAX_POOL
    for name, part in parts.items():
        code = code.replace(name, part)
    return code + unpool


ATROUS = """
def atrous(maps, kernels, bias, stride, rate):
    _, C, N, _ = kernels.shape
    h, w = maps.shape[1:]
    out = np.zeros((len(bias), -(-h // stride), -(-w // stride)))
    for k, v, u in np.ndindex(out.shape):
        total = 0
        for n, m in np.ndindex(N, N):
            y, x = stride * v + rate * (n - (N - 1) // 2), stride * u + rate * (m - (N - 1) // 2)
            if 0 <= y < h and 0 <= x < w:
                total += sum(kernels[k, c, n, m] * maps[c, y, x] for c in range(C))
        out[k, v, u] = total + bias[k]
    return out
"""


def loss(
    softmax="np.exp(scores) / np.exp(scores).sum(axis=0)",
    result="-np.log(p).mean()",
    gradient="gradient / len(v)",
    labelled="np.nonzero(truth != 255)",
    true="truth",
):
    """Return an answer to task 5 with another soft-max, mean, gradient or truth; none survives large scores."""
    return f"""
def loss_and_gradient(scores, truth):
    P = {softmax}
    v, u = {labelled}
    true = {true}
    p = P[true[v, u], v, u]
    gradient = np.zeros(P.shape)
    gradient[:, v, u] = P[:, v, u]
    gradient[true[v, u], v, u] -= 1
    return {result}, {gradient}"""


class TestSegmentation(GraderChecks):
    exercise = "07_segmentation"
    entries = (
        # ---- task 1
        right(
            "powers of three, and what is left wherever it fits, in an array",
            task="chain",
            code="""
def fewest_rates(field):
    n = 0
    while 3**n < field:
        n += 1
    rates = [3**k for k in range(n - 1)]
    left = (field - 1) // 2 - sum(rates)
    return np.sort(rates + [left] * (left > 0))""",
        ),
        right(
            "from the far end: the last layer takes two thirds",
            task="chain",
            code="""
def fewest_rates(field):
    if field == 1:
        return []
    inner = -(-field // 3)
    inner += 1 - inner % 2
    return [*fewest_rates(inner), (field - inner) // 2]""",
        ),
        mistake(
            "all rates 1",
            task="chain",
            loses=2,
            says="field 9: 2 layers are enough, you take 4",
            code="def fewest_rates(field):\n    return [1] * ((field - 1) // 2)",
        ),
        mistake(
            "doubled rates, as in the lecture",
            task="chain",
            loses=2,
            says="field 9: 2 layers are enough, you take 3",
            code=chain("2 ** len(rates)"),
        ),
        mistake(
            "one layer",
            task="chain",
            loses=3,
            says="only 3 of its pixels count",
            code="def fewest_rates(field):\n    return [(field - 1) // 2] if field > 1 else []",
        ),
        mistake(
            "one pixel too greedy",
            task="chain",
            loses=3,
            says="as in the lecture's gridding",
            code=chain("2 * sum(rates) + 2"),
        ),
        mistake(
            "greedy by three times",
            task="chain",
            loses=3,
            says="as in the lecture's gridding",
            code=chain("3 * sum(rates) + 1"),
        ),
        mistake(
            "powers of three, not cut to the field",
            task="chain",
            loses=3,
            says="have a field of",
            code="""
def fewest_rates(field):
    rates = []
    while 1 + 2 * sum(rates) < field:
        rates.append(3 ** len(rates))
    return rates""",
        ),
        mistake(
            "the rates sum to the field",
            task="chain",
            loses=3,
            says="the rates sum to (field - 1) / 2",
            code=chain(to_see="field - 1"),
        ),
        mistake(
            "the output's own pixel forgotten",
            task="chain",
            loses=3,
            says="the output's own pixel is part of the field",
            code=chain(to_see="(field + 1) // 2"),
        ),
        mistake(
            "how many instead of which",
            task="chain",
            loses=3,
            says="return a list of rates",
            code=chain(result="len(rates)"),
        ),
        mistake(
            "a rate of zero at the end",
            task="chain",
            loses=3,
            says="a rate is a whole number from 1",
            code=chain(result="rates + [0]"),
        ),
        mistake(
            "fractions",
            task="chain",
            loses=3,
            says="a rate is a whole number from 1",
            code="def fewest_rates(field):\n    return [(field - 1) / 4] * 2",
        ),
        mistake(
            "the fields of the visible tests written in",
            task="chain",
            loses=3,
            says="on inputs you haven't seen",
            code=chain(to_see="(field - 1) // 2 if field in (1, 3, 7, 9, 13, 27, 29, 61, 243) else 1"),
        ),
        mistake(
            "takes nothing away",
            task="chain",
            loses=3,
            says="no reply before timeout",
            code="""
def fewest_rates(field):
    left, rates = (field - 1) // 2, []
    while left >= 0:
        rates = [1]
    return rates""",
        ),
        # ---- task 2
        right(
            "numpy's windows, and add.at",
            task="pool",
            code="""
def max_pool(maps, kernel, stride):
    windows = np.lib.stride_tricks.sliding_window_view(maps, (kernel, kernel), axis=(1, 2))[:, ::stride, ::stride]
    windows = windows.reshape(*windows.shape[:3], -1)
    row, column = np.divmod(windows.argmax(axis=-1), kernel)
    v, u = np.ogrid[: windows.shape[1], : windows.shape[2]]
    return windows.max(axis=-1), (stride * v + row) * maps.shape[2] + stride * u + column

def unpool(values, indices, shape):
    maps = np.zeros(shape)
    for channel, some, places in zip(maps, values, indices):
        np.add.at(channel.reshape(-1), places, some)
    return maps""",
        ),
        right(
            "the running maximum of shifted maps, and bincount",
            task="pool",
            code="""
def max_pool(maps, kernel, stride):
    C, h, w = maps.shape
    H, W = (h - kernel) // stride + 1, (w - kernel) // stride + 1
    places = np.arange(h * w).reshape(h, w)
    best, where = np.full((C, H, W), -np.inf), np.zeros((C, H, W), int)
    for n, m in np.ndindex(kernel, kernel):
        part = maps[:, n::stride, m::stride][:, :H, :W]
        where = np.where(part > best, places[n::stride, m::stride][:H, :W], where)
        best = np.maximum(best, part)
    return best, where

def unpool(values, indices, shape):
    size = shape[1] * shape[2]
    flat = [np.bincount(np.ravel(i), np.ravel(v), size) for v, i in zip(values, indices)]
    return np.reshape(flat, shape)""",
        ),
        right(
            "lists of numbers",
            task="pool",
            code="""
def max_pool(maps, kernel, stride):
    C, h, w = maps.shape
    best = [
        [
            [
                max((maps[c, v + n, u + m], -(v + n) * w - u - m) for n in range(kernel) for m in range(kernel))
                for u in range(0, w - kernel + 1, stride)
            ]
            for v in range(0, h - kernel + 1, stride)
        ]
        for c in range(C)
    ]
    return (
        [[[value for value, _ in row] for row in channel] for channel in best],
        [[[-place for _, place in row] for row in channel] for channel in best],
    )

def unpool(values, indices, shape):
    maps = [[[0.0] * shape[2] for _ in range(shape[1])] for _ in range(shape[0])]
    for channel, some, places in zip(maps, values, indices):
        for value, index in zip(np.ravel(some), np.ravel(places)):
            channel[index // shape[2]][index % shape[2]] += value
    return maps""",
        ),
        right(
            "unpooling by one index over all channels",
            task="pool",
            code=pool(
                unpool="""
def unpool(values, indices, shape):
    C, h, w = shape
    everywhere = np.asarray(indices) + h * w * np.arange(C)[:, None, None]
    return np.bincount(everywhere.ravel(), np.ravel(values), C * h * w).reshape(shape)"""
            ),
        ),
        mistake(
            "the lecture's windows of 2 x 2", task="pool", loses=2, says="and not of 3 x 3,", code=LECTURE_POOL + UNPOOL
        ),
        mistake(
            "minima",
            task="pool",
            loses=2,
            says="the smallest number of the first window",
            code=pool().replace("argmax", "argmin"),
        ),
        mistake(
            "mean pooling",
            task="pool",
            loses=1,
            says="is the mean of the first window",
            code=pool().replace("= window[n, m]", "= window.mean()"),
        ),
        mistake(
            "windows one pixel apart",
            task="pool",
            loses=2,
            says="your windows begin one pixel apart",
            code=pool().replace("max_pool(maps, kernel, stride):", "max_pool(maps, kernel, stride):\n    stride = 1"),
        ),
        mistake(
            "windows side by side",
            task="pool",
            loses=2,
            says="your windows don't overlap",
            code=pool().replace(
                "max_pool(maps, kernel, stride):", "max_pool(maps, kernel, stride):\n    stride = kernel"
            ),
        ),
        mistake(
            "a smaller window at the end of a row",
            task="pool",
            loses=2,
            says="the last window of a row has fewer than three columns",
            code=pool(across="-(-(w - kernel) // stride) + 1"),
        ),
        mistake(
            "smaller windows all along the border",
            task="pool",
            loses=2,
            says="windows at the border have fewer than 3 x 3 pixels",
            code=pool(down="-(-h // stride)", across="-(-w // stride)"),
        ),
        mistake(
            "maximum over channels",
            task="pool",
            loses=1,
            says="each channel has its own",
            code=pool(result="pooled.max(axis=0), indices"),
        ),
        mistake(
            "maxima only",
            task="pool",
            loses=2,
            says="return two arrays, the maxima and their indices",
            code="""
def max_pool(maps, kernel, stride):
    windows = np.lib.stride_tricks.sliding_window_view(maps, (kernel, kernel), axis=(1, 2))[:, ::stride, ::stride]
    return list(windows.max(axis=(3, 4)))[:1]
"""
            + UNPOOL,
        ),
        mistake(
            "a maximum that starts at 0",
            task="pool",
            loses=1,
            says="on inputs you haven't seen: wrong maxima (a map may be negative everywhere)",
            code=pool().replace("= window[n, m]", "= max(0, window[n, m])"),
        ),
        mistake(
            "3 and 2 written in",
            task="pool",
            loses=2,
            says="on inputs you haven't seen: wrong shape of the maxima",
            code=pool().replace(
                "max_pool(maps, kernel, stride):", "max_pool(maps, kernel, stride):\n    kernel, stride = 3, 2"
            ),
        ),
        mistake(
            "index in the window",
            task="pool",
            loses=1,
            says="that is the index in the window",
            code=pool("kernel * n + m"),
        ),
        mistake(
            "row times height",
            task="pool",
            loses=1,
            says="you multiply the row by the height",
            code=pool("(top + n) * h + left + m"),
        ),
        mistake(
            "column by column",
            task="pool",
            loses=1,
            says="you count column by column",
            code=pool("(left + m) * h + top + n"),
        ),
        mistake(
            "width of the pooled map",
            task="pool",
            loses=1,
            says="you multiply the row by the windows of a row",
            code=pool("(top + n) * shape[2] + left + m"),
        ),
        mistake(
            "counted from 1", task="pool", loses=1, says="you count from 1", code=pool("(top + n) * w + left + m + 1")
        ),
        mistake(
            "the window's corner",
            task="pool",
            loses=1,
            says="that is the window's first number",
            code=pool("top * w + left"),
        ),
        mistake(
            "width of what the windows cover",
            task="pool",
            loses=1,
            says="column 7 is in no window",
            code=pool("(top + n) * (w - 1) + left + m"),
        ),
        mistake(
            "stride left out of the index", task="pool", loses=1, says="not at 1, 1", code=pool("(v + n) * w + u + m")
        ),
        mistake(
            "kernel for stride in the index",
            task="pool",
            loses=1,
            says="windows begin `stride` pixels apart, not `kernel`",
            code=pool("(kernel * v + n) * w + kernel * u + m"),
        ),
        mistake(
            "stride of 2 in the index",
            task="pool",
            loses=1,
            says="on inputs you haven't seen: wrong indices",
            code=pool("(2 * v + n) * w + 2 * u + m"),
        ),
        mistake(
            "channels counted on",
            task="pool",
            loses=1,
            says="each channel begins at 0",
            code=pool("c * h * w + (top + n) * w + left + m"),
        ),
        mistake(
            "the last of equal numbers",
            task="pool",
            loses=1,
            says="of equal numbers the one with the smaller index wins",
            code=pool().replace("window.argmax()", "window.size - 1 - window.ravel()[::-1].argmax()"),
        ),
        right("nested lists", task="pool", code=pool(result="[pooled.tolist(), indices.tolist()]")),
        mistake(
            "one index for all channels",
            task="pool",
            loses=1,
            says="one index a window",
            code=pool(result="pooled, indices[0]"),
        ),
        mistake(
            "the lecture's unpooling, channel by channel",
            task="pool",
            loses=1,
            says="the second value has replaced the first",
            code=pool(
                unpool="""
def unpool(values, indices, shape):
    maps = np.zeros(shape)
    for c in range(shape[0]):
        maps[c].flat[indices[c].ravel()] = values[c].ravel()
    return maps"""
            ),
        ),
        mistake(
            "+= with repeated indices",
            task="pool",
            loses=1,
            says="adds only once where an index repeats",
            code=pool(
                unpool="""
def unpool(values, indices, shape):
    maps = np.zeros((shape[0], shape[1] * shape[2]))
    for c in range(shape[0]):
        maps[c, indices[c].ravel()] += values[c].ravel()
    return maps.reshape(shape)"""
            ),
        ),
        mistake(
            "the larger of two",
            task="pool",
            loses=1,
            says="only the first value, or the larger, has got there",
            code=pool(
                unpool="""
def unpool(values, indices, shape):
    maps = np.zeros(shape)
    for c, v, u in np.ndindex(indices.shape):
        index = indices[c, v, u]
        maps[c].flat[index] = max(maps[c].flat[index], values[c, v, u])
    return maps"""
            ),
        ),
        mistake(
            "the mean of two",
            task="pool",
            loses=1,
            says="that is their mean",
            code=pool(
                unpool="""
def unpool(values, indices, shape):
    maps, times = np.zeros(shape), np.zeros(shape)
    for c, v, u in np.ndindex(indices.shape):
        maps[c].flat[indices[c, v, u]] += values[c, v, u]
        times[c].flat[indices[c, v, u]] += 1
    return maps / np.maximum(times, 1)"""
            ),
        ),
        mistake(
            "everything into channel 0",
            task="pool",
            loses=1,
            says="channel 1 is empty",
            code=pool(
                unpool="""
def unpool(values, indices, shape):
    maps = np.zeros(shape)
    np.add.at(maps.reshape(-1), indices.ravel(), values.ravel())
    return maps"""
            ),
        ),
        mistake(
            "row by the height",
            task="pool",
            loses=1,
            says="divide by the width",
            code=pool(
                unpool="""
def unpool(values, indices, shape):
    maps = np.zeros((shape[0], 8, 8))
    for c, v, u in np.ndindex(indices.shape):
        index = indices[c, v, u]
        maps[c, index // shape[1], index % shape[1]] += values[c, v, u]
    return maps[:, : shape[1], : shape[2]]"""
            ),
        ),
        mistake(
            "spread over the window",
            task="pool",
            loses=1,
            says="a value goes to one place, not to a window",
            code=pool(
                unpool="""
def unpool(values, indices, shape):
    return values.repeat(3, axis=1).repeat(3, axis=2)[:, : shape[1], : shape[2]]"""
            ),
        ),
        mistake(
            "one channel",
            task="pool",
            loses=1,
            says="expected the shape that was asked for",
            code=pool(
                unpool="""
def unpool(values, indices, shape):
    return np.zeros(shape[1:])"""
            ),
        ),
        mistake(
            "decimals cut off",
            task="pool",
            loses=1,
            says="on inputs you haven't seen: a value isn't where its index says, or isn't what it was",
            code=pool(
                unpool="""
def unpool(values, indices, shape):
    maps = np.zeros(shape, int)
    for c, v, u in np.ndindex(indices.shape):
        maps[c].flat[indices[c, v, u]] += int(values[c, v, u])
    return maps"""
            ),
        ),
        # ---- task 3
        right("loops", task="atrous", code=ATROUS),
        right(
            "a list, by scipy and larger kernels with zeros",
            task="atrous",
            code="""
from scipy.ndimage import correlate

def atrous(maps, kernels, bias, stride, rate):
    K, C, N, _ = kernels.shape
    size = rate * (N - 1) + 1
    spread = np.zeros((K, C, size, size))
    spread[..., ::rate, ::rate] = kernels
    whole = [sum(correlate(maps[c], spread[k, c], mode="constant") for c in range(C)) + bias[k] for k in range(K)]
    return [output[::stride, ::stride].tolist() for output in whole]""",
        ),
        right(
            "shifted maps and einsum",
            task="atrous",
            code="""
def atrous(maps, kernels, bias, stride, rate):
    (C, h, w), N = maps.shape, kernels.shape[-1]
    reach = rate * (N - 1) // 2
    padded = np.pad(maps, ((0, 0), (reach, reach), (reach, reach)))
    seen = np.array([[padded[:, rate * n :, rate * m :][:, :h:stride, :w:stride] for m in range(N)] for n in range(N)])
    return np.einsum("kcnm,nmcvu->kvu", kernels, seen) + bias[:, None, None]""",
        ),
        mistake(
            "the lecture's function for each pair, not summed",
            task="atrous",
            loses=3,
            says="sum over the input channels",
            code="""
def atrous(maps, kernels, bias, stride, rate):
    h, w = maps.shape[1:]
    padded = np.pad(maps, ((0, 0), (rate, rate), (rate, rate)))
    out = np.zeros((*kernels.shape[:2], -(-h // stride), -(-w // stride)))
    for k, c, n, m in np.ndindex(kernels.shape):
        seen = padded[c, rate * n : rate * n + h : stride, rate * m : rate * m + w : stride]
        out[k, c] += kernels[k, c, n, m] * seen
    return out""",
        ),
        mistake(
            "output channels summed",
            task="atrous",
            loses=1,
            says="one output channel is missing",
            code=ATROUS.replace("return out", "return out.sum(axis=0)"),
        ),
        mistake(
            "nothing returned",
            task="atrous",
            loses=3,
            says="did you forget `return`?",
            code=ATROUS.replace("return out", "pass"),
        ),
        mistake(
            "rate taken for a stride",
            task="atrous",
            loses=1,
            says="you take the rate for a stride",
            code=ATROUS.replace("rate * (n", "(n")
            .replace("rate * (m", "(m")
            .replace("return out", "return out[:, ::rate, ::rate]"),
        ),
        mistake(
            "padded by 1",
            task="atrous",
            loses=2,
            says="pad by rate, not by 1",
            code="""
def atrous(maps, kernels, bias, stride, rate):
    _, h, w = maps.shape
    padded = np.pad(maps, ((0, 0), (1, 1), (1, 1)))
    h, w = h + 2 - 2 * rate, w + 2 - 2 * rate
    out = bias[:, None, None]
    for n, m in np.ndindex(3, 3):
        seen = padded[:, rate * n : rate * n + h : stride, rate * m : rate * m + w : stride]
        out = out + np.tensordot(kernels[:, :, n, m], seen, axes=1)
    return out""",
        ),
        mistake(
            "not padded",
            task="atrous",
            loses=3,
            says="the border is missing",
            code="""
def atrous(maps, kernels, bias, stride, rate):
    _, h, w = maps.shape
    padded = np.pad(maps, ((0, 0), (0, 0), (0, 0)))
    h, w = h - 2 * rate, w - 2 * rate
    out = bias[:, None, None]
    for n, m in np.ndindex(3, 3):
        seen = padded[:, rate * n : rate * n + h : stride, rate * m : rate * m + w : stride]
        out = out + np.tensordot(kernels[:, :, n, m], seen, axes=1)
    return out""",
        ),
        mistake("no bias", task="atrous", loses=1, says="the bias is missing", code=ATROUS.replace("+ bias[k]", "")),
        mistake(
            "bias for each input channel",
            task="atrous",
            loses=1,
            says="added for each input channel",
            code=ATROUS.replace("+ bias[k]", "+ C * bias[k]"),
        ),
        mistake(
            "bias for each weight",
            task="atrous",
            loses=1,
            says="added for each weight: once",
            code=ATROUS.replace("+ bias[k]", "+ N * N * bias[k]"),
        ),
        mistake(
            "bias for each weight and channel",
            task="atrous",
            loses=1,
            says="added for each weight and each channel",
            code=ATROUS.replace("+ bias[k]", "+ C * N * N * bias[k]"),
        ),
        mistake(
            "channel 0 alone",
            task="atrous",
            loses=1,
            says="that is channel 0 alone",
            code=ATROUS.replace("for c in range(C)", "for c in range(1)"),
        ),
        mistake(
            "only the last channel stays",
            task="atrous",
            loses=1,
            says="that is the last channel alone",
            code=ATROUS.replace("for c in range(C)", "for c in range(C - 1, C)"),
        ),
        mistake(
            "mean over channels",
            task="atrous",
            loses=1,
            says="that is the mean over channels",
            code=ATROUS.replace("+ bias[k]", "/ C + bias[k]"),
        ),
        mistake(
            "input and output channel swapped",
            task="atrous",
            loses=1,
            says="input and output channel are swapped",
            code=ATROUS.replace("kernels[k, c,", "kernels[c, k,"),
        ),
        mistake(
            "one kernel for all inputs",
            task="atrous",
            loses=1,
            says="each pair of channels has its own",
            code=ATROUS.replace("kernels[k, c,", "kernels[k, 0,"),
        ),
        mistake(
            "one kernel for all outputs",
            task="atrous",
            loses=1,
            says="output 1 at the same place",
            code=ATROUS.replace("kernels[k, c,", "kernels[0, c,"),
        ),
        mistake(
            "two channels written in",
            task="atrous",
            loses=1,
            says="on inputs you haven't seen: wrong with other numbers of channels",
            code=ATROUS.replace("for c in range(C)", "for c in range(2) if c < C"),
        ),
        mistake(
            "rate ignored",
            task="atrous",
            loses=1,
            says="the neighbour at (2, 3) answers",
            code=ATROUS.replace("rate *", "1 *"),
        ),
        mistake(
            "rate on the rows only",
            task="atrous",
            loses=1,
            says="the neighbour at (2, 3) answers",
            code=ATROUS.replace("rate * (m", "(m"),
        ),
        mistake(
            "kernel turned round",
            task="atrous",
            loses=1,
            says="the kernel is turned round: the 1 lies below and to the right",
            code=ATROUS.replace("c, n, m]", "c, N - 1 - n, N - 1 - m]"),
        ),
        mistake(
            "rows of the kernel turned round",
            task="atrous",
            loses=1,
            says="from top to bottom",
            code=ATROUS.replace("c, n, m]", "c, N - 1 - n, m]"),
        ),
        mistake(
            "columns of the kernel turned round",
            task="atrous",
            loses=1,
            says="from left to right",
            code=ATROUS.replace("c, n, m]", "c, n, N - 1 - m]"),
        ),
        mistake(
            "one hole too many",
            task="atrous",
            loses=1,
            says="(rate + 1) is too far",
            code=ATROUS.replace("rate *", "(rate + 1) *"),
        ),
        mistake(
            "kernel transposed",
            task="atrous",
            loses=1,
            says="rows and columns of the kernel are swapped",
            code=ATROUS.replace("c, n, m]", "c, m, n]"),
        ),
        mistake(
            "kernel not centred",
            task="atrous",
            loses=2,
            says="the middle weights, 5 and 14, meet",
            code=ATROUS.replace("(n - (N - 1) // 2)", "n").replace("(m - (N - 1) // 2)", "m"),
        ),
        mistake(
            "border repeated",
            task="atrous",
            loses=1,
            says="outside is zero",
            code=ATROUS.replace("if 0 <= y < h and 0 <= x < w", "if True").replace(
                "maps[c, y, x]", "maps[c, min(max(y, 0), h - 1), min(max(x, 0), w - 1)]"
            ),
        ),
        mistake(
            "what leaves on the right comes back on the left",
            task="atrous",
            loses=1,
            says="outside is zero",
            code=ATROUS.replace("if 0 <= y < h and 0 <= x < w", "if True").replace(
                "maps[c, y, x]", "maps[c, y % h, x % w]"
            ),
        ),
        mistake(
            "rate 2 written in",
            task="atrous",
            loses=1,
            says="on inputs you haven't seen: wrong with other kernels and rates",
            code=ATROUS.replace("rate *", "2 *"),
        ),
        mistake(
            "stride ignored",
            task="atrous",
            loses=1,
            says="the stride is ignored",
            code=ATROUS.replace("_, C, N, _", "stride = 1\n    _, C, N, _"),
        ),
        mistake(
            "stride rounded down",
            task="atrous",
            loses=1,
            says="of five rows the stride keeps 0, 2 and 4",
            code=ATROUS.replace("-(-h // stride), -(-w // stride)", "h // stride, w // stride"),
        ),
        mistake(
            "stride down only",
            task="atrous",
            loses=1,
            says="the stride counts across as well as down",
            code=ATROUS.replace("-(-w // stride)", "w").replace("stride * u", "u"),
        ),
        mistake(
            "stride across only",
            task="atrous",
            loses=1,
            says="the stride counts down as well as across",
            code=ATROUS.replace("-(-h // stride)", "h").replace("stride * v", "v"),
        ),
        mistake(
            "first the stride, then the holes",
            task="atrous",
            loses=1,
            says="the rate counts inputs, also where a stride leaves outputs out",
            code=ATROUS.replace("rate *", "rate * stride *"),
        ),
        mistake(
            "places one pixel on",
            task="atrous",
            loses=1,
            says="belongs to pixel (2v, 2u)",
            code=ATROUS.replace("stride * v", "v + (stride - 1) * (v + 1)").replace(
                "stride * u", "u + (stride - 1) * (u + 1)"
            ),
        ),
        mistake(
            "kernels of 3 x 3 written in",
            task="atrous",
            loses=2,
            says="take N from kernels.shape",
            code=ATROUS.replace("_, C, N, _ = kernels.shape", "C, N = len(maps), 3"),
        ),
        mistake(
            "padded by the rate whatever the kernel",
            task="atrous",
            loses=1,
            says="kernels of 1 x 1 reach beyond nothing",
            code="""
def atrous(maps, kernels, bias, stride, rate):
    padded = np.pad(maps, ((0, 0), (rate, rate), (rate, rate)))
    N = kernels.shape[-1]
    h, w = padded.shape[1] - rate * (N - 1), padded.shape[2] - rate * (N - 1)
    out = bias[:, None, None]
    for n, m in np.ndindex(N, N):
        seen = padded[:, rate * n : rate * n + h : stride, rate * m : rate * m + w : stride]
        out = out + np.tensordot(kernels[:, :, n, m], seen, axes=1)
    return out""",
        ),
        mistake(
            "padded by 1 and the size of a larger kernel forgotten",
            task="atrous",
            loses=1,
            says="on inputs you haven't seen: wrong shape with other kernels and rates",
            code="""
def atrous(maps, kernels, bias, stride, rate):
    N = kernels.shape[-1]
    reach = rate if N > 1 else 0
    padded = np.pad(maps, ((0, 0), (reach, reach), (reach, reach)))
    h, w = padded.shape[1] - rate * (N - 1), padded.shape[2] - rate * (N - 1)
    out = bias[:, None, None]
    for n, m in np.ndindex(N, N):
        seen = padded[:, rate * n : rate * n + h : stride, rate * m : rate * m + w : stride]
        out = out + np.tensordot(kernels[:, :, n, m], seen, axes=1)
    return out""",
        ),
        # ---- task 4
        right("three properties", task="boxes", code=probing()),
        right(
            "zeros first, then the negative of an image, then two dots",
            task="boxes",
            code="""
def name_mechanism(box, size):
    image = np.random.default_rng(3).random((size, size))
    if (box(image + 1) == 0).mean() > 0.7:
        return 0
    if not np.allclose(box(-image), -box(image)):
        return 1
    dots = []
    for column in range(size // 2, size // 2 + 2):
        dot = np.zeros((size, size))
        dot[size // 2, column] = 1.0
        dots.append(box(dot).sum(axis=0))
    return 3 if np.allclose(dots[0][:-1], dots[1][1:]) else 2""",
        ),
        right(
            "by the answers to all dots of a row: a matrix",
            task="boxes",
            code="""
def name_mechanism(box, size):
    rows, middle = np.eye(size), size // 2
    answers = np.array([box(np.outer(rows[middle], row)) for row in rows])
    image = np.outer(rows[middle], np.arange(size) + 1.0)
    if not np.allclose(box(image), np.tensordot(np.arange(size) + 1.0, answers, axes=1)):
        return INDICES if (box(np.ones((size, size))) != 0).mean() < 0.4 else SKIPS
    return ATROUS if np.allclose(answers[middle][:, :-1], answers[middle + 1][:, 1:]) else STRIDED""",
        ),
        mistake(
            "always the same",
            task="boxes",
            loses=3,
            says="this box is ATROUS, and you say INDICES",
            code="def name_mechanism(box, size):\n    return INDICES",
        ),
        mistake(
            "skips taken for a sum of products",
            task="boxes",
            loses=3,
            says="is the answer to a sum of two images the sum of the answers?",
            code="""
def name_mechanism(box, size):
    one = np.random.default_rng(1).random((size, size))
    dot = np.zeros((size, size))
    dot[size // 2, size // 2] = 1
    if np.mean(box(1 + one) == 0) > 0.5:
        return INDICES
    return ATROUS if box(dot).max() == box(dot)[size // 2, size // 2] else STRIDED""",
        ),
        mistake(
            "a post that isn't moved",
            task="boxes",
            loses=3,
            says="move it by one pixel",
            code=probing(moves="box(dot).max() == box(dot)[size // 2, size // 2]"),
        ),
        mistake(
            "moved by four pixels",
            task="boxes",
            loses=3,
            says="move it by one pixel",
            code=probing(moves="np.allclose(box(np.roll(dot, 4, axis=1)), np.roll(box(dot), 4, axis=1))"),
        ),
        mistake(
            "twice an image instead of a sum of two",
            task="boxes",
            loses=3,
            says="and you say",
            code=probing(linear="np.allclose(box(2 * one), 2 * box(one))"),
        ),
        mistake(
            "zeros in a dark image",
            task="boxes",
            loses=3,
            says="which of them leaves three of four pixels at zero, even in a bright image?",
            code=probing(empty="np.mean(box(dot) == 0) > 0.5"),
        ),
        mistake(
            "the lecture's numbers: how bright a post comes back",
            task="boxes",
            loses=2,
            says="and you say",
            code="""
def name_mechanism(box, size):
    post = np.zeros((size, size))
    post[:, size // 2 + 1] = 1
    row = box(post).max(axis=0)
    if np.isclose(row.max(), 1):
        return INDICES
    if row.max() > 1:
        return SKIPS
    return ATROUS if row.argmax() == size // 2 + 1 else STRIDED""",
        ),
        mistake(
            "nine of ten pixels zero",
            task="boxes",
            loses=2,
            says="this box is INDICES, and you say SKIPS",
            code=probing(empty="np.mean(box(1 + one) == 0) > 0.9"),
        ),
        mistake(
            "the sizes of the visible tests written in",
            task="boxes",
            loses=3,
            says="on inputs you haven't seen: a box gets the name of another mechanism",
            code=probing().replace("    if np", "    if size not in (16, 24):\n        return SKIPS\n    if np"),
        ),
        mistake(
            "a text",
            task="boxes",
            loses=3,
            says="returned no array of numbers",
            code="def name_mechanism(box, size):\n    return 'atrous'",
        ),
        # ---- task 5
        right(
            "a loop, the largest score subtracted, and lists",
            task="loss",
            code="""
def loss_and_gradient(scores, truth):
    losses, gradient = [], np.zeros(scores.shape)
    for v in range(truth.shape[0]):
        for u in range(truth.shape[1]):
            if truth[v, u] != 255:
                s = scores[:, v, u] - scores[:, v, u].max()
                losses.append(np.log(np.exp(s).sum()) - s[truth[v, u]])
                gradient[:, v, u] = np.exp(s) / np.exp(s).sum()
                gradient[truth[v, u], v, u] -= 1
    return [sum(losses) / len(losses), (gradient / len(losses)).tolist()]""",
        ),
        right(
            "scipy's soft-max and a one-hot truth",
            task="loss",
            code="""
from scipy.special import log_softmax, softmax

def loss_and_gradient(scores, truth):
    true = np.arange(len(scores))[:, None, None] == truth
    gradient = np.where(truth == 255, 0, softmax(scores, axis=0) - true) / true.sum()
    return -log_softmax(scores, axis=0)[true].mean(), gradient""",
        ),
        right(
            "how far the others lead",
            task="loss",
            code="""
def loss_and_gradient(scores, truth):
    v, u = np.nonzero(truth != 255)
    s, c, count = scores[:, v, u], truth[v, u], len(v)
    total = np.logaddexp.reduce(s, axis=0)
    gradient = np.zeros(scores.shape)
    gradient[:, v, u] = np.exp(s - total) / count
    gradient[c, v, u] -= 1 / count
    return (total - s[c, np.arange(count)]).mean(), gradient""",
        ),
        mistake(
            "the colleague's loss as it is",
            task="loss",
            loses=4,
            says="",
            code=COLLEAGUE,
        ),
        mistake(
            "the colleague's loss, the soft-max mended",
            task="loss",
            loses=4,
            says="you count the unlabelled pixel as the last class",
            code=COLLEAGUE.replace("axis=1, keepdims=True", "axis=0"),
        ),
        mistake(
            "the colleague's loss, unlabelled pixels mended in the loss alone",
            task="loss",
            loses=3,
            says="the pixel that isn't labelled has no part in the loss",
            code="""
def loss_and_gradient(scores, truth):
    P = np.exp(scores) / np.exp(scores).sum(axis=0)
    one_hot = np.arange(len(scores))[:, None, None] == truth
    return -np.log(P[one_hot]).mean(), P - one_hot""",
        ),
        mistake(
            "no protection against large scores",
            task="loss",
            loses=1,
            says="subtract the pixel's largest score",
            code=loss(),
        ),
        mistake(
            "no shift, in long double",
            task="loss",
            loses=1,
            says="on inputs you haven't seen",
            code="""
def loss_and_gradient(scores, truth):
    odds = np.exp(np.asarray(scores, np.longdouble))
    log_P = np.log(odds / odds.sum(axis=0))
    labelled = truth != 255
    is_true = np.arange(len(scores))[:, None, None] == truth
    gradient = labelled * (np.exp(log_P) - is_true) / labelled.sum()
    return float(-log_P[is_true].mean()), gradient.astype(float)""",
        ),
        mistake(
            "logarithm of a probability that is zero",
            task="loss",
            loses=1,
            says="don't take the logarithm of P",
            code=loss("np.exp(scores - scores.max(axis=0)) / np.exp(scores - scores.max(axis=0)).sum(axis=0)"),
        ),
        mistake(
            "a loss for large scores, a gradient that isn't",
            task="loss",
            loses=1,
            says="the loss is right, the gradient no number",
            code="""
def loss_and_gradient(scores, truth):
    s = scores - scores.max(axis=0)
    log_P = s - np.log(np.exp(s).sum(axis=0))
    v, u = np.nonzero(truth != 255)
    gradient = np.zeros(scores.shape)
    gradient[:, v, u] = (np.exp(scores) / np.exp(scores).sum(axis=0))[:, v, u]
    gradient[truth[v, u], v, u] -= 1
    return -log_P[truth[v, u], v, u].mean(), gradient / len(v)""",
        ),
        mistake(
            "one largest score for the whole image",
            task="loss",
            loses=1,
            says="on inputs you haven't seen: no number: subtract each pixel's own largest score",
            code="""
def loss_and_gradient(scores, truth):
    s = scores - scores.max() + 600
    log_P = s - np.log(np.exp(s).sum(axis=0))
    v, u = np.nonzero(truth != 255)
    gradient = np.zeros(scores.shape)
    gradient[:, v, u] = np.exp(log_P)[:, v, u]
    gradient[truth[v, u], v, u] -= 1
    return -log_P[truth[v, u], v, u].mean(), gradient / len(v)""",
        ),
        mistake(
            "the largest score subtracted in place",
            task="loss",
            loses=1,
            says="changed its argument `scores`",
            code="""
def loss_and_gradient(scores, truth):
    scores -= scores.max(axis=0)
    s = scores
    log_P = s - np.log(np.exp(s).sum(axis=0))
    v, u = np.nonzero(truth != 255)
    gradient = np.zeros(scores.shape)
    gradient[:, v, u] = np.exp(log_P)[:, v, u]
    gradient[truth[v, u], v, u] -= 1
    return -log_P[truth[v, u], v, u].mean(), gradient / len(v)""",
        ),
        mistake(
            "no gradient",
            task="loss",
            loses=3,
            says="return two things, the loss and its gradient",
            code=loss().replace(", gradient / len(v)", ""),
        ),
        mistake(
            "divided by all pixels",
            task="loss",
            loses=2,
            says="you divide by all four pixels",
            code=loss(result="-np.log(p).sum() / truth.size"),
        ),
        right(
            "nested lists, and helpers with everyday names",
            task="loss",
            code="""
weights, read, field, got, slips, odds, scores, truth = "these were names of the test cells, too".split()


def gradient(P, truth):
    known = (truth != 255).sum()
    return [[[(P[c, v, u] - (truth[v, u] == c)) / known * (truth[v, u] != 255) for u in range(P.shape[2])]
        for v in range(P.shape[1])] for c in range(P.shape[0])]


def loss(log_P, truth):
    return [-log_P[truth[place], *place] for place in np.ndindex(truth.shape) if truth[place] != 255]


def loss_and_gradient(scores, truth):
    shifted = scores - scores.max(axis=0)
    log_P = shifted - np.log(np.exp(shifted).sum(axis=0))
    return [float(np.mean(loss(log_P, truth))), gradient(np.exp(log_P), truth)]""",
        ),
        mistake(
            "log P cut off",
            task="loss",
            loses=1,
            says="Is log P cut off?",
            code="""
def loss_and_gradient(scores, truth):
    labelled = truth != 255
    P = np.exp(scores - scores.max(axis=0))
    P = P / P.sum(axis=0)
    is_true = np.arange(len(scores))[:, None, None] == truth
    return -np.log(P[is_true] + 1e-12).mean(), labelled * (P - is_true) / labelled.sum()""",
        ),
        mistake("sum", task="loss", loses=2, says="that is the sum", code=loss(result="-np.log(p).sum()")),
        mistake(
            "sign",
            task="loss",
            loses=2,
            says="the sign is swapped: a loss is -log P",
            code=loss(result="np.log(p).mean()"),
        ),
        mistake(
            "log10",
            task="loss",
            loses=2,
            says="that is the logarithm to base 10",
            code=loss(result="-np.log10(p).mean()"),
        ),
        mistake(
            "log2", task="loss", loses=2, says="that is the logarithm to base 2", code=loss(result="-np.log2(p).mean()")
        ),
        mistake(
            "no logarithm", task="loss", loses=2, says="that is the mean of P(true class)", code=loss(result="p.mean()")
        ),
        mistake("1 - P", task="loss", loses=2, says="that is the mean of 1 - P", code=loss(result="(1 - p).mean()")),
        mistake(
            "mean over classes",
            task="loss",
            loses=2,
            says="you average over classes",
            code=loss(result="np.mean([-np.log(p[truth[v, u] == c]).mean() for c in set(truth[v, u])])"),
        ),
        mistake(
            "logarithm of the mean",
            task="loss",
            loses=2,
            says="you take the logarithm of the mean",
            code=loss(result="-np.log(p.mean())"),
        ),
        mistake(
            "three labelled pixels written in",
            task="loss",
            loses=2,
            says="on inputs you haven't seen: wrong loss",
            code=loss(result="-np.log(p).sum() / 3"),
        ),
        mistake(
            "one loss a pixel",
            task="loss",
            loses=2,
            says="expected one number first, the mean",
            code=loss(result="-np.log(p)"),
        ),
        mistake(
            "no soft-max",
            task="loss",
            loses=4,
            says="those are the scores themselves",
            code=loss("scores", "-p.mean()"),
        ),
        mistake(
            "soft-max over rows",
            task="loss",
            loses=4,
            says="the soft-max runs over the rows",
            code=loss("np.exp(scores) / np.exp(scores).sum(axis=1, keepdims=True)"),
        ),
        mistake(
            "soft-max over columns",
            task="loss",
            loses=4,
            says="the soft-max runs over the columns",
            code=loss("np.exp(scores) / np.exp(scores).sum(axis=-1, keepdims=True)"),
        ),
        mistake(
            "soft-max over everything",
            task="loss",
            loses=4,
            says="the soft-max runs over the whole image",
            code=loss("np.exp(scores) / np.exp(scores).sum()"),
        ),
        mistake(
            "unlabelled is class 0",
            task="loss",
            loses=4,
            says="you count the unlabelled pixel as class 0",
            code=loss(labelled="np.nonzero(truth < 256)", true="np.where(truth == 255, 0, truth)"),
        ),
        mistake(
            "unlabelled clipped to the last class",
            task="loss",
            loses=4,
            says="you count the unlabelled pixel as the last class",
            code=loss(labelled="np.nonzero(truth < 256)", true="np.clip(truth, 0, len(P) - 1)"),
        ),
        mistake(
            "unlabelled not ignored",
            task="loss",
            loses=4,
            says="index 255 is out of bounds",
            code=loss(labelled="np.nonzero(truth < 256)"),
        ),
        mistake(
            "gradient of a sum",
            task="loss",
            loses=3,
            says="in a mean of three it counts a third",
            code=loss(gradient="gradient"),
        ),
        mistake(
            "gradient divided by all pixels",
            task="loss",
            loses=3,
            says="you divide by all four pixels: one isn't labelled, so divide by three",
            code=loss(gradient="gradient / truth.size"),
        ),
        mistake(
            "gradient divided by all scores",
            task="loss",
            loses=3,
            says="you divide by all scores of the image",
            code=loss(gradient="gradient / gradient.size"),
        ),
        mistake(
            "sign of the gradient",
            task="loss",
            loses=3,
            says="a higher score of the true class makes the loss smaller",
            code=loss(gradient="-gradient / len(v)"),
        ),
        mistake(
            "truth not subtracted",
            task="loss",
            loses=3,
            says="that is P alone",
            code=loss(gradient="np.where(truth != 255, P, 0) / len(v)"),
        ),
        mistake(
            "derivative by P",
            task="loss",
            loses=3,
            says="that is the derivative with respect to P, -1 / P",
            code=loss(gradient="np.where(gradient < 0, -1 / P, 0) / len(v)"),
        ),
        mistake(
            "logarithm forgotten",
            task="loss",
            loses=3,
            says="that is the derivative of the mean of -P",
            code=loss(gradient="np.where(gradient < 0, P * gradient, 0) / len(v)"),
        ),
        mistake(
            "the true class alone",
            task="loss",
            loses=3,
            says="the other classes' scores have a gradient too",
            code=loss(gradient="np.minimum(gradient, 0) / len(v)"),
        ),
        mistake(
            "unlabelled pixels learn",
            task="loss",
            loses=3,
            says="the pixel that isn't labelled has no part in the loss",
            code=loss(gradient="np.where(truth == 255, P, gradient) / len(v)"),
        ),
        mistake(
            "gradient of each pixel, in a list",
            task="loss",
            loses=3,
            says="one derivative a score",
            code=loss(gradient="gradient[:, v, u] / len(v)"),
        ),
        mistake(
            "three labelled pixels written in the gradient",
            task="loss",
            loses=3,
            says="on inputs you haven't seen: wrong gradient",
            code=loss(gradient="gradient / 3"),
        ),
    )
