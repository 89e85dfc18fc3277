"""The policy laboratory's results as Markdown tables: by policy, by class, by distance (section 4)."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.workshop.scoring.confusions import band_names
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, per_cent
from semgrid_edu.workshop.studies.ground_truth.truth_policies import counts_of

COLUMNS = ("found", "mistaken", "missed", "wrong", "hidden", "iou")
"""Shares of `TruthCounts.shares`, in the order of the columns."""


def policy_table(result: dict) -> str:
    """Return one row per policy, over all classes and distances, per cent.

    "mean iou" is the mean over the classes that occur.

    Parameters
    ----------
    result : dict
        From `truth_policies`, or from the JSON file that it was written to.

    Returns
    -------
    str
    """
    rows = [["per cent", *COLUMNS, "mean iou"]]
    for name in result["sums"]:
        counts = counts_of(result, name)
        shares, mean = counts.shares(axis=(0, 1)), np.nanmean(counts.shares(axis=0)["iou"])
        rows.append([name, *(_cell(shares[column]) for column in COLUMNS), _cell(mean)])
    return markdown_table(rows)


def class_table(result: dict, name: str) -> str:
    """Return one row per class of one policy, over all distances, per cent.

    Parameters
    ----------
    result : dict
        From `truth_policies`, or from the JSON file that it was written to.
    name : str
        The name of the policy.

    Returns
    -------
    str

    Raises
    ------
    ArgumentError
        When the result has no such policy.
    """
    return _table(counts_of(result, name).shares(axis=0), result["classes"])


def distance_table(result: dict, name: str) -> str:
    """Return one row per band of distance of one policy, over all classes, per cent.

    Parameters, result and errors are those of `class_table`.
    """
    return _table(counts_of(result, name).shares(axis=1), band_names(result["bands"]))


def truth_tables(result: dict) -> str:
    """Return all policies, then classes and distances of the first one, each table under its title.

    Parameters and result are those of `policy_table`.
    """
    first = next(iter(result["sums"]))
    tables = {
        f"{len(result['drives'])} drives": policy_table(result),
        f"{first}, by class": class_table(result, first),
        f"{first}, by distance": distance_table(result, first),
    }
    return "\n\n".join(f"{title}\n\n{table}" for title, table in tables.items())


def _table(shares: dict[str, NDArray], names: Iterable[str]) -> str:
    """Return one row per entry of the shares."""
    rows = [[name, *(_cell(shares[column][k]) for column in COLUMNS)] for k, name in enumerate(names)]
    return markdown_table([["per cent", *COLUMNS], *rows])


def _cell(share: float) -> str:
    return per_cent(None if np.isnan(share) else float(share))
