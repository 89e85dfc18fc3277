"""The graders of exercise 04, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


class TestCmcdot(GraderChecks):
    exercise = "04_cmcdot"
    entries = (
        # ---- task 1
        right(
            "a loop over particles",
            task="in-cells",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, dy])
    dynamic, mean = np.zeros(shape), np.full((2, *shape), np.nan)
    sums = {}
    for (x, y), v, w in zip(position, velocity, weight):
        r, c = int((x_max - x) // cell), int((y_max - y) // cell)
        if 0 <= r < shape[0] and 0 <= c < shape[1]:
            dynamic[r, c] += w
            sums[r, c] = sums.get((r, c), 0) + w * v
    for (r, c), s in sums.items():
        mean[:, r, c] = s / dynamic[r, c]
    return dynamic, mean""",
        ),
        right(
            "one long row of all cells, returned as lists",
            task="in-cells",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    H, W = shape
    row = np.floor((x_max - position[:, 0] + dx) / cell).astype(int)
    col = np.floor((y_max - position[:, 1] + dy) / cell).astype(int)
    ok = (row >= 0) & (row < H) & (col >= 0) & (col < W)

    def total(values):
        return np.bincount(row[ok] * W + col[ok], values[ok], minlength=H * W).reshape(shape)

    dynamic = total(weight)
    return [dynamic.tolist(), (np.stack([total(weight * v) for v in velocity.T]) / dynamic).tolist()]""",
        ),
        right(
            "histograms, and 0 / 0 for NaN",
            task="in-cells",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, dy])
    where = np.floor((np.array([x_max, y_max]) - position) / cell)
    def total(values):
        edges = [np.arange(n + 1) for n in shape]
        inside = (where >= 0).all(axis=1) & (where < shape).all(axis=1)
        return np.histogram2d(*where[inside].T, bins=edges, weights=values[inside])[0]
    dynamic = total(weight)
    return dynamic, np.stack([total(weight * v) for v in velocity.T]) / dynamic""",
        ),
        mistake(
            "motion added",
            task="in-cells",
            loses=2,
            says="so what stands comes nearer: subtract",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position + np.array([dx, dy])
    row = np.floor((x_max - position[:, 0]) / cell).astype(int)
    col = np.floor((y_max - position[:, 1]) / cell).astype(int)
    ok = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    d, m = np.zeros(shape), np.zeros((2, *shape))
    np.add.at(d, (row[ok], col[ok]), weight[ok])
    for k in range(2):
        np.add.at(m[k], (row[ok], col[ok]), (weight * velocity[:, k])[ok])
    return d, m / d""",
        ),
        mistake(
            "not moved",
            task="in-cells",
            loses=2,
            says="positions are in the frame of the last scan",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    row = np.floor((x_max - position[:, 0]) / cell).astype(int)
    col = np.floor((y_max - position[:, 1]) / cell).astype(int)
    ok = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    d, m = np.zeros(shape), np.zeros((2, *shape))
    np.add.at(d, (row[ok], col[ok]), weight[ok])
    for k in range(2):
        np.add.at(m[k], (row[ok], col[ok]), (weight * velocity[:, k])[ok])
    return d, m / d""",
        ),
        mistake(
            "moved forward alone",
            task="in-cells",
            loses=2,
            says="on inputs you haven't seen: wrong sums",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, 0])
    row = np.floor((x_max - position[:, 0]) / cell).astype(int)
    col = np.floor((y_max - position[:, 1]) / cell).astype(int)
    ok = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    d, m = np.zeros(shape), np.zeros((2, *shape))
    np.add.at(d, (row[ok], col[ok]), weight[ok])
    for k in range(2):
        np.add.at(m[k], (row[ok], col[ok]), (weight * velocity[:, k])[ok])
    return d, m / d""",
        ),
        mistake(
            "row and column swapped",
            task="in-cells",
            loses=2,
            says="row and column are swapped",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, dy])
    col = np.floor((x_max - position[:, 0]) / cell).astype(int)
    row = np.floor((y_max - position[:, 1]) / cell).astype(int)
    ok = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    d, m = np.zeros(shape), np.zeros((2, *shape))
    np.add.at(d, (row[ok], col[ok]), weight[ok])
    for k in range(2):
        np.add.at(m[k], (row[ok], col[ok]), (weight * velocity[:, k])[ok])
    return d, m / d""",
        ),
        mistake(
            "row 0 at the vehicle",
            task="in-cells",
            loses=2,
            says="row 0 is the farthest ahead",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, dy])
    row = np.floor(position[:, 0] / cell).astype(int)
    col = np.floor((y_max - position[:, 1]) / cell).astype(int)
    ok = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    d, m = np.zeros(shape), np.zeros((2, *shape))
    np.add.at(d, (row[ok], col[ok]), weight[ok])
    for k in range(2):
        np.add.at(m[k], (row[ok], col[ok]), (weight * velocity[:, k])[ok])
    return d, m / d""",
        ),
        mistake(
            "particles outside wrap around",
            task="in-cells",
            loses=2,
            says="row -1 is outside",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, dy])
    where = tuple(np.floor((np.array([x_max, y_max]) - position) / cell).astype(int).T)
    d, m = np.zeros(shape), np.zeros((2, *shape))
    np.add.at(d, where, weight)
    for k in range(2):
        np.add.at(m[k], where, weight * velocity[:, k])
    return d, m / d""",
        ),
        mistake(
            "+= keeps the last of each cell",
            task="in-cells",
            loses=2,
            says="two particles share cell (0, 2), you count one",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, dy])
    row = np.floor((x_max - position[:, 0]) / cell).astype(int)
    col = np.floor((y_max - position[:, 1]) / cell).astype(int)
    ok = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    d, m = np.zeros(shape), np.zeros((2, *shape))
    d[row[ok], col[ok]] += weight[ok]
    m[:, row[ok], col[ok]] += (weight[:, None] * velocity)[ok].T
    return d, m / d""",
        ),
        mistake(
            "mean velocity without weights",
            task="in-cells",
            loses=2,
            says="that is the plain mean",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, dy])
    row = np.floor((x_max - position[:, 0]) / cell).astype(int)
    col = np.floor((y_max - position[:, 1]) / cell).astype(int)
    ok = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    d, n, m = np.zeros(shape), np.zeros(shape), np.zeros((2, *shape))
    np.add.at(d, (row[ok], col[ok]), weight[ok])
    np.add.at(n, (row[ok], col[ok]), 1)
    for k in range(2):
        np.add.at(m[k], (row[ok], col[ok]), velocity[ok, k])
    return d, m / n""",
        ),
        mistake(
            "momentum instead of velocity",
            task="in-cells",
            loses=2,
            says="divide it by the sum of the weights",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, dy])
    row = np.floor((x_max - position[:, 0]) / cell).astype(int)
    col = np.floor((y_max - position[:, 1]) / cell).astype(int)
    ok = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    d, m = np.zeros(shape), np.zeros((2, *shape))
    np.add.at(d, (row[ok], col[ok]), weight[ok])
    for k in range(2):
        np.add.at(m[k], (row[ok], col[ok]), (weight * velocity[:, k])[ok])
    return d, np.where(d > 0, m, np.nan)""",
        ),
        mistake(
            "zero velocity where no particle is",
            task="in-cells",
            loses=2,
            says="its velocity is NaN, not",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, dy])
    row = np.floor((x_max - position[:, 0]) / cell).astype(int)
    col = np.floor((y_max - position[:, 1]) / cell).astype(int)
    ok = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    d, m = np.zeros(shape), np.zeros((2, *shape))
    np.add.at(d, (row[ok], col[ok]), weight[ok])
    for k in range(2):
        np.add.at(m[k], (row[ok], col[ok]), (weight * velocity[:, k])[ok])
    return d, m / np.where(d > 0, d, 1)""",
        ),
        mistake(
            "truncated across: what is just outside is drawn in",
            task="in-cells",
            loses=2,
            says="on inputs you haven't seen: wrong sums in row 0 or column 0: int() and astype(int) cut -0.6 to 0",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, dy])
    row = np.trunc((x_max - position[:, 0]) / cell).astype(int)
    col = np.trunc((y_max - position[:, 1]) / cell).astype(int)
    ok = (position[:, 0] < x_max) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    d, m = np.zeros(shape), np.zeros((2, *shape))
    np.add.at(d, (row[ok], col[ok]), weight[ok])
    for k in range(2):
        np.add.at(m[k], (row[ok], col[ok]), (weight * velocity[:, k])[ok])
    return d, m / d""",
        ),
        mistake(
            "int() where floor is meant",
            task="in-cells",
            loses=2,
            says="int() and astype(int) cut -0.5 to 0; take np.floor first",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    dynamic, moment = np.zeros(shape), np.zeros((2, *shape))
    for (x, y), v, w in zip(position, velocity, weight):
        r, c = int((x_max - x + dx) / cell), int((y_max - y + dy) / cell)
        if 0 <= r < shape[0] and 0 <= c < shape[1]:
            dynamic[r, c] += w
            moment[:, r, c] += w * v
    return dynamic, moment / dynamic""",
        ),
        mistake(
            "a row of H cells",
            task="in-cells",
            loses=2,
            says="(row, col) is cell row * W + col",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    H, W = shape
    row = np.floor((x_max - position[:, 0] + dx) / cell).astype(int)
    col = np.floor((y_max - position[:, 1] + dy) / cell).astype(int)
    ok = (row >= 0) & (row < H) & (col >= 0) & (col < W)
    flat = row[ok] * H + col[ok]

    def total(values):
        return np.bincount(flat, values[ok], minlength=H * W).reshape(shape)

    dynamic = total(weight)
    return dynamic, np.stack([total(weight * v) for v in velocity.T]) / dynamic""",
        ),
        mistake(
            "the two components last",
            task="in-cells",
            loses=2,
            says="expected velocity of shape (2, 3, 4), got (3, 4, 2)",
            code="""
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    position = position - np.array([dx, dy])
    row = np.floor((x_max - position[:, 0]) / cell).astype(int)
    col = np.floor((y_max - position[:, 1]) / cell).astype(int)
    ok = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    d, m = np.zeros(shape), np.zeros((*shape, 2))
    np.add.at(d, (row[ok], col[ok]), weight[ok])
    np.add.at(m, (row[ok], col[ok]), (weight[:, None] * velocity)[ok])
    return d, m / d[..., None]""",
        ),
        # ---- task 2
        right(
            "cell by cell",
            task="update",
            code="""
def update(belief, likelihood, first_sight):
    after = np.array(belief, dtype=float)
    for r, c in np.ndindex(belief.shape[1:]):
        free, static, dynamic = likelihood[:, r, c]
        if free == static == dynamic:
            continue
        b = after[:, r, c]
        b[:3] += b[3] * np.array(first_sight)
        b[3] = 0
        b *= [free, static, dynamic, free]
        b[:] = b / b.sum() if b.sum() > 0 else [0, 0, 0, 1]
    return after""",
        ),
        right(
            "three states alone, then UNKNOWN",
            task="update",
            code="""
def update(belief, likelihood, first_sight):
    spread = np.ptp(likelihood, axis=0) > 0
    three = (belief[:3] + belief[3] * np.reshape(first_sight, (3, 1, 1))) * likelihood
    total = three.sum(axis=0)
    three = np.divide(three, total, out=np.zeros_like(three), where=total > 0)
    return np.where(spread, np.concatenate([three, (total == 0)[None]]), belief)""",
        ),
        mistake(
            "the lecture's: DYNAMIC has STATIC's likelihood",
            task="update",
            loses=2,
            says="this scanner tells DYNAMIC from STATIC",
            code="""
def update_cell(b, occupied, free, first_sight):
    b = np.array(b, dtype=float)
    if occupied != free:
        b[:3] += b[UNKNOWN] * np.array(first_sight)
        b[UNKNOWN] = 0
    joint = b * [free, occupied, occupied, free]
    return joint / joint.sum() if joint.any() else np.array([0.0, 0, 0, 1])


def update(belief, likelihood, first_sight):
    after = np.zeros(belief.shape)
    for r, c in np.ndindex(belief.shape[1:]):
        after[:, r, c] = update_cell(belief[:, r, c], likelihood[1, r, c], likelihood[0, r, c], first_sight)
    return after""",
        ),
        mistake(
            "STATIC and DYNAMIC swapped",
            task="update",
            loses=2,
            says="STATIC and DYNAMIC are swapped",
            code="""
def update(belief, likelihood, first_sight):
    silent = (likelihood == likelihood[0]).all(axis=0)
    b = belief + np.where(silent, 0, belief[3]) * np.array([*first_sight, -1])[:, None, None]
    p = b * likelihood[[0, 2, 1, 0]]
    t = p.sum(axis=0)
    p = np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])
    return np.where(silent, belief, p)""",
        ),
        mistake(
            "silent where two of three are equal",
            task="update",
            loses=2,
            says="on inputs you haven't seen: UNKNOWN is left where two of the three likelihoods are equal",
            code="""
