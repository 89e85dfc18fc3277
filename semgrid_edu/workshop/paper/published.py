"""The numbers that the paper prints in its tables (section 4), from `paper.toml`."""

from semgrid_edu.metrics import METRICS
from semgrid_edu.storage.files import table_beside

_PRINTED = table_beside(__file__)


class _Names(dict):
    """The names of the paper's networks; any other network goes by its own name."""

    def __missing__(self, network: str) -> str:
        """Return the name of a network that the paper doesn't have."""
        return network


NETWORKS = _Names(segnet="SegNet", fcn="FCN", deeplab="DeepLab v2")
"""The image networks by the names of the paper, in the order of Table 1."""


def _shares(per_cent: list[float]) -> dict[str, float]:
    """Return scores as shares by metric."""
    return {name: value / 100 for name, value in zip(METRICS, per_cent, strict=True)}


def _scores(table: dict[str, list[list[float]]]) -> dict[tuple[str, bool], dict[str, float]]:
    """Return scores by image network and whether the CRF refines its grids."""
    return {(network, crf): _shares(rows[crf]) for network, rows in table.items() for crf in (False, True)}


TABLE_1_SCORES, TABLE_2_SCORES = _scores(_PRINTED["table1"]), _scores(_PRINTED["table2"])
"""Table 1, on KITTI, and Table 2, on INRIA-Chroma: by image network and whether the CRF refines its grids."""

TABLE_3_SCORES = _shares(_PRINTED["table3"]["scores"])
"""Below Table 3, on SYNTHIA."""

TABLE_3_CONFUSION = _PRINTED["table3"]["confusion"]
"""Table 3: row truth, column detected, per cent of the row; the classes of SYNTHIA-10 in their order."""
