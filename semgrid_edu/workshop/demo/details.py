"""The numbers from which the page tells the story of any cell, rounded to bytes, one map of the grid for each."""

import base64
import zlib
from collections.abc import Sequence
from dataclasses import asdict
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.camera import Camera
from semgrid_edu.crf import CrfParams
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LABEL_SETS
from semgrid_edu.networks import Architecture, SemanticGridNet
from semgrid_edu.occupancy import SensorModel
from semgrid_edu.pipeline import FrameResult
from semgrid_edu.planes import plane_pixels
from semgrid_edu.plotting import STATE_COLOURS
from semgrid_edu.story import ContributionMaps, contribution_maps, last_sight, scan_maps, what_if
from semgrid_edu.story.cell_evidence import VERDICTS, classes_at
from semgrid_edu.story.cell_story import label_and_rival
from semgrid_edu.story.crf_messages import beliefs_before_last_update, neighbour_messages, strongest_neighbours
from semgrid_edu.story.what_if import CHANGES
from semgrid_edu.story.words import FAULTS, SENTENCES, faults

STEPS = {"part": 0.1, "reach": 0.5, "distance": 0.1, "pixel": 1 / 32, "message": 0.1}
"""To what the numbers are rounded: parts of a score, metres, pixels, and what neighbours add.

A byte then holds parts up to 12.7, which nearly every plane stays below, and a reach up to 127 m.
"""

NOT_SEEN = 2**16 - 1
"""Both coordinates of a point that the camera doesn't see."""

FILTER_STEPS = ("move", "predict", "update", "resample", "shown")
"""After which of the filter's steps the states are told, see `CellStory.steps`."""

Maps = dict[str, NDArray[np.uint8]]
"""By name (K, H, W); what doesn't fit into a byte has K high bytes followed by K low ones."""


class StoryMaps(NamedTuple):
    """Maps of bytes in the order in which they compress best.

    Parameters
    ----------
    alike : dict of str to (K, H, W) uint8
        Maps of which a cell has often what another cell has: all bytes of a cell stand together.
    smooth : dict of str to (K, H, W) uint8
        Maps that change little from row to row: one after the other, each row as the difference to the one before.
    """

    alike: Maps
    smooth: Maps

    def packed(self) -> str:
        """Return the data URI of a zlib stream."""
        alike, smooth = (np.concatenate([*maps.values()]) for maps in self)
        rows = np.diff(smooth, axis=1, prepend=np.uint8(0))  # bytes wrap around, and so does their sum in the script
        raw = np.ascontiguousarray(alike.transpose(1, 2, 0)).tobytes() + rows.tobytes()
        compressor = zlib.compressobj(8, strategy=zlib.Z_FILTERED)
        stream = compressor.compress(raw) + compressor.flush()
        return f"data:application/zlib;base64,{base64.b64encode(stream).decode()}"

    def layout(self) -> dict[str, list[int]]:
        """Return for each name where its bytes begin, K, and the steps to a cell's next byte and to the next cell."""
        n_cells, places = next(iter(self.smooth.values()))[0].size, {}
        per_cell = sum(map(len, self.alike.values()))
        for at, maps, step, stride in ((0, self.alike, 1, per_cell), (per_cell * n_cells, self.smooth, n_cells, 1)):
            for name, part in maps.items():
                places[name] = [at, len(part), step, stride]
                at += len(part) * step
        return places