def update(belief, likelihood, first_sight):
    silent = likelihood[0] == likelihood[1]
    b = belief + np.where(silent, 0, belief[3]) * np.array([*first_sight, -1])[:, None, None]
    p = b * likelihood[[0, 1, 2, 0]]
    t = p.sum(axis=0)
    p = np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])
    return np.where(silent, belief, p)""",
        ),
        mistake(
            "argument changed in place",
            task="update",
            loses=2,
            says="update changed its argument",
            code="""
def update(belief, likelihood, first_sight):
    silent = (likelihood == likelihood[0]).all(axis=0)
    old = belief.copy()
    belief += np.where(silent, 0, belief[3]) * np.array([*first_sight, -1])[:, None, None]
    p = belief * likelihood[[0, 1, 2, 0]]
    t = p.sum(axis=0)
    p = np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])
    return np.where(silent, old, p)""",
        ),
        mistake(
            "0 / 0 where nothing explains the scan",
            task="update",
            loses=1,
            says="0/0: nothing explains its scan",
            code="""
def update(belief, likelihood, first_sight):
    silent = (likelihood == likelihood[0]).all(axis=0)
    b = belief + np.where(silent, 0, belief[3]) * np.array([*first_sight, -1])[:, None, None]
    p = b * likelihood[[0, 1, 2, 0]]
    return np.where(silent, belief, p / p.sum(axis=0))""",
        ),
        mistake(
            "a silent scan reveals",
            task="update",
            loses=1,
            says="there UNKNOWN stays",
            code="""
