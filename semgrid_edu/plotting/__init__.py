"""Figures for lectures, demo and experiments in a consistent style: maps, images, charts, animations.

Every function with a parameter `ax` draws into these Axes, by default into a new figure, and returns the Axes. Grids
are drawn as top-down maps in metres: the x axis points up, which is forward, and the y axis to the left, so its numbers
decrease from left to right. Arrays are never flipped: row 0 is the farthest ahead, column 0 the leftmost.
"""

from semgrid_edu.plotting.animations import (
    MAX_ANIMATION_BYTES,
    Animation,
    animate,
    animate_occupancy,
    particles,
    velocity_wheel,
)
from semgrid_edu.plotting.charts import confusion, training_curves
from semgrid_edu.plotting.colours import (
    DEPTH_RANGE,
    HEADING_COLOURS,
    STATE_COLOURS,
    STATE_NAMES,
    WHEEL_SPEED,
    binary_states,
    class_legend,
    depth_colours,
    occupancy_colours,
    velocity_colours,
)
from semgrid_edu.plotting.grids import grid_labels, grid_values, label_maps, occupancy, velocity, velocity_arrows
from semgrid_edu.plotting.images import image_labels, points_on_image

FIGURE_DPI = 110
"""Dots per inch of all notebook figures: `plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI`."""

__all__ = [
    "DEPTH_RANGE",
    "FIGURE_DPI",
    "HEADING_COLOURS",
    "MAX_ANIMATION_BYTES",
    "STATE_COLOURS",
    "STATE_NAMES",
    "WHEEL_SPEED",
    "Animation",
    "animate",
    "animate_occupancy",
    "binary_states",
    "class_legend",
    "confusion",
    "depth_colours",
    "grid_labels",
    "grid_values",
    "image_labels",
    "label_maps",
    "occupancy",
    "occupancy_colours",
    "particles",
    "points_on_image",
    "training_curves",
    "velocity",
    "velocity_arrows",
    "velocity_colours",
    "velocity_wheel",
]
