"""The graders of exercise 08, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def reduction(body):
    """Return an answer to task 1 with this body."""
    return f"def reduce_planes(planes, theta, beta):\n    return {body}"


def back(
    theta_bar="np.einsum('khw,cdhw->kcd', blamed, planes)",
    beta_bar="blamed.sum(axis=(1, 2))",
    planes_bar="np.einsum('kcd,khw->cdhw', theta, blamed)",
):
    """Return an answer to task 2 with these three derivatives."""
    return f"""
def reduce_back(planes, theta, blamed):
    return {theta_bar}, {beta_bar}, {planes_bar}"""


def balance(
    below="sum((m != 255).sum() for m in where)", alpha="np.median(f[f > 0]) / f[f > 0]", where="if (m == c).any()"
):
    """Return an answer to task 3 with these parts."""
    return f"""
def balance(maps, n_classes):
    f = np.zeros(n_classes)
    for c in range(n_classes):
        where = [m for m in maps {where}]
        if any((m == c).any() for m in maps):
            f[c] = sum((m == c).sum() for m in where) / ({below})
    weights = np.zeros(n_classes)
    weights[f > 0] = {alpha}
    return weights"""


def loss(
    result="-(w * of_truth).sum() / w.sum()",
    log_g="logits - m - np.log(np.exp(logits - m).sum(axis=0))",
    m="logits.max(axis=0)",
):
    """Return an answer to task 4 with these parts; w are the weights of labelled cells."""
    return f"""
def weighted_loss(logits, truth, alpha):
    m = {m}
    log_g = {log_g}
    rows, cols = np.nonzero(truth != 255)
    true = truth[rows, cols]
    of_truth, w = log_g[true, rows, cols], alpha[true]
    return {result}"""


def step(delta="kappa * delta + gradient", theta="theta - eta * new", returned="new"):
    """Return an answer to task 5 with these parts; `new` is the new delta."""
    return f"""
def momentum_step(theta, delta, gradient, eta, kappa):
    new = {delta}
    return {theta}, {returned}"""


def rate(factor):
    """Return an answer to the second half of task 5 with this factor."""
    return f"def cosine_rate(eta, step, steps):\n    return eta * {factor}"


class TestFusion(GraderChecks):
    exercise = "08_fusion"
    entries = (
        # ---- task 1
        right(
            "four loops",
            task="reduce-planes",
            code="""
def reduce_planes(planes, theta, beta):
    K, C, D = theta.shape
    maps = np.zeros((K, *planes.shape[2:]))
    for k in range(K):
        maps[k] += beta[k]
        for c in range(C):
            for d in range(D):
                maps[k] += theta[k, c, d] * planes[c, d]
    return maps""",
        ),
        right(
            "a list of maps",
            task="reduce-planes",
            code=reduction("[(t[..., None, None] * planes).sum(axis=(0, 1)) + b for t, b in zip(theta, beta)]"),
        ),
        right(
            "a product of two matrices",
            task="reduce-planes",
            code="""
