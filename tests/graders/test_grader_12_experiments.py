"""The graders of exercise 12, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, pack, right


def pooled(
    total="total + matrix",
    start="np.zeros_like(counts[0])",
    cells="total.sum(axis=1)",
    score="np.mean([total[c, c] / cells[c] for c in range(len(cells)) if cells[c]])",
    chosen="name == drive",
    result="{drive: of(drive) for drive in drives}",
):
    """Return an answer to task 1 with these parts."""
    return f"""
def drive_scores(counts, drives):
    def of(drive):
        total = {start}
        for matrix, name in zip(counts, drives):
            if {chosen}:
                total = {total}
        cells = {cells}
        return {score}
    return {result}"""


def holm(order="np.argsort(p_values)", limit="level / (m - place)", stop="break", keep="p_values[k] > "):
    """Return an answer to task 2 with these parts."""
    return f"""
def given_up(p_values, level=0.025):
    found, m = [False] * len(p_values), len(p_values)
    for place, k in enumerate({order}):
        if {keep}{limit}:
            {stop}
        found[k] = True
    return found"""


def jackknife(
    without="metric(total - m)",
    variance="(V - 1) / V * ((w - w.mean()) ** 2).sum()",
    half="t * np.sqrt(variance)",
    quantile="(1 + level) / 2",
    freedom="V - 1",
    middle="metric(total)",
    pooled="[sum(m for m, town in zip(matrices, towns) if town == one) for one in set(towns)]",
):
    """Return an answer to task 3 with these parts; V is the number of towns."""
    return f"""
def town_interval(matrices, towns, metric, level=0.95):
    pooled = {pooled}
    V, total = len(pooled), sum(matrices)
    w = np.array([{without} for m in pooled])
    variance = {variance}
    t = stats.t.ppf({quantile}, {freedom})
    half, middle = {half}, {middle}
    return middle - half, middle, middle + half"""


def paired(
    without="metric(A - x) - metric(B - y)",
    middle="metric(A) - metric(B)",
    pairs="zip(a, b)",
    half="stats.t.ppf((1 + level) / 2, V - 1) * np.sqrt((V - 1) / V * ((w - w.mean()) ** 2).sum())",
):
    """Return an answer to task 4 with these parts."""
    return f"""
def paired_interval(a, b, metric, level=0.95):
    V, A, B = len(a), a.sum(axis=0), b.sum(axis=0)
    w = np.array([{without} for x, y in {pairs}])
    half, middle = {half}, {middle}
    return middle - half, middle, middle + half"""


def separate(half, middle="metric(a.sum(0)) - metric(b.sum(0))"):
    """Return an answer to task 4 that makes two intervals, of half-widths ha and hb, and joins them so."""
    return f"""
def paired_interval(a, b, metric, level=0.95):
    def width(matrices):
        V, total = len(matrices), matrices.sum(axis=0)
        w = np.array([metric(total - m) for m in matrices])
        return stats.t.ppf((1 + level) / 2, V - 1) * np.sqrt((V - 1) / V * ((w - w.mean()) ** 2).sum())
    ha, hb = width(a), width(b)
    half, middle = {half}, {middle}
    return middle - half, middle, middle + half"""


def ece(
    labelled="truth != 255",
    sure="p.max(axis=1)",
    right="p.argmax(axis=1) == t",
    group="np.minimum((sure * bins).astype(int), bins - 1)",
    gap="abs(right[here].mean() - sure[here].mean())",
    weight="here.mean()",
    total="sum(gaps)",
    groups="range(bins)",
):
    """Return an answer to task 5 with these parts."""
    return f"""