def frame_details(
    result: FrameResult, net: SemanticGridNet, truth: NDArray | None, past: Sequence[tuple[Frame, NDArray]] = ()
) -> StoryMaps:
    """Collect what the page tells of the cells of a frame.

    Parameters
    ----------
    result : FrameResult
        The frame's result from the package's own stages, with the filter's steps.
    net : SemanticGridNet
        The network that made it.
    truth : (H, W) uint8 or None
        The true classes, where they are known.
    past : sequence of (Frame, (H, W) int)
        The earlier frames, and what each by itself called the cells: for a result with memory.

    Returns
    -------
    StoryMaps
        The same names with the same numbers of maps for every frame of a network.
    """
    spec, o = net.need_architecture().grid, result.belief.probability
    params = CrfParams.for_cells(spec.cell)
    known = np.full(spec.shape, IGNORE) if truth is None else truth
    named = np.stack([*label_and_rival(result.grid, known), result.refined.argmax(axis=0)])
    before, after = (np.take_along_axis(g, named, axis=0) for g in (result.grid, result.refined))
    states = {"shown": o, **result.belief.steps}
    Q = beliefs_before_last_update(result.grid, o, params)
    messages = np.take_along_axis(neighbour_messages(Q, o, params), named, axis=0)
    (rows, cols), pull = strongest_neighbours(Q, named[2], o, params)
    alike = {
        "states": np.concatenate([states_bytes(states[step]) for step in FILTER_STEPS]),
        **_scan(result, spec),
        "classes": np.stack([*named, known]).astype(np.uint8),
        **_words(result, net, named, known),
        "after": _bytes(255 * after),
        "strongest": _bytes(np.concatenate([rows + 128, cols + 128, pull / STEPS["message"]])),
        **_memory(result, [*past, (result.frame, named[0])], net.need_architecture()),
    }
    smooth = {
        "before": _bytes(255 * before),
        "messages": _bytes(messages / STEPS["message"]),
        **_parts(contribution_maps(net, result.scores, o), *named[:2]),
    }
    return StoryMaps(alike, smooth)


def _words(result: FrameResult, net: SemanticGridNet, named: NDArray, truth: NDArray) -> Maps:
    """Return what the sentences of each cell are filled with: `CellStory`'s classes of pixels, `otherwise`, `fault`."""
    architecture, otherwise = net.need_architecture(), what_if(result, net)
    called, shown = classes_at(result, *plane_pixels(architecture.grid, architecture.heights, result.frame.camera))
    label, _, refined = named
    unknown = np.full_like(label, IGNORE)
    maps = {
        "called": called,
        "shown": shown,
        "otherwise": np.stack([otherwise.get(change, unknown) for change in CHANGES]),
        "fault": faults(label, refined, truth, otherwise)[None],
    }
    return {name: values.astype(np.uint8) for name, values in maps.items()}


def _memory(result: FrameResult, seen: Sequence[tuple[Frame, NDArray]], architecture: Architecture) -> Maps:
    """Return the numbers of `CellMemory` in its order, per cent and tenths of a second; nothing without memory."""
    if result.remembered is None:
        return {}
    frames, labels = zip(*seen, strict=True)
    sight = last_sight(frames, labels, architecture.grid, LABEL_SETS[architecture.label_set].n_semantic)
    ago = np.array([10 * (result.frame.time - frame.time) for frame in frames[::-1]])[np.maximum(sight.back, 0)]
    sure, label = 100 * result.remembered.max(axis=0), result.remembered.argmax(axis=0)
    earlier = np.full(label.shape, len(seen) - 1)
    return {"memory": _wide(np.rint(np.stack([label, sure, sight.back + 1, sight.label, ago, earlier])))}


def states_bytes(probability: NDArray) -> NDArray[np.uint8]:
    """Round the four states of each cell to 255ths that sum to 255.

    Parameters
    ----------
    probability : (4, H, W) float
        Probabilities that sum to 1.
    """
    upto = np.rint(255 * np.clip(np.cumsum(probability, axis=0), 0, 1)).astype(np.int64)
    upto[-1] = 255
    return np.diff(np.maximum.accumulate(upto, axis=0), axis=0, prepend=0).astype(np.uint8)


def _bytes(values: NDArray) -> NDArray[np.uint8]:
    return np.rint(values).clip(0, 255).astype(np.uint8)


def _wide(values: NDArray) -> NDArray[np.uint8]:
    """Return the high bytes of (K, H, W) numbers from 0 to 65535, then their low ones."""
    values = values.astype(np.int64)
    return np.concatenate([values >> 8, values & 255]).astype(np.uint8)