def update(belief, likelihood, first_sight):
    b = belief + belief[3] * np.array([*first_sight, -1])[:, None, None]
    p = b * likelihood[[0, 1, 2, 0]]
    t = p.sum(axis=0)
    return np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])""",
        ),
        mistake(
            "no normalisation",
            task="update",
            loses=3,
            says="divide by the sum over its states",
            code="""
def update(belief, likelihood, first_sight):
    silent = (likelihood == likelihood[0]).all(axis=0)
    b = belief + np.where(silent, 0, belief[3]) * np.array([*first_sight, -1])[:, None, None]
    return np.where(silent, belief, b * likelihood[[0, 1, 2, 0]])""",
        ),
        mistake(
            "first sight in place of the belief",
            task="update",
            loses=3,
            says="its old belief in FREE, STATIC and DYNAMIC got lost",
            code="""
def update(belief, likelihood, first_sight):
    silent = (likelihood == likelihood[0]).all(axis=0)
    p = np.array([*first_sight, 0])[:, None, None] * likelihood[[0, 1, 2, 0]]
    return np.where(silent, belief, p / p.sum(axis=0))""",
        ),
        mistake(
            "shared out after Bayes' rule",
            task="update",
            loses=2,
            says="before you multiply by the likelihood, not after",
            code="""
