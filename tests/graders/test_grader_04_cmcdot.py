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
            "loops",
            task="mix",
            code="""
def mix(belief, M):
    after, newborn = np.zeros_like(belief), np.zeros(belief.shape[1:])
    for i in range(4):
        for j in range(4):
            after[j] += belief[i] * M[i, j]
            if j == 2 and i != 2:
                newborn += belief[i] * M[i, j]
    return after, newborn""",
        ),
        right(
            "the state axis last, and a belief without DYNAMIC",
            task="mix",
            code="""
def mix(belief, M):
    others = belief.copy()
    others[DYNAMIC] = 0
    return np.moveaxis(np.moveaxis(belief, 0, -1) @ M, -1, 0), np.tensordot(M[:, DYNAMIC], others, axes=1)""",
        ),
        mistake(
            "matrix transposed",
            task="mix",
            loses=2,
            says="M is used the wrong way round",
            code="""
def mix(belief, M):
    after = np.tensordot(M, belief, axes=1)
    return after, after[2] - M[2, 2] * belief[2]""",
        ),
        mistake(
            "all dynamic mass is newborn",
            task="mix",
            loses=2,
            says="isn't born again",
            code="""
def mix(belief, M):
    after = np.tensordot(M.T, belief, axes=1)
    return after, after[2]""",
        ),
        mistake(
            "what stays instead of what comes",
            task="mix",
            loses=2,
            says="that is what stays DYNAMIC",
            code="""
def mix(belief, M):
    return np.tensordot(M.T, belief, axes=1), M[2, 2] * belief[2]""",
        ),
        mistake(
            "newborn is the difference",
            task="mix",
            loses=2,
            says="no negative birth",
            code="""
def mix(belief, M):
    after = np.tensordot(M.T, belief, axes=1)
    return after, after[2] - belief[2]""",
        ),
        mistake(
            "survivors counted twice",
            task="mix",
            loses=2,
            says="nothing may get lost",
            code="""
def mix(belief, M):
    after = np.tensordot(M.T, belief, axes=1)
    newborn = after[2] - M[2, 2] * belief[2]
    after[2] = newborn + belief[2]
    return after, newborn""",
        ),
        mistake(
            "born from FREE alone",
            task="mix",
            loses=2,
            says="STATIC and UNKNOWN may turn DYNAMIC too",
            code="""
def mix(belief, M):
    return np.tensordot(M.T, belief, axes=1), M[0, 2] * belief[0]""",
        ),
        mistake(
            "argument changed in place",
            task="mix",
            loses=2,
            says="mix changed its argument",
            code="""
def mix(belief, M):
    stays = M[2, 2] * belief[2]
    belief[:] = np.tensordot(M.T, belief, axes=1)
    return belief, belief[2] - stays""",
        ),
        mistake(
            "UNKNOWN never gives birth",
            task="mix",
            loses=2,
            says="on inputs you haven't seen: wrong newborn mass",
            code="""
def mix(belief, M):
    return np.tensordot(M.T, belief, axes=1), M[0, 2] * belief[0] + M[1, 2] * belief[1]""",
        ),
        mistake(
            "a row of the matrix instead of a column",
            task="mix",
            loses=2,
            says="in a column of M, not in its row",
            code="""
def mix(belief, M):
    return np.tensordot(M.T, belief, axes=1), sum(M[2, i] * belief[i] for i in (0, 1, 3))""",
        ),
        # ---- task 3
        right(
            "a loop over cells",
            task="update",
            code="""
def update(belief, occupied, free, first_sight):
    after = np.zeros_like(belief)
    for r, c in np.ndindex(occupied.shape):
        f, s, d, u = belief[:, r, c]
        o, e = occupied[r, c], free[r, c]
        if o == e:
            after[:, r, c] = f, s, d, u
            continue
        p = [(f + u * first_sight[0]) * e, (s + u * first_sight[1]) * o, (d + u * first_sight[2]) * o, 0]
        after[:, r, c] = [q / sum(p) for q in p] if sum(p) > 0 else [0, 0, 0, 1]
    return after""",
        ),
        right(
            "0 / 0, repaired afterwards",
            task="update",
            code="""
def update(belief, occupied, free, first_sight):
    b, seen = belief.copy(), occupied != free
    for k in range(3):
        b[k][seen] += first_sight[k] * belief[3][seen]
    b[3][seen] = 0
    b *= np.where(np.arange(4)[:, None, None] % 3, occupied, free)
    b = np.where(seen, b, belief)
    b /= b.sum(axis=0)
    b[:, np.isnan(b[0])] = np.array([[0], [0], [0], [1]])
    return b""",
        ),
        mistake(
            "no reveal",
            task="update",
            loses=2,
            says="somebody looked, yet UNKNOWN is",
            code="""
def update(belief, occupied, free, first_sight):
    p = belief * np.stack([free, occupied, occupied, free])
    t = p.sum(axis=0)
    return np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])""",
        ),
        mistake(
            "revealed where nobody looks",
            task="update",
            loses=1,
            says="nobody looked at cell (0, 0)",
            code="""
def update(belief, occupied, free, first_sight):
    b = belief + belief[3] * np.array([*first_sight, -1])[:, None, None]
    p = b * np.stack([free, occupied, occupied, free])
    t = p.sum(axis=0)
    return np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])""",
        ),
        mistake(
            "0 / 0",
            task="update",
            loses=1,
            says="is 0/0",
            code="""
def update(belief, occupied, free, first_sight):
    b = belief + np.where(occupied != free, belief[3], 0) * np.array([*first_sight, -1])[:, None, None]
    p = b * np.stack([free, occupied, occupied, free])
    return p / p.sum(axis=0)""",
        ),
        mistake(
            "0 / 0 hidden by a small number",
            task="update",
            loses=1,
            says="UNKNOWN should be 1",
            code="""
def update(belief, occupied, free, first_sight):
    b = belief + np.where(occupied != free, belief[3], 0) * np.array([*first_sight, -1])[:, None, None]
    p = b * np.stack([free, occupied, occupied, free])
    return p / (p.sum(axis=0) + 1e-9)""",
        ),
        mistake(
            "no normalisation",
            task="update",
            loses=3,
            says="divide by the sum over its states",
            code="""
def update(belief, occupied, free, first_sight):
    b = belief + np.where(occupied != free, belief[3], 0) * np.array([*first_sight, -1])[:, None, None]
    return np.where(occupied != free, b * np.stack([free, occupied, occupied, free]), b)""",
        ),
        mistake(
            "first sight in place of the belief",
            task="update",
            loses=3,
            says="its old belief in FREE, STATIC and DYNAMIC got lost",
            code="""
def update(belief, occupied, free, first_sight):
    b = np.where(occupied != free, np.array([*first_sight, 0])[:, None, None], belief)
    p = b * np.stack([free, occupied, occupied, free])
    t = p.sum(axis=0)
    return np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])""",
        ),
        mistake(
            "DYNAMIC takes P(z | free)",
            task="update",
            loses=2,
            says="DYNAMIC takes P(z | occupied) too",
            code="""
def update(belief, occupied, free, first_sight):
    b = belief + np.where(occupied != free, belief[3], 0) * np.array([*first_sight, -1])[:, None, None]
    p = b * np.stack([free, occupied, free, free])
    t = p.sum(axis=0)
    return np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])""",
        ),
        mistake(
            "shared out after Bayes' rule",
            task="update",
            loses=2,
            says="before you multiply by the evidence, not after",
            code="""
def update(belief, occupied, free, first_sight):
    p = belief * np.stack([free, occupied, occupied, free])
    t = p.sum(axis=0)
    p = np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])
    return p + np.where((occupied != free) & (t > 0), p[3], 0) * np.array([*first_sight, -1])[:, None, None]""",
        ),
        mistake(
            "UNKNOWN thrown away",
            task="update",
            loses=2,
            says="UNKNOWN was thrown away",
            code="""
def update(belief, occupied, free, first_sight):
    p = belief * np.stack([free, occupied, occupied, free])
    p[3] = np.where(occupied != free, 0, p[3])
    t = p.sum(axis=0)
    return np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])""",
        ),
        mistake(
            "what is improbable taken for a contradiction",
            task="update",
            loses=1,
            says="on inputs you haven't seen: a cell, surely free, explains its scan with a small probability",
            code="""
def update(belief, occupied, free, first_sight):
    b = belief + np.where(occupied != free, belief[3], 0) * np.array([*first_sight, -1])[:, None, None]
    p = b * np.stack([free, occupied, occupied, free])
    t = p.sum(axis=0)
    return np.where(t > 1e-3, p / np.where(t > 1e-3, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])""",
        ),
        mistake(
            "contradicted only when surely free",
            task="update",
            loses=1,
            says="on inputs you haven't seen: a cell is NaN",
            code="""
def update(belief, occupied, free, first_sight):
    b = belief + np.where(occupied != free, belief[3], 0) * np.array([*first_sight, -1])[:, None, None]
    p = b * np.stack([free, occupied, occupied, free])
    return np.where((b[0] == 1) & (free == 0), np.array([0, 0, 0, 1.0])[:, None, None], p / p.sum(axis=0))""",
        ),
        mistake(
            "revealed only where something is hit",
            task="update",
            loses=2,
            says="on inputs you haven't seen: UNKNOWN is left in cells that the scan sees",
            code="""
def update(belief, occupied, free, first_sight):
    b = belief + np.where(occupied > free, belief[3], 0) * np.array([*first_sight, -1])[:, None, None]
    p = b * np.stack([free, occupied, occupied, free])
    t = p.sum(axis=0)
    return np.where(t > 0, p / np.where(t > 0, t, 1), np.array([0, 0, 0, 1.0])[:, None, None])""",
        ),
        # ---- task 4
        right(
            "two pointers",
            task="systematic",
            code="""
def systematic(weight, count, offset):
    drawn, n, end, total = [], 0, weight[0], sum(weight)
    for m in range(count):
        while end <= (m + offset) / count * total:
            n += 1
            end += weight[n]
        drawn.append(n)
    return np.array(drawn)""",
        ),
        right(
            "a list, by helpers with ordinary names",
            task="systematic",
            code="""
weight, before, got, slips = "mine", None, [], 3


def drawn(ends, tooth):
    return sum(bool(end <= tooth) for end in ends)


def systematic(weight, count, offset):
    ends = np.cumsum(weight)
    return [drawn(ends, (m + offset) / count * ends[-1]) for m in range(count)]""",
        ),
        right(
            "count the parts that end before each tooth",
            task="systematic",
            code="""
def systematic(weight, count, offset):
    ends = np.cumsum(weight)
    teeth = np.linspace(0, ends[-1], count, endpoint=False) + offset * ends[-1] / count
    return (teeth[:, None] >= ends[None]).sum(axis=1)""",
        ),
        mistake(
            "two pointers with `if`",
            task="systematic",
            loses=3,
            says="go on `while` a particle ends before the tooth, not `if`",
            code="""
def systematic(weight, count, offset):
    drawn, n, end, total = [], 0, weight[0], sum(weight)
    for m in range(count):
        if end <= (m + offset) / count * total:
            n += 1
            end += weight[n]
        drawn.append(n)
    return np.array(drawn)""",
        ),
        mistake(
            "weights not normalised",
            task="systematic",
            loses=3,
            says="the weights sum to 10, not to 1",
            code="""
def systematic(weight, count, offset):
    return np.searchsorted(np.cumsum(weight), (np.arange(count) + offset) / count, side="right")""",
        ),
        mistake(
            "cumulative sum off by one",
            task="systematic",
            loses=3,
            says="every index is one too large",
            code="""
def systematic(weight, count, offset):
    ends = np.concatenate([[0], np.cumsum(weight)])
    return np.searchsorted(ends, (np.arange(count) + offset) / count * ends[-1], side="right")""",
        ),
        mistake(
            "an offset for each tooth: stratified",
            task="systematic",
            loses=3,
            says="the comb has one offset",
            code="""
def systematic(weight, count, offset):
    ends = np.cumsum(weight)
    offsets = np.random.default_rng().random(count)
    return np.searchsorted(ends, (np.arange(count) + offsets) / count * ends[-1], side="right")""",
        ),
        mistake(
            "drawn from an urn: multinomial",
            task="systematic",
            loses=3,
            says="nothing else is random",
            code="""
def systematic(weight, count, offset):
    return np.sort(np.random.default_rng().choice(len(weight), count, p=weight / sum(weight)))""",
        ),
        mistake(
            "offset not divided",
            task="systematic",
            loses=3,
            says="divide it by `count` too",
            code="""
def systematic(weight, count, offset):
    ends = np.cumsum(weight) / sum(weight)
    return np.searchsorted(ends, np.arange(count) / count + offset, side="right")""",
        ),
        mistake(
            "teeth from end to end",
            task="systematic",
            loses=3,
            says="so the last isn't at its end",
            code="""
def systematic(weight, count, offset):
    ends = np.cumsum(weight) / sum(weight)
    teeth = np.minimum(np.linspace(0, 1, count) + offset / count, 0.999)
    return np.searchsorted(ends, teeth, side="right")""",
        ),
        mistake(
            "as many as there are weights",
            task="systematic",
            loses=3,
            says="as many as `count`",
            code="""
def systematic(weight, count, offset):
    ends, N = np.cumsum(weight), len(weight)
    return np.searchsorted(ends, (np.arange(N) + offset) / N * ends[-1], side="right")""",
        ),
        mistake(
            "endless loop",
            task="systematic",
            loses=3,
            says="no reply before timeout",
            code="""
def systematic(weight, count, offset):
    drawn, n = [], 0
    while len(drawn) < count:
        n = (n + 1) % len(weight)
    return drawn""",
        ),
        mistake(
            "on a border, the first of the two",
            task="systematic",
            loses=3,
            says="on inputs you haven't seen: a particle of weight 0 was drawn",
            code="""
def systematic(weight, count, offset):
    ends = np.cumsum(weight)
    return np.searchsorted(ends, (np.arange(count) + offset) / count * ends[-1], side="left")""",
        ),
        mistake(
            "offset ignored",
            task="systematic",
            loses=3,
            says="where the comb begins decides",
            code="""
def systematic(weight, count, offset):
    ends = np.cumsum(weight)
    return np.searchsorted(ends, np.arange(count) / count * ends[-1], side="right")""",
        ),
        # ---- task 5
        right(
            "the formulas of the lecture",
            task="meet",
            code="""
def meet(own, arrives):
    a = np.clip(arrives, 0, 0.999)
    possible = 1 - a * own[1]
    after = own * (1 - a) / possible
    after[2] = (a * (1 - own[1]) + (1 - a) * own[2]) / possible
    return after""",
        ),
        right(
            "all eight combinations of each cell",
            task="meet",
            code="""
def meet(own, arrives):
    after = np.zeros(own.shape)
    for r, c in np.ndindex(arrives.shape):
        a = min(arrives[r, c], 0.999)
        for state in range(4):
            after[state, r, c] += own[state, r, c] * (1 - a)
            if state != STATIC:
                after[DYNAMIC, r, c] += own[state, r, c] * a
        after[:, r, c] /= after[:, r, c].sum()
    return after""",
        ),
        mistake(
            "not normalised after striking out",
            task="meet",
            loses=2,
            says="sums to 0.75: divide by what is left",
            code="""
def meet(own, arrives):
    a = np.minimum(arrives, 0.999)
    after = own * (1 - a)
    after[2] += a * (1 - own[1])
    return after""",
        ),
        mistake(
            "nothing struck out",
            task="meet",
            loses=2,
            says="a thing can't arrive where STATIC stands",
            code="""
def meet(own, arrives):
    a = np.minimum(arrives, 0.999)
    after = own * (1 - a)
    after[2] += a
    return after""",
        ),
        mistake(
            "added to what is there",
            task="meet",
            loses=3,
            says="sums to 1.50: divide by what is left",
            code="""
def meet(own, arrives):
    after = own.copy()
    after[2] += np.minimum(arrives, 0.999)
    return after""",
        ),
        mistake(
            "added, then normalised",
            task="meet",
            loses=3,
            says="`arrives and FREE` isn't FREE",
            code="""
def meet(own, arrives):
    after = own.copy()
    after[2] += np.minimum(arrives, 0.999)
    return after / after.sum(axis=0)""",
        ),
        mistake(
            "own dynamic mass counted twice",
            task="meet",
            loses=1,
            says="you count its DYNAMIC mass twice",
            code="""
def meet(own, arrives):
    a = np.minimum(arrives, 0.999)
    after = own * (1 - a)
    after[2] = own[2] + a * (1 - own[1])
    return after / after.sum(axis=0)""",
        ),
        mistake(
            "own dynamic mass lost",
            task="meet",
            loses=1,
            says="the own DYNAMIC of cell (0, 1) got lost",
            code="""
def meet(own, arrives):
    a = np.minimum(arrives, 0.999)
    after = own * (1 - a)
    after[2] = a * (1 - own[1])
    return after / after.sum(axis=0)""",
        ),
        mistake(
            "STATIC always wins",
            task="meet",
            loses=2,
            says="STATIC isn't always right",
            code="""
def meet(own, arrives):
    a = np.minimum(arrives, 0.999)
    after = own * (1 - a)
    after[1] = own[1]
    after[2] += a * (1 - own[1])
    return after""",
        ),
        mistake(
            "argument changed in place",
            task="meet",
            loses=2,
            says="meet changed its argument",
            code="""
def meet(own, arrives):
    a = np.minimum(arrives, 0.999)
    static = own[1].copy()
    own *= 1 - a
    own[2] += a * (1 - static)
    return own / own.sum(axis=0)""",
        ),
        mistake(
            "no limit to what arrives",
            task="meet",
            loses=1,
            says="let particles claim 0.999 at most",
            code="""
def meet(own, arrives):
    after = own * (1 - arrives)
    after[2] += arrives * (1 - own[1])
    return after / after.sum(axis=0)""",
        ),
        mistake(
            "what arrives fills free space alone",
            task="meet",
            loses=2,
            says="on inputs you haven't seen: sums are right, values are not (UNKNOWN is a state too)",
            code="""
def meet(own, arrives):
    a = np.minimum(arrives, 0.999)
    after = own * (1 - a)
    after[2] += a * (own[0] + own[2])
    after[3] += a * own[3]
    return after / after.sum(axis=0)""",
        ),
        # ---- passed, or lost, when somebody tried who had not written the tests
        mistake(
            "writes into M",
            task="mix",
            loses=2,
            says="it changes an argument",
            code="""
def mix(belief, M):
    after = np.tensordot(M.T, belief, axes=1)
    M[2, 2] = 0
    return after, np.tensordot(M[:, 2], belief, axes=1)""",
        ),
        mistake(
            "the same belief, whatever arrives",
            task="meet",
            loses=4,
            says="on inputs you haven't seen",
            code="""
def meet(own, arrives):
    if arrives.shape in ((5, 7), (3, 4)):
        return np.broadcast_to(np.array([0.1, 0.2, 0.3, 0.4])[:, None, None], own.shape)
    a = np.minimum(arrives, 0.999)
    joint = (1 - a) * own
    joint[2] += a * (1 - own[1])
    return joint / joint.sum(axis=0)""",
        ),
    )