def reduce_planes(planes, theta, beta):
    C, D, H, W = planes.shape
    column = planes.reshape(C * D, H * W)
    return (theta.reshape(len(theta), C * D) @ column + beta.reshape(-1, 1)).reshape(-1, H, W)""",
        ),
        right(
            "tensordot", task="reduce-planes", code=reduction("np.tensordot(theta, planes, 2) + beta[:, None, None]")
        ),
        mistake(
            "class and plane swapped",
            task="reduce-planes",
            loses=2,
            says="class and plane are swapped",
            code=reduction("np.einsum('kdc,cdhw->khw', theta, planes) + beta[:, None, None]"),
        ),
        mistake(
            "no bias",
            task="reduce-planes",
            loses=2,
            says="the bias is missing",
            code=reduction("np.einsum('kcd,cdhw->khw', theta, planes)"),
        ),
        mistake(
            "bias by column",
            task="reduce-planes",
            loses=2,
            says="your bias changes along the columns",
            code=reduction("np.einsum('kcd,cdhw->khw', theta, planes) + beta"),
        ),
        mistake(
            "bias with every term",
            task="reduce-planes",
            loses=2,
            says="the bias is added with every term",
            code=reduction("(theta[..., None, None] * planes + beta[:, None, None, None, None]).sum(axis=(1, 2))"),
        ),
        mistake(
            "bias with every plane",
            task="reduce-planes",
            loses=2,
            says="the bias is added with every plane",
            code=reduction("(np.einsum('kcd,cdhw->kdhw', theta, planes) + beta[:, None, None, None]).sum(axis=1)"),
        ),
        mistake(
            "mean instead of sum",
            task="reduce-planes",
            loses=2,
            says="that is a mean over classes and planes",
            code=reduction("(theta[..., None, None] * planes).mean(axis=(1, 2)) + beta[:, None, None]"),
        ),
        mistake(
            "the best plane and class",
            task="reduce-planes",
            loses=2,
            says="that is the largest term",
            code=reduction("(theta[..., None, None] * planes).max(axis=(1, 2)) + beta[:, None, None]"),
        ),
        mistake(
            "ground plane alone",
            task="reduce-planes",
            loses=2,
            says="that is the ground plane alone",
            code=reduction("np.einsum('kc,chw->khw', theta[:, :, 0], planes[:, 0]) + beta[:, None, None]"),
        ),
        mistake(
            "weights left out",
            task="reduce-planes",
            loses=2,
            says="the weights are missing",
            code=reduction("planes.sum(axis=(0, 1)) + beta[:, None, None]"),
        ),
        mistake(
            "soft-max of the scores first",
            task="reduce-planes",
            loses=2,
            says="you apply a soft-max over classes",
            code="""
def reduce_planes(planes, theta, beta):
    g = np.exp(planes) / np.exp(planes).sum(axis=0)
    return np.einsum("kcd,cdhw->khw", theta, g) + beta[:, None, None]""",
        ),
        mistake(
            "soft-max over planes",
            task="reduce-planes",
            loses=2,
            says="you apply a soft-max over planes",
            code="""
def reduce_planes(planes, theta, beta):
    g = np.exp(planes) / np.exp(planes).sum(axis=1, keepdims=True)
    return np.einsum("kcd,cdhw->khw", theta, g) + beta[:, None, None]""",
        ),
        mistake(
            "ReLU already",
            task="reduce-planes",
            loses=2,
            says="the ReLU comes later",
            code=reduction("np.maximum(0, np.einsum('kcd,cdhw->khw', theta, planes) + beta[:, None, None])"),
        ),
        mistake(
            "two classes and planes written in",
            task="reduce-planes",
            loses=2,
            says="on inputs you haven't seen: wrong sums when C, D and K are other numbers",
            code="""
def reduce_planes(planes, theta, beta):
    maps = beta[:, None, None] + np.zeros((len(theta), *planes.shape[2:]))
    for c, d in ((0, 0), (0, 1), (1, 0), (1, 1)):
        if c < len(planes) and d < planes.shape[1]:
            maps = maps + theta[:, c, d, None, None] * planes[c, d]
    return maps""",
        ),
        # ---- task 2
        right(
            "loops that add up",
            task="reduce-back",
            code="""
def reduce_back(planes, theta, blamed):
    theta_bar, planes_bar = np.zeros_like(theta), np.zeros_like(planes)
    for k, c, d in np.ndindex(theta.shape):
        theta_bar[k, c, d] = np.sum(planes[c, d] * blamed[k])
        planes_bar[c, d] += theta[k, c, d] * blamed[k]
    return theta_bar, [np.sum(b) for b in blamed], planes_bar""",
        ),
        right(
            "lists of numbers and maps",
            task="reduce-back",
            code="""
def reduce_back(planes, theta, blamed):
    K, C, D = theta.shape
    theta_bar = [[[(planes[c, d] * blamed[k]).sum() for d in range(D)] for c in range(C)] for k in range(K)]
    planes_bar = [[sum(theta[k, c, d] * blamed[k] for k in range(K)) for d in range(D)] for c in range(C)]
    return theta_bar, [b.sum() for b in blamed], planes_bar""",
        ),
        right(
            "transposed matrices",
            task="reduce-back",
            code="""
