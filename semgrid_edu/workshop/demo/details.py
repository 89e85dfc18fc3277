"""What the page needs to tell the story of any cell of a frame: one byte map after the other, compressed.

What all stories of cells on a page have in common: the grid, the camera, the planes, the classes, the CRF.
"""

import base64
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import Camera
from semgrid_edu.crf import CrfParams, mean_field, unary_from_probability
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LABEL_SETS
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import PlanarMotion, SensorModel
from semgrid_edu.occupancy.polar import beams_of
from semgrid_edu.pipeline import FrameResult
from semgrid_edu.plotting import STATE_COLOURS
from semgrid_edu.story import ContributionMaps, contribution_maps

PART_STEP = 0.1
"""Parts of a score are rounded to this step; a byte reaches 12.7 to both sides, more than nearly every plane has."""

REACH_STEP = 0.5
"""How far a beam sees is rounded to this step, metres, so that a byte reaches 127 m."""

NO_TRUTH = 255
"""The byte of a cell whose truth isn't known."""

VERDICTS = ("silent", "passed", "ground", "hit")
"""What a scan can say of a cell, see `CellScan.verdict`; a byte holds the index."""

UPDATES = 10
"""Number of the CRF's updates, the default of `mean_field`."""

Maps = dict[str, NDArray[np.uint8]]


def frame_details(result: FrameResult, net: SemanticGridNet, truth: NDArray | None) -> Maps:
    """Collect what the page tells of the cells of a frame, rounded to bytes.

    Parameters
    ----------
    result : FrameResult
        The frame's result from the package's own stages, with the filter's steps.
    net : SemanticGridNet
        The network that made it.
    truth : (H, W) uint8 or None
        The true classes, where they are known.

    Returns
    -------
    dict of str to (K, H, W) uint8
        The same names with the same numbers of maps K for every frame of a network.
    """
    spec = net.need_architecture().grid
    o = result.belief.probability
    steps = {name: states_bytes(states) for name, states in {"shown": o, **result.belief.steps}.items()}
    parts = contribution_maps(net, result.scores, o)
    return steps | _said(result, spec) | _neighbours(result, spec) | _classes(result, truth, parts)


def states_bytes(probability: NDArray) -> NDArray[np.uint8]:
    """Round the four states of each cell to 255ths that sum to 255, and leave the last one out.

    Parameters
    ----------
    probability : (4, H, W) float
        Probabilities that sum to 1.

    Returns
    -------
    (3, H, W) uint8
        FREE, STATIC and DYNAMIC; UNKNOWN is what is missing from 255.
    """
    upto = np.rint(255 * np.clip(np.cumsum(probability[:3], axis=0), 0, 1)).astype(np.int64)
    return np.diff(np.maximum.accumulate(upto, axis=0), axis=0, prepend=0).astype(np.uint8)


def packed(maps: Mapping[str, NDArray[np.uint8]]) -> str:
    """Compress maps, one after the other.

    Parameters
    ----------
    maps : mapping of str to (K, H, W) uint8
        The maps.

    Returns
    -------
    str
        Data URI of a zlib stream.
    """
    raw = b"".join(np.ascontiguousarray(part).tobytes() for part in maps.values())
    return f"data:application/zlib;base64,{base64.b64encode(zlib.compress(raw, 6)).decode()}"


def _said(result: FrameResult, spec: GridSpec) -> Maps:
    """Return the numbers of returns, the reach of the beam and what the scan says: `cell_scan` for all cells."""
    sensor = SensorModel()
    scan = sensor.scan(result.frame.points_grid)
    rows, cols, inside = spec.cells(scan.points)
    height = scan.points[:, 2].astype(np.float64)
    obstacle = inside & (height >= sensor.obstacle_min) & (height <= sensor.obstacle_max)
    ground = inside & (height < sensor.obstacle_min)
    counts = [np.bincount(rows[k] * spec.shape[1] + cols[k], minlength=np.prod(spec.shape)) for k in (obstacle, ground)]
    x, y = spec.centers().reshape(-1, 2).T
    reach = scan.reach[beams_of(x, y, len(scan.reach))]
    evidence = scan.evidence(spec, PlanarMotion())
    beyond = (np.hypot(x, y) - reach).astype(np.float32)
    verdict = np.where(evidence.free.ravel() > evidence.occupied.ravel(), np.where(beyond <= -spec.cell / 2, 1, 2), 0)
    verdict[counts[0] > 0] = VERDICTS.index("hit")
    maps = {"obstacles": counts[0], "ground": counts[1], "verdict": verdict, "reach": np.rint(reach / REACH_STEP)}
    return {name: np.minimum(values, 255).astype(np.uint8).reshape(1, *spec.shape) for name, values in maps.items()}