def calibration_error(probability, truth, bins=10):
    kept = {labelled}
    p, t = probability[kept], truth[kept]
    sure, right = {sure}, {right}
    group, gaps = {group}, []
    for b in {groups}:
        here = group == b
        if here.any():
            gaps.append({weight} * {gap})
    return {total}"""


EVERYDAY = "got, slips, a, b, matrices, first, counts, yes = 'these were names of the test cells, too'.split(',') * 4\n"


def on_own_jackknife(number):
    """Return an answer to task 4 that hands pairs to the jackknife of task 3, whatever that does."""
    return right(
        f"both matrices side by side, for a jackknife that is wrong, {number}",
        task="paired",
        code="""
def paired_interval(a, b, metric, level=0.95):
    names = [str(v) for v in range(len(a))]
    return town_interval(np.stack([a, b], axis=1), names, lambda two: metric(two[0]) - metric(two[1]), level)""",
    )


class TestExperiments(GraderChecks):
    exercise = "12_experiments"
    entries = (
        # ---- task 1
        right("a loop", task="drive-scores", code=pooled()),
        right(
            "np.unique and np.add.at",
            task="drive-scores",
            code="""
def drive_scores(counts, drives):
    names, number = np.unique(drives, return_inverse=True)
    totals = np.zeros((len(names), *counts.shape[1:]))
    np.add.at(totals, number, counts)
    recalls = np.einsum("vcc->vc", totals) / totals.sum(axis=2)
    return dict(zip(names.tolist(), np.nanmean(recalls, axis=1).tolist()))""",
        ),
        mistake(
            "mean over frames",
            task="drive-scores",
            loses=2,
            says="sum the matrices first",
            code="""
def drive_scores(counts, drives):
    def one(m):
        return np.mean([m[c, c] / m[c].sum() for c in range(len(m)) if m[c].sum()])
    return {d: np.mean([one(m) for m, name in zip(counts, drives) if name == d]) for d in drives}""",
        ),
        mistake(
            "pixel accuracy",
            task="drive-scores",
            loses=2,
            says="that is pixel accuracy",
            code=pooled(score="np.trace(total) / total.sum()"),
        ),
        mistake(
            "columns",
            task="drive-scores",
            loses=2,
            says="you divide by the columns",
            code=pooled(cells="total.sum(axis=0)"),
        ),
        mistake(
            "the last frame alone",
            task="drive-scores",
            loses=2,
            says="only the last frame of drive a counts",
            code=pooled(total="matrix"),
        ),
        mistake(
            "neighbours alone",
            task="drive-scores",
            loses=2,
            says="only one frame of drive a counts",
            code=pooled(chosen="name == drive and not total.any()"),
        ),
        mistake("all drives summed", task="drive-scores", loses=2, says="keep them apart", code=pooled(chosen="True")),
        mistake(
            "an absent class is 0",
            task="drive-scores",
            loses=2,
            says="it doesn't count as 0",
            code=pooled(score="np.mean(np.diag(total) / np.maximum(cells, 1))"),
        ),
        mistake(
            "an absent class is 0 / 0",
            task="drive-scores",
            loses=2,
            says="you divide by the 0 cells",
            code=pooled(score="np.mean(np.diag(total) / cells)"),
        ),
        mistake(
            "a list",
            task="drive-scores",
            loses=2,
            says="return a dictionary",
            code=pooled(result="[of(drive) for drive in dict.fromkeys(drives)]"),
        ),
        mistake(
            "two classes only",
            task="drive-scores",
            loses=2,
            says="on inputs you haven't seen: a wrong score",
            code=pooled(score="np.mean([total[c, c] / cells[c] for c in range(2) if cells[c]])"),
        ),
        right(
            "scores in arrays, and helpers with everyday names",
            task="drive-scores",
            code=EVERYDAY + pooled(result="{drive: np.array([of(drive)]) for drive in drives}"),
        ),
        mistake(
            "texts in place of scores",
            task="drive-scores",
            loses=2,
            says="drive_scores, for drive a, returned no array of numbers but a str",
            code=pooled(score="f'{np.trace(total) / total.sum():.1%}'"),
        ),
        # ---- task 2
        right("a loop with a break", task="given-up", code=holm()),
        right(
            "adjusted p-values",
            task="given-up",
            code="""
