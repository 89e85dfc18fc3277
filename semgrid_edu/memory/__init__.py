"""The stage `remember`, g -> g over frames: what earlier images said of a cell, kept where it still holds (section 3).

The paper's semantic grid knows only the last image. Here class beliefs are kept in a map that scrolls under the vehicle
by whole cells, as the occupancy filter's does. `notebooks/worlds/lecture_14_class_memory.py` is the exact model that
this approximates.
"""

from semgrid_edu.memory.class_map import ClassMap, View, remember_drive, smooth_drive
from semgrid_edu.memory.literal import carry_classes_literal, learn_classes_literal, recall_classes_literal
from semgrid_edu.memory.state import ClassMemory, Look, MemoryParams, look_at
from semgrid_edu.memory.steps import carry_classes, learn_classes, recall_classes

__all__ = [
    "ClassMap",
    "ClassMemory",
    "Look",
    "MemoryParams",
    "View",
    "carry_classes",
    "carry_classes_literal",
    "learn_classes",
    "learn_classes_literal",
    "look_at",
    "recall_classes",
    "recall_classes_literal",
    "remember_drive",
    "smooth_drive",
]