def reduce_back(planes, theta, blamed):
    K, C, D = theta.shape
    B, P, T = blamed.reshape(K, -1), planes.reshape(C * D, -1), theta.reshape(K, C * D)
    return (B @ P.T).reshape(K, C, D), B @ np.ones(B.shape[1]), (T.T @ B).reshape(planes.shape)""",
        ),
        right(
            "finite differences",
            task="reduce-back",
            code="""
def reduce_back(planes, theta, blamed):
    def total(planes, theta):
        return (np.einsum("kcd,cdhw->khw", theta, planes) * blamed).sum()
    by = np.zeros_like(theta), np.zeros_like(planes)
    for place in np.ndindex(theta.shape):
        step = np.zeros_like(theta); step[place] = 1.0
        by[0][place] = total(planes, theta + step) - total(planes, theta)
    for place in np.ndindex(planes.shape):
        step = np.zeros_like(planes); step[place] = 1.0
        by[1][place] = total(planes + step, theta) - total(planes, theta)
    return by[0], blamed.sum(axis=(1, 2)), by[1]""",
        ),
        mistake(
            "mean over cells",
            task="reduce-back",
            loses=2,
            says="that is the mean over cells",
            code=back(theta_bar="np.einsum('khw,cdhw->kcd', blamed, planes) / blamed[0].size"),
        ),
        mistake(
            "sums multiplied",
            task="reduce-back",
            loses=2,
            says="blame is lost: sum planes times blamed",
            code=back(theta_bar="blamed.sum(axis=(1, 2))[:, None, None] * planes.sum(axis=(2, 3))"),
        ),
        mistake(
            "first cell only",
            task="reduce-back",
            loses=2,
            says="that is the first cell alone",
            code=back(theta_bar="blamed[:, 0, 0][:, None, None] * planes[:, :, 0, 0]"),
        ),
        mistake(
            "summed over maps",
            task="reduce-back",
            loses=2,
            says="you sum over the reduced maps too",
            code=back(theta_bar="np.einsum('lhw,cdhw->cd', blamed, planes)[None].repeat(len(theta), axis=0)"),
        ),
        mistake(
            "theta for its derivative",
            task="reduce-back",
            loses=2,
            says="that is theta itself",
            code=back(theta_bar="theta"),
        ),
        mistake(
            "class and plane swapped",
            task="reduce-back",
            loses=2,
            says="class and plane are swapped in the derivative with respect to theta",
            code=back(theta_bar="np.einsum('khw,cdhw->kdc', blamed, planes)"),
        ),
        mistake(
            "mean for the bias",
            task="reduce-back",
            loses=2,
            says="by beta: that is the mean over cells",
            code=back(beta_bar="blamed.mean(axis=(1, 2))"),
        ),
        mistake(
            "one for the bias",
            task="reduce-back",
            loses=2,
            says="by beta: 1 is that of a map by its bias",
            code=back(beta_bar="np.ones(len(blamed))"),
        ),
        mistake(
            "first map only, back to the planes",
            task="reduce-back",
            loses=1,
            says="that is the blame of map 0 alone",
            code=back(planes_bar="theta[0][..., None, None] * blamed[0]"),
        ),
        mistake(
            "later maps overwrite",
            task="reduce-back",
            loses=1,
            says="that is the blame of map 1 alone",
            code="""
def reduce_back(planes, theta, blamed):
    theta_bar, planes_bar = np.zeros_like(theta), np.zeros_like(planes)
    for k, c, d in np.ndindex(theta.shape):
        theta_bar[k, c, d] = np.sum(planes[c, d] * blamed[k])
        planes_bar[c, d] = theta[k, c, d] * blamed[k]
    return theta_bar, blamed.sum(axis=(1, 2)), planes_bar""",
        ),
        mistake(
            "mean over maps",
            task="reduce-back",
            loses=1,
            says="that is the mean over maps",
            code=back(planes_bar="np.einsum('kcd,khw->cdhw', theta, blamed) / len(theta)"),
        ),
        mistake(
            "weights left out on the way back",
            task="reduce-back",
            loses=1,
            says="what comes from behind goes back by the weight",
            code=back(planes_bar="np.broadcast_to(blamed.sum(axis=0), planes.shape)"),
        ),
        mistake(
            "class and plane swapped on the way back",
            task="reduce-back",
            loses=1,
            says="class and plane are swapped: theta[k, c, d]",
            code=back(planes_bar="np.einsum('kdc,khw->cdhw', theta, blamed)"),
        ),
        mistake(
            "two maps written in",
            task="reduce-back",
            loses=1,
            says="on inputs you haven't seen",
            code=back(planes_bar="np.einsum('kcd,khw->cdhw', theta[:2], blamed[:2])"),
        ),
        mistake(
            "one row written in",
            task="reduce-back",
            loses=2,
            says="on inputs you haven't seen: wrong derivatives by theta",
            code=back(theta_bar="np.einsum('kw,cdw->kcd', blamed[:, 0], planes[:, :, 0])"),
        ),
        # ---- task 3
        right(
            "np.unique, map by map, in dictionaries",
            task="balance",
            code="""
