"""The stories of all cells as bytes, which the page's script reads: rounded numbers, one map of the grid for each."""

import base64
import zlib
from collections.abc import Sequence
from dataclasses import asdict
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.camera import Camera
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LABEL_SETS
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.pipeline import FrameResult
from semgrid_edu.planes import plane_pixels
from semgrid_edu.plotting import STATE_COLOURS
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.demo.contributions import Contributions
from semgrid_edu.workshop.demo.evidence import VERDICTS, Sight
from semgrid_edu.workshop.demo.stories import frame_story
from semgrid_edu.workshop.demo.what_if import CHANGES, FAULTS

SENTENCES = table_beside(__file__, "words")
"""The sentences of a story by part and case; the page's script fills in the names in braces."""

STEPS = {"part": 0.1, "reach": 0.5, "distance": 0.1, "pixel": 1 / 32, "message": 0.1}
"""The steps to which numbers are rounded: parts of a score, metres, pixels, and what neighbours add.

A byte then holds parts up to 12.7, which nearly no plane exceeds, and a reach up to 127 m.
"""

NOT_SEEN = 2**16 - 1
"""Both coordinates of a point that the camera doesn't see."""

FILTER_STEPS = ("move", "predict", "update", "resample", "shown")
"""The steps of the filter after which the page shows the states, see `FrameStory.states`."""

Maps = dict[str, NDArray[np.uint8]]
"""By name (K, H, W); what doesn't fit into a byte has K high bytes followed by K low ones."""


class StoryMaps(NamedTuple):
    """Maps of bytes in the order in which they compress best.

    Parameters
    ----------
    alike : dict of str to (K, H, W) uint8
        Maps in which many cells have the same numbers: the bytes of a cell are stored side by side.
    smooth : dict of str to (K, H, W) uint8
        Maps that change little from row to row: one after the other, each row as the difference from the row before.
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
        n_cells = next(iter(self.smooth.values()))[0].size
        places = {}
        per_cell = sum(map(len, self.alike.values()))
        for at, maps, step, stride in ((0, self.alike, 1, per_cell), (per_cell * n_cells, self.smooth, n_cells, 1)):
            for name, part in maps.items():
                places[name] = [at, len(part), step, stride]
                at += len(part) * step
        return places


def frame_details(result: FrameResult, net: SemanticGridNet, past: Sequence[tuple[Frame, NDArray]] = ()) -> StoryMaps:
    """Collect what the page tells about the cells of a frame.

    Parameters
    ----------
    result, net, past
        As for `frame_story`, which does the work.

    Returns
    -------
    StoryMaps
        The same names with the same numbers of maps for every frame of a network.
    """
    story = frame_story(result, net, past)
    named = np.stack([story.label, story.rival, story.refined])
    before = np.take_along_axis(result.grid, named, axis=0)
    after = np.take_along_axis(result.refined, named, axis=0)
    messages = np.take_along_axis(story.neighbours.messages, named, axis=0)
    rows, cols = story.neighbours.steps
    unknown = np.full_like(story.label, IGNORE)
    alike = {
        "states": np.concatenate([states_bytes(story.states[step]) for step in FILTER_STEPS]),
        "obstacles": _bytes(story.scan.obstacles[None]),
        "ground": _bytes(story.scan.ground[None]),
        "verdict": _bytes(story.scan.verdict[None]),
        "reach": _bytes(story.scan.reach[None] / STEPS["reach"]),
        "classes": _bytes(np.stack([*named, story.truth])),
        "called": _bytes(story.called),
        "shown": _bytes(story.shown),
        "otherwise": _bytes(np.stack([story.otherwise.get(change, unknown) for change in CHANGES])),
        "fault": _bytes(story.fault[None]),
        "after": _bytes(255 * after),
        "strongest": _bytes(np.concatenate([rows + 128, cols + 128, story.neighbours.pull / STEPS["message"]])),
    }
    if story.sight is not None:
        alike["memory"] = _memory(result.remembered, story.sight, len(past))
    smooth = {
        "before": _bytes(255 * before),
        "messages": _bytes(messages / STEPS["message"]),
        **_parts(story.why),
    }
    return StoryMaps(alike, smooth)


def _memory(remembered: NDArray, sight: Sight, earlier: int) -> NDArray[np.uint8]:
    """Return class and per cent; frames since the last sight + 1, its class and tenths of a second; frames searched."""
    label = remembered.argmax(axis=0)
    probability = 100 * remembered.max(axis=0)
    numbers = [label, probability, sight.back + 1, sight.label, 10 * sight.seconds, np.full(label.shape, earlier)]
    return _wide(np.rint(np.stack(numbers)))


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


def _parts(why: Contributions) -> Maps:
    """Return what speaks for one class rather than another.

    The totals are the four states, then image, occupancy, constants and their sum. What rounding loses is counted among
    the constants, so that the page's numbers add up. "times" says how many times as probable the class is, as two
    digits and a power of ten.
    """
    sums = np.stack([*why.occupancy, why.planes.sum(axis=0), why.occupancy.sum(axis=0), why.score])
    *states, image, occupancy, total = np.rint(sums / STEPS["part"])
    power = np.floor(np.maximum(why.score, 0) / np.log(10))
    return {
        "planes": _bytes((why.planes / STEPS["part"]).clip(-127, 127) + 128),
        "scores": _bytes((why.classes / STEPS["part"]).clip(-127, 127) + 128),
        "totals": _wide(np.stack([*states, image, occupancy, total - image - occupancy, total]) + 2**15),
        "times": _bytes(np.stack([10 * np.exp(why.score - power * np.log(10)), power])),
    }


def cell_places(spec: GridSpec, heights: ArrayLike, camera: Camera) -> StoryMaps:
    """Return what is the same in every frame: a cell's distance, and the pixels of its points on the planes (eq. (1)).

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
    """Return what the page's script needs besides the maps of each frame, as plain numbers and text for JSON.

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
        The grid, the images' width, heights of the planes, whether the network sees those of returns, names and
        colours, the rounding, and the maps of all frames.
    """
    architecture = net.need_architecture()
    spec = architecture.grid
    label_set = LABEL_SETS[architecture.label_set]
    places = cell_places(spec, architecture.heights, camera)
    return {
        "grid": {**asdict(spec), "rows": spec.shape[0], "cols": spec.shape[1]},
        "width": camera.size[1],
        "heights": list(architecture.heights),
        "uses_return_heights": architecture.uses_return_heights,
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
