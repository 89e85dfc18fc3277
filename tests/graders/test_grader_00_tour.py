"""The graders of exercise 00, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right

FORGETTING = """
def forgetting(joint):
    def surprise(known):
        return -(joint * {log}(known / known.sum(0))).sum()
    return (surprise(joint), surprise({known}))"""


class TestTour(GraderChecks):
    exercise = "00_tour"
    entries = (
        # ---- task 1
        right(
            "truncate, since points lie inside",
            task="cell-of",
            code="""
def cell_of(x, y, x_max, y_max, cell):
    return [int((x_max - x) / cell), int((y_max - y) / cell)]""",
        ),
        right(
            "count cells one by one",
            task="cell-of",
            code="""
def cell_of(x, y, x_max, y_max, cell):
    row = col = 0
    while x_max - (row + 1) * cell > x:
        row += 1
    while y_max - (col + 1) * cell > y:
        col += 1
    return row, col""",
        ),
        mistake(
            "axes swapped",
            task="cell-of",
            loses=2,
            says="row and column are swapped",
            code="""
def cell_of(x, y, x_max, y_max, cell):
    return int((y_max - y) / cell), int((x_max - x) / cell)""",
        ),
        mistake(
            "row 0 at the vehicle",
            task="cell-of",
            loses=2,
            says="row 0 is the farthest ahead",
            code="def cell_of(x, y, x_max, y_max, cell):\n    return int(x / cell), int((y_max - y) / cell)",
        ),
        mistake(
            "y to the right",
            task="cell-of",
            loses=2,
            says="y points left",
            code="def cell_of(x, y, x_max, y_max, cell):\n    return int((x_max - x) / cell), int((y + y_max) / cell)",
        ),
        mistake(
            "rounded: half a cell off",
            task="cell-of",
            loses=2,
            says="round to the nearest border",
            code="""
def cell_of(x, y, x_max, y_max, cell):
    return round((x_max - x) / cell), round((y_max - y) / cell)""",
        ),
        mistake(
            "metres instead of cells",
            task="cell-of",
            loses=2,
            says="you count metres",
            code="def cell_of(x, y, x_max, y_max, cell):\n    return int(x_max - x), int(y_max - y)",
        ),
        mistake(
            "floats for indices",
            task="cell-of",
            loses=2,
            says="an index must be an integer",
            code="""
def cell_of(x, y, x_max, y_max, cell):
    return np.floor((x_max - x) / cell), np.floor((y_max - y) / cell)""",
        ),
        mistake(
            "cells of 0.5 m written in",
            task="cell-of",
            loses=2,
            says="on inputs you haven't seen: wrong row (behind the vehicle x is negative; cells need not be 0.5 m)",
            code="def cell_of(x, y, x_max, y_max, cell):\n    return int((x_max - x) / 0.5), int((y_max - y) / 0.5)",
        ),
        mistake(
            "endless loop",
            task="cell-of",
            loses=2,
            says="no reply before timeout",
            code="def cell_of(x, y, x_max, y_max, cell):\n    while True:\n        x -= cell",
        ),
        mistake(
            "endless loop on other inputs only",
            task="cell-of",
            loses=2,
            says="it does not come to an end",
            code="""
def cell_of(x, y, x_max, y_max, cell):
    row = col = 0
    while (row + 1) * cell != 1.5:
        row += 1
    while (col + 1) * cell != 1:
        col += 1
    return row, col""",
        ),
        # ---- task 2
        right(
            "a loop over cells",
            task="bayes-update",
            code="""
def bayes_update(belief, likelihood):
    after = np.empty_like(belief)
    for r in range(belief.shape[1]):
        for c in range(belief.shape[2]):
            product = [b * z for b, z in zip(belief[:, r, c], likelihood[:, r, c])]
            after[:, r, c] = [p / sum(product) for p in product]
    return after""",
        ),
        right(
            "in logarithms, which warns of log 0",
            task="bayes-update",
            code="""