def balance(maps, n_classes):
    cells, below = {}, {}
    for m in maps:
        classes, counts = np.unique(m[m != IGNORE], return_counts=True)
        for c, n in zip(classes, counts):
            cells[c] = cells.get(c, 0) + n
            below[c] = below.get(c, 0) + counts.sum()
    f = {c: cells[c] / below[c] for c in cells}
    middle = np.median(list(f.values()))
    return np.array([middle / f[c] if c in f else 0.0 for c in range(n_classes)])""",
        ),
        right(
            "bincount and NaN",
            task="balance",
            code="""
def balance(maps, n_classes):
    counts = np.array([np.bincount(m[m < n_classes].astype(int), minlength=n_classes) for m in maps])
    below = ((counts > 0) * counts.sum(axis=1, keepdims=True)).sum(axis=0)
    f = np.where(below > 0, counts.sum(axis=0) / below, np.nan)
    return np.nan_to_num(np.nanmedian(f) / f)""",
        ),
        mistake(
            "counted over all maps",
            task="balance",
            loses=2,
            says="every class is counted over all maps",
            code=balance(where=""),
        ),
        mistake(
            "unlabelled cells counted",
            task="balance",
            loses=2,
            says="unlabelled cells are counted below",
            code=balance(below="sum(m.size for m in where)"),
        ),
        mistake(
            "mean instead of median",
            task="balance",
            loses=2,
            says="that is the mean of the frequencies over f",
            code=balance(alpha="np.mean(f[f > 0]) / f[f > 0]"),
        ),
        mistake(
            "mean of the maps' frequencies",
            task="balance",
            loses=2,
            says="you average the frequencies of the maps",
            code="""
def balance(maps, n_classes):
    f = np.zeros(n_classes)
    for c in range(n_classes):
        each = [(m == c).sum() / (m != 255).sum() for m in maps if (m == c).any()]
        f[c] = np.mean(each) if each else 0
    alpha = np.zeros(n_classes)
    alpha[f > 0] = np.median(f[f > 0]) / f[f > 0]
    return alpha""",
        ),
        mistake(
            "upside down",
            task="balance",
            loses=2,
            says="what is frequent must weigh less",
            code=balance(alpha="f[f > 0] / np.median(f[f > 0])"),
        ),
        mistake("no median", task="balance", loses=2, says="that is 1 / f", code=balance(alpha="1 / f[f > 0]")),
        mistake(
            "frequencies returned",
            task="balance",
            loses=2,
            says="that is the frequency f itself",
            code=balance(alpha="f[f > 0]"),
        ),
        mistake(
            "the upper one in the middle",
            task="balance",
            loses=2,
            says="you take the upper one",
            code=balance(alpha="np.sort(f[f > 0])[(f > 0).sum() // 2] / f[f > 0]"),
        ),
        mistake(
            "the lower one in the middle",
            task="balance",
            loses=2,
            says="you take the lower one",
            code=balance(alpha="np.sort(f[f > 0])[((f > 0).sum() - 1) // 2] / f[f > 0]"),
        ),
        mistake(
            "absent classes in the median",
            task="balance",
            loses=1,
            says="absent class 4 pulls the median down",
            code=balance(alpha="np.median(f) / f[f > 0]"),
        ),
        mistake(
            "divided by the frequency 0",
            task="balance",
            loses=1,
            says="don't divide by its frequency",
            code="""
