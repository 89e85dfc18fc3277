"""Houses: walls with windows and doors, and a gable, hip or flat roof."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.workshop.simulation.things import shapes
from semgrid_edu.workshop.simulation.things.materials import PALETTES, Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import UP, Shape, cross, merge, quads

_DEEP = -2.5
"""Walls go this deep into the ground, metres, so that no gap opens on a slope."""
_box, _shape = partial(shapes.box, kind=Kind.BUILDING), partial(shapes.shape, kind=Kind.BUILDING)


@dataclass(frozen=True)
class House:
    """The plan of a house: x along the front, y away from the street, origin in the middle of the front.

    Parameters
    ----------
    width, depth : float
        Sides of the plan, metres.
    storeys : int
        Number of full storeys, 2.9 m each.
    roof : str
        "gable", "hip" or "flat".
    shop : bool
        Whether the ground floor is a shop window.
    seed : int
        Seed for colours, windows and the door.
    """

    width: float
    depth: float
    storeys: int
    roof: str
    shop: bool
    seed: int

    @property
    def eaves(self) -> float:
        """Height of the walls, metres."""
        return 2.9 * self.storeys + 0.5


def _pick(palette: str, rng: np.random.Generator) -> tuple[float, float, float]:
    return PALETTES[palette][rng.integers(len(PALETTES[palette]))]


def _walls(house: House) -> list[tuple[NDArray, NDArray, float]]:
    """Return origin, direction and length of the four walls, each left to right as seen from outside; front first."""
    w = house.width / 2
    d = house.depth
    corners = np.array([[-w, 0, 0], [w, 0, 0], [w, d, 0], [-w, d, 0]])
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(edges, axis=1)
    return [(c, e / n, n) for c, e, n in zip(corners, edges, lengths, strict=True)]


def _panel(corner, right, up, out: float, colour, material=Material.MATTE) -> Shape:
    """Place rectangles on a wall, `out` metres in front of it."""
    normal = cross(right, up)
    normal /= np.linalg.norm(normal)
    return quads(corner + out * normal, right, up, colour, material, Kind.BUILDING)


def _windows(origin, along, length: float, sills: NDArray, style: tuple, rng: np.random.Generator) -> list[Shape]:
    """Place a grid of windows on a wall: frame, two panes, optional sill and shutters."""
    spacing, (w, h), frame, shutters, has_sill = style
    n = max(int((length - 0.8) / spacing), 1)
    step = length / n
    x, z = (a.ravel() for a in np.meshgrid((np.arange(n) + 0.5) * step - w / 2, sills))
    keep = rng.random(len(x)) > 0.06
    x = x[keep]
    z = z[keep]
    corner = origin + x[:, None] * along + z[:, None] * UP
    curtain = rng.random((len(x), 1))
    pane = np.where(curtain < 0.3, 0.25, 0.02) * np.array([1.0, 1.02, 1.06]) * (0.6 + 0.8 * curtain)
    edge = 0.08
    parts = [_panel(corner, w * along, h * UP, 0.02, frame)]
    for k in range(2):
        inner = corner + (edge + k * (w / 2 - edge / 2 + 0.02)) * along + edge * UP
        parts.append(_panel(inner, (w / 2 - 1.25 * edge) * along, (h - 2 * edge) * UP, 0.04, pane, Material.GLASS))
    if has_sill:
        parts.append(_panel(corner - 0.1 * along - 0.12 * UP, (w + 0.2) * along, 0.12 * UP, 0.07, (0.45, 0.44, 0.42)))
    if shutters:
        for shift in (-0.5 * w - 0.02, w + 0.02):
            parts.append(_panel(corner + shift * along, 0.5 * w * along, h * UP, 0.05, shutters, Material.WOOD))
    return parts


def _front_door(origin, along, length: float, rng: np.random.Generator) -> list[Shape]:
    """Place a door with its frame, a window and a small canopy near the middle of the front."""
    at = origin + (length * rng.uniform(0.3, 0.6)) * along
    colour = _pick("doors", rng)
    out = cross(along, UP)
    return [
        _panel(at - 0.12 * along, 1.34 * along, 2.5 * UP, 0.06, (0.6, 0.58, 0.54)),
        _panel(at, 1.1 * along, 2.35 * UP, 0.08, colour, Material.WOOD),
        _panel(at + 0.25 * along + 1.4 * UP, 0.6 * along, 0.7 * UP, 0.1, (0.03, 0.03, 0.035), Material.GLASS),
        _box(at + 0.55 * along + 0.45 * out + 2.62 * UP, (1.9, 0.9, 0.1), (0.2, 0.19, 0.18), Material.MATTE),
    ]


def _shop_front(origin, along, length: float, rng: np.random.Generator) -> list[Shape]:
    """Place a shop's windows and sign board on the ground floor."""
    colour = np.array(_pick("shops", rng))
    n = max(int(length / 2.6), 1)
    step = (length - 0.8) / n
    corner = origin + (0.5 + np.arange(n) * step)[:, None] * along + 0.45 * UP
    letters = rng.uniform(0.15, 0.6, 9).cumsum()
    letters = letters[letters < length - 2.2]
    words = origin + (1.0 + letters)[:, None] * along + 3.1 * UP
    return [
        _panel(origin + 0.2 * along, (length - 0.4) * along, 3.0 * UP, 0.03, 0.5 * colour + 0.05),
        _panel(corner, (step - 0.25) * along, 2.3 * UP, 0.05, (0.05, 0.055, 0.06), Material.GLASS),
        _panel(origin + 0.2 * along + 2.9 * UP, (length - 0.4) * along, 0.75 * UP, 0.12, colour),
        _panel(words, 0.26 * along, 0.32 * UP, 0.14, (0.85, 0.83, 0.75)),
    ]