def update(belief, likelihood, first_sight):
    silent = (likelihood == likelihood[0]).all(axis=0)
    p = belief * likelihood[[0, 1, 2, 0]]
    t = p.sum(axis=0)
    known = t > 0
    p = np.where(known, p / np.where(known, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])
    p = p + np.where(known, p[3], 0) * np.array([*first_sight, -1])[:, None, None]
    return np.where(silent, belief, p)""",
        ),
        mistake(
            "UNKNOWN thrown away",
            task="update",
            loses=2,
            says="UNKNOWN was thrown away",
            code="""
def update(belief, likelihood, first_sight):
    silent = (likelihood == likelihood[0]).all(axis=0)
    p = belief * np.concatenate([likelihood, 0 * likelihood[:1]])
    t = p.sum(axis=0)
    p = np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])
    return np.where(silent, belief, p)""",
        ),
        mistake(
            "what is improbable taken for a contradiction",
            task="update",
            loses=1,
            says="on inputs you haven't seen: a cell, surely free, explains its scan with a small probability",
            code="""
def update(belief, likelihood, first_sight):
    silent = (likelihood == likelihood[0]).all(axis=0)
    b = belief + np.where(silent, 0, belief[3]) * np.array([*first_sight, -1])[:, None, None]
    p = b * likelihood[[0, 1, 2, 0]]
    t = p.sum(axis=0)
    p = np.where(t > 1e-3, p / np.where(t > 1e-3, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])
    return np.where(silent, belief, p)""",
        ),
        # ---- task 3
        right(
            "two pointers",
            task="stratified",
            code="""