def given_up(p_values, level=0.025):
    p = np.asarray(p_values)
    order = p.argsort()
    adjusted = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    return (adjusted <= level)[np.argsort(order)]""",
        ),
        mistake("uncorrected", task="given-up", loses=2, says="without a correction", code=holm(limit="level")),
        mistake("Bonferroni", task="given-up", loses=2, says="Bonferroni's correction", code=holm(limit="level / m")),
        mistake(
            "goes on after the first that stays",
            task="given-up",
            loses=2,
            says="stop at the first",
            code=holm(stop="continue"),
        ),
        mistake(
            "the list's own order",
            task="given-up",
            loses=2,
            says="0.004 is at most",
            code=holm(order="range(m)"),
        ),
        mistake(
            "largest first",
            task="given-up",
            loses=2,
            says="0.004 is at most",
            code=holm(order="np.argsort(p_values)[::-1]"),
        ),
        mistake(
            "in sorted order",
            task="given-up",
            loses=2,
            says="not in sorted order",
            code="""
def given_up(p_values, level=0.025):
    p = np.sort(p_values)
    return np.cumprod(p <= level / np.arange(len(p), 0, -1)).astype(bool)""",
        ),
        mistake(
            "below, not at most",
            task="given-up",
            loses=2,
            says="equal to its limit",
            code=holm(keep="p_values[k] >= "),
        ),
        mistake(
            "five at most",
            task="given-up",
            loses=2,
            says="on inputs you haven't seen",
            code=holm(order="np.argsort(p_values)[:5]"),
        ),
        mistake(
            "the level by heart",
            task="given-up",
            loses=2,
            says="level 0.05",
            code=holm(limit="0.025 / (m - place)"),
        ),
        # ---- task 3
        right("by the formula", task="towns", code=jackknife()),
        right(
            "pseudo-values",
            task="towns",
            code="""
def town_interval(matrices, towns, metric, level=0.95):
    towns = np.array(towns)
    V, score = len(set(towns)), metric(sum(matrices))
    pseudo = [V * score - (V - 1) * metric(matrices[towns != one].sum(axis=0)) for one in set(towns)]
    half = stats.sem(pseudo) * stats.t.isf((1 - level) / 2, V - 1)
    return score - half, score, score + half""",
        ),
        right(
            "around the score",
            task="towns",
            code=jackknife(variance="(V - 1) / V * ((w - metric(total)) ** 2).sum()"),
        ),
        mistake(
            "1.96",
            task="towns",
            loses=3,
            says="1.96 is for very many drives",
            code=jackknife(half="1.96 * np.sqrt(variance)"),
        ),
        mistake(
            "no quantile",
            task="towns",
            loses=3,
            says="that is the standard error",
            code=jackknife(half="np.sqrt(variance)"),
        ),
        mistake(
            "V degrees of freedom",
            task="towns",
            loses=3,
            says="G - 1 degrees of freedom, not G",
            code=jackknife(freedom="V"),
        ),
        mistake("one side", task="towns", loses=3, says="2.5 % on each side", code=jackknife(quantile="level")),
        mistake(
            "standard error of what is left",
            task="towns",
            loses=3,
            says="like independent scores",
            code=jackknife(variance="w.var(ddof=1) / V"),
        ),
        mistake(
            "variance of what is left",
            task="towns",
            loses=3,
            says="must be scaled up",
            code=jackknife(variance="w.var(ddof=1)"),
        ),
        mistake(
            "mean of squares",
            task="towns",
            loses=3,
            says="the mean of the squares isn't their sum",
            code=jackknife(variance="w.var()"),
        ),
        mistake(
            "factor forgotten",
            task="towns",
            loses=3,
            says="the factor (G - 1) / G is missing",
            code=jackknife(variance="((w - w.mean()) ** 2).sum()"),
        ),
        mistake(
            "factor upside down",
            task="towns",
            loses=3,
            says="not G / (G - 1)",
            code=jackknife(variance="V / (V - 1) * ((w - w.mean()) ** 2).sum()"),
        ),
        mistake(
            "each drive alone",
            task="towns",
            loses=3,
            says="you use the score of each town alone",
            code=jackknife(without="metric(m)", variance="w.var(ddof=1) / V"),
        ),
        mistake(
            "root forgotten", task="towns", loses=3, says="the root is missing", code=jackknife(half="t * variance")
        ),
        mistake(
            "mean of the drives' scores",
            task="towns",
            loses=3,
            says="Sum the matrices first",
            code=jackknife(middle="np.mean([metric(m) for m in pooled])"),
        ),
        mistake(
            "around what is left",
            task="towns",
            loses=3,
            says="around the score of *all* drives",
            code=jackknife(middle="w.mean()"),
        ),
        mistake(
            "level ignored",
            task="towns",
            loses=3,
            says="on inputs you haven't seen",
            code=jackknife(quantile="0.975"),
        ),
        mistake(
            "endless loop",
            task="towns",
            loses=3,
            says="no reply before timeout",
            code="""