def bayes_update(belief, likelihood):
    log = np.log(belief) + np.log(likelihood)
    product = np.exp(log - log.max(axis=0))
    return product / np.sum(product, axis=0, keepdims=True)""",
        ),
        right(
            "nested lists, by helpers with ordinary names",
            task="bayes-update",
            code="""
before, got, total, quiet, K, ahead = "mine", None, [], 3, {}, 0


def wrong(states, z):
    product = [b * p for b, p in zip(states, z)]
    return [p / sum(product) for p in product]


def bayes_update(belief, likelihood):
    _, H, W = belief.shape
    cells = [[wrong(belief[:, r, c], likelihood[:, r, c]) for c in range(W)] for r in range(H)]
    return [[[cell[state] for cell in row] for row in cells] for state in range(4)]""",
        ),
        mistake(
            "no normalisation",
            task="bayes-update",
            loses=3,
            says="the four states of cell (1, 2) sum to 0.38",
            code="def bayes_update(belief, likelihood):\n    return belief * likelihood",
        ),
        mistake(
            "normalised over the whole grid",
            task="bayes-update",
            loses=3,
            says="did you normalise over the state axis",
            code="""
def bayes_update(belief, likelihood):
    product = belief * likelihood
    return product / product.sum()""",
        ),
        mistake(
            "normalised over the wrong axis",
            task="bayes-update",
            loses=3,
            says="did you normalise over the state axis",
            code="""
def bayes_update(belief, likelihood):
    product = belief * likelihood
    return product / product.sum(axis=-1, keepdims=True)""",
        ),
        mistake(
            "prior forgotten",
            task="bayes-update",
            loses=3,
            says="multiply the old belief in",
            code="def bayes_update(belief, likelihood):\n    return likelihood / likelihood.sum(axis=0)",
        ),
        mistake(
            "added instead of multiplied",
            task="bayes-update",
            loses=3,
            says="the scan is silent in cell (0, 1)",
            code="""
def bayes_update(belief, likelihood):
    both = belief + likelihood
    return both / both.sum(axis=0)""",
        ),
        mistake(
            "soft-max instead of a sum",
            task="bayes-update",
            loses=3,
            says="the scan is silent in cell (0, 1)",
            code="""
def bayes_update(belief, likelihood):
    e = np.exp(belief * likelihood)
    return e / e.sum(axis=0)""",
        ),
        mistake(
            "argument changed in place",
            task="bayes-update",
            loses=3,
            says="changed its argument",
            code="""
def bayes_update(belief, likelihood):
    belief *= likelihood
    belief /= belief.sum(axis=0)
    return belief""",
        ),
        mistake(
            "argument changed in place, but for small grids",
            task="bayes-update",
            loses=3,
            says="on inputs you haven't seen: it changes an argument",
            code="""
def bayes_update(belief, likelihood):
    after = belief.copy() if belief.size < 30 else belief
    after *= likelihood
    after /= after.sum(axis=0)
    return after""",
        ),
        mistake(
            "only the grid of the visible test",
            task="bayes-update",
            loses=3,
            says="on inputs you haven't seen",
            code="""
def bayes_update(belief, likelihood):
    after = belief.copy()
    for r in range(2):
        for c in range(3):
            product = belief[:, r, c] * likelihood[:, r, c]
            after[:, r, c] = product / product.sum()
    return after""",
        ),
        mistake(
            "a crash",
            task="bayes-update",
            loses=3,
            says="ZeroDivisionError",
            code="def bayes_update(belief, likelihood):\n    return 1 / 0",
        ),
        # ---- task 3
        right(
            "a 3 x 4 projection matrix",
            task="pixel-of",
            code="""
def pixel_of(point, K, T_camera_from_grid):
    a, b, w = K @ T_camera_from_grid[:3] @ [*point, 1]
    return (a / w, b / w) if w > 0 else (float("nan"), float("nan"))""",
        ),
        right(
            "focal lengths by hand",
            task="pixel-of",
            code="""