def stratified(weight, count, offsets):
    drawn, n, end, total = [], 0, weight[0], sum(weight)
    for i in range(count):
        while end <= (i + offsets[i]) / count * total:
            n += 1
            end += weight[n]
        drawn.append(n)
    return np.array(drawn)""",
        ),
        right(
            "count the parts that end before each tooth",
            task="stratified",
            code="""
def stratified(weight, count, offsets):
    ends = np.cumsum(weight)
    teeth = np.linspace(0, ends[-1], count, endpoint=False) + np.asarray(offsets) * ends[-1] / count
    return np.digitize(teeth, ends)""",
        ),
        mistake(
            "the lecture's comb, pasted",
            task="stratified",
            loses=3,
            says="truth value of an array",
            code="""
def stratified(weight, count, offset):
    drawn, n, end = [], 0, weight[0]
    for i in range(count):
        tooth = (i + offset) / count * sum(weight)
        while end <= tooth:
            n += 1
            end += weight[n]
        drawn.append(n)
    return drawn""",
        ),
        mistake(
            "the comb, with the first offset",
            task="stratified",
            loses=3,
            says="with the first offset for all",
            code="""
def stratified(weight, count, offsets):
    ends = np.cumsum(weight)
    return np.searchsorted(ends, (np.arange(count) + offsets[0]) / count * ends[-1], side="right")""",
        ),
        mistake(
            "two pointers with `if`",
            task="stratified",
            loses=3,
            says="go on `while` a particle ends before the tooth, not `if`",
            code="""
def stratified(weight, count, offsets):
    drawn, n, end, total = [], 0, weight[0], sum(weight)
    for i in range(count):
        if end <= (i + offsets[i]) / count * total and n < len(weight) - 1:
            n += 1
            end += weight[n]
        drawn.append(n)
    return np.array(drawn)""",
        ),
        mistake(
            "weights not normalised",
            task="stratified",
            loses=3,
            says="the weights sum to 10, not to 1",
            code="""
def stratified(weight, count, offsets):
    drawn = np.searchsorted(np.cumsum(weight), (np.arange(count) + offsets) / count, side="right")
    return np.minimum(drawn, len(weight) - 1)""",
        ),
        mistake(
            "cumulative sum off by one",
            task="stratified",
            loses=3,
            says="every index is one too large",
            code="""
def stratified(weight, count, offsets):
    ends = np.concatenate([[0], np.cumsum(weight)])
    return np.searchsorted(ends, (np.arange(count) + offsets) / count * ends[-1], side="right")""",
        ),
        mistake(
            "own offsets in place of the given ones",
            task="stratified",
            loses=3,
            says="the offsets are given",
            code="""