def town_interval(matrices, towns, metric, level=0.95):
    while len(matrices):
        pass""",
        ),
        right(
            "a list, and helpers with everyday names",
            task="towns",
            code=EVERYDAY + jackknife().replace("return", "return [").replace("+ half", "+ half]"),
        ),
        mistake(
            "two ends alone",
            task="towns",
            loses=3,
            says="town_interval must return three numbers",
            code=jackknife().replace("middle, middle + half", "middle + half"),
        ),
        mistake(
            "a text",
            task="towns",
            loses=3,
            says="town_interval returned no array of numbers but a str",
            code=jackknife(middle="'69 %'", half="'30 %'").replace("middle - half, middle, ", ""),
        ),
        mistake(
            "one drive at a time",
            task="towns",
            loses=3,
            says="you leave out one drive at a time",
            code=jackknife(pooled="matrices"),
        ),
        mistake(
            "degrees of freedom of the drives",
            task="towns",
            loses=3,
            says="what is left out are towns",
            code=jackknife(freedom="len(matrices) - 1"),
        ),
        mistake(
            "every town has two drives, side by side in the second half",
            task="towns",
            loses=3,
            says="on inputs you haven't seen",
            code=jackknife(pooled="list(matrices[: len(matrices) // 2] + matrices[len(matrices) // 2 :])"),
        ),
        # ---- task 4
        right("by the formula", task="paired", code=paired()),
        right(
            "both matrices of a drive side by side",
            task="paired",
            code="""
def paired_interval(a, b, metric, level=0.95):
    names = [str(v) for v in range(len(a))]
    return town_interval(np.stack([a, b], axis=1), names, lambda two: metric(two[0]) - metric(two[1]), level)""",
        ),
        right(
            "pseudo-values",
            task="paired",
            code="""
