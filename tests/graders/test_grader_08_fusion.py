"""The graders of exercise 08, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def table(same="(columns[:n] == column[:n, None]).all(axis=0)", pick="np.bincount(truth[same]).argmax()", counts="-1"):
    """Return an answer to task 1 with these parts."""
    return f"""
def name_cells(columns, truth, new):
    columns, truth = columns[:, truth != 255], truth[truth != 255]
    named = np.zeros(new.shape[1], int)
    for j, column in enumerate(new.T):
        for n in range(len(column), {counts}, -1):
            same = {same}
            if same.any():
                named[j] = {pick}
                break
    return named"""


def gradient_check(
    behind="rng.normal(size=np.shape(forward(planes, theta, beta)))",
    wrong="not np.allclose(told, by_nudging, rtol=1e-3, atol=1e-6)",
    order="{'planes': planes, 'theta': theta, 'beta': beta}",
    kept="values.copy()",
):
    """Return an answer to task 2 with these parts."""
    return f"""
def wrong_derivative(forward, back, planes, theta, beta):
    rng, inputs = np.random.default_rng(5), {order}
    behind = {behind}
    for (name, values), told in zip(inputs.items(), back(planes, theta, behind)):
        by_nudging = np.zeros(values.shape)
        for place in np.ndindex(values.shape):
            losses = []
            for sign in (1, -1):
                nudged = {kept}
                nudged[place] += sign * 1e-3
                losses.append((forward(**{{**inputs, name: nudged}}) * behind).sum())
            by_nudging[place] = (losses[0] - losses[1]) / 2e-3
        if {wrong}:
            return name
    return "none\""""


def shares(weight="cells * np.clip(alpha, 1 / limit, limit)", share="weight / weight.sum()"):
    """Return an answer to the first half of task 3 with these parts."""
    return f"def shares(cells, alpha, limit):\n    weight = {weight}\n    return {share}"


def limit(
    order="sorted(limits)",
    weight="np.clip(alpha, 1 / limit, limit)",
    enough="cells[c] * weight[c] >= at_least * total",
    small="weight[cells > 0].max() <= at_most * total",
    none="0",
):
    """Return an answer to the second half of task 3 with these parts."""
    return f"""
def choose_limit(cells, alpha, limits, c, at_least, at_most):
    for limit in {order}:
        weight = {weight}
        total = (cells * weight).sum()
        if {enough} and {small}:
            return limit
    return {none}"""


def back(
    m="logits.max(axis=0)",
    g="e / e.sum(axis=0)",
    weight="np.where(labelled, alpha[true], 0)",
    result="weight * (g - one_hot) / weight.sum()",
    true="np.where(labelled, truth, 0)",
):
    """Return an answer to task 4 with these parts."""
    return f"""
def loss_back(logits, truth, alpha):
    e = np.exp(logits - {m})
    g = {g}
    labelled = truth != 255
    true = {true}
    one_hot = (np.arange(len(logits))[:, None, None] == true) * 1.0
    weight = {weight}
    return {result}"""


def optimiser(
    before="np.concatenate([np.zeros((1, steps.shape[1])), steps[:-1]])",
    solved="np.linalg.lstsq(np.stack([-gradients.ravel(), before.ravel()], axis=1), steps.ravel(), rcond=None)[0]",
    returned="found[0], found[1]",
):
    """Return an answer to the first half of task 5 with these parts."""
    return f"""
def rate_and_momentum(path, gradients):
    steps = np.diff(path, axis=0)
    before = {before}
    found = {solved}
    return {returned}"""


def rates(delta="kappa * delta + gradient", rate="-(step * delta).sum() / (delta**2).sum()"):
    """Return an answer to the second half of task 5 with these parts."""
    return f"""
def rates(path, gradients, kappa):
    delta, found = np.zeros(path.shape[1]), []
    for step, gradient in zip(np.diff(path, axis=0), gradients):
        delta = {delta}
        found.append({rate})
    return np.array(found)"""


