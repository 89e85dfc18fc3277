"""The graders of exercise 03, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


class TestBof(GraderChecks):
    exercise = "03_bof"
    entries = (
        # ---- task 1
        right(
            "numpy, both at once",
            task="antecedent",
            code="""
def antecedent(row, col, velocity, dt, cell):
    return np.array([row, col]) + np.rint(np.array(velocity) * dt / cell).astype(int)""",
        ),
        right(
            "through metres and back",
            task="antecedent",
            code="""
def antecedent(row, col, velocity, dt, cell):
    x, y = -(row + 0.5) * cell - velocity[0] * dt, -(col + 0.5) * cell - velocity[1] * dt
    return int(np.floor(-x / cell)), int(np.floor(-y / cell))""",
        ),
        mistake(
            "where it will be",
            task="antecedent",
            loses=2,
            says="you look for where it was",
            code="""
def antecedent(row, col, velocity, dt, cell):
    return row - round(velocity[0] * dt / cell), col - round(velocity[1] * dt / cell)""",
        ),
        mistake(
            "rows count up",
            task="antecedent",
            loses=2,
            says="rows count down the map",
            code="""
def antecedent(row, col, velocity, dt, cell):
    return row - round(velocity[0] * dt / cell), col + round(velocity[1] * dt / cell)""",
        ),
        mistake(
            "y to the right",
            task="antecedent",
            loses=2,
            says="columns count to the right and y to the left",
            code="""
def antecedent(row, col, velocity, dt, cell):
    return row + round(velocity[0] * dt / cell), col - round(velocity[1] * dt / cell)""",
        ),
        mistake(
            "x and y swapped",
            task="antecedent",
            loses=2,
            says="x and y are swapped",
            code="""
def antecedent(row, col, velocity, dt, cell):
    return row + round(velocity[1] * dt / cell), col + round(velocity[0] * dt / cell)""",
        ),
        mistake(
            "time forgotten",
            task="antecedent",
            loses=2,
            says="the distance covered is velocity times dt",
            code="""
def antecedent(row, col, velocity, dt, cell):
    return row + round(velocity[0] / cell), col + round(velocity[1] / cell)""",
        ),
        mistake(
            "metres instead of cells",
            task="antecedent",
            loses=2,
            says="you count metres",
            code="""
def antecedent(row, col, velocity, dt, cell):
    return row + round(velocity[0] * dt), col + round(velocity[1] * dt)""",
        ),
        mistake(
            "floats for indices",
            task="antecedent",
            loses=2,
            says="an index must be an integer",
            code="""
def antecedent(row, col, velocity, dt, cell):
    return row + velocity[0] * dt / cell, col + velocity[1] * dt / cell""",
        ),
        mistake(
            "cut instead of rounded",
            task="antecedent",
            loses=2,
            says="on inputs you haven't seen: one cell off: a way of 2.9999999 cells is one of 3",
            code="""
def antecedent(row, col, velocity, dt, cell):
    return row + int(velocity[0] * dt / cell), col + int(velocity[1] * dt / cell)""",
        ),
        mistake(
            "the sum cut instead of the way rounded",
            task="antecedent",
            loses=2,
            says="on inputs you haven't seen: one cell off",
            code="""
def antecedent(row, col, velocity, dt, cell):
    return int(row + velocity[0] * dt / cell), int(col + velocity[1] * dt / cell)""",
        ),
        mistake(
            "endless loop",
            task="antecedent",
            loses=2,
            says="no reply before timeout",
            code="def antecedent(row, col, velocity, dt, cell):\n    while True:\n        row += 1",
        ),
        # ---- task 2
        right(
            "slices with a margin",
            task="shift",
            code="""
def shift(mass, down, right):
    height, width = mass.shape
    down, right = np.clip(down, -height, height), np.clip(right, -width, width)
    wide = np.pad(mass, ((height, height), (width, width)))
    return wide[height - down : 2 * height - down, width - right : 2 * width - right]""",
        ),
        right(
            "roll, then clear what came round",
            task="shift",
            code="""