def stratified(weight, count, offsets):
    ends = np.cumsum(weight)
    mine = np.random.default_rng().random(count)
    return np.searchsorted(ends, (np.arange(count) + mine) / count * ends[-1], side="right")""",
        ),
        mistake(
            "on a border, the first of the two",
            task="stratified",
            loses=3,
            says="on inputs you haven't seen: a particle of weight 0 was drawn",
            code="""
def stratified(weight, count, offsets):
    ends = np.cumsum(weight)
    return np.searchsorted(ends, (np.arange(count) + offsets) / count * ends[-1], side="left")""",
        ),
        mistake(
            "endless loop",
            task="stratified",
            loses=3,
            says="no reply before timeout",
            code="""
def stratified(weight, count, offsets):
    drawn, n = [], 0
    while len(drawn) < count:
        n = (n + 1) % len(weight)
    return drawn""",
        ),
        # ---- task 4
        right(
            "by hand",
            task="cuts",
            code="""
def cuts(predicts):
    exact = {1: 2 / 3, 2: 0.4 / 0.6, 3: 0.5}
    found = {edge: predicts(*PROBES[edge]) - exact[edge] for edge in exact}
    return {edge: price for edge, price in found.items() if not -0.001 < price < 0.001}""",
        ),
        right(
            "all combinations",
            task="cuts",
            code="""
def exact(left, own, right):
    moves = stands = none = 0.0
    for l in ("right", "static", "other"):
        for o in ("static", "other"):
            for r in ("left", "other"):
                p = left.get(l, 1 - left.get("right", 0) - left.get("static", 0)) if l == "other" else left.get(l, 0)
                p *= own.get("static", 0) if o == "static" else 1 - own.get("static", 0)
                p *= right.get("left", 0) if r == "left" else 1 - right.get("left", 0)
                things = (l == "right") + (o == "static") + (r == "left")
                if things <= 1:
                    none += p
                    moves += p * (l == "right" or r == "left")
    return moves / none


def cuts(predicts):
    answer = {}
    for edge in PROBES:
        price = predicts(*PROBES[edge]) - exact(*PROBES[edge])
        if abs(price) > 1e-3:
            answer[edge] = price
    return answer""",
        ),
        mistake(
            "against the package instead of the exact answer",
            task="cuts",
            loses=3,
            says="is your exact answer of that world right",
            code="""
def cuts(predicts):
    prices = {edge: predicts(*cells) - package_filter(*cells) for edge, cells in PROBES.items()}
    return {edge: price for edge, price in prices.items() if abs(price) > 0.001}""",
        ),
        mistake(
            "exact minus filter",
            task="cuts",
            loses=3,
            says="the price is the filter's answer minus the exact one",
            code="""
def cuts(predicts):
    exact = {1: 2 / 3, 2: 2 / 3, 3: 0.5}
    found = {edge: exact[edge] - predicts(*PROBES[edge]) for edge in exact}
    return {edge: price for edge, price in found.items() if abs(price) > 0.001}""",
        ),
        mistake(
            "what the filter predicts in place of the price",
            task="cuts",
            loses=3,
            says="subtract the exact answer",
            code="""
def cuts(predicts):
    exact = {1: 2 / 3, 2: 2 / 3, 3: 0.5}
    found = {edge: predicts(*PROBES[edge]) for edge in exact}
    return {edge: p for edge, p in found.items() if abs(p - exact[edge]) > 0.001}""",
        ),
        mistake(
            "arrivals of world 1 not struck out",
            task="cuts",
            loses=3,
            says="a price of 0.333 is right, got 0.250",
            code="""
def cuts(predicts):
    exact = {1: 0.75, 2: 2 / 3, 3: 0.5}
    found = {edge: predicts(*PROBES[edge]) - exact[edge] for edge in exact}
    return {edge: price for edge, price in found.items() if abs(price) > 0.001}""",
        ),
        mistake(
            "only what is too large",
            task="cuts",
            loses=3,
            says="on inputs you haven't seen",
            code="""