def _gable(house: House, tiles, wall, wall_material, rng: np.random.Generator) -> list[Shape]:
    """Build a gable roof with overhanging eaves and a chimney; its ridge is along the street or across it."""
    across = rng.random() < 0.4
    w = house.width / 2
    d = house.depth
    z = house.eaves
    span, run = (w, d / 2) if not across else (d / 2, w)
    rise = run * rng.uniform(0.6, 1.0)
    over = 0.45
    eave = (-run - over, -over * rise / run)
    ends = (-span - over, span + over)
    slope = np.array([(ends[0], *eave), (ends[1], *eave), (ends[1], 0, rise), (ends[0], 0, rise)])
    gable = np.array([[span, -run, 0], [span, run, 0], [span, 0, rise]])
    half_a_turn = np.array([-1.0, -1.0, 1.0])
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]) if across else np.eye(3)
    parts = [
        _shape((corners * flip) @ turn.T + [0, d / 2, z], faces, colour, material)
        for corners, faces, colour, material in (
            (slope, [[0, 1, 2], [0, 2, 3]], tiles, Material.TILES),
            (gable, [[0, 1, 2]], wall, wall_material),
        )
        for flip in (np.ones(3), half_a_turn)
    ]
    chimney = _box((0.5 * w, 0.6 * d, z + 0.9 * rise), (0.7, 0.6, 1.6), PALETTES["brick"][0], Material.BRICK)
    return [*parts, chimney]


def _hip(house: House, tiles) -> list[Shape]:
    """Build a hip roof."""
    w = house.width / 2 + 0.4
    d = house.depth + 0.8
    z = house.eaves
    over = 0.4
    rise = 0.35 * min(2 * w, d)
    ridge = max(w - d / 2, 0.3)
    eave = [(-w, -over, z), (w, -over, z), (w, d - over, z), (-w, d - over, z)]
    top = [(-ridge, house.depth / 2, z + rise), (ridge, house.depth / 2, z + rise)]
    faces = [[0, 1, 5], [0, 5, 4], [1, 2, 5], [2, 3, 4], [2, 4, 5], [3, 0, 4]]
    return [_shape(eave + top, faces, tiles, Material.TILES)]


def _flat(house: House, wall) -> list[Shape]:
    """Build a flat roof with a cornice."""
    w = house.width
    d = house.depth
    z = house.eaves
    cornice = 0.8 * np.asarray(wall) + 0.1
    return [
        _box((0, d / 2, z + 0.1), (w + 0.5, d + 0.5, 0.35), cornice, Material.PLASTER),
        _box((0.2 * w, 0.5 * d, z + 1.0), (2.5, 2.5, 1.6), (0.4, 0.4, 0.4), Material.PLASTER),
    ]


def _balconies(house: House, rng: np.random.Generator) -> list[Shape]:
    """Place a column of balconies on the front."""
    x = rng.uniform(-0.25, 0.25) * house.width
    parts = []
    for storey in range(1, house.storeys):
        z = 2.9 * storey + 0.45
        parts.append(_box((x, -0.6, z), (2.8, 1.2, 0.15), (0.5, 0.49, 0.47), Material.PLASTER))
        parts.append(_box((x, -1.18, z + 0.55), (2.8, 0.05, 0.95), (0.3, 0.34, 0.38), Material.METAL))
    return parts


def _draw_style(house: House, rng: np.random.Generator) -> tuple:
    """Draw the window style of a house: spacing, size, colours of frame and shutters, whether there are sills."""
    frame = (0.72, 0.71, 0.68) if rng.random() < 0.75 else (0.12, 0.08, 0.06)
    shutters = PALETTES["doors"][rng.integers(4)] if house.roof == "gable" and rng.random() < 0.45 else None
    size = (rng.uniform(1.0, 1.5), rng.uniform(1.35, 1.7))
    spacing = rng.uniform(2.2, 3.2) + (0.8 if shutters else 0)
    return spacing, size, frame, shutters, rng.random() < 0.7


def _body(house: House, wall, material: Material) -> list[Shape]:
    """Build the four walls as one box, with a darker plinth at the base."""
    w = house.width
    d = house.depth
    middle = house.depth / 2
    return [
        _box((0, middle, (house.eaves + _DEEP) / 2), (w, d, house.eaves - _DEEP), wall, material),
        _box((0, middle, (_DEEP + 0.5) / 2), (w + 0.06, d + 0.06, 0.5 - _DEEP), 0.5 * wall, Material.PLASTER),
    ]


def build_house(house: House) -> Shape:
    """Build a house.

    Parameters
    ----------
    house : House
        The plan of the house.
    """
    rng = np.random.default_rng([house.seed, 80])
    material = Material.BRICK if rng.random() < 0.3 else Material.PLASTER
    wall = np.array(_pick(material.name.lower(), rng)) * rng.uniform(0.8, 1.15, 3)
    tiles = np.array(_pick("tiles", rng)) * rng.uniform(0.8, 1.2)
    parts = _body(house, wall, material)
    style = _draw_style(house, rng)
    sills = 2.9 * np.arange(house.storeys) + 1.3
    front, *others = _walls(house)
    parts += _windows(*front, sills[1:] if house.shop else sills, style, rng)
    parts += (_shop_front if house.shop else _front_door)(*front, rng)
    parts += [window for side in others for window in _windows(*side, sills, style, rng)]
    if house.roof == "gable":
        parts += _gable(house, tiles, wall, material, rng)
    else:
        parts += _hip(house, tiles) if house.roof == "hip" else _flat(house, wall)
    if house.storeys >= 3 and rng.random() < 0.5:
        parts += _balconies(house, rng)
    return merge(parts)