def paired_interval(a, b, metric, level=0.95):
    V, d = len(a), metric(a.sum(0)) - metric(b.sum(0))
    pseudo = [V * d - (V - 1) * (metric(a.sum(0) - a[v]) - metric(b.sum(0) - b[v])) for v in range(V)]
    half = stats.t.ppf((1 + level) / 2, V - 1) * np.std(pseudo, ddof=1) / V**0.5
    return d - half, d, d + half""",
        ),
        mistake(
            "b - a", task="paired", loses=2, says="a - b is asked for", code=paired(middle="metric(B) - metric(A)")
        ),
        mistake(
            "variances added",
            task="paired",
            loses=2,
            says="their variances are added",
            code=separate("np.hypot(ha, hb)"),
        ),
        mistake(
            "half-widths added", task="paired", loses=2, says="you add the two half-widths", code=separate("ha + hb")
        ),
        mistake(
            "half-widths subtracted",
            task="paired",
            loses=2,
            says="you subtract the two half-widths",
            code=separate("abs(ha - hb)"),
        ),
        mistake("ends subtracted", task="paired", loses=2, says="can't simply be subtracted", code=separate("ha - hb")),
        mistake(
            "mean of the drives' differences",
            task="paired",
            loses=2,
            says="Sum the matrices first",
            code=paired(middle="np.mean([metric(x) - metric(y) for x, y in zip(a, b)])"),
        ),
        mistake(
            "each drive's own difference",
            task="paired",
            loses=2,
            says="you use each drive's own difference",
            code=paired(
                without="metric(x) - metric(y)", half="stats.t.ppf((1 + level) / 2, V - 1) * w.std(ddof=1) / np.sqrt(V)"
            ),
        ),
        mistake(
            "1.96",
            task="paired",
            loses=2,
            says="expected 0.01317",
            code=paired(half="1.96 * np.sqrt((V - 1) / V * ((w - w.mean()) ** 2).sum())"),
        ),
        mistake(
            "pixel accuracy, whatever the metric",
            task="paired",
            loses=2,
            says="on inputs you haven't seen",
            code=paired(
                without="pixel_accuracy(A - x) - pixel_accuracy(B - y)", middle="pixel_accuracy(A) - pixel_accuracy(B)"
            ),
        ),
        *(on_own_jackknife(number) for number in range(5)),
        # ---- task 5
        right("a loop over groups", task="calibration", code=ece()),
        right(
            "np.digitize and sums",
            task="calibration",
            code="""
def calibration_error(probability, truth, bins=10):
    sure, right = probability.max(axis=1), probability.argmax(axis=1) == truth
    sure, right = sure[truth != 255], right[truth != 255]
    group = np.digitize(sure, np.linspace(0, 1, bins + 1)[1:-1])
    return np.abs(np.bincount(group, right - sure)).sum() / len(sure)""",
        ),
        right(
            "edges included above",
            task="calibration",
            code=ece(group="np.maximum(np.ceil(sure * bins).astype(int) - 1, 0)"),
        ),
        right(
            "a number in a list, and helpers with everyday names",
            task="calibration",
            code=EVERYDAY + ece(total="[sum(gaps)]"),
        ),
        mistake(
            "the gaps",
            task="calibration",
            loses=3,
            says="calibration_error returned several numbers instead of one",
            code=ece(total="gaps"),
        ),
        mistake(
            "plain mean of groups",
            task="calibration",
            loses=3,
            says="you take the plain mean of the groups",
            code=ece(weight="1", total="np.mean(gaps)"),
        ),
        mistake(
            "plain mean of ten groups",
            task="calibration",
            loses=3,
            says="you take the plain mean of ten groups",
            code=ece(weight="1 / bins"),
        ),
        mistake(
            "no weights", task="calibration", loses=3, says="the gaps are added without weights", code=ece(weight="1")
        ),
        mistake(
            "signs cancel, then the absolute value",
            task="calibration",
            loses=3,
            says="the gaps of the groups cancel",
            code=ece(gap="(right[here].mean() - sure[here].mean())", total="abs(sum(gaps))"),
        ),
        mistake(
            "signed",
            task="calibration",
            loses=3,
            says="is negative",
            code=ece(gap="(right[here].mean() - sure[here].mean())"),
        ),
        mistake(
            "squared",
            task="calibration",
            loses=3,
            says="the gaps are squared",
            code=ece(gap="(right[here].mean() - sure[here].mean()) ** 2"),
        ),
        mistake(
            "the middle of the group",
            task="calibration",
            loses=3,
            says="not the middle of the group",
            code=ece(gap="abs(right[here].mean() - (b + 0.5) / bins)"),
        ),
        mistake(
            "largest gap",
            task="calibration",
            loses=3,
            says="that is the largest gap",
            code=ece(weight="1", total="max(gaps)"),
        ),
        mistake(
            "cell by cell",
            task="calibration",
            loses=3,
            says="you compare cell by cell",
            code=ece(gap="np.abs(right[here] - sure[here]).mean()"),
        ),
        mistake(
            "a group for 1 alone",
            task="calibration",
            loses=3,
            says="has got a group of its own",
            code=ece(group="(sure * bins).astype(int)", groups="range(bins + 1)"),
        ),
        mistake(
            "1 in no group",
            task="calibration",
            loses=3,
            says="is in no group",
            code=ece(group="(sure * bins).astype(int)"),
        ),
        mistake(
            "unlabelled cells count",
            task="calibration",
            loses=3,
            says="cells without a label count as wrong",
            code=ece(labelled="truth >= 0"),
        ),
        mistake(
            "N of all cells",
            task="calibration",
            loses=3,
            says="N is the number of labelled cells",
            code=ece(weight="here.sum() / len(truth)"),
        ),
        mistake(
            "probability of the true class",
            task="calibration",
            loses=3,
            says="not of the true class",
            code=ece(sure="p[np.arange(len(p)), t]"),
        ),
        mistake(
            "probability of the first class",
            task="calibration",
            loses=3,
            says="not that of the first class",
            code=ece(sure="p[:, 0]"),
        ),
        mistake(
            "ten groups, whatever is asked",
            task="calibration",
            loses=3,
            says="on inputs you haven't seen",
            code=ece(group="np.minimum((sure * 10).astype(int), 9)", groups="range(10)"),
        ),
        mistake(
            "empty groups",
            task="calibration",
            loses=3,
            says="an empty group has no mean",
            code="""
