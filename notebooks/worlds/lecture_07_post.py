"""The pixels along a post have the same label, but a soft-max per pixel doesn't know that."""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.graphical import Factor, eliminate, in_rows
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph, binary, directed, with_gaps


def post_pixels(pixels: int = 5, stays: float = 0.8, lead: float = 1.0) -> StageGraph:
    """Build the graph of the labels of neighbouring pixels along a post, and a network's scores of each.

    Parameters
    ----------
    pixels : int
        Number of pixels.
    stays : float
        Probability that the next pixel has the same label.
    lead : float
        The margin of the larger of the network's two scores: it is right with probability 1 / (1 + exp(-lead)).

    Returns
    -------
    StageGraph
        Variables x1, x2, ... (the labels: 0 something else, 1 post) and s1, s2, ... (the class with the larger score).
    """
    labels = [f"x{k}" for k in range(1, pixels + 1)]
    scores = [f"s{k}" for k in range(1, pixels + 1)]
    right = 1 / (1 + np.exp(-lead))
    factors = [binary(labels[0], 0.5)]
    factors += [Factor(pair, [[stays, 1 - stays], [1 - stays, stays]]) for pair in pairwise(labels)]
    factors += [Factor(pair, [[right, 1 - right], [1 - right, right]]) for pair in zip(labels, scores, strict=True)]
    return StageGraph(
        "Labels of pixels along a post",
        directed(factors),
        positions=in_rows(with_gaps(labels), (), with_gaps(scores)),
        observed=tuple(scores),
        equations={labels[-1]: "labels of the pixels", scores[-1]: "what the scores say"},
        cut=CUT,
    )


def believed_of_post(named: Sequence[int], stays: float = 0.8, lead: float = 1.0) -> NDArray[np.float64]:
    """Return P(post) of each pixel: exactly, and by a soft-max of the pixel's scores alone, (2, K).

    `named` is the class with the larger score in each pixel, 0 something else, 1 post.
    """
    model = post_pixels(len(named), stays, lead).model
    known = {f"s{k}": int(one) for k, one in enumerate(named, 1)}
    exact = [eliminate(model, f"x{k}", known).normalised().table[1] for k in range(1, len(named) + 1)]
    alone = 1 / (1 + np.exp(-lead * (2 * np.asarray(named) - 1)))
    return np.array([exact, alone])


@cache
def gap_in_a_post() -> Price:
    """P(post) of a pixel that the network gets wrong, between four that it gets right."""
    exact, alone = believed_of_post([1, 1, 0, 1, 1])[:, 2]
    return Price(exact, alone, "P(post) of a gap in a post")


CUT = (
    CutEdge(
        "x2 -> x3",
        "A soft-max per pixel takes labels as independent once the scores are known, so a gap in a post stays a gap: "
        "where the scores name post, post, something else, post, post, the pixel in the middle is post with 0.27 "
        "instead of 0.66.",
        ("x2", "x3"),
        gap_in_a_post,
    ),
)
"""The edges that a soft-max per pixel cuts."""
