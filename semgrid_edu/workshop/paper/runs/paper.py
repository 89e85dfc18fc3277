"""The numbers that the paper prints in its tables (section 4)."""

from semgrid_edu.metrics import METRICS


class _Names(dict):
    """The names of the paper's networks; any other network goes by its own name."""

    def __missing__(self, network: str) -> str:
        """Return the name of a network that the paper doesn't have."""
        return network


NETWORKS = _Names(segnet="SegNet", fcn="FCN", deeplab="DeepLab v2")
"""The image networks by the names of the paper, in the order of Table 1."""


def _shares(*per_cent: float) -> dict[str, float]:
    """Return a row of a table as shares by metric."""
    return {name: value / 100 for name, value in zip(METRICS, per_cent, strict=True)}


TABLE_1_SCORES = {
    ("segnet", False): _shares(81.1, 49.4, 69.8),
    ("segnet", True): _shares(81.2, 45.6, 69.6),
    ("fcn", False): _shares(79.8, 47.5, 68.6),
    ("fcn", True): _shares(80.0, 43.7, 68.2),
    ("deeplab", False): _shares(76.2, 36.9, 63.1),
    ("deeplab", True): _shares(76.9, 34.6, 63.3),
}
"""Table 1, on KITTI: by image network and whether the CRF refines its grids."""

TABLE_2_SCORES = {
    ("segnet", False): _shares(78.6, 35.3, 65.2),
    ("segnet", True): _shares(78.9, 33.3, 65.4),
}
"""Table 2, on INRIA-Chroma."""

TABLE_3_SCORES = _shares(72.0, 36.0, 73.0)
"""Below Table 3, on SYNTHIA."""

TABLE_3_CONFUSION = (
    (93.35, 0.42, 2.92, 0.12, 0.55, 0.86, 0.41, 1.01, 0.07, 0.29),
    (60.67, 30.26, 0.36, 5.02, 0.22, 2.29, 0.17, 0.54, 0.31, 0.16),
    (32.19, 0.33, 57.42, 1.25, 0.86, 0.17, 0.51, 2.35, 0.08, 4.85),
    (43.57, 9.70, 8.37, 30.38, 0.24, 1.47, 0.71, 2.52, 0.71, 2.33),
    (38.25, 0.77, 21.55, 0.10, 26.07, 0.41, 0.50, 7.61, 0.15, 4.59),
    (57.65, 0.73, 3.55, 0.25, 0.41, 32.68, 1.53, 2.45, 0.34, 0.40),
    (66.51, 0.17, 7.63, 1.30, 1.02, 0.98, 17.34, 2.79, 0.55, 1.71),
    (41.14, 0.82, 8.32, 0.05, 2.40, 0.34, 0.68, 44.93, 0.30, 1.02),
    (70.70, 0.40, 6.89, 1.11, 1.15, 1.97, 11.27, 0.65, 4.29, 1.57),
    (16.43, 0.33, 48.51, 2.43, 1.30, 0.17, 1.16, 2.61, 0.36, 26.69),
)
"""Table 3: row truth, column detected, per cent of the row; the classes of SYNTHIA-10 in their order."""