def balance(maps, n_classes):
    f = np.zeros(n_classes)
    for c in range(n_classes):
        where = [m for m in maps if (m == c).any()]
        f[c] = sum((m == c).sum() for m in where) / max(1, sum((m != 255).sum() for m in where))
    return np.median(f[f > 0]) / f""",
        ),
        mistake(
            "absent classes weigh one",
            task="balance",
            loses=1,
            says="so its weight is 0, got 1",
            code="""
def balance(maps, n_classes):
    f = np.zeros(n_classes)
    for c in range(n_classes):
        where = [m for m in maps if (m == c).any()]
        if where:
            f[c] = sum((m == c).sum() for m in where) / sum((m != 255).sum() for m in where)
    alpha = np.ones(n_classes)
    alpha[f > 0] = np.median(f[f > 0]) / f[f > 0]
    return alpha""",
        ),
        mistake(
            "maps of one size only",
            task="balance",
            loses=2,
            says="on inputs you haven't seen: it raises an error in line",
            code="""
def balance(maps, n_classes):
    maps = np.stack(maps)
    f = np.zeros(n_classes)
    for c in range(n_classes):
        where = maps[(maps == c).any(axis=(1, 2))]
        if len(where):
            f[c] = (where == c).sum() / (where != 255).sum()
    alpha = np.zeros(n_classes)
    alpha[f > 0] = np.median(f[f > 0]) / f[f > 0]
    return alpha""",
        ),
        mistake(
            "a step ahead",
            task="cosine-rate",
            loses=1,
            says="is a step ahead",
            code=rate("(1 + np.cos(np.pi * (step + 1) / steps)) / 2"),
        ),
        mistake(
            "endless loop",
            task="balance",
            loses=3,
            says="no reply before timeout",
            code="""
def balance(maps, n_classes):
    c, f = 0, np.zeros(n_classes)
    while c < n_classes:
        where = [m for m in maps if (m == c).any()]
        if where:
            f[c] = sum((m == c).sum() for m in where) / sum((m != 255).sum() for m in where)
    return np.median(f) / f""",
        ),
        # ---- task 4
        right(
            "cell by cell",
            task="weighted-loss",
            code="""
def weighted_loss(logits, truth, alpha):
    above, below = 0.0, 0.0
    for r in range(truth.shape[0]):
        for col in range(truth.shape[1]):
            c = truth[r, col]
            if c != IGNORE:
                z = logits[:, r, col]
                above += alpha[c] * (z.max() + np.log(np.exp(z - z.max()).sum()) - z[c])
                below += alpha[c]
    return above / below""",
        ),
        right(
            "class by class, with logaddexp",
            task="weighted-loss",
            code="""
def weighted_loss(logits, truth, alpha):
    log_g = logits - np.logaddexp.reduce(logits, axis=0)
    sums = [(a * -log_g[c][truth == c].sum(), a * (truth == c).sum()) for c, a in enumerate(alpha)]
    return sum(s for s, _ in sums) / sum(w for _, w in sums)""",
        ),
        right(
            "one-hot, and scipy's log-soft-max",
            task="weighted-loss",
            code="""
from scipy.special import log_softmax