def shift(mass, down, right):
    flown = np.roll(mass, (down, right), axis=(0, 1))
    rows, cols = np.indices(mass.shape)
    inside = (rows - down >= 0) & (rows - down < mass.shape[0]) & (cols - right >= 0) & (cols - right < mass.shape[1])
    return flown * inside""",
        ),
        mistake(
            "wraps around",
            task="shift",
            loses=2,
            says="the world isn't round",
            code="def shift(mass, down, right):\n    return np.roll(mass, (down, right), axis=(0, 1))",
        ),
        mistake(
            "the wrong way",
            task="shift",
            loses=2,
            says="it flew the wrong way",
            code="""
def shift(mass, down, right):
    flown = np.zeros_like(mass)
    for r in range(mass.shape[0]):
        for c in range(mass.shape[1]):
            if 0 <= r + down < mass.shape[0] and 0 <= c + right < mass.shape[1]:
                flown[r, c] = mass[r + down, c + right]
    return flown""",
        ),
        mistake(
            "rows upside down",
            task="shift",
            loses=2,
            says="it flew down instead of up",
            code="""
def shift(mass, down, right):
    from scipy import ndimage
    return ndimage.shift(mass, (-down, right), order=0)""",
        ),
        mistake(
            "columns mirrored",
            task="shift",
            loses=2,
            says="it flew left instead of right",
            code="""
def shift(mass, down, right):
    from scipy import ndimage
    return ndimage.shift(mass, (down, -right), order=0)""",
        ),
        mistake(
            "axes swapped",
            task="shift",
            loses=2,
            says="`down` is for rows",
            code="""
def shift(mass, down, right):
    from scipy import ndimage
    return ndimage.shift(mass, (right, down), order=0)""",
        ),
        mistake(
            "border repeated",
            task="shift",
            loses=2,
            says="at the border you repeat the last cell",
            code="""
def shift(mass, down, right):
    rows = np.clip(np.arange(mass.shape[0]) - down, 0, mass.shape[0] - 1)
    cols = np.clip(np.arange(mass.shape[1]) - right, 0, mass.shape[1] - 1)
    return mass[np.ix_(rows, cols)]""",
        ),
        mistake(
            "argument changed in place",
            task="shift",
            loses=2,
            says="changed its argument",
            code="""
def shift(mass, down, right):
    mass[:-1] = mass[1:]
    mass[-1] = 0
    mass[:, 2:] = mass[:, :-2].copy()
    mass[:, :2] = 0
    return mass""",
        ),
        mistake(
            "slices that know one direction",
            task="shift",
            loses=2,
            says="on inputs you haven't seen",
            code="""
def shift(mass, down, right):
    flown = np.zeros_like(mass)
    flown[:down, right:] = mass[-down:, :-right]
    return flown""",
        ),
        mistake(
            "negative indices come round",
            task="shift",
            loses=2,
            says="on inputs you haven't seen: it raises an error in line",
            code="""
def shift(mass, down, right):
    flown = np.zeros_like(mass)
    for r in range(mass.shape[0]):
        for c in range(mass.shape[1]):
            if r + down >= 0 and c + right < mass.shape[1]:
                flown[r + down, c + right] = mass[r, c]
    return flown""",
        ),
        # ---- task 3
        right(
            "a loop over cells and hypotheses",
            task="update",
            code="""
def update(joint, if_occupied, if_free):
    after = np.zeros_like(joint)
    for r in range(joint.shape[1]):
        for c in range(joint.shape[2]):
            hypotheses = [p * q for p, q in zip(joint[:, r, c], if_occupied[:, r, c])]
            total = sum(hypotheses) + (1 - sum(joint[:, r, c])) * if_free[r, c]
            after[:, r, c] = [h / total for h in hypotheses]
    return after""",
        ),
        right(
            "free as one more hypothesis",
            task="update",
            code="""
