"""Random cells, and every labelling of a tiny grid with what it costs: what exact inference is compared with."""

from itertools import product

import numpy as np

from semgrid_edu.crf import energy, pair_weights


def random_cells(shape=(3, 2, 3), seed=0):
    """Return a unary term, (C, H, W), and occupancy probabilities, (4, H, W)."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=shape), np.moveaxis(rng.dirichlet(np.ones(4), shape[1:]), -1, 0)


def enumerated(unary, values, params):
    """Return all labellings, (n, H, W), and their energies; some are checked against `energy`."""
    classes, *grid = unary.shape
    cells = int(np.prod(grid))
    x = np.array(list(product(range(classes), repeat=cells))).reshape(-1, cells)
    pairs = np.triu(pair_weights(values, params))
    agree = sum(np.einsum("ni,ij,nj->n", x == label, pairs, x == label, optimize=True) for label in range(classes))
    energies = unary.reshape(classes, cells)[x, np.arange(cells)].sum(axis=1) + pairs.sum() - agree
    labellings = x.reshape(-1, *grid)
    for k in np.linspace(0, len(x) - 1, 5).astype(int):
        np.testing.assert_allclose(energies[k], energy(labellings[k], unary, values, params), rtol=1e-9, atol=1e-9)
    return labellings, energies