def pixel_of(point, K, T_camera_from_grid):
    X, Y, Z = T_camera_from_grid[:3, :3] @ point + T_camera_from_grid[:3, 3]
    pixel = np.array([K[0, 0] * X / Z + K[0, 2], K[1, 1] * Y / Z + K[1, 2]])
    return pixel if Z > 0 else np.array([np.nan, np.nan])""",
        ),
        mistake(
            "no division by Z",
            task="pixel-of",
            loses=2,
            says="did you divide by Z?",
            code="""
def pixel_of(point, K, T_camera_from_grid):
    P = (T_camera_from_grid @ np.append(point, 1))[:3]
    return tuple((K @ P)[:2]) if P[2] > 0 else (np.nan, np.nan)""",
        ),
        mistake(
            "divided by the distance",
            task="pixel-of",
            loses=2,
            says="Z is the depth along the camera's axis",
            code="""
def pixel_of(point, K, T_camera_from_grid):
    P = (T_camera_from_grid @ np.append(point, 1))[:3]
    return tuple((K @ (P / np.linalg.norm(P)))[:2]) if P[2] > 0 else (np.nan, np.nan)""",
        ),
        mistake(
            "transform inverted",
            task="pixel-of",
            loses=2,
            says="you use the inverse transform",
            code="""
def pixel_of(point, K, T_camera_from_grid):
    X, Y, Z, _ = np.linalg.inv(T_camera_from_grid) @ np.append(point, 1)
    return tuple((K @ [X / Z, Y / Z, 1])[:2]) if Z > 0 else (np.nan, np.nan)""",
        ),
        mistake(
            "no translation",
            task="pixel-of",
            loses=2,
            says="the fourth coordinate of a point is 1",
            code="""
def pixel_of(point, K, T_camera_from_grid):
    X, Y, Z, _ = T_camera_from_grid @ np.append(point, 0)
    return tuple((K @ [X / Z, Y / Z, 1])[:2]) if Z > 0 else (np.nan, np.nan)""",
        ),
        mistake(
            "u and v swapped",
            task="pixel-of",
            loses=2,
            says="that is (v, u)",
            code="""
def pixel_of(point, K, T_camera_from_grid):
    X, Y, Z, _ = T_camera_from_grid @ np.append(point, 1)
    u, v, _ = K @ [X / Z, Y / Z, 1]
    return (v, u) if Z > 0 else (np.nan, np.nan)""",
        ),
        mistake(
            "half-pixel shift",
            task="pixel-of",
            loses=2,
            says="half a pixel too much",
            code="""
def pixel_of(point, K, T_camera_from_grid):
    X, Y, Z, _ = T_camera_from_grid @ np.append(point, 1)
    u, v, _ = K @ [X / Z, Y / Z, 1]
    return (u + 0.5, v + 0.5) if Z > 0 else (np.nan, np.nan)""",
        ),
        mistake(
            "no principal point",
            task="pixel-of",
            loses=2,
            says="the principal point is missing",
            code="""
def pixel_of(point, K, T_camera_from_grid):
    X, Y, Z, _ = T_camera_from_grid @ np.append(point, 1)
    return (K[0, 0] * X / Z, K[1, 1] * Y / Z) if Z > 0 else (np.nan, np.nan)""",
        ),
        mistake(
            "behind the camera mirrored into the image",
            task="pixel-of",
            loses=1,
            says="a point 5 m behind the camera has no pixel",
            code="""
def pixel_of(point, K, T_camera_from_grid):
    X, Y, Z, _ = T_camera_from_grid @ np.append(point, 1)
    return tuple((K @ [X / Z, Y / Z, 1])[:2])""",
        ),
        mistake(
            "pixels rounded",
            task="pixel-of",
            loses=2,
            says="on inputs you haven't seen: other pixels",
            code="""
def pixel_of(point, K, T_camera_from_grid):
    X, Y, Z, _ = T_camera_from_grid @ np.append(point, 1)
    u, v, _ = K @ [X / Z, Y / Z, 1]
    return (np.round(u), np.round(v)) if Z > 0 else (np.nan, np.nan)""",
        ),
        # ---- task 4
        right(
            "a loop over classes",
            task="accuracies",
            code="""