def _neighbours(result: FrameResult, spec: GridSpec) -> Maps:
    """Return what every cell believed before the last update of the CRF."""
    unary = unary_from_probability(result.grid)
    Q = mean_field(unary, result.belief.probability, CrfParams.for_cells(spec.cell), UPDATES - 1)
    return {"neighbours": np.rint(255 * Q).astype(np.uint8)}


def _classes(result: FrameResult, truth: NDArray | None, parts: ContributionMaps) -> Maps:
    """Return the classes that are compared, their probabilities around the CRF, and the parts of the score."""
    known = np.full(result.grid.shape[1:], NO_TRUTH) if truth is None else truth
    label, rival = label_and_rival_maps(result.grid, known)
    refined = result.refined.argmax(axis=0)
    named = np.stack([label, rival, refined])
    before, after = (np.rint(255 * np.take_along_axis(g, named, axis=0)) for g in (result.grid, result.refined))

    def difference(part: NDArray) -> NDArray:
        of = [np.take_along_axis(part, c.reshape((1,) * (part.ndim - 2) + c.shape), axis=-3) for c in (label, rival)]
        return np.rint((of[0] - of[1])[..., 0, :, :] / PART_STEP)

    small = {name: difference(part) for name, part in (("planes", parts.by_plane), ("scores", parts.by_class))}
    large = np.concatenate([difference(parts.occupancy), difference(parts.score)[None]]).astype(np.int64) + 2**15
    return {
        "classes": np.stack([*named, known]).astype(np.uint8),
        "before": before.astype(np.uint8),
        "after": after.astype(np.uint8),
        **{name: (np.clip(part, -127, 127) + 128).astype(np.uint8) for name, part in small.items()},
        "large": np.concatenate([large >> 8, large & 255]).astype(np.uint8),
    }


def label_and_rival_maps(g: NDArray, truth: NDArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return each cell's most probable class and the one that it is compared with: `label_and_rival` for all cells.

    Parameters
    ----------
    g : (C, H, W) float
        The semantic grid.
    truth : (H, W) int
        The true classes; a number of no class where it isn't known.

    Returns
    -------
    label, rival : (H, W) int64
        Classes.
    """
    label, second = np.argsort(-g, axis=0, kind="stable")[:2]
    return label, np.where((truth != label) & (truth < len(g)), truth, second)


@dataclass(frozen=True)
class StoryData:
    """What the page's script needs besides the maps of each frame, as plain numbers for JSON.

    Parameters
    ----------
    grid : dict of str to float
        The fields of `GridSpec`, and "rows" and "cols".
    camera : dict of str to list of float
        "K" and "T_camera_from_grid" row by row, and "size" (h, w), of the camera at the size of the drive's images.
    heights : list of float
        Heights of the planes, metres.
    names : list of str
        Names of the classes.
    colours : dict of str to list of list of int
        Colours of the "classes" and of the "states".
    crf : dict of str to float or str
        The fields of `CrfParams`.
    layout : dict of str to int
        Names of the maps of a frame, in their order, and how many there are of each.
    verdicts : list of str
        What a scan can say of a cell.
    steps : dict of str to float
        How the numbers are rounded: "part" of a score, and "reach" of a beam in metres.
    """

    grid: dict[str, float]
    camera: dict[str, list[float]]
    heights: list[float]
    names: list[str]
    colours: dict[str, list[list[int]]]
    crf: dict[str, float | str]
    layout: dict[str, int]
    verdicts: list[str]
    steps: dict[str, float]

    @classmethod
    def of(cls, net: SemanticGridNet, camera: Camera, layout: dict[str, int]) -> "StoryData":
        """Gather it from a network and a camera.

        Parameters
        ----------
        net : SemanticGridNet
            The network of the package's results.
        camera : Camera
            The camera at the size of the drive's images.
        layout : dict of str to int
            The maps of a frame.

        Returns
        -------
        StoryData
            Plain numbers.
        """
        architecture = net.need_architecture()
        spec, label_set = architecture.grid, LABEL_SETS[architecture.label_set]
        matrices = {"K": camera.K, "T_camera_from_grid": camera.T_camera_from_grid}
        return cls(
            grid={**asdict(spec), "rows": spec.shape[0], "cols": spec.shape[1]},
            camera={**{name: matrix.ravel().tolist() for name, matrix in matrices.items()}, "size": list(camera.size)},
            heights=list(architecture.heights),
            names=list(label_set.names),
            colours={"classes": [list(c) for c in label_set.rgb], "states": [list(c) for c in STATE_COLOURS]},
            crf=asdict(CrfParams.for_cells(spec.cell)),
            layout=layout,
            verdicts=list(VERDICTS),
            steps={"part": PART_STEP, "reach": REACH_STEP},
        )
