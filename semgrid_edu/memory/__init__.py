"""The stage `remember`, g -> g over frames: classes that earlier images gave a cell, as long as they hold (section 3).

The paper's semantic grid is made from the last image alone. Here class beliefs are kept in a map that scrolls under the
vehicle by whole cells, as the occupancy filter's map does. In reading order: `class_memory`, `drives`.
"""

from semgrid_edu.memory.class_memory import (
    ClassMemory,
    Look,
    MemoryParams,
    MemoryState,
    View,
    carry_classes,
    learn_classes,
    look_at,
    recall_classes,
)
from semgrid_edu.memory.drives import remember_drive, smooth_drive

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
