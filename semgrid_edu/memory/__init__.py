"""The stage `remember`, g -> g over frames: classes that earlier images gave a cell, as long as they hold (section 3).

The paper's semantic grid is made from the last image alone. Here class beliefs are kept in a map that scrolls under the
vehicle by whole cells, as the occupancy filter's map does. In reading order: `state`, `steps`, `class_memory`.
"""

from semgrid_edu.memory.class_memory import ClassMemory, View, remember_drive, smooth_drive
from semgrid_edu.memory.state import Look, MemoryParams, MemoryState, look_at
from semgrid_edu.memory.steps import carry_classes, learn_classes, recall_classes

__all__ = [
    "ClassMemory",
    "Look",
    "MemoryParams",
    "MemoryState",
    "View",
    "carry_classes",
    "learn_classes",
    "look_at",
    "recall_classes",
    "remember_drive",
    "smooth_drive",
]
