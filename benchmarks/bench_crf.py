"""Time mean field against pydensecrf2 and against the written-out twin: `python benchmarks/bench_crf.py`.

The street is made up: classes in patches, noisy network scores, occupancy states in patches of their own. Both
libraries take turns, so that a busy machine slows both; the best of the rounds counts.
"""

import numpy as np
import pydensecrf.densecrf as densecrf
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.special import softmax
from timing import best_times

from semgrid_edu.crf import CrfParams, mean_field, mean_field_naive, unary_from_probability
from semgrid_edu.grid import GridSpec

N_CLASSES = 14
ROUNDS = 15


def street(shape: tuple[int, int], seed: int) -> tuple[NDArray, NDArray, NDArray]:
    """Make up unary (C, H, W), values (4, H, W) and the true labels (H, W)."""
    rng = np.random.default_rng(seed)

    def patches(count: int) -> NDArray:
        return np.argmax([gaussian_filter(rng.normal(size=shape), 4) for _ in range(count)], axis=0)

    truth, state = patches(N_CLASSES), patches(4)
    scores = 2 * np.eye(N_CLASSES)[truth] + 1.5 * rng.normal(size=(*shape, N_CLASSES))
    belief = 5 * np.eye(4)[state] + 0.5 * rng.normal(size=(*shape, 4))
    unary = unary_from_probability(softmax(scores, axis=-1).transpose(2, 0, 1))
    return unary, softmax(belief, axis=-1).transpose(2, 0, 1), truth


def partner(unary: NDArray, values: NDArray, params: CrfParams, iterations: int = 10) -> NDArray:
    """Do the same with pydensecrf2, which filters in six dimensions and keeps a cell's word to itself."""
    n_classes, height, width = unary.shape
    place = np.indices((height, width))
    crf = densecrf.DenseCRF(height * width, n_classes)
    crf.setUnaryEnergy(np.ascontiguousarray(unary.reshape(n_classes, -1), dtype=np.float32))
    bilateral = np.concatenate([place / params.sigma_alpha, values / params.sigma_beta]).reshape(6, -1)
    spatial = (place / params.sigma_gamma).reshape(2, -1)
    for features, weight in ((bilateral, params.w_bilateral), (spatial, params.w_spatial)):
        crf.addPairwiseEnergy(
            np.ascontiguousarray(features, dtype=np.float32),
            compat=weight,
            kernel=densecrf.DIAG_KERNEL,
            normalization=densecrf.NORMALIZE_SYMMETRIC,
        )
    return np.asarray(crf.inference(iterations)).reshape(unary.shape)


def main() -> None:
    """Print times, their ratio and how far results agree."""
    params = CrfParams()
    for name, spec in (("compact", GridSpec.compact()), ("paper", GridSpec.paper())):
        unary, values, truth = street(spec.shape, seed=0)
        ours, theirs = mean_field(unary, values, params), partner(unary, values, params)
        fast, slow = best_times(
            [lambda u=unary, v=values: mean_field(u, v, params), lambda u=unary, v=values: partner(u, v, params)],
            ROUNDS,
        )
        print(f"{name} {spec.shape}: mean_field {fast:.1f} ms, pydensecrf2 {slow:.1f} ms, ratio {slow / fast:.2f}")
        accuracy = [(q.argmax(axis=0) == truth).mean() for q in (-unary, ours, theirs)]
        print("  accuracy without CRF {:.3f}, mean_field {:.3f}, pydensecrf2 {:.3f};".format(*accuracy), end=" ")
        print(f"same label in {(ours.argmax(axis=0) == theirs.argmax(axis=0)).mean():.3f} of cells")
    unary, values, _ = street((40, 30), seed=0)
    exact, ours, theirs = (f(unary, values, params) for f in (mean_field_naive, mean_field, partner))
    naive, fast = best_times(
        [lambda: mean_field_naive(unary, values, params), lambda: mean_field(unary, values, params)], ROUNDS
    )
    print(f"small (40, 30): mean_field_naive {naive:.1f} ms, mean_field {fast:.1f} ms, ratio {naive / fast:.1f}")
    for label, q in (("mean_field", ours), ("pydensecrf2", theirs)):
        same = (q.argmax(axis=0) == exact.argmax(axis=0)).mean()
        print(
            f"  {label} against exact: mean |dQ| {abs(q - exact).mean():.5f}, max {abs(q - exact).max():.3f}, ", end=""
        )
        print(f"same label in {same:.3f} of cells")


if __name__ == "__main__":
    main()