def update(joint, if_occupied, if_free):
    belief = np.concatenate([joint, 1 - joint.sum(axis=0, keepdims=True)])
    likelihood = np.concatenate([if_occupied, if_free[None]])
    product = belief * likelihood
    return (product / product.sum(axis=0))[:-1]""",
        ),
        mistake(
            "free forgotten",
            task="update",
            loses=3,
            says="the velocities sum to 1, yet the cell may be free",
            code="""
def update(joint, if_occupied, if_free):
    product = joint * if_occupied
    return product / product.sum(axis=0)""",
        ),
        mistake(
            "no normalisation",
            task="update",
            loses=3,
            says="Bayes' rule has a second step",
            code="def update(joint, if_occupied, if_free):\n    return joint * if_occupied",
        ),
        mistake(
            "likelihoods swapped",
            task="update",
            loses=3,
            says="the two likelihoods are swapped",
            code="""
def update(joint, if_occupied, if_free):
    product = joint * if_free
    return product / (product.sum(axis=0) + (1 - joint.sum(axis=0)) * if_occupied)""",
        ),
        mistake(
            "free without its prior",
            task="update",
            loses=3,
            says="free lacks its prior",
            code="""
def update(joint, if_occupied, if_free):
    product = joint * if_occupied
    return product / (product.sum(axis=0) + if_free)""",
        ),
        mistake(
            "each velocity against all else",
            task="update",
            loses=3,
            says="you update each velocity against all else",
            code="""
def update(joint, if_occupied, if_free):
    return joint * if_occupied / (joint * if_occupied + (1 - joint) * if_free)""",
        ),
        mistake(
            "normalised over the whole grid",
            task="update",
            loses=3,
            says="go cell by cell",
            code="""
def update(joint, if_occupied, if_free):
    product = joint * if_occupied
    return product / (product.sum() + ((1 - joint.sum(axis=0)) * if_free).sum())""",
        ),
        mistake(
            "argument changed in place",
            task="update",
            loses=3,
            says="changed its argument",
            code="""
def update(joint, if_occupied, if_free):
    free = (1 - joint.sum(axis=0)) * if_free
    joint *= if_occupied
    return joint / (joint.sum(axis=0) + free)""",
        ),
        mistake(
            "axes swapped",
            task="update",
            loses=3,
            says="expected the shape of the joint",
            code="""
def update(joint, if_occupied, if_free):
    product = (joint * if_occupied).T
    return product / (product.sum(axis=-1) + ((1 - joint.sum(axis=0)) * if_free).T)[..., None]""",
        ),
        mistake(
            "three velocities written in",
            task="update",
            loses=3,
            says="on inputs you haven't seen",
            code="""
def update(joint, if_occupied, if_free):
    product = joint * if_occupied
    occupied = joint[0] + joint[1] + joint[2]
    return product / (product[0] + product[1] + product[2] + (1 - occupied) * if_free)""",
        ),
        mistake(
            "the same likelihood for all velocities",
            task="update",
            loses=3,
            says="you average what the scanner says over the velocities",
            code="""
def update(joint, if_occupied, if_free):
    product = joint * if_occupied.mean(axis=0)
    return product / (product.sum(axis=0) + (1 - joint.sum(axis=0)) * if_free)""",
        ),
        mistake(
            "the lecture's function, pasted",
            task="update",
            loses=3,
            says="IndexError",
            code="""