def weighted_loss(logits, truth, alpha):
    one_hot = truth == np.arange(len(logits))[:, None, None]
    w = one_hot * alpha[:, None, None]
    return -(w * log_softmax(logits, axis=0)).sum() / w.sum()""",
        ),
        mistake(
            "divided by the labelled cells",
            task="weighted-loss",
            loses=3,
            says="you divide by the number of cells: divide by the sum of their weights",
            code=loss("-(w * of_truth).mean()"),
        ),
        mistake(
            "divided by all cells",
            task="weighted-loss",
            loses=3,
            says="you divide by the number of cells, unlabelled ones too",
            code=loss("-(w * of_truth).sum() / truth.size"),
        ),
        mistake(
            "no weights", task="weighted-loss", loses=3, says="the weights are missing", code=loss("-of_truth.mean()")
        ),
        mistake(
            "the sum",
            task="weighted-loss",
            loses=3,
            says="that is the sum: divide it",
            code=loss("-(w * of_truth).sum()"),
        ),
        mistake(
            "sign swapped",
            task="weighted-loss",
            loses=3,
            says="the sign is swapped",
            code=loss("(w * of_truth).sum() / w.sum()"),
        ),
        mistake(
            "log10",
            task="weighted-loss",
            loses=3,
            says="that is the logarithm to base 10",
            code=loss("-(w * of_truth).sum() / w.sum() / np.log(10)"),
        ),
        mistake(
            "unlabelled cells weigh below",
            task="weighted-loss",
            loses=3,
            says="the unlabelled cell is counted below",
            code=loss("-(w * of_truth).sum() / alpha[np.minimum(truth, len(alpha) - 1)].sum()"),
        ),
        mistake(
            "no logarithm",
            task="weighted-loss",
            loses=4,
            says="that is the mean probability of the truth",
            code=loss("(w * np.exp(of_truth)).sum() / w.sum()"),
        ),
        mistake(
            "soft-max along the columns",
            task="weighted-loss",
            loses=4,
            says="your soft-max runs along the row of cells",
            code=loss(log_g="logits - np.log(np.exp(logits).sum(axis=2, keepdims=True))"),
        ),
        mistake(
            "soft-max over everything",
            task="weighted-loss",
            loses=4,
            says="your soft-max runs over all numbers at once",
            code=loss(log_g="logits - np.log(np.exp(logits).sum())"),
        ),
        mistake(
            "soft-max over the rows",
            task="weighted-loss",
            loses=4,
            says="there is no soft-max, or it runs down the rows",
            code=loss(log_g="logits - np.log(np.exp(logits).sum(axis=1, keepdims=True))"),
        ),
        mistake("no soft-max", task="weighted-loss", loses=4, says="there is no soft-max", code=loss(log_g="logits")),
        mistake(
            "255 as an index",
            task="weighted-loss",
            loses=4,
            says="IndexError",
            code="""
def weighted_loss(logits, truth, alpha):
    log_g = logits - np.logaddexp.reduce(logits, axis=0)
    w = alpha[truth]
    return -(w * np.take_along_axis(log_g, truth[None], axis=0)[0]).sum() / w.sum()""",
        ),
        mistake(
            "unlabelled is class 0",
            task="weighted-loss",
            loses=3,
            says="you count the unlabelled cell as class 0",
            code=loss().replace("rows,", "truth = np.where(truth == 255, 0, truth)\n    rows,", 1),
        ),
        mistake(
            "unlabelled clipped to the last class",
            task="weighted-loss",
            loses=3,
            says="you count the unlabelled cell as the last class",
            code=loss().replace("rows,", "truth = np.minimum(truth, len(alpha) - 1)\n    rows,", 1),
        ),
        mistake(
            "unlabelled weighs as class 0 below",
            task="weighted-loss",
            loses=3,
            says="weighs below as class 0",
            code=loss("-(w * of_truth).sum() / alpha[np.where(truth == 255, 0, truth)].sum()"),
        ),
        mistake(
            "soft-max of a soft-max",
            task="weighted-loss",
            loses=4,
            says="that is the soft-max of a soft-max",
            code=loss().replace("    m =", "    logits = np.exp(logits) / np.exp(logits).sum(axis=0)\n    m ="),
        ),
        mistake(
            "divided by the weights of all classes",
            task="weighted-loss",
            loses=3,
            says="you divide by the weights of all classes",
            code=loss("-(w * of_truth).sum() / alpha.sum()"),
        ),
        mistake(
            "logarithm of a probability that is zero",
            task="weighted-loss",
            loses=1,
            says="keep log g, g itself is 0 here",
            code=loss(log_g="np.log(np.exp(logits - m) / np.exp(logits - m).sum(axis=0))"),
        ),
        mistake(
            "overflow",
            task="weighted-loss",
            loses=1,
            says="subtract the largest logit of each cell first",
            code=loss(m="0"),
        ),
        mistake(
            "a small number against log 0",
            task="weighted-loss",
            loses=4,
            says="on inputs you haven't seen",
            code="""
