"""The paper's nine claims and what must hold for each, written down before the numbers were (section 4).

Verdicts are found as `verdicts` says.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from semgrid_edu.workshop.paper.reports.claim_statements import (
    effect_of_crf,
    effect_of_distance,
    effect_of_reduction,
    effect_on_new_routes,
    errors_on_perfect_data,
    geometry_and_learning,
    order_of_networks,
    overturned_cars,
    road_and_sidewalk,
)
from semgrid_edu.workshop.paper.reports.verdicts import Statement
from semgrid_edu.workshop.paper.runs.claim_runs import ClaimRuns


@dataclass(frozen=True)
class Claim:
    """One claim of the paper.

    Parameters
    ----------
    text : str
        What the paper says, in short.
    judged_by : str
        The statements that must hold, in words.
    statements : callable
        (runs, folder of all runs) -> the same statements with their numbers.
    """

    text: str
    judged_by: str
    statements: Callable[[ClaimRuns, Path], list[Statement]]


CLAIMS = {
    1: Claim(
        "With few training images SegNet is better than FCN, and FCN than DeepLab v2.",
        "each network of Table 1 is better than the next one in every metric.",
        order_of_networks,
    ),
    2: Claim(
        "The CRF raises pixel accuracy slightly and lowers class accuracy.",
        "for each network of Table 1, the CRF adds pixel accuracy and costs class accuracy.",
        effect_of_crf,
    ),
    3: Claim(
        "The same holds on a second data set, with routes not seen in training.",
        "claim 2 for SegNet, trained and tested on long routes, none of which is in both.",
        effect_on_new_routes,
    ),
    4: Claim(
        "On perfect data most errors are cells called void; road and car do well; lane markings are found surprisingly "
        "often; poles come out larger than they are.",
        "of the cells that are something and are called something else, more than half are called void; road and "
        "car are called right more often than the mean class; lane markings are called lane more often than the "
        "road beside them is; and more cells are called pole than are poles.",
        errors_on_perfect_data,
    ),
    5: Claim(
        "Closer objects are estimated better than distant ones.",
        "of the cells with a semantic class (true labels), more are called right up to 20 m than from 20 to 40 m, "
        "and there than beyond; and the same for the classes that stand.",
        effect_of_distance,
    ),
    6: Claim(
        "An upside-down car is still called a car, because the occupancy grid detects it.",
        "more than half of the cells of cars that lie on their tops are called car, and more than by a network that"
        " doesn't see the occupancy grid.",
        overturned_cars,
    ),
    7: Claim(
        "Road and sidewalk, both free in the occupancy grid, are told apart.",
        "of the road's cells that are called road or sidewalk, more than half are called road; likewise for the "
        "sidewalk; and the mean of both is higher than with what the occupancy grid alone can tell (true labels).",
        road_and_sidewalk,
    ),
    8: Claim(
        "The 1x1 reduction costs no accuracy and saves time.",
        "with the 1x1 reduction each metric is at most half a point lower than without, and a frame takes less time.",
        effect_of_reduction,
    ),
    9: Claim(
        "Geometry alone suffers from errors of calibration and segmentation; learning the fusion repairs them.",
        "image labels that are carried to the grid by geometry do better when they are true (errors of "
        "segmentation), and worse with a calibration that is one degree off in pitch (errors of calibration); the "
        "network does better than geometry with the network's labels, both with the right calibration and with the"
        " wrong one (true labels of the grid).",
        geometry_and_learning,
    ),
}
"""The nine claims by number."""