def update(joint, if_occupied, if_free):
    after = np.zeros_like(joint)
    for cell in range(6):
        occupied = joint[:, cell] * if_occupied[cell]
        free = (1 - joint[:, cell].sum()) * if_free[cell]
        after[:, cell] = occupied / (occupied.sum() + free)
    return after""",
        ),
        # ---- task 4
        right(
            "a loop over cells, numpy's own average and covariance",
            task="mean-and-covariance",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    shape = joint.shape[1:]
    mean, covariance = np.full((2, *shape), np.nan), np.full((2, 2, *shape), np.nan)
    for r, c in np.ndindex(shape):
        weights = joint[fast, r, c]
        if weights.sum() > 0:
            mean[:, r, c] = np.average(velocities[fast], axis=0, weights=weights)
            covariance[:, :, r, c] = np.cov(velocities[fast].T, aweights=weights, ddof=0)
    return mean, covariance""",
        ),
        right(
            "nested lists, and names that the tests have, too",
            task="mean-and-covariance",
            code="""
joint, velocities, before, got, slips = "mine", None, [], 3, {}


def mean(weights, values):
    total = sum(weights)
    return sum(w * v for w, v in zip(weights, values)) / total if total > 0 else float("nan")


def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    (_, H, W), v = joint.shape, velocities[fast]
    m, axes = joint[fast], (0, 1)
    means = [[[mean(m[:, r, c], v[:, i]) for c in range(W)] for r in range(H)] for i in axes]

    def covariance(i, j, r, c):
        return mean(m[:, r, c], (v[:, i] - means[i][r][c]) * (v[:, j] - means[j][r][c]))

    return means, [[[[covariance(i, j, r, c) for c in range(W)] for r in range(H)] for j in axes] for i in axes]""",
        ),
        right(
            "moments",
            task="mean-and-covariance",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    m, v = joint[fast], velocities[fast]
    total = m.sum(axis=0)
    mean = np.tensordot(v.T, m, axes=1) / total
    second = np.tensordot(np.einsum("vi,vj->ijv", v, v), m, axes=1) / total
    return mean, second - mean[:, None] * mean[None]""",
        ),
        mistake(
            "not divided by the probability",
            task="mean-and-covariance",
            loses=2,
            says="given that something moves means divided by P(it moves)",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    m, v = joint[fast], velocities[fast]
    mean = np.tensordot(v.T, m, axes=1)
    apart = v[:, :, None, None] - mean / m.sum(axis=0)
    return np.where(m.sum(axis=0) > 0, mean, np.nan), np.einsum("vhw,vihw,vjhw->ijhw", m, apart, apart)""",
        ),
        mistake(
            "what stands counted in",
            task="mean-and-covariance",
            loses=2,
            says="what stands doesn't move",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    share = joint / joint.sum(axis=0)
    mean = np.einsum("vhw,vi->ihw", share, velocities)
    apart = velocities[:, :, None, None] - mean
    return mean, np.einsum("vhw,vihw,vjhw->ijhw", share, apart, apart)""",
        ),
        mistake(
            "x and y swapped",
            task="mean-and-covariance",
            loses=4,
            says="x and y are swapped",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    share, v = joint[fast] / joint[fast].sum(axis=0), velocities[fast][:, ::-1]
    mean = np.einsum("vhw,vi->ihw", share, v)
    apart = v[:, :, None, None] - mean
    return mean, np.einsum("vhw,vihw,vjhw->ijhw", share, apart, apart)""",
        ),
        mistake(
            "every velocity counts the same",
            task="mean-and-covariance",
            loses=4,
            says="every velocity counts the same",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    nothing = np.where(joint[fast].sum(axis=0) > 0, 0, np.nan)
    mean, covariance = velocities[fast].mean(axis=0), np.cov(velocities[fast].T)
    return mean[:, None, None] + nothing, covariance[..., None, None] + nothing""",
        ),
        mistake(
            "the most probable velocity",
            task="mean-and-covariance",
            loses=2,
            says="that is the most probable velocity",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    share, v = joint[fast] / joint[fast].sum(axis=0), velocities[fast]
    mean = np.einsum("vhw,vi->ihw", share, v)
    apart = v[:, :, None, None] - mean
    best = v[joint[fast].argmax(axis=0)].transpose(2, 0, 1) + 0 * mean
    return best, np.einsum("vhw,vihw,vjhw->ijhw", share, apart, apart)""",
        ),
        mistake(
            "zero instead of NaN",
            task="mean-and-covariance",
            loses=1,
            says="no velocity isn't zero velocity",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    share = joint[fast] / np.maximum(joint[fast].sum(axis=0), 1e-12)
    mean = np.einsum("vhw,vi->ihw", share, velocities[fast])
    apart = velocities[fast][:, :, None, None] - mean
    return mean, np.einsum("vhw,vihw,vjhw->ijhw", share, apart, apart)""",
        ),
        mistake(
            "NaN where there is little",
            task="mean-and-covariance",
            loses=1,
            says="on inputs you haven't seen: NaN where something may move",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    total = joint[fast].sum(axis=0)
    share = joint[fast] / np.where(total > 1e-3, total, np.nan)
    mean = np.einsum("vhw,vi->ihw", share, velocities[fast])
    apart = velocities[fast][:, :, None, None] - mean
    return mean, np.einsum("vhw,vihw,vjhw->ijhw", share, apart, apart)""",
        ),
        mistake(
            "mean not taken off",
            task="mean-and-covariance",
            loses=2,
            says="take the mean velocity off first",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    share, v = joint[fast] / joint[fast].sum(axis=0), velocities[fast]
    return np.einsum("vhw,vi->ihw", share, v), np.einsum("vhw,vi,vj->ijhw", share, v, v)""",
        ),
        mistake(
            "variances only",
            task="mean-and-covariance",
            loses=2,
            says="the two components vary together",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    share = joint[fast] / joint[fast].sum(axis=0)
    mean = np.einsum("vhw,vi->ihw", share, velocities[fast])
    variance = np.einsum("vhw,vihw->ihw", share, (velocities[fast][:, :, None, None] - mean) ** 2)
    return mean, variance[None] * np.eye(2)[:, :, None, None]""",
        ),
        mistake(
            "standard deviations",
            task="mean-and-covariance",
            loses=2,
            says="these are standard deviations",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    share = joint[fast] / joint[fast].sum(axis=0)
    mean = np.einsum("vhw,vi->ihw", share, velocities[fast])
    variance = np.einsum("vhw,vihw->ihw", share, (velocities[fast][:, :, None, None] - mean) ** 2)
    return mean, np.sqrt(variance)[None] * np.eye(2)[:, :, None, None]""",
        ),
        # ---- task 5
        right(
            "the eight pairs, counted",
            task="arrive",
            code="""
def arrive(own, arrives):
    after = np.zeros_like(own)
    for state in range(4):
        for comes, p in ((True, arrives), (False, 1 - arrives)):
            if not (comes and state in (1, 2)):
                after[2 if comes else state] += p * own[state]
    return after / after.sum(axis=0)""",
        ),
        right(
            "by a loop over cells",
            task="arrive",
            code="""
def arrive(own, arrives):
    after = np.zeros(own.shape)
    for r in range(own.shape[1]):
        for c in range(own.shape[2]):
            a, s = arrives[r, c], own[1, r, c] + own[2, r, c]
            after[:, r, c] = (1 - a) * own[:, r, c] / (1 - a * s)
            after[2, r, c] = 1 - after[0, r, c] - after[1, r, c] - after[3, r, c]
    return after""",
        ),
        mistake(
            "nothing struck out",
            task="arrive",
            loses=3,
            says="you strike nothing out",
            code="""
def arrive(own, arrives):
    after = (1 - arrives) * own
    after[2] += arrives
    return after""",
        ),
        mistake(
            "what stands wins",
            task="arrive",
            loses=3,
            says="neither of the two wins",
            code="""
def arrive(own, arrives):
    free, static, dynamic, unknown = own
    nothing = 1 - arrives
    return np.stack([nothing * free, static, arrives * (free + unknown) + dynamic, nothing * unknown])""",
        ),
        mistake(
            "added and scaled",
            task="arrive",
            loses=3,
            says="you add what arrives and scale",
            code="""
def arrive(own, arrives):
    after = own.copy()
    after[2] += arrives
    return after / after.sum(axis=0)""",
        ),
        right(
            "what is left, scaled",
            task="arrive",
            code="""
def arrive(own, arrives):
    after = (1 - arrives) * own
    after[2] += arrives * (own[0] + own[3])
    return after / after.sum(axis=0)""",
        ),
        mistake(
            "the package's function, wrapped",
            task="arrive",
            loses=3,
            says="you strike out one pair, as the lecture does",
            code="""
def arrive(own, arrives):
    from semgrid_edu.occupancy.cellwise import strike_out
    possible = arrives * (1 - own[1])
    keep, take = strike_out(arrives, possible)
    after = keep * own
    after[2] += take * possible
    return after""",
        ),
        mistake(
            "the package's function, wrapped",
            task="mean-and-covariance",
            loses=5,
            says="you leave the first bin out",
            code="""
def mean_and_covariance(joint, velocities, slow):
    from semgrid_edu.occupancy.bof import bof_velocity
    from semgrid_edu.occupancy.bof_state import BofState
    none = np.zeros(joint.shape[1:])
    return bof_velocity(BofState(none, none, joint, velocities, np.zeros_like(velocities)))""",
        ),
        mistake(
            "the package's function, wrapped",
            task="shift",
            loses=2,
            says="on inputs you haven't seen: wrong for a way of 0",
            code="""
def shift(mass, down, right):
    from semgrid_edu.occupancy.bof import _elsewhere
    return _elsewhere(mass, np.array([down, right]))""",
        ),
        mistake(
            "the zero velocity alone left out",
            task="mean-and-covariance",
            loses=2,
            says="what moves at 0.7 m/s isn't faster than `slow` either",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.abs(velocities).max(axis=1) > 0
    share = joint[fast] / joint[fast].sum(axis=0)
    mean = np.einsum("vhw,vi->ihw", share, velocities[fast])
    apart = velocities[fast][:, :, None, None] - mean
    return mean, np.einsum("vhw,vihw,vjhw->ijhw", share, apart, apart)""",
        ),
        mistake(
            "what moved already lost",
            task="arrive",
            loses=3,
            says="what moved in the cell already got lost",
            code="""
def arrive(own, arrives):
    after = (1 - arrives) * own
    after[2] = arrives * (own[0] + own[3])
    return after / after.sum(axis=0)""",
        ),
        mistake(
            "not divided by what is left",
            task="arrive",
            loses=3,
            says="divide by what is left after striking out",
            code="""
def arrive(own, arrives):
    after = (1 - arrives) * own
    after[2] += arrives * (own[0] + own[3])
    return after""",
        ),
        mistake(
            "what is struck out becomes UNKNOWN",
            task="arrive",
            loses=3,
            says="aren't UNKNOWN, they are impossible",
            code="""
def arrive(own, arrives):
    after = (1 - arrives) * own
    after[2] += arrives * (own[0] + own[3])
    after[3] += arrives * (own[1] + own[2])
    return after""",
        ),
        mistake(
            "FREE and STATIC mixed up",
            task="arrive",
            loses=3,
            says="by hand: 0.21, 0.12, 0.38, 0.09",
            code="""
def arrive(own, arrives):
    after = (1 - arrives) * own
    after[2] += arrives * (own[1] + own[3])
    return after / after.sum(axis=0)""",
        ),
        mistake(
            "in odds, which are infinite where it is certain",
            task="arrive",
            loses=3,
            says="on inputs you haven't seen: no number where it is certain that something arrives",
            code="""
def arrive(own, arrives):
    odds = arrives / (1 - arrives)
    after = own.copy()
    after[2] += odds * (own[0] + own[3])
    return after / after.sum(axis=0)""",
        ),
        right(
            "pairs, cell by cell",
            task="arrive",
            code="""
def arrive(own, arrives):
    after = np.zeros_like(own)
    for r, c in np.ndindex(arrives.shape):
        for state, comes in np.ndindex(4, 2):
            if not (state in (1, 2) and comes):
                chance = arrives[r, c] if comes else 1 - arrives[r, c]
                after[2 if comes else state, r, c] += chance * own[state, r, c]
    return after / after.sum(axis=0)""",
        ),
        mistake(
            "a crash", task="arrive", loses=3, says="IndexError", code="def arrive(own, arrives):\n    return own[4]"
        ),
        # ---- passed, or lost, when somebody tried who had not written the tests
        mistake(
            "writes into `if_free`",
            task="update",
            loses=3,
            says="it changes an argument",
            code="""
def update(joint, if_occupied, if_free):
    occupied = joint * if_occupied
    if_free *= 1 - joint.sum(axis=0)
    return occupied / (occupied.sum(axis=0) + if_free)""",
        ),
        mistake(
            "writes into `arrives`",
            task="arrive",
            loses=3,
            says="it changes an argument",
            code="""
def arrive(own, arrives):
    free, static, dynamic, unknown = own
    comes, possible = arrives * (free + unknown), 1 - arrives * (static + dynamic)
    np.subtract(1, arrives, out=arrives)
    return np.stack([arrives * free, arrives * static, comes + arrives * dynamic, arrives * unknown]) / possible""",
        ),
        right(
            "in float32",
            task="update",
            code="""
def update(joint, if_occupied, if_free):
    joint, if_occupied, if_free = (np.float32(a) for a in (joint, if_occupied, if_free))
    occupied = joint * if_occupied
    return occupied / (occupied.sum(axis=0) + (1 - joint.sum(axis=0)) * if_free)""",
        ),
        right(
            "`a` cut to 0.999, as the lecture teaches",
            task="arrive",
            code="""
def arrive(own, arrives):
    a, after = np.minimum(arrives, 0.999), np.empty_like(own)
    after[:] = (1 - a) * own / (1 - a * (own[1] + own[2]))
    after[2] += a * (own[0] + own[3]) / (1 - a * (own[1] + own[2]))
    return after""",
        ),
        mistake(
            "writes into `joint`",
            task="mean-and-covariance",
            loses=5,
            says="it changes an argument",
            code="""
def mean_and_covariance(joint, velocities, slow):
    fast = np.hypot(*velocities.T) > slow
    total = joint[fast].sum(axis=0)
    joint[fast] /= total
    mean = np.einsum("vhw,vi->ihw", joint[fast], velocities[fast])
    apart = velocities[fast][:, :, None, None] - mean
    return mean, np.einsum("vhw,vihw,vjhw->ijhw", joint[fast], apart, apart)""",
        ),
        # ---- task 6
        right(
            "a dictionary of places, in logarithms",
            task="follow",
            code="""
def follow(start, steps, prior, if_occupied, if_free):
    ratio = np.log(if_occupied) - np.log(if_free)
    score = np.log(prior)
    for t in range(len(ratio)):
        place = start + np.asarray(steps) * (t + 1)
        inside = (place >= 0) & (place < ratio.shape[1])
        score = score + np.where(inside, ratio[t][np.where(inside, place, 0)], 0)
    weight = np.exp(score - score.max())
    return weight / weight.sum()""",
        ),
        right(
            "plain loops",
            task="follow",
            code="""
def follow(start, steps, prior, if_occupied, if_free):
    weights = []
    for step, p in zip(steps, prior):
        for t, (occupied, free) in enumerate(zip(if_occupied, if_free), start=1):
            for cell in range(len(free)):
                p = p * (occupied[cell] if cell == start + t * step else free[cell])
        weights.append(p)
    return [w / sum(weights) for w in weights]""",
        ),
        mistake(
            "only the thing's own cell",
            task="follow",
            loses=3,
            says="you ask only the cell in which the thing would be",
            code="""
def follow(start, steps, prior, if_occupied, if_free):
    own = [[o[start + s * t] for t, o in enumerate(if_occupied, 1)] for s in steps]
    weight = prior * np.prod(own, axis=1)
    return weight / weight.sum()""",
        ),
        mistake(
            "not normalised",
            task="follow",
            loses=3,
            says="divide by the sum",
            code="""
def follow(start, steps, prior, if_occupied, if_free):
    cells = np.arange(if_free.shape[1])
    return [
        p * np.prod([np.where(cells == start + s * t, *of).prod() for t, of in enumerate(zip(if_occupied, if_free), 1)])
        for s, p in zip(steps, prior)
    ]""",
        ),
        mistake(
            "the first scan at the start",
            task="follow",
            loses=3,
            says="the first scan is made after one step",
            code="""
def follow(start, steps, prior, if_occupied, if_free):
    cells = np.arange(if_free.shape[1])
    weight = np.array([
        p * np.prod([np.where(cells == start + s * t, *of).prod() for t, of in enumerate(zip(if_occupied, if_free))])
        for s, p in zip(steps, prior)
    ])
    return weight / weight.sum()""",
        ),
        mistake(
            "the prior forgotten",
            task="follow",
            loses=3,
            says="a scan that says nothing leaves the prior as it was",
            code="""
def follow(start, steps, prior, if_occupied, if_free):
    cells = np.arange(if_free.shape[1])
    weight = np.array([
        np.prod([np.where(cells == start + s * t, *of).prod() for t, of in enumerate(zip(if_occupied, if_free), 1)])
        for s in steps
    ])
    return weight / weight.sum()""",
        ),
        mistake(
            "who leaves on the left comes back on the right",
            task="follow",
            loses=3,
            says="on inputs you haven't seen: wrong where a thing leaves the line",
            code="""
def follow(start, steps, prior, if_occupied, if_free):
    weight = np.array(prior, dtype=float)
    for k, s in enumerate(steps):
        for t, (o, f) in enumerate(zip(if_occupied, if_free), 1):
            likelihood = f.copy()
            if start + s * t < len(f):
                likelihood[start + s * t] = o[start + s * t]
            weight[k] *= likelihood.prod()
    return weight / weight.sum()""",
        ),
        # ---- task 7
        right(
            "cell by cell",
            task="collect",
            code="""
def collect(flown, unknown):
    own, arrives = np.zeros((4, *unknown.shape)), np.zeros(unknown.shape)
    for r, c in np.ndindex(unknown.shape):
        arrives[r, c] = min(sum(flown[1:, r, c]), 0.999)
        own[:, r, c] = [1 - flown[0, r, c] - unknown[r, c], flown[0, r, c], 0, unknown[r, c]]
    return own, arrives""",
        ),
        right(
            "FREE last, in float32",
            task="collect",
            code="""
def collect(flown, unknown):
    own = np.zeros((4, *unknown.shape), np.float32)
    own[1], own[3] = flown[0], unknown
    own[0] = 1 - own.sum(axis=0)
    return own, np.clip(np.float32(flown[1:]).sum(axis=0), 0, np.float32(0.999))""",
        ),
        mistake(
            "what stands arrives, too",
            task="collect",
            loses=2,
            says="what stands doesn't arrive",
            code="""
def collect(flown, unknown):
    own = np.stack([1 - flown[0] - unknown, flown[0], 0 * unknown, unknown])
    return own, np.minimum(flown.sum(axis=0), 0.999)""",
        ),
        mistake(
            "nothing cut",
            task="collect",
            loses=2,
            says="let arrivals be at most 0.999",
            code="""
def collect(flown, unknown):
    return np.stack([1 - flown[0] - unknown, flown[0], 0 * unknown, unknown]), flown[1:].sum(axis=0)""",
        ),
        mistake(
            "arrivals as independent",
            task="collect",
            loses=2,
            says="BOF adds arrivals up",
            code="""
def collect(flown, unknown):
    own = np.stack([1 - flown[0] - unknown, flown[0], 0 * unknown, unknown])
    return own, np.minimum(1 - np.prod(1 - flown[1:], axis=0), 0.999)""",
        ),
        mistake(
            "what arrives counted as the cell's own",
            task="collect",
            loses=2,
            says="what arrives isn't the cell's own",
            code="""
def collect(flown, unknown):
    arrives = np.minimum(flown[1:].sum(axis=0), 0.999)
    return np.stack([1 - flown[0] - arrives - unknown, flown[0], arrives, unknown]), arrives""",
        ),
        mistake(
            "three velocities written in",
            task="collect",
            loses=2,
            says="on inputs you haven't seen: wrong probability of arrivals",
            code="""
def collect(flown, unknown):
    own = np.stack([1 - flown[0] - unknown, flown[0], 0 * unknown, unknown])
    return own, np.minimum(flown[1] + flown[2], 0.999)""",
        ),
    )