def accuracies(confusion):
    shares = []
    for c, row in enumerate(confusion):
        if sum(row):
            shares.append(row[c] / sum(row))
    return sum(confusion[c][c] for c in range(len(confusion))) / sum(map(sum, confusion)), sum(shares) / len(shares)""",
        ),
        right(
            "nanmean over 0 / 0, which warns",
            task="accuracies",
            code="""
def accuracies(confusion):
    return np.trace(confusion) / confusion.sum(), np.nanmean(confusion.diagonal() / confusion.sum(1))""",
        ),
        mistake(
            "columns instead of rows",
            task="accuracies",
            loses=3,
            says="a true class is a row",
            code="""
def accuracies(confusion):
    return np.trace(confusion) / confusion.sum(), np.mean(confusion.diagonal() / confusion.sum(axis=0))""",
        ),
        mistake(
            "absent class counted as 0",
            task="accuracies",
            loses=3,
            says="leave it out of the mean instead of counting a 0",
            code="""
def accuracies(confusion):
    share = confusion.diagonal() / np.maximum(confusion.sum(axis=1), 1)
    return np.trace(confusion) / confusion.sum(), share.mean()""",
        ),
        mistake(
            "absent class makes it NaN",
            task="accuracies",
            loses=3,
            says="0 / 0 is not a share",
            code="""
def accuracies(confusion):
    return np.trace(confusion) / confusion.sum(), np.mean(confusion.diagonal() / confusion.sum(axis=1))""",
        ),
        mistake(
            "divided by all cells",
            task="accuracies",
            loses=3,
            says="a class is measured on its own cells only",
            code="""
def accuracies(confusion):
    return np.trace(confusion) / confusion.sum(), np.mean(confusion.diagonal() / confusion.sum())""",
        ),
        mistake(
            "intersection over union",
            task="accuracies",
            loses=3,
            says="that is intersection over union",
            code="""
def accuracies(confusion):
    right = confusion.diagonal()
    union = confusion.sum(axis=0) + confusion.sum(axis=1) - right
    occurs = confusion.sum(axis=1) > 0
    return right.sum() / confusion.sum(), (right / union)[occurs].mean()""",
        ),
        mistake(
            "three classes written in",
            task="accuracies",
            loses=3,
            says="on inputs you haven't seen: wrong pixel accuracy",
            code="""
def accuracies(confusion):
    share = [confusion[0, 0] / confusion[0].sum(), confusion[1, 1] / confusion[1].sum()]
    return (confusion[0, 0] + confusion[1, 1] + confusion[2, 2]) / confusion.sum(), np.mean(share)""",
        ),
        mistake(
            "the two swapped",
            task="accuracies",
            loses=3,
            says="pixel accuracy comes first",
            code="""
def accuracies(confusion):
    cells = confusion.sum(axis=1)
    seen = cells > 0
    return (confusion.diagonal()[seen] / cells[seen]).mean(), np.trace(confusion) / confusion.sum()""",
        ),
        # ---- task 5
        right(
            "a loop over classes",
            task="fmiou",
            code="""
def fm_iou(confusion):
    total = 0.0
    for c in range(len(confusion)):
        cells, claimed, found = sum(confusion[c]), sum(row[c] for row in confusion), confusion[c][c]
        if cells:
            total += cells / np.sum(confusion) * found / (cells + claimed - found)
    return total""",
        ),
        right(
            "the union not below one, which changes nothing",
            task="fmiou",
            code="""
def fm_iou(confusion):
    cells, claimed, right = confusion.sum(axis=1), confusion[:, :-1].sum(axis=0), confusion.diagonal()
    return np.average(right / np.maximum(cells + claimed - right, 1), weights=cells)""",
        ),
        mistake(
            "plain mean",
            task="fmiou",
            loses=3,
            says="plain mean of the two IoUs",
            code="""