def weighted_loss(logits, truth, alpha):
    m = logits.max(axis=0)
    g = np.exp(logits - m) / np.exp(logits - m).sum(axis=0) + 1e-4
    rows, cols = np.nonzero(truth != 255)
    true = truth[rows, cols]
    return -(alpha[true] * np.log(g[true, rows, cols])).sum() / alpha[true].sum()""",
        ),
        mistake(
            "one number subtracted from all cells",
            task="weighted-loss",
            loses=1,
            says="subtract the largest logit of each cell first",
            code=loss(m="logits.max()"),
        ),
        # ---- task 5
        right(
            "number by number",
            task="momentum-step",
            code="""
def momentum_step(theta, delta, gradient, eta, kappa):
    theta, delta = np.array(theta), np.array(delta)
    for place in np.ndindex(theta.shape):
        delta[place] = kappa * delta[place] + gradient[place]
        theta[place] -= eta * delta[place]
    return theta, delta""",
        ),
        right(
            "the same sums in another order",
            task="momentum-step",
            code="""
def momentum_step(theta, delta, gradient, eta, kappa):
    return theta - eta * kappa * delta - eta * gradient, gradient + delta * kappa""",
        ),
        right(
            "nested lists, and helpers with everyday names",
            task="momentum-step",
            code="""
weights, read, loss, gradient, planes, first = "these were names of tests".split() + [0]


def got(theta, delta, gradient, eta, kappa):
    delta = [[kappa * d + g for d, g in zip(*rows)] for rows in zip(np.atleast_2d(delta), np.atleast_2d(gradient))]
    return [[t - eta * d for t, d in zip(*rows)] for rows in zip(np.atleast_2d(theta), delta)], delta


def momentum_step(theta, delta, gradient, eta, kappa):
    return [np.reshape(part, np.shape(theta)).tolist() for part in got(theta, delta, gradient, eta, kappa)]""",
        ),
        mistake(
            "a dictionary",
            task="momentum-step",
            loses=2,
            says="for delta momentum_step returned no array of numbers",
            code="def momentum_step(theta, delta, gradient, eta, kappa):\n    return theta, {'delta': delta}",
        ),
        mistake(
            "uphill", task="momentum-step", loses=2, says="the step goes uphill", code=step(theta="theta + eta * new")
        ),
        mistake(
            "dampening",
            task="momentum-step",
            loses=2,
            says="the gradient is damped by 1 - kappa",
            code=step(delta="kappa * delta + (1 - kappa) * gradient"),
        ),
        mistake(
            "rate twice",
            task="momentum-step",
            loses=2,
            says="the rate counts twice",
            code=step(delta="kappa * delta + eta * gradient"),
        ),
        mistake(
            "rate inside delta",
            task="momentum-step",
            loses=2,
            says="the rate stands inside delta",
            code=step(delta="kappa * delta + eta * gradient", theta="theta - new"),
        ),
        mistake(
            "Nesterov",
            task="momentum-step",
            loses=2,
            says="that is Nesterov's momentum",
            code=step(theta="theta - eta * (gradient + kappa * new)"),
        ),
        mistake(
            "delta first",
            task="momentum-step",
            loses=2,
            says="that is delta: return theta first",
            code=step(theta="new", returned="theta - eta * new"),
        ),
        mistake(
            "rate and momentum swapped",
            task="momentum-step",
            loses=2,
            says="eta and kappa are swapped",
            code=step(delta="eta * delta + gradient", theta="theta - kappa * new"),
        ),
        mistake(
            "old delta",
            task="momentum-step",
            loses=2,
            says="you step by the old delta",
            code=step(theta="theta - eta * delta"),
        ),
        mistake(
            "plain descent",
            task="momentum-step",
            loses=2,
            says="that is plain descent",
            code=step(theta="theta - eta * gradient"),
        ),
        mistake(
            "momentum on all",
            task="momentum-step",
            loses=2,
            says="kappa damps the new gradient too",
            code=step(delta="kappa * (delta + gradient)"),
        ),
        mistake(
            "gradients pile up",
            task="momentum-step",
            loses=2,
            says="the old delta doesn't fade",
            code=step(delta="delta + gradient"),
        ),
        mistake(
            "two minus signs",
            task="momentum-step",
            loses=2,
            says="two minus signs go uphill",
            code=step(delta="kappa * delta - gradient"),
        ),
        mistake(
            "step returned for delta",
            task="momentum-step",
            loses=2,
            says="delta is returned with the rate in it",
            code=step(returned="eta * new"),
        ),
        mistake(
            "arguments changed in place",
            task="momentum-step",
            loses=2,
            says="changed its argument `theta`",
            code="""
