"""Tables of the errors of labels made from LIDAR: by policy, class and distance."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from semgrid_edu.workshop.scoring.confusions import band_names
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, per_cent
from worlds.lecture_09_counts import counts_of


def policy_table(result: dict) -> str:
    """Return one row per policy, over all classes and distances, per cent; "mean iou" is the mean over the classes.

    Parameters
    ----------
    result : dict
        From `truth_policies`, or from the JSON file that it was written to.
    """
    of = {name: counts_of(result, name) for name in result["sums"]}
    rows = [one.shares(axis=(0, 1)) | {"mean iou": np.nanmean(one.shares(axis=0)["iou"])} for one in of.values()]
    return _table({column: [row[column] for row in rows] for column in rows[0]}, of)


def class_table(result: dict, name: str) -> str:
    """Return one row per class of one policy, over all distances, per cent.

    Parameters
    ----------
    result : dict
        From `truth_policies`, or from the JSON file that it was written to.
    name : str
        The name of the policy.
    """
    return _table(counts_of(result, name).shares(axis=0), result["classes"])


def distance_table(result: dict, name: str) -> str:
    """Return one row per band of distance of one policy, over all classes. Parameters are those of `class_table`."""
    return _table(counts_of(result, name).shares(axis=1), band_names(result["bands"]))


def _table(shares: dict[str, ArrayLike], names: Iterable[str]) -> str:
    """Return one row per entry of the shares, one column per share."""
    texts = ([per_cent(None if np.isnan(share) else share) for share in column] for column in shares.values())
    return markdown_table([["per cent", *shares], *([*row] for row in zip(names, *texts, strict=True))])


def truth_tables(result: dict) -> str:
    """Return all policies, then classes and distances of the first one, each table under its title.

    Parameters
    ----------
    result : dict
        From `truth_policies`, or from the JSON file that it was written to.
    """
    first = next(iter(result["sums"]))
    return (
        f"{len(result['drives'])} drives\n\n{policy_table(result)}\n\n"
        f"{first}, by class\n\n{class_table(result, first)}\n\n{first}, by distance\n\n{distance_table(result, first)}"
    )
