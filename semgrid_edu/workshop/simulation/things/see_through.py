"""Shapes that let a part of the light through: wire mesh, porous hedges and panes of glass; and posts."""

from functools import cache

import numpy as np

from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.primitives import box, quads, tube
from semgrid_edu.workshop.simulation.things.shapes import Shape, merge

_ZINC, _FRAME, _TWIGS = (0.33, 0.35, 0.35), (0.16, 0.17, 0.18), (0.05, 0.11, 0.028)
MESH_HEIGHT, PANE_HEIGHT = 1.95, 2.1
"""Heights of a fence of wire mesh and of a row of panes, metres."""


@cache
def mesh_frame(length: float) -> Shape:
    """Make what is solid of a piece of wire mesh fence from the origin along x: a post at its start, a rail on top.

    Parameters
    ----------
    length : float
        Distance to the next post, metres.

    Returns
    -------
    Shape
    """
    post = box((0, 0, MESH_HEIGHT / 2 - 0.3), (0.06, 0.06, MESH_HEIGHT + 0.7), _ZINC, Material.METAL, Kind.FENCE)
    rail = box((length / 2, 0, MESH_HEIGHT - 0.02), (length, 0.03, 0.04), _ZINC, Material.METAL, Kind.FENCE)
    return merge([post, rail])


@cache
def mesh_sheet(length: float) -> Shape:
    """Make the wire mesh of a piece of fence, as a sheet of `Material.WIRE` from the origin along x.

    Parameters
    ----------
    length : float
        Length of the piece, metres.

    Returns
    -------
    Shape
    """
    return quads((0, 0, 0.05), (length, 0, 0), (0, 0, MESH_HEIGHT - 0.05), _ZINC, Material.WIRE, Kind.FENCE)


def porous_hedge(length: float, thickness: float, height: float) -> Shape:
    """Make a piece of hedge from the origin along x, as a volume of `Material.TWIGS`.

    Parameters
    ----------
    length, thickness, height : float
        Its sides along x, y and z, metres.

    Returns
    -------
    Shape
    """
    size = (length, thickness, height + 0.5)
    return box((length / 2, 0, height / 2 - 0.25), size, _TWIGS, Material.TWIGS, Kind.PLANT)


@cache
def pane_frame(length: float) -> Shape:
    """Make what is solid of one pane from the origin along x: a post at its start, rails below and above the glass.

    Parameters
    ----------
    length : float
        Distance to the next post, metres.

    Returns
    -------
    Shape
    """
    post = box((0, 0, PANE_HEIGHT / 2), (0.06, 0.06, PANE_HEIGHT + 0.2), _FRAME, Material.METAL, Kind.FENCE)
    rails = [box((length / 2, 0, z), (length, 0.05, 0.06), _FRAME, Material.METAL, Kind.FENCE) for z in (0.2, 2.05)]
    return merge([post, *rails])


@cache
def pane(length: float) -> Shape:
    """Make a pane of glass that shows what is behind it, as a sheet of `Material.PANE` from the origin along x.

    Parameters
    ----------
    length : float
        Length of the pane, metres.

    Returns
    -------
    Shape
    """
    return quads((0, 0, 0.23), (length, 0, 0), (0, 0, PANE_HEIGHT - 0.3), _FRAME, Material.PANE, Kind.FENCE)


@cache
def bollard(height: float, radius: float) -> Shape:
    """Make a post without a fence on the origin.

    Parameters
    ----------
    height, radius : float
        Its size above the ground, metres.

    Returns
    -------
    Shape
    """
    return tube((0, 0, -0.5), (0, 0, height), (radius, radius), np.multiply(_ZINC, 0.8), Material.METAL, Kind.POLE, 9)
