"""Kinds and materials of surfaces, and the class of each kind in the label sets of section 4."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.labels import IGNORE, LabelSet
from semgrid_edu.storage.files import table_beside

_TABLES = table_beside(__file__)
Kind = IntEnum("Kind", tuple(_TABLES["classes"]), start=0, module=__name__)
"""The object that a surface belongs to; finer than both label sets, so both can be derived from it."""
Material = IntEnum("Material", tuple(_TABLES["reflectance"]), start=0, module=__name__)
"""The material of a surface; decides its texture, gloss and LIDAR reflectance."""
REFLECTANCE = np.array(tuple(_TABLES["reflectance"].values()), np.float32)
"""Share of 905 nm light that each `Material` reflects (1: retroreflective plates and signs)."""
PALETTES = _TABLES["palettes"]
"""Linear colours to choose from, such as "paint" and "clothes"."""


def class_of_kind(label_set: LabelSet) -> NDArray[np.uint8]:
    """Return the class of every `Kind` in a label set.

    In KITTI-14, poles are signage and lane marks are road. SYNTHIA-10 has no class for pedestrians, bicycles and sky:
    they are void. A cyclist is one road user, so rider and bicycle are both `Kind.BICYCLE`.

    Parameters
    ----------
    label_set : LabelSet
        The target classes.

    Returns
    -------
    (256,) uint8
        Lookup table from kinds to classes; 255 (unlabelled) stays 255.
    """
    table = np.full(256, IGNORE, dtype=np.uint8)
    for kind, names in zip(Kind, _TABLES["classes"].values(), strict=True):
        table[kind] = label_set.index(next(name for name in (*names, "void") if name in label_set.names))
    return table