def calibration_error(probability, truth, bins=10):
    p, t = probability[truth != 255], truth[truth != 255]
    sure, right = p.max(axis=1), p.argmax(axis=1) == t
    group = np.minimum((sure * bins).astype(int), bins - 1)
    rows = [group == b for b in range(bins)]
    return sum(row.mean() * abs(right[row].mean() - sure[row].mean()) for row in rows)""",
        ),
        # ---- passed, or lost, when somebody tried who had not written the tests
        mistake(
            "a class that is never called is left out",
            task="drive-scores",
            loses=2,
            says="on inputs you haven't seen: a wrong score",
            code="""
def drive_scores(counts, drives):
    scores = {}
    for drive in dict.fromkeys(drives):
        total = sum(matrix for matrix, name in zip(counts, drives) if name == drive)
        cells = total.sum(axis=1)
        use = (cells > 0) & (total.sum(axis=0) > 0)
        scores[drive] = np.mean(np.diag(total)[use] / cells[use])
    return scores""",
        ),
        mistake(
            "a class that is never right is left out",
            task="drive-scores",
            loses=2,
            says="on inputs you haven't seen: a wrong score",
            code="""
def drive_scores(counts, drives):
    scores = {}
    for drive in dict.fromkeys(drives):
        total = sum(matrix for matrix, name in zip(counts, drives) if name == drive)
        cells = total.sum(axis=1)
        use = np.diag(total) > 0
        scores[drive] = np.mean(np.diag(total)[use] / cells[use])
    return scores""",
        ),
        right(
            "scores as Decimal",
            task="drive-scores",
            code="""
from decimal import Decimal

def drive_scores(counts, drives):
    scores = {}
    for drive in set(drives):
        total = counts[[name == drive for name in drives]].sum(axis=0).tolist()
        shares = [Decimal(row[c]) / sum(row) for c, row in enumerate(total) if sum(row)]
        scores[drive] = sum(shares) / len(shares)
    return scores""",
        ),
    )

    def test_a_wrong_jackknife_costs_nothing_in_task_4(self):
        built_on = [a for a in pack(self.entries) if "paired" in a and "that is wrong" in a["paired"].title]
        assert all(answers["towns"].loses for answers in built_on)
        assert len(built_on) == 5