def _scan(result: FrameResult, spec: GridSpec) -> Maps:
    """Return the numbers of returns, the reach of the beam and what the scan says: `cell_scan` for all cells."""
    said = scan_maps(result.frame.points_grid, spec, SensorModel())
    rows, cols, inside = spec.cells(said.points)
    counts = {}
    for name, kind in (("obstacles", said.obstacle), ("ground", said.ground)):
        cells = (rows * spec.shape[1] + cols)[inside & kind]
        counts[name] = np.bincount(cells, minlength=said.verdict.size).reshape(1, *spec.shape)
    maps = {**counts, "verdict": said.verdict[None], "reach": said.reach[None] / STEPS["reach"]}
    return {name: _bytes(values) for name, values in maps.items()}


def _parts(parts: ContributionMaps, label: NDArray, rival: NDArray) -> Maps:
    """Return what speaks for one class rather than another.

    The totals are the four states, then image, occupancy, constants and their sum: what rounding loses is counted among
    the constants, so that the page's numbers add up. Last comes how many times as probable the class is, as two digits
    and a power of ten.
    """

    def difference(part: NDArray) -> NDArray:
        of = [np.take_along_axis(part, c.reshape((1,) * (part.ndim - 2) + c.shape), axis=-3) for c in (label, rival)]
        return (of[0] - of[1])[..., 0, :, :]

    planes, scores, states = map(difference, (parts.by_plane, parts.by_class, parts.occupancy))
    score = difference(parts.score)
    *tenths, image, occupancy, total = np.rint(
        np.stack([*states, planes.sum(axis=0), states.sum(axis=0), score]) / STEPS["part"]
    )
    power = np.floor(np.maximum(score, 0) / np.log(10))
    return {
        "planes": _bytes((planes / STEPS["part"]).clip(-127, 127) + 128),
        "scores": _bytes((scores / STEPS["part"]).clip(-127, 127) + 128),
        "totals": _wide(np.stack([*tenths, image, occupancy, total - image - occupancy, total]) + 2**15),
        "times": _bytes(np.stack([10 * np.exp(score - power * np.log(10)), power])),
    }


def cell_places(spec: GridSpec, heights: ArrayLike, camera: Camera) -> StoryMaps:
    """Return what holds of a cell in every frame: its distance, and the pixels of its points on the planes (eq. (1)).

    Parameters
    ----------
    spec : GridSpec
        The grid, (H, W).
    heights : (D,) float
        Heights of the planes, metres.
    camera : Camera
        The camera at the size of the drive's images.

    Returns
    -------
    StoryMaps
        "distance", and "pixels": u of the D points, then v.
    """
    pixels, visible = plane_pixels(spec, heights, camera)
    steps = np.where(visible[..., None], np.rint(pixels / STEPS["pixel"]), NOT_SEEN)
    alike = {"distance": _wide(np.rint(spec.distances()[None] / STEPS["distance"]))}
    return StoryMaps(alike, {"pixels": _wide(np.moveaxis(steps, -1, 0).reshape(-1, *spec.shape))})


def story_data(net: SemanticGridNet, camera: Camera, frame_layout: dict[str, list[int]]) -> dict[str, object]:
    """Gather what the page's script needs besides the maps of each frame, as plain numbers and text for JSON.

    Parameters
    ----------
    net : SemanticGridNet
        The network of the package's results.
    camera : Camera
        The camera at the size of the drive's images.
    frame_layout : dict of str to list of int
        `StoryMaps.layout` of the frames.

    Returns
    -------
    dict of str to object
        The grid, the images' width, heights of the planes, names and colours, the rounding, and the maps of all frames.
    """
    architecture = net.need_architecture()
    spec, label_set = architecture.grid, LABEL_SETS[architecture.label_set]
    places = cell_places(spec, architecture.heights, camera)
    return {
        "grid": {**asdict(spec), "rows": spec.shape[0], "cols": spec.shape[1]},
        "width": camera.size[1],
        "heights": list(architecture.heights),
        "names": label_set.names,
        "flat": label_set.flat,
        "colours": {"classes": label_set.rgb, "states": STATE_COLOURS},
        "verdicts": VERDICTS,
        "sentences": SENTENCES,
        "faults": FAULTS,
        "changes": CHANGES,
        "steps": STEPS,
        "layout": frame_layout,
        "filter_steps": FILTER_STEPS,
        "places": places.packed(),
        "places_layout": places.layout(),
    }