def cuts(predicts):
    exact = {1: 2 / 3, 2: 2 / 3, 3: 0.5}
    found = {edge: predicts(*PROBES[edge]) - exact[edge] for edge in exact}
    return {edge: price for edge, price in found.items() if price > 0.001}""",
        ),
        mistake(
            "the answers of the visible test",
            task="cuts",
            loses=3,
            says="on inputs you haven't seen",
            code="""
def cuts(predicts):
    return {1: 1 / 3} if predicts(*PROBES[2]) < 0.7 else {1: 1 / 3, 2: 0.8 - 2 / 3}""",
        ),
        # ---- task 5
        right(
            "a generator, and a plain function as the method",
            task="track",
            code="""
class Mine:
    def __init__(self, draws):
        self.draws = draws

    def draw(self, weight, count, rng):
        return self.draws(weight, count, rng.random(count))


def track(frames, spec, draws=stratified):
    params = CmcdotParams(n_particles=20000, resampling=Mine(draws))
    for belief in track_drive(frames, spec, params, seed=0):
        yield belief


def maps(frames, spec, draws=stratified):
    return [belief.probability[DYNAMIC].tolist() for belief in track(frames, spec, draws)]""",
        ),
        right(
            "one offset after the other, as a list",
            task="track",
            code="""
def track(frames, spec, draws=None):
    class Slow:
        def draw(self, weight, count, rng):
            ends, one = np.cumsum(weight), 1 / count
            teeth = [(i + rng.random()) * one * ends[-1] for i in range(count)]
            return np.searchsorted(ends, teeth, side="right")
    return list(track_drive(frames, spec, CmcdotParams(n_particles=20_000, resampling=Slow())))


def maps(frames, spec, draws=None):
    return np.array([belief.probability[2] for belief in track(frames, spec, draws)])""",
        ),
        mistake(
            "the package's resampling",
            task="track",
            loses=2,
            says="that is the package's own resampling",
            code="""
def track(frames, spec, draws=None):
    return track_drive(frames, spec, CmcdotParams(n_particles=20_000), seed=0)


def maps(frames, spec, draws=None):
    return np.array([belief.probability[2] for belief in track(frames, spec, draws)])""",
        ),
        mistake(
            "another number of particles",
            task="track",
            loses=2,
            says="on inputs you haven't seen: it isn't the same filter",
            code="""
def track(frames, spec, draws=None):
    class Mine:
        def draw(self, weight, count, rng):
            ends = np.cumsum(weight)
            return np.searchsorted(ends, (np.arange(count) + rng.random(count)) / count * ends[-1], side="right")
    return track_drive(frames, spec, CmcdotParams(n_particles=10_000, resampling=Mine()), seed=0)


def maps(frames, spec, draws=None):
    return np.array([belief.probability[2] for belief in track(frames, spec, draws)])""",
        ),
        mistake(
            "only another seed",
            task="track",
            loses=2,
            says="on inputs you haven't seen: it isn't the same filter",
            code="""
def track(frames, spec, draws=None):
    return track_drive(frames, spec, CmcdotParams(n_particles=20_000), seed=1)


def maps(frames, spec, draws=None):
    return np.array([belief.probability[2] for belief in track(frames, spec, draws)])""",
        ),
        mistake(
            "nothing returned",
            task="track",
            loses=2,
            says="NoneType",
            code="""
def track(frames, spec, draws=None):
    track_drive(frames, spec)


def maps(frames, spec, draws=None):
    return np.array([belief.probability[2] for belief in track(frames, spec, draws)])""",
        ),
        mistake(
            "all particles at random",
            task="track",
            loses=2,
            says="on inputs you haven't seen: it isn't the same filter",
            code="""
def track(frames, spec, draws=None):
    class Mine:
        def draw(self, weight, count, rng):
            return rng.integers(0, len(weight), count)
    return track_drive(frames, spec, CmcdotParams(n_particles=20_000, resampling=Mine()), seed=0)


def maps(frames, spec, draws=None):
    return np.array([belief.probability[2] for belief in track(frames, spec, draws)])""",
        ),
    )
