"""Time the fast mean field against pydensecrf2 and the book's: `python benchmarks/bench_crf.py`.

The street is made up: classes in patches, noisy network scores, occupancy states in other patches. All take turns, so
that a busy machine slows all of them; the best of the rounds counts. Every time includes the set-up of the kernels.
pydensecrf2 gets the four state probabilities as they are (six features of a point) or, since they sum to one, as three
numbers with the same distances (five features, as `mean_field` has them).
"""

import os
import subprocess
import sys
import tempfile

import numba
import numpy as np
import pydensecrf.densecrf as densecrf
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.special import softmax
from timing import best_times

from semgrid_edu import crf
from semgrid_edu.crf import CrfParams, mean_field_naive, unary_from_probability
from semgrid_edu.fast import mean_field
from semgrid_edu.grid import GridSpec

N_CLASSES = 14
ROUNDS = 15
BOOK_ROUNDS = 3

ZERO_SUM = np.array([[1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]]) / 2
"""Takes four probabilities to three numbers, and keeps distances."""

FIRST_CALL = """
import time
import numpy as np
from semgrid_edu.crf import CrfParams
from semgrid_edu.fast import mean_field
start = time.perf_counter()
mean_field(np.zeros((2, 3, 3)), np.full((4, 3, 3), 0.25), CrfParams())
print(time.perf_counter() - start)
"""


def street(shape: tuple[int, int], seed: int, n_classes: int = N_CLASSES) -> tuple[NDArray, NDArray, NDArray]:
    """Make up unary (C, H, W), values (4, H, W) and the true labels (H, W)."""
    rng = np.random.default_rng(seed)

    def patches(count: int) -> NDArray:
        return np.argmax([gaussian_filter(rng.normal(size=shape), 4) for _ in range(count)], axis=0)

    truth = patches(n_classes)
    state = patches(4)
    scores = 2 * np.eye(n_classes)[truth] + 1.5 * rng.normal(size=(*shape, n_classes))
    belief = 5 * np.eye(4)[state] + 0.5 * rng.normal(size=(*shape, 4))
    unary = unary_from_probability(softmax(scores, axis=-1).transpose(2, 0, 1))
    return unary, softmax(belief, axis=-1).transpose(2, 0, 1), truth


def partner(unary: NDArray, values: NDArray, params: CrfParams, state_features: NDArray | None = None) -> NDArray:
    """Do the same with pydensecrf2, which doesn't subtract what a cell tells itself."""
    state = values if state_features is None else np.einsum("ks,shw->khw", state_features, values)
    n_classes, height, width = unary.shape
    place = np.indices((height, width))
    dense = densecrf.DenseCRF(height * width, n_classes)
    dense.setUnaryEnergy(np.ascontiguousarray(unary.reshape(n_classes, -1), dtype=np.float32))
    bilateral = np.concatenate([place / params.sigma_alpha, state / params.sigma_beta]).reshape(-1, height * width)
    spatial = (place / params.sigma_gamma).reshape(2, -1)
    for features, weight in ((bilateral, params.w_bilateral), (spatial, params.w_spatial)):
        dense.addPairwiseEnergy(
            np.ascontiguousarray(features, dtype=np.float32),
            compat=weight,
            kernel=densecrf.DIAG_KERNEL,
            normalization=densecrf.NORMALIZE_SYMMETRIC,
        )
    return np.asarray(dense.inference(10)).reshape(unary.shape)


def compare(name: str, shape: tuple[int, int], threads: int) -> None:
    """Print the times of all, and how many times as long as `fast.mean_field` pydensecrf2 and the book take."""
    unary, values, _ = street(shape, seed=0)
    params = CrfParams()
    numba.set_num_threads(threads)
    ours, six, five = best_times(
        [
            lambda: mean_field(unary, values, params),
            lambda: partner(unary, values, params),
            lambda: partner(unary, values, params, ZERO_SUM),
        ],
        ROUNDS,
    )
    (book,) = best_times([lambda: crf.mean_field(unary, values, params)], BOOK_ROUNDS)
    print(f"{name} {shape}, threads: {threads}: fast.mean_field {ours:.1f} ms; pydensecrf2 ", end="")
    print(f"6-D {six:.1f} ms, ratio {six / ours:.2f}; 5-D {five:.1f} ms, ratio {five / ours:.2f}; ", end="")
    print(f"the book's {book:.0f} ms, ratio {book / ours:.1f}")


def agreement() -> None:
    """Print how often labels are right, and how far results on a small grid lie from the written-out twin's."""
    params = CrfParams()
    unary, values, truth = street(GridSpec.paper().shape, seed=0)
    ours = mean_field(unary, values, params)
    theirs = partner(unary, values, params)
    accuracy = [(q.argmax(axis=0) == truth).mean() for q in (-unary, ours, theirs)]
    print("accuracy without CRF {:.3f}, mean_field {:.3f}, pydensecrf2 {:.3f};".format(*accuracy), end=" ")
    print(f"same label in {(ours.argmax(axis=0) == theirs.argmax(axis=0)).mean():.3f} of cells")
    unary, values, _ = street((40, 30), seed=0)
    exact = mean_field_naive(unary, values, params)
    for label, q in (
        ("mean_field", mean_field(unary, values, params)),
        ("pydensecrf2", partner(unary, values, params)),
    ):
        error = abs(q - exact)
        same = (q.argmax(axis=0) == exact.argmax(axis=0)).mean()
        print(f"  {label} against mean_field_naive, 40 x 30 cells: mean |dQ| {error.mean():.5f}, ", end="")
        print(f"max {error.max():.3f}, same label in {same:.3f} of cells")


def growth() -> None:
    """Print a table: the time as cells or classes become more, and the time for each of them."""
    print("| cells | classes | ms | ns for a cell and class |\n|---:|---:|---:|---:|")
    cases = [((rows, 155), N_CLASSES) for rows in (89, 178, 355, 710)] + [((355, 155), n) for n in (2, 7, 28, 56)]
    for shape, n_classes in cases:
        unary, values, _ = street(shape, 0, n_classes)
        (ms,) = best_times([lambda u=unary, v=values: mean_field(u, v, CrfParams())], ROUNDS)
        print(f"| {unary[0].size} | {n_classes} | {ms:.1f} | {1e6 * ms / unary.size:.0f} |")


def first_calls() -> None:
    """Print how long a process waits for its first result: compiled anew, and loaded from the cache on disk."""
    with tempfile.TemporaryDirectory() as folder:
        for label in ("compiled", "loaded from the cache"):
            command = [sys.executable, "-c", FIRST_CALL]
            environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
            seconds = subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout
            print(f"first call, {label}: {float(seconds):.1f} s")


def main() -> None:
    """Print times, their ratio and how far results agree."""
    most = numba.get_num_threads()
    for threads in range(min(2, most), 0, -1):
        compare("paper", GridSpec.paper().shape, threads)
        compare("compact", GridSpec.compact().shape, threads)
    numba.set_num_threads(most)
    agreement()
    growth()
    first_calls()


if __name__ == "__main__":
    main()