def momentum_step(theta, delta, gradient, eta, kappa):
    delta *= kappa
    delta += gradient
    theta -= eta * delta
    return theta, delta""",
        ),
        mistake(
            "a row of parameters only",
            task="momentum-step",
            loses=2,
            says="on inputs you haven't seen",
            code="""
def momentum_step(theta, delta, gradient, eta, kappa):
    new = np.array([kappa * float(d) + float(g) for d, g in zip(delta, gradient)])
    return theta - eta * new, new""",
        ),
        right(
            "the square of half the angle's cosine",
            task="cosine-rate",
            code=rate("np.cos(np.pi * step / steps / 2) ** 2"),
        ),
        right(
            "degrees made radians",
            task="cosine-rate",
            code="""
import math

def cosine_rate(eta, step, steps):
    return 0.5 * eta + 0.5 * eta * math.cos(math.radians(180 * step / steps))""",
        ),
        mistake(
            "five steps written in",
            task="cosine-rate",
            loses=1,
            says="on inputs you haven't seen: wrong in other steps",
            code=rate("(1 + np.cos(np.pi * step / 5)) / 2"),
        ),
        mistake(
            "no 1 +", task="cosine-rate", loses=1, says="it falls to -eta", code=rate("np.cos(np.pi * step / steps)")
        ),
        mistake(
            "not halved",
            task="cosine-rate",
            loses=1,
            says="the first step would have twice the rate",
            code=rate("(1 + np.cos(np.pi * step / steps))"),
        ),
        mistake(
            "a whole cosine",
            task="cosine-rate",
            loses=1,
            says="that is a whole cosine",
            code=rate("(1 + np.cos(2 * np.pi * step / steps)) / 2"),
        ),
        mistake(
            "a quarter of a cosine",
            task="cosine-rate",
            loses=1,
            says="that is a quarter of a cosine",
            code=rate("np.cos(np.pi * step / steps / 2)"),
        ),
        mistake(
            "a straight line",
            task="cosine-rate",
            loses=1,
            says="that is a straight line",
            code=rate("(1 - step / steps)"),
        ),
        mistake(
            "degrees",
            task="cosine-rate",
            loses=1,
            says="the angle is in degrees",
            code=rate("(1 + np.cos(180 * step / steps)) / 2"),
        ),
        mistake(
            "the last step is the end",
            task="cosine-rate",
            loses=1,
            says="the last step gets rate 0",
            code=rate("(1 + np.cos(np.pi * step / (steps - 1))) / 2"),
        ),
        # ---- passed, or lost, when somebody tried who had not written the tests
        mistake(
            "255 overwritten in place",
            task="weighted-loss",
            loses=3,
            says="it changes an argument",
            code="""
def weighted_loss(logits, truth, alpha):
    logits = logits - logits.max(axis=0)
    weight = np.where(truth == 255, 0, alpha[np.where(truth == 255, 0, truth)])
    truth[truth == 255] = 0
    log_g = logits - np.log(np.exp(logits).sum(axis=0))
    return -(weight * np.take_along_axis(log_g, truth[None], axis=0)[0]).sum() / weight.sum()""",
        ),
        mistake(
            "labels made to indices in place",
            task="balance",
            loses=2,
            says="it changes an argument",
            code="""
def balance(maps, n_classes):
    for m in maps:
        m[m == 255] = n_classes
    counts = np.array([np.bincount(m.ravel(), minlength=n_classes + 1)[:n_classes] for m in maps])
    below = (counts > 0).T @ counts.sum(axis=1)
    f = counts.sum(axis=0) / np.maximum(below, 1)
    return np.where(f > 0, np.median(f[f > 0]) / np.where(f > 0, f, 1), 0)""",
        ),
        right(
            "a rate as a fraction",
            task="cosine-rate",
            code="""
from fractions import Fraction

def cosine_rate(eta, step, steps):
    return Fraction(eta) * Fraction((1 + np.cos(np.pi * step / steps)) / 2)""",
        ),
    )