def fm_iou(confusion):
    right = confusion.diagonal()
    union = confusion[:, :-1].sum(axis=0) + confusion.sum(axis=1) - right
    return (right / np.maximum(union, 1))[union > 0].mean()""",
        ),
        mistake(
            "divided by the truth alone",
            task="fmiou",
            loses=3,
            says="that is the pixel accuracy",
            code="""
def fm_iou(confusion):
    cells = confusion.sum(axis=1)
    return (cells / cells.sum() * confusion.diagonal() / np.maximum(cells, 1)).sum()""",
        ),
        mistake(
            "the right cells counted twice",
            task="fmiou",
            loses=3,
            says="you count the right cells twice",
            code="""
def fm_iou(confusion):
    cells, claimed = confusion.sum(axis=1), confusion[:, :-1].sum(axis=0)
    return (cells / cells.sum() * confusion.diagonal() / np.maximum(cells + claimed, 1)).sum()""",
        ),
        mistake(
            "divided by what is claimed",
            task="fmiou",
            loses=3,
            says="claimed cells only",
            code="""
def fm_iou(confusion):
    cells, claimed = confusion.sum(axis=1), confusion[:, :-1].sum(axis=0)
    return (cells / cells.sum() * confusion.diagonal() / np.maximum(claimed, 1)).sum()""",
        ),
        mistake(
            "a class that never occurs makes it NaN",
            task="fmiou",
            loses=3,
            says="0 / 0 is not a share",
            code="""
def fm_iou(confusion):
    cells, right = confusion.sum(axis=1), confusion.diagonal()
    return (cells / cells.sum() * right / (cells + confusion[:, :-1].sum(axis=0) - right)).sum()""",
        ),
        mistake(
            "weighted by what is claimed",
            task="fmiou",
            loses=3,
            says="weight each by how frequent the class is in the truth",
            code="""
def fm_iou(confusion):
    cells, claimed, right = confusion.sum(axis=1), confusion[:, :-1].sum(axis=0), confusion.diagonal()
    return np.average(right / np.maximum(cells + claimed - right, 1), weights=claimed)""",
        ),
        mistake(
            "the answer of the example",
            task="fmiou",
            loses=3,
            says="on inputs you haven't seen: wrong FmIoU",
            code="def fm_iou(confusion):\n    return 7 / 12",
        ),
        mistake(
            "the argument changed",
            task="fmiou",
            loses=3,
            says="changed its argument",
            code="""
def fm_iou(confusion):
    right = confusion.diagonal().copy()
    cells = confusion.sum(axis=1)
    union = np.maximum(cells + confusion[:, :-1].sum(axis=0) - right, 1)
    confusion *= 0
    return (cells / cells.sum() * right / union).sum()""",
        ),
        mistake(
            "the argument changed, but for few classes",
            task="fmiou",
            loses=3,
            says="on inputs you haven't seen: it changes an argument",
            code="""
def fm_iou(confusion):
    right = confusion.diagonal().copy()
    cells = confusion.sum(axis=1)
    union = np.maximum(cells + confusion[:, :-1].sum(axis=0) - right, 1)
    if len(confusion) > 3:
        confusion *= 0
    return (cells / cells.sum() * right / union).sum()""",
        ),
        mistake(
            "cells without a claim left out",
            task="fmiou",
            loses=3,
            says="leave out the cells without a claim",
            code="""
def fm_iou(confusion):
    confusion = confusion[:, :-1]
    cells, right = confusion.sum(axis=1), confusion.diagonal()
    return (cells / cells.sum() * right / np.maximum(cells + confusion.sum(axis=0) - right, 1)).sum()""",
        ),
        mistake(
            "the package's function, as the lecture calls it",
            task="fmiou",
            loses=3,
            says="a square matrix",
            code="""
from semgrid_edu.metrics import frequency_weighted_iou


def fm_iou(confusion):
    return frequency_weighted_iou(confusion)""",
        ),
        # ---- task 6
        right(
            "case by case",
            task="forgetting",
            code="""