class TestFusion(GraderChecks):
    exercise = "08_fusion"
    entries = (
        # ---- task 1
        right(
            "a dictionary of counters, by the beginning of a column",
            task="name-cells",
            code="""
from collections import Counter, defaultdict

def name_cells(columns, truth, new):
    counters = defaultdict(Counter)
    for *column, c in np.vstack([columns, truth]).T.tolist():
        if c != 255:
            for n in range(len(column) + 1):
                counters[tuple(column[:n])][c] += 1
    named = []
    for column in new.T.tolist():
        while tuple(column) not in counters:
            column = column[:-1]
        counts = counters[tuple(column)]
        named.append(min(c for c in counts if counts[c] == max(counts.values())))
    return named""",
        ),
        right(
            "helpers with everyday names, in floats",
            task="name-cells",
            code="""
def got(columns, truth, column):
    while True:
        same = np.all(columns[: len(column)].T == column, axis=1)
        if same.any():
            classes, counts = np.unique(truth[same], return_counts=True)
            return float(classes[np.argmax(counts)])
        column = column[:-1]


def name_cells(columns, truth, new):
    known = truth < 255
    return [got(columns[:, known], truth[known], column) for column in new.T]""",
        ),
        mistake(
            "no way out",
            task="name-cells",
            loses=1,
            says="of the cells with label 1 classes 1 and 3 are most frequent",
            code=table(counts="len(column) - 1"),
        ),
        mistake(
            "the first row left out first",
            task="name-cells",
            loses=1,
            says="leave out the state",
            code=table(same="(columns[len(columns) - n :] == column[len(columns) - n :, None]).all(axis=0)"),
        ),
        mistake(
            "first row alone",
            task="name-cells",
            loses=3,
            says="the first row alone",
            code=table(same="(columns[: min(n, 1)] == column[: min(n, 1), None]).all(axis=0)"),
        ),
        mistake(
            "the lecture's table, which knows two rows",
            task="name-cells",
            loses=3,
            says="on inputs you haven't seen",
            code="""
def name_cells(columns, truth, new):
    use = truth != 255
    counts = np.zeros((256, 4, 14))
    np.add.at(counts, (columns[0][use], columns[1][use], truth[use]), 1)
    return counts.argmax(axis=2)[new[0], new[1]]""",
        ),
        mistake(
            "unlabelled cells counted",
            task="name-cells",
            loses=3,
            says="255 isn't a class",
            code=table().replace("columns, truth = columns[:, truth != 255], truth[truth != 255]", "pass"),
        ),
        mistake(
            "the last of equally frequent classes",
            task="name-cells",
            loses=3,
            says="equally frequent",
            code=table(pick="255 - np.bincount(255 - truth[same]).argmax()"),
        ),
        mistake(
            "the last that was met",
            task="name-cells",
            loses=3,
            says="label 0 with state 1 is mostly class 2",
            code=table(pick="truth[same][-1]"),
        ),
        mistake(
            "cells sorted in place",
            task="name-cells",
            loses=2,
            says="it changes an argument",
            code=table().replace(
                "    columns, truth =",
                "    columns[:], truth[:] = columns[:, ::-1].copy(), truth[::-1].copy()\n    columns, truth =",
            ),
        ),
        # ---- task 2
        right("nudges of a thousandth", task="wrong-derivative", code=gradient_check()),
        right(
            "one map and one cell at a time",
            task="wrong-derivative",
            code="""
def wrong_derivative(forward, back, planes, theta, beta):
    maps = forward(planes, theta, beta)
    for place in np.ndindex(maps.shape):
        behind = np.zeros(maps.shape)
        behind[place] = 2.0
        told = back(planes, theta, behind)
        for number, name in enumerate(("planes", "theta", "beta")):
            inputs = [planes, theta, beta]
            for where in np.ndindex(inputs[number].shape):
                nudge = np.zeros(inputs[number].shape)
                nudge[where] = 1
                nudged = list(inputs)
                nudged[number] = inputs[number] + nudge
                wanted = 2 * (forward(*nudged) - maps)[place]
                if abs(wanted - told[number][where]) > 1e-3 * max(abs(wanted), 1e-3):
                    return name
    return "none\"""",
        ),
        right(
            "written again by hand",
            task="wrong-derivative",
            code="""
def wrong_derivative(forward, back, planes, theta, beta):
    behind = np.random.default_rng(1).normal(size=(len(theta), *planes.shape[2:]))
    by_planes = (theta[..., None, None] * behind[:, None, None]).sum(axis=0)
    by_theta = (planes * behind[:, None, None]).sum(axis=(3, 4))
    wanted = by_planes, by_theta, behind.sum(axis=(1, 2))
    for name, a, b in zip(("planes", "theta", "beta"), wanted, back(planes, theta, behind)):
        if not np.allclose(a, b):
            return name
    return "none\"""",
        ),
        mistake(
            "ones from behind",
            task="wrong-derivative",
            loses=2,
            says="All ones hide",
            code=gradient_check(behind="np.ones(np.shape(forward(planes, theta, beta)))"),
        ),
        mistake(
            "sums compared",
            task="wrong-derivative",
            loses=3,
            says="",
            code=gradient_check(wrong="not np.isclose(np.abs(told).sum(), np.abs(by_nudging).sum(), rtol=0.2)"),
        ),
        mistake(
            "a coarse tolerance",
            task="wrong-derivative",
            loses=1,
            says="compare each number by itself",
            code=gradient_check(wrong="not np.allclose(told, by_nudging, rtol=0.1, atol=0.1)"),
        ),
        mistake(
            "no tolerance",
            task="wrong-derivative",
            loses=3,
            says="nothing is wrong here",
            code=gradient_check(wrong="(told != by_nudging).any()"),
        ),
        mistake(
            "another order of the derivatives",
            task="wrong-derivative",
            loses=3,
            says="nothing is wrong here",
            code=gradient_check(order="{'theta': theta, 'planes': planes, 'beta': beta}").replace(
                "if not np", "if np.shape(told) != by_nudging.shape or not np"
            ),
        ),
        mistake(
            "nudged and not put back",
            task="wrong-derivative",
            loses=2,
            says="it changes an argument",
            code=gradient_check(kept="values").replace(
                "            by_nudging[place] =",
                "                nudged[place] -= 0.999 * sign * 1e-3\n            by_nudging[place] =",
            ),
        ),
        mistake(
            "always none",
            task="wrong-derivative",
            loses=3,
            says='wrong is "planes"',
            code="def wrong_derivative(forward, back, planes, theta, beta):\n    return 'none'",
        ),
        mistake(
            "from behind in the shape of the visible test",
            task="wrong-derivative",
            loses=3,
            says="on inputs you haven't seen",
            code=gradient_check(behind="rng.normal(size=(2, 2, 3)) if planes.size == 36 else np.ones((2, 1, 2))"),
        ),
        mistake(
            "a number",
            task="wrong-derivative",
            loses=3,
            says="return",
            code="def wrong_derivative(forward, back, planes, theta, beta):\n    return 0",
        ),
        # ---- task 3
        right(
            "minimum and maximum", task="shares", code=shares("cells * np.minimum(np.maximum(alpha, 1 / limit), limit)")
        ),
        right(
            "class by class",
            task="shares",
            code="""
def shares(cells, alpha, limit):
    weights = [n * (limit if a > limit else 1 / limit if a < 1 / limit else a) for n, a in zip(cells, alpha)]
    return [weight / sum(weights) for weight in weights]""",
        ),
        mistake(
            "only large weights limited",
            task="shares",
            loses=2,
            says="weights below 1 / limit",
            code=shares("cells * np.minimum(alpha, limit)"),
        ),
        mistake(
            "only small weights limited",
            task="shares",
            loses=2,
            says="weights above the limit",
            code=shares("cells * np.maximum(alpha, 1 / limit)"),
        ),
        mistake("no limit", task="shares", loses=2, says="nothing is limited", code=shares("cells * alpha")),
        mistake("cells alone", task="shares", loses=2, says="the weights don't count", code=shares("cells * 1.0")),
        mistake("not divided", task="shares", loses=2, says="divide it by the sum", code=shares(share="weight * 1.0")),
        mistake(
            "weights alone",
            task="shares",
            loses=2,
            says="the cells don't count",
            code=shares("np.clip(alpha, 1 / limit, limit) * (cells > 0)"),
        ),
        mistake(
            "limited in place",
            task="shares",
            loses=2,
            says="on inputs you haven't seen: it changes an argument",
            code="""
def shares(cells, alpha, limit):
    np.clip(alpha, 1 / limit, limit, out=alpha)
    return cells * alpha / (cells * alpha).sum()""",
        ),
        right(
            "all that fit, then the smallest",
            task="choose-limit",
            code="""
def choose_limit(cells, alpha, limits, c, at_least, at_most):
    fit = []
    for limit in limits:
        w = np.array([min(max(a, 1 / limit), limit) if n else 0 for a, n in zip(alpha, cells)])
        if w[c] * cells[c] / (w @ cells) >= at_least and max(w) / (w @ cells) <= at_most:
            fit.append(limit)
    return min(fit) if fit else 0""",
        ),
        right("an array of limits, sorted", task="choose-limit", code=limit(order="np.sort(limits)")),
        mistake(
            "in the order given", task="choose-limit", loses=2, says="8 will do as well", code=limit(order="limits")
        ),
        mistake("the largest", task="choose-limit", loses=2, says="", code=limit(order="sorted(limits)[::-1]")),
        mistake(
            "no single cell looked at",
            task="choose-limit",
            loses=2,
            says="one cell of unknown-dynamic",
            code=limit(small="True"),
        ),
        mistake(
            "class c's cells alone looked at",
            task="choose-limit",
            loses=2,
            says="one cell of unknown-dynamic",
            code=limit(small="weight[c] <= at_most * total"),
        ),
        mistake(
            "the class's share not looked at",
            task="choose-limit",
            loses=2,
            says="reach a tenth with 8",
            code=limit(enough="True"),
        ),
        mistake(
            "small weights not limited",
            task="choose-limit",
            loses=2,
            says="",
            code=limit(weight="np.minimum(alpha, limit)"),
        ),
        mistake(
            "the largest limit when none fits",
            task="choose-limit",
            loses=2,
            says="stay below a tenth",
            code=limit(none="max(limits)"),
        ),
        mistake(
            "nothing when none fits",
            task="choose-limit",
            loses=2,
            says="returned nothing",
            code=limit(none="None"),
        ),
        mistake(
            "limits sorted in place",
            task="choose-limit",
            loses=2,
            says="on inputs you haven't seen: it changes an argument",
            code=limit(order="limits").replace("    for limit", "    limits.sort()\n    for limit"),
        ),
        mistake(
            "a bound on a class in place of a cell",
            task="choose-limit",
            loses=2,
            says="",
            code=limit(small="(cells * weight).max() <= at_most * total"),
        ),
        # ---- task 4
        right(
            "cell by cell",
            task="loss-back",
            code="""
def loss_back(logits, truth, alpha):
    result, total = np.zeros(logits.shape), 0
    for r, c in np.ndindex(truth.shape):
        if truth[r, c] != 255:
            e = np.exp(logits[:, r, c] - max(logits[:, r, c]))
            g = e / sum(e)
            g[truth[r, c]] -= 1
            result[:, r, c] = alpha[truth[r, c]] * g
            total += alpha[truth[r, c]]
    return result / total""",
        ),
        right(
            "scipy's soft-max, and a one-hot truth without unlabelled cells",
            task="loss-back",
            code="""
from scipy.special import softmax

def loss_back(logits, truth, alpha):
    one_hot = truth == np.arange(len(logits))[:, None, None]
    weight = (one_hot * alpha[:, None, None]).sum(axis=0)
    return weight * (softmax(logits, axis=0) - one_hot) / weight.sum()""",
        ),
        mistake(
            "divided by the labelled cells",
            task="loss-back",
            loses=3,
            says="divide by the sum of their weights",
            code=back(result="weight * (g - one_hot) / labelled.sum()"),
        ),
        mistake(
            "divided by all cells",
            task="loss-back",
            loses=3,
            says="you divide by the number of cells",
            code=back(result="weight * (g - one_hot) / truth.size"),
        ),
        mistake(
            "no weights",
            task="loss-back",
            loses=3,
            says="the weights are missing",
            code=back(weight="labelled * 1.0"),
        ),
        mistake(
            "not divided",
            task="loss-back",
            loses=3,
            says="not yet divided",
            code=back(result="weight * (g - one_hot)"),
        ),
        mistake(
            "sign swapped",
            task="loss-back",
            loses=3,
            says="the sign is swapped",
            code=back(result="weight * (one_hot - g) / weight.sum()"),
        ),
        mistake(
            "each class its own weight",
            task="loss-back",
            loses=3,
            says="the weight of the *true* class",
            code=back(result="labelled * alpha[:, None, None] * (g - one_hot) / weight.sum()"),
        ),
        mistake(
            "the unlabelled cell's weight counted",
            task="loss-back",
            loses=3,
            says="unlabelled cell's weight",
            code=back(result="weight * (g - one_hot) / alpha[true].sum()"),
        ),
        mistake(
            "unlabelled is class 0",
            task="loss-back",
            loses=3,
            says="the third cell isn't labelled",
            code=back(weight="alpha[true]"),
        ),
        mistake(
            "1 not subtracted",
            task="loss-back",
            loses=3,
            says="sum to 0",
            code=back(result="weight * g / weight.sum()"),
        ),
        mistake(
            "soft-max over everything",
            task="loss-back",
            loses=4,
            says="sum to 0",
            code=back(m="logits.max()", g="e / e.sum()"),
        ),
        mistake(
            "soft-max along the columns",
            task="loss-back",
            loses=4,
            says="",
            code=back(m="logits.max()", g="e / e.sum(axis=2, keepdims=True)"),
        ),
        mistake(
            "overflow",
            task="loss-back",
            loses=1,
            says="subtract the largest logit of each cell first",
            code=back(m="0"),
        ),
        mistake(
            "nothing subtracted, in long double",
            task="loss-back",
            loses=1,
            says="on inputs you haven't seen",
            code=back(m="np.longdouble(0)", result="(weight * (g - one_hot) / weight.sum()).astype(float)"),
        ),
        mistake(
            "one number subtracted from all cells",
            task="loss-back",
            loses=1,
            says="subtract",
            code=back(m="logits.max()"),
        ),
        mistake("255 as an index", task="loss-back", loses=4, says="IndexError", code=back(weight="alpha[truth]")),
        mistake(
            "255 overwritten in place",
            task="loss-back",
            loses=3,
            says="on inputs you haven't seen: it changes an argument",
            code=back(true="truth").replace("    true =", "    truth[~labelled] = 0\n    true ="),
        ),
        # ---- task 5
        right("least squares", task="rate-and-momentum", code=optimiser()),
        right(
            "the first step gives the rate",
            task="rate-and-momentum",
            code="""
def rate_and_momentum(path, gradients):
    steps = path[1:] - path[:-1]
    eta = -(steps[0] @ gradients[0]) / (gradients[0] @ gradients[0])
    left = steps[1:] + eta * gradients[1:]
    return [eta, (left * steps[:-1]).sum() / (steps[:-1] ** 2).sum()]""",
        ),
        mistake(
            "the sign of the rate",
            task="rate-and-momentum",
            loses=2,
            says="mind the sign",
            code=optimiser(returned="-found[0], found[1]"),
        ),
        mistake(
            "momentum first",
            task="rate-and-momentum",
            loses=2,
            says="rate and momentum are swapped",
            code=optimiser(returned="found[1], found[0]"),
        ),
        mistake(
            "no step before",
            task="rate-and-momentum",
            loses=2,
            says="rate and momentum of the path",
            code=optimiser(before="np.zeros(steps.shape)"),
        ),
        mistake(
            "gradients in place of steps before",
            task="rate-and-momentum",
            loses=2,
            says="rate and momentum of the path",
            code=optimiser(before="np.concatenate([np.zeros((1, steps.shape[1])), -gradients[:-1]])"),
        ),
        mistake(
            "the first two steps of one parameter alone",
            task="rate-and-momentum",
            loses=2,
            says="on inputs you haven't seen",
            code="""
def rate_and_momentum(path, gradients):
    eta = round((path[0, 0] - path[1, 0]) / gradients[0, 0], 1)
    return eta, round(((path[2, 0] - path[1, 0]) + eta * gradients[1, 0]) / (path[1, 0] - path[0, 0]), 1)""",
        ),
        right("projected on delta", task="rates", code=rates()),
        right(
            "the largest parameter of each delta",
            task="rates",
            code="""
def rates(path, gradients, kappa):
    found = []
    for k in range(len(gradients)):
        delta = sum(kappa ** (k - i) * gradients[i] for i in range(k + 1))
        n = np.abs(delta).argmax()
        found.append((path[k, n] - path[k + 1, n]) / delta[n])
    return found""",
        ),
        mistake("no momentum", task="rates", loses=1, says="rates 0.5, 0.2, 0.1", code=rates(delta="gradient")),
        mistake(
            "momentum of the last step",
            task="rates",
            loses=1,
            says="not the last step",
            code="""
def rates(path, gradients, kappa):
    steps = np.diff(path, axis=0)
    before = np.concatenate([np.zeros((1, steps.shape[1])), steps[:-1]])
    return -((steps - kappa * before) * gradients).sum(axis=1) / (gradients**2).sum(axis=1)""",
        ),
        mistake(
            "rounded to a digit",
            task="rates",
            loses=1,
            says="on inputs you haven't seen",
            code=rates().replace("np.array(found)", "np.round(found, 1)"),
        ),
        mistake(
            "endless loop",
            task="rates",
            loses=1,
            says="no reply before timeout",
            code="""
def rates(path, gradients, kappa):
    found = np.ones(len(gradients))
    while found.any():
        found += 1
    return found""",
        ),
        mistake(
            "the sign",
            task="rates",
            loses=1,
            says="the first step has the rate 0.5",
            code=rates(rate="(step @ delta) / (delta @ delta)"),
        ),
        mistake(
            "one rate for all",
            task="rates",
            loses=1,
            says="rates 0.5, 0.2, 0.1",
            code=rates().replace("return np.array(found)", "return np.full(len(found), found[0])"),
        ),
    )
