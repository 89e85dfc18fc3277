"""The graders of exercise 12, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, pack, right


def pooled(
    total="total + matrix",
    start="np.zeros_like(counts[0])",
    cells="total.sum(axis=1)",
    score="np.mean([total[c, c] / cells[c] for c in range(len(cells)) if cells[c] >= least])",
    chosen="name == drive",
    result="{drive: of(drive) for drive in drives}",
):
    """Return an answer to task 1 with these parts."""
    return f"""
def drive_scores(counts, drives, least=1):
    def of(drive):
        total = {start}
        for matrix, name in zip(counts, drives):
            if {chosen}:
                total = {total}
        cells = {cells}
        return {score}
    return {result}"""


def hochberg(order="np.argsort(p_values)[::-1]", limit="level / (place + 1)", given="order[place:]", compare="<="):
    """Return an answer to task 2 with these parts."""
    return f"""
def given_up(p_values, level=0.025):
    order, found = {order}, [False] * len(p_values)
    for place, k in enumerate(order):
        if p_values[k] {compare} {limit}:
            for one in {given}:
                found[one] = True
            break
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
    without="share(A - x, B - y)",
    middle="share(A, B)",
    pairs="zip(a, b)",
    half="stats.t.ppf((1 + level) / 2, V - 1) * np.sqrt((V - 1) / V * ((w - w.mean()) ** 2).sum())",
    share="(metric(x) - metric(y)) / (1 - metric(y))",
):
    """Return an answer to task 4 with these parts."""
    return f"""
def paired_interval(a, b, metric, level=0.95):
    def share(x, y):
        return {share}
    V, A, B = len(a), a.sum(axis=0), b.sum(axis=0)
    w = np.array([{without} for x, y in {pairs}])
    half, middle = {half}, {middle}
    return middle - half, middle, middle + half"""


def separate(half):
    """Return an answer to task 4 that leaves drives out of one method alone, and joins half-widths ha and hb so."""
    return f"""
def paired_interval(a, b, metric, level=0.95):
    def share(x, y):
        return (metric(x) - metric(y)) / (1 - metric(y))
    V, A, B = len(a), a.sum(axis=0), b.sum(axis=0)
    def width(w):
        return stats.t.ppf((1 + level) / 2, V - 1) * np.sqrt((V - 1) / V * ((np.array(w) - np.mean(w)) ** 2).sum())
    ha, hb = width([share(A - x, B) for x in a]), width([share(A, B - y) for y in b])
    half, middle = {half}, share(A, B)
    return middle - half, middle, middle + half"""


IN_TURN = "np.repeat(np.arange(bins), list(map(len, np.array_split(sure, bins))))"
"""The group of each cell, when they are cut as they stand."""


