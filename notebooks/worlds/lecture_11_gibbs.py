"""Gibbs sampling of the CRF: the model's own probabilities, without mean field."""

import numpy as np
from numpy.typing import NDArray


def frequencies(
    unary: NDArray, weights: NDArray, sweeps: int = 60, burn_in: int = 20, seed: int = 0
) -> NDArray[np.float64]:
    """Draw each cell's label in turn, given all others, and count how often each label is drawn.

    It starts from the network's map. On the crop of lecture 11 a chain of 1500 sweeps that starts from the true map
    comes to the same number of cells for each car.

    Parameters
    ----------
    unary : (C, H, W) float
        The network's price of each label.
    weights : (H W, H W) float
        The price of two different labels, for every pair of cells; zero on the diagonal.
    sweeps : int
        How often each cell is drawn.
    burn_in : int
        So many sweeps aren't counted.
    seed : int
        Seed of the draws.

    Returns
    -------
    (C, H, W) float64
        How often each label was drawn, as a share of the sweeps that count.
    """
    rng = np.random.default_rng(seed)
    phi = unary.reshape(len(unary), -1).T
    labels = phi.argmin(axis=1)
    score = weights @ np.eye(phi.shape[1])[labels] - phi  # log of each label's probability, but for a constant
    counts = np.zeros(phi.shape)
    cells = np.arange(len(phi))
    for sweep in range(sweeps):
        noise = rng.gumbel(size=phi.shape)  # the largest of score + Gumbel noise is a draw of the soft-max of the score
        for i in range(len(phi)):
            new = (score[i] + noise[i]).argmax()
            if new != labels[i]:
                score[:, labels[i]] -= weights[i]
                score[:, new] += weights[i]
                labels[i] = new
        if sweep >= burn_in:
            counts[cells, labels] += 1
    return counts.T.reshape(unary.shape) / (sweeps - burn_in)