def forgetting(joint):
    both = alone = 0.0
    for (c, i, j), p in np.ndenumerate(joint):
        if p > 0:
            both -= p * np.log(p / joint[:, i, j].sum())
            alone -= p * np.log(joint[c, :, j].sum() / joint[:, :, j].sum())
    return both, alone""",
        ),
        right(
            "as differences of entropies",
            task="forgetting",
            code="""
def forgetting(joint):
    def H(table):
        return -(table * np.log(np.maximum(table, 1e-300))).sum()
    return [H(joint) - H(joint.sum(0)), H(joint.sum(1)) - H(joint.sum((0, 1)))]""",
        ),
        mistake(
            "the earlier image alone",
            task="forgetting",
            loses=3,
            says="that is the earlier image alone",
            code=FORGETTING.format(log="np.log", known="joint.sum(2, keepdims=True)"),
        ),
        mistake(
            "no image at all",
            task="forgetting",
            loses=3,
            says="that uses no image at all",
            code=FORGETTING.format(log="np.log", known="joint.sum((1, 2), keepdims=True)"),
        ),
        mistake(
            "in bits",
            task="forgetting",
            loses=3,
            says="that is in bits",
            code=FORGETTING.format(log="np.log2", known="joint.sum(1, keepdims=True)"),
        ),
        mistake(
            "the mean over the cells of the table",
            task="forgetting",
            loses=3,
            says="every case counts as often as it happens",
            code="""
def forgetting(joint):
    seen = joint.sum(1)
    return -np.log(joint / joint.sum(0)).mean(), -np.log(seen / seen.sum(0)).mean()""",
        ),
        mistake(
            "the surprise at class and image together",
            task="forgetting",
            loses=3,
            says="that is the surprise at class and image together",
            code="""
def forgetting(joint):
    both, alone = joint, joint.sum(1)
    return -(both * np.log(both)).sum(), -(alone * np.log(alone)).sum()""",
        ),
        mistake(
            "the two swapped",
            task="forgetting",
            loses=3,
            says="the two are swapped",
            code=FORGETTING.format(log="np.log", known="joint.sum(1, keepdims=True)") + "[::-1]",
        ),
        mistake(
            "the present image in both",
            task="forgetting",
            loses=3,
            says="knowing more can't cost more",
            code="""
def forgetting(joint):
    seen = joint.sum(1)
    surprise = -(seen * np.log(seen / seen.sum(0))).sum()
    return surprise, surprise""",
        ),
        mistake(
            "0 log 0",
            task="forgetting",
            loses=3,
            says="on inputs you haven't seen: NaN or infinity",
            code="""
def forgetting(joint):
    seen = joint.sum(1)
    return -(joint * np.log(joint / joint.sum(0))).sum(), -(seen * np.log(seen / seen.sum(0))).sum()""",
        ),
        mistake(
            "the price alone",
            task="forgetting",
            loses=3,
            says="return two numbers",
            code="def forgetting(joint):\n    return 0.336",
        ),
        mistake(
            "the answer of the example",
            task="forgetting",
            loses=3,
            says="on inputs you haven't seen: wrong surprise",
            code="def forgetting(joint):\n    return 0.2949, 0.6109",
        ),
        mistake(
            "the argument changed",
            task="forgetting",
            loses=3,
            says="changed its argument",
            code="""
def forgetting(joint):
    seen = joint.sum(1)
    alone = -(seen * np.log(seen / seen.sum(0))).sum()
    joint /= joint.sum(0)
    return 0.2949, alone""",
        ),
        mistake(
            "the argument changed, where something never happens",
            task="forgetting",
            loses=3,
            says="on inputs you haven't seen: it changes an argument",
            code="""
def forgetting(joint):
    joint[joint == 0] = 1e-300
    seen = joint.sum(1)
    return -(joint * np.log(joint / joint.sum(0))).sum(), -(seen * np.log(seen / seen.sum(0))).sum()""",
        ),
    )