def ece(
    labelled="truth != 255",
    sure="p.max(axis=1)",
    right="p.argmax(axis=1) == t",
    group=f"{IN_TURN}[sure.argsort().argsort()]",
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
    names, pairs = [str(v) for v in range(len(a))], np.stack([a, b], axis=1)
    return town_interval(pairs, names, lambda two: 1 - (1 - metric(two[0])) / (1 - metric(two[1])), level)""",
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
def drive_scores(counts, drives, least=1):
    names, number = np.unique(drives, return_inverse=True)
    totals = np.zeros((len(names), *counts.shape[1:]))
    np.add.at(totals, number, counts)
    totals[totals.sum(axis=2) < least] = 0
    recalls = np.einsum("vcc->vc", totals) / totals.sum(axis=2)
    return dict(zip(names.tolist(), np.nanmean(recalls, axis=1).tolist()))""",
        ),
        mistake(
            "mean over frames",
            task="drive-scores",
            loses=2,
            says="sum the matrices first",
            code="""
def drive_scores(counts, drives, least=1):
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
            code=pooled(score="np.mean([total[c, c] / cells[c] for c in range(2) if cells[c] >= least])"),
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
        right("a loop with a break", task="given-up", code=hochberg()),
        right(
            "adjusted p-values",
            task="given-up",
            code="""
def given_up(p_values, level=0.025):
    p = np.asarray(p_values)
    order = p.argsort()[::-1]
    adjusted = np.minimum.accumulate(p[order] * np.arange(1, len(p) + 1))
    return (adjusted <= level)[np.argsort(order)]""",
        ),
        right(
            "all up to the largest that goes",
            task="given-up",
            code="""
def given_up(p_values, level=0.025):
    ranks = {p: sum(q >= p for q in p_values) for p in p_values}
    most = max((p for p in p_values if p <= level / ranks[p]), default=-1)
    return [p <= most for p in p_values]""",
        ),
        mistake("uncorrected", task="given-up", loses=2, says="without a correction", code=hochberg(limit="level")),
        mistake(
            "Bonferroni",
            task="given-up",
            loses=2,
            says="that is Holm's correction, or Bonferroni's",
            code=hochberg(limit="level / len(p_values)"),
        ),
        mistake(
            "the package's function, wrapped",
            task="given-up",
            loses=2,
            says="that is Holm's correction, or Bonferroni's",
            code="""
def given_up(p_values, level=0.025):
    from semgrid_edu.workshop.paper.verdicts import holm
    return holm(p_values, level)""",
        ),
        mistake(
            "each against its own limit",
            task="given-up",
            loses=2,
            says="so it goes as well",
            code=hochberg(given="[k]").replace("            break\n", ""),
        ),
        mistake(
            "the first that goes alone",
            task="given-up",
            loses=2,
            says="all smaller ones go as well",
            code=hochberg(given="[k]"),
        ),
        mistake(
            "the list's own order",
            task="given-up",
            loses=2,
            says="comes first and is above the level",
            code=hochberg(order="list(range(len(p_values)))"),
        ),
        mistake(
            "smallest first",
            task="given-up",
            loses=2,
            says="comes first and is above the level",
            code=hochberg(order="np.argsort(p_values)"),
        ),
        mistake(
            "in sorted order",
            task="given-up",
            loses=2,
            says="not in sorted order",
            code="""
def given_up(p_values, level=0.025):
    p = np.sort(p_values)[::-1]
    return np.maximum.accumulate(p <= level / np.arange(1, len(p) + 1))[::-1]""",
        ),
        mistake(
            "below, not at most",
            task="given-up",
            loses=2,
            says="equal to its limit",
            code=hochberg(compare="<"),
        ),
        mistake(
            "five at most",
            task="given-up",
            loses=2,
            says="on inputs you haven't seen",
            code=hochberg(order="np.argsort(p_values)[::-1][:5]"),
        ),
        mistake(
            "the level by heart",
            task="given-up",
            loses=2,
            says="level 0.05",
            code=hochberg(limit="0.025 / (place + 1)"),
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
    names, pairs = [str(v) for v in range(len(a))], np.stack([a, b], axis=1)
    return town_interval(pairs, names, lambda two: 1 - (1 - metric(two[0])) / (1 - metric(two[1])), level)""",
        ),
        right(
            "pseudo-values",
            task="paired",
            code="""
def paired_interval(a, b, metric, level=0.95):
    def share(x, y):
        return 1 - (1 - metric(x)) / (1 - metric(y))
    V, d = len(a), share(a.sum(0), b.sum(0))
    pseudo = [V * d - (V - 1) * share(a.sum(0) - a[v], b.sum(0) - b[v]) for v in range(V)]
    half = stats.t.ppf((1 + level) / 2, V - 1) * np.std(pseudo, ddof=1) / V**0.5
    return d - half, d, d + half""",
        ),
        mistake("b - a", task="paired", loses=2, says="a is better", code=paired(middle="share(B, A)")),
        mistake(
            "divided by the errors of a",
            task="paired",
            loses=2,
            says="divide by the errors of b, not by those of a",
            code=paired(share="(metric(x) - metric(y)) / (1 - metric(x))"),
        ),
        mistake(
            "divided by what b calls right",
            task="paired",
            loses=2,
            says="divide by what b calls wrong",
            code=paired(share="metric(x) / metric(y) - 1"),
        ),
        mistake(
            "the errors that remain",
            task="paired",
            loses=2,
            says="that is the share of b's errors that a makes as well",
            code=paired(share="(1 - metric(x)) / (1 - metric(y))"),
        ),
        mistake(
            "the interval of the difference",
            task="paired",
            loses=2,
            says="that is the interval of the difference",
            code=paired(without="metric(A - x) - metric(B - y)"),
        ),
        mistake(
            "divided by the errors in all drives",
            task="paired",
            loses=2,
            says="by the errors in all drives",
            code=paired(without="(metric(A - x) - metric(B - y)) / (1 - metric(B))"),
        ),
        *(on_own_jackknife(number) for number in range(5)),
        mistake(
            "variances added",
            task="paired",
            loses=2,
            says="two methods on *different* drives",
            code=separate("np.hypot(ha, hb)"),
        ),
        mistake("drives left out of a alone", task="paired", loses=2, says="out of a alone", code=separate("ha")),
        mistake("drives left out of b alone", task="paired", loses=2, says="out of b alone", code=separate("hb")),
        mistake("ends swapped", task="paired", loses=2, says="can't simply be subtracted", code=separate("hb - ha")),
        mistake(
            "mean of the drives' shares",
            task="paired",
            loses=2,
            says="Sum the matrices first",
            code=paired(middle="np.mean([share(x, y) for x, y in zip(a, b)])"),
        ),
        mistake(
            "each drive's own share",
            task="paired",
            loses=2,
            says="you use each drive's own share",
            code=paired(without="share(x, y)", half="stats.t.ppf((1 + level) / 2, V - 1) * w.std(ddof=1) / np.sqrt(V)"),
        ),
        mistake(
            "1.96",
            task="paired",
            loses=2,
            says="expected 0.2428",
            code=paired(half="1.96 * np.sqrt((V - 1) / V * ((w - w.mean()) ** 2).sum())"),
        ),
        mistake(
            "pixel accuracy, whatever the metric",
            task="paired",
            loses=2,
            says="on inputs you haven't seen",
            code=paired(share="1 - (1 - pixel_accuracy(x)) / (1 - pixel_accuracy(y))"),
        ),
        # ---- task 5
        right("a loop over groups", task="calibration", code=ece()),
        right(
            "a table sorted by rows",
            task="calibration",
            code="""
def calibration_error(probability, truth, bins=10):
    rows = sorted((p.max(), p.argmax() == t) for p, t in zip(probability, truth) if t != 255)
    each, more, start, error = *divmod(len(rows), bins), 0, 0
    for b in range(bins):
        group = rows[start : start + each + (b < more)]
        start += len(group)
        error += abs(sum(right for _, right in group) - sum(sure for sure, _ in group))
    return error / len(rows)""",
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
            "the surest first",
            task="calibration",
            loses=3,
            says="the first group, that of the least sure, has three",
            code=ece(group=f"{IN_TURN}[(-sure).argsort().argsort()]"),
        ),
        mistake(
            "what is left over gets a group of its own",
            task="calibration",
            loses=3,
            says="the first group, that of the least sure, has three",
            code=ece(group="sure.argsort().argsort() // (len(sure) // bins)", groups="range(bins + 1)"),
        ),
        mistake(
            "what is left over gets lost",
            task="calibration",
            loses=3,
            says="the ninth is in none of yours",
            code=ece(group="sure.argsort().argsort() // (len(sure) // bins)"),
        ),
        mistake(
            "not sorted",
            task="calibration",
            loses=3,
            says="sort the cells by how sure",
            code=ece(group=IN_TURN),
        ),
        mistake(
            "too sure alone",
            task="calibration",
            loses=3,
            says="you count only where it is surer than right",
            code=ece(gap="max(0, sure[here].mean() - right[here].mean())"),
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
            "two classes taken for granted",
            task="calibration",
            loses=3,
            says="on inputs you haven't seen",
            code=ece(sure="p[:, :2].max(axis=1)"),
        ),
        mistake(
            "a mean of a group that is empty",
            task="calibration",
            loses=3,
            says="is one of your groups empty?",
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
            "the package's functions, wrapped",
            task="drive-scores",
            loses=2,
            says="drive a has 4 cells of the second class, fewer than 5",
            code="""
def drive_scores(counts, drives, least=1):
    from semgrid_edu.metrics import class_accuracy
    from semgrid_edu.workshop.scoring.confusions import drive_confusions
    return dict(zip(dict.fromkeys(drives), map(class_accuracy, drive_confusions(counts, drives))))""",
        ),
        mistake(
            "the package's function, wrapped",
            task="paired",
            loses=2,
            says="that is the difference of the two accuracies",
            code="""
def paired_interval(a, b, metric, level=0.95):
    from semgrid_edu.workshop.scoring import statistics
    return statistics.paired_interval(a[None], b[None], metric, level)""",
        ),
        mistake(
            "the package's functions, wrapped",
            task="calibration",
            loses=3,
            says="these groups are equally wide",
            code="""
def calibration_error(probability, truth, bins=10):
    from semgrid_edu.crf import expected_calibration_error, reliability
    return expected_calibration_error(reliability(probability.T, truth, bins))""",
        ),
        mistake(
            "`least` counted in each frame",
            task="drive-scores",
            loses=2,
            says="on inputs you haven't seen: a wrong score",
            code=pooled(total="total + np.where(matrix.sum(axis=1, keepdims=True) >= least, matrix, 0)"),
        ),
        mistake(
            "a class that is never called is left out",
            task="drive-scores",
            loses=2,
            says="on inputs you haven't seen: a wrong score",
            code="""
def drive_scores(counts, drives, least=1):
    scores = {}
    for drive in dict.fromkeys(drives):
        total = sum(matrix for matrix, name in zip(counts, drives) if name == drive)
        cells = total.sum(axis=1)
        use = (cells >= least) & (total.sum(axis=0) > 0)
        scores[drive] = np.mean(np.diag(total)[use] / cells[use])
    return scores""",
        ),
        mistake(
            "a class that is never right is left out",
            task="drive-scores",
            loses=2,
            says="on inputs you haven't seen: a wrong score",
            code="""
def drive_scores(counts, drives, least=1):
    scores = {}
    for drive in dict.fromkeys(drives):
        total = sum(matrix for matrix, name in zip(counts, drives) if name == drive)
        cells = total.sum(axis=1)
        use = (np.diag(total) > 0) & (cells >= least)
        scores[drive] = np.mean(np.diag(total)[use] / cells[use])
    return scores""",
        ),
        right(
            "scores as Decimal",
            task="drive-scores",
            code="""
from decimal import Decimal

def drive_scores(counts, drives, least=1):
    scores = {}
    for drive in set(drives):
        total = counts[[name == drive for name in drives]].sum(axis=0).tolist()
        shares = [Decimal(row[c]) / sum(row) for c, row in enumerate(total) if sum(row) >= least]
        scores[drive] = sum(shares) / len(shares)
    return scores""",
        ),
    )

    def test_a_wrong_jackknife_costs_nothing_in_task_4(self):
        built_on = [a for a in pack(self.entries) if "paired" in a and "that is wrong" in a["paired"].title]
        assert all(answers["towns"].loses for answers in built_on)
        assert len(built_on) == 5
