"""What things are and what they are made of, and the class that each label set of section 4 gives them."""

import tomllib
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.labels import IGNORE, LabelSet


class Kind(IntEnum):
    """What a surface belongs to: finer than either label set, so that both can be derived."""

    ROAD = 0
    LANE = 1
    SIDEWALK = 2
    GRASS = 3
    PLANT = 4
    CAR = 5
    PEDESTRIAN = 6
    BICYCLE = 7
    BUILDING = 8
    SIGN = 9
    POLE = 10
    FENCE = 11
    SKY = 12


class Material(IntEnum):
    """What a surface is made of: decides its texture, its gloss and its LIDAR reflectance."""

    MATTE = 0
    GROUND = 1
    PLASTER = 2
    BRICK = 3
    TILES = 4
    WOOD = 5
    GLASS = 6
    PAINT = 7
    METAL = 8
    BARK = 9
    LEAF = 10
    CLOTH = 11
    RUBBER = 12
    LAMP = 13
    RETRO = 14
    # these three stop only a part of the rays, by chance
    WIRE = 15
    PANE = 16
    TWIGS = 17


REFLECTANCE = np.array(
    [0.35, 0.25, 0.45, 0.35, 0.3, 0.4, 0.08, 0.3, 0.4, 0.25, 0.4, 0.3, 0.06, 0.7, 1.0, 0.4, 0.01, 0.4], dtype=np.float32
)
"""Share of 905 nm light that each `Material` sends back (1: retroreflective plates and signs)."""

PALETTES = {
    name: tuple(map(tuple, colours))
    for name, colours in tomllib.loads(Path(__file__).with_name("palettes.toml").read_text(encoding="utf-8")).items()
}
"""Linear colours of what comes in several, by what wears them."""

_KITTI_NAMES = {"lane": "road", "sign": "signage", "pole": "signage"}


def class_of_kind(label_set: LabelSet) -> NDArray[np.uint8]:
    """Return the class of every `Kind` in a label set.

    In KITTI-14, poles are signage and lane marks are road. SYNTHIA-10 has no class for pedestrians, bicycles and sky:
    they are void. A cyclist is one road user, so rider and bicycle are both `Kind.BICYCLE`.

    Parameters
    ----------
    label_set : LabelSet
        The classes to translate to.

    Returns
    -------
    (256,) uint8
        A table to index with kinds; 255 (unlabelled) stays 255.
    """
    table = np.full(256, IGNORE, dtype=np.uint8)
    for kind in Kind:
        name = "vegetation" if kind in (Kind.GRASS, Kind.PLANT) else kind.name.lower()
        candidates = (name, _KITTI_NAMES.get(name), "void")
        table[kind] = label_set.index(next(c for c in candidates if c in label_set.names))
    return table
