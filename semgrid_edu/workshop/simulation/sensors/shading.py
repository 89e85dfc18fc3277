"""Shading: the radiance of each hit from material, sun, sky, gloss and haze, in one numba kernel."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.workshop.simulation.sensors.raycast import Hits, Instant
from semgrid_edu.workshop.simulation.street.ground import KERB_WIDTH, ground_kind, lane_mark
from semgrid_edu.workshop.simulation.street.layout import Road, outside_asphalt, to_road
from semgrid_edu.workshop.simulation.street.light import Light, noise_tile, sky_radiance, texture
from semgrid_edu.workshop.simulation.things.materials import Kind, Material


@njit(cache=True, fastmath=True)
def _asphalt(tile, road, s, d, blur, out):
    """Write the albedo of the carriageway; return whether the point is on a lane mark."""
    fade = 1.0 / (1.0 + 6.0 * blur)
    fine = (texture(tile, 40.0 * s, 40.0 * d) - 0.5) * fade
    broad = texture(tile, 1.7 * s + 91.0, 3.0 * d) - 0.5
    patch = texture(tile, 0.35 * s + 17.0, 0.9 * d + 5.0)
    grey = 0.115 + 0.05 * fine + 0.035 * broad
    if patch > 0.80:
        grey *= 0.72
    lane = (abs(d) % road.lane) / road.lane
    grey *= 1.0 - 0.10 * np.exp(-(((abs(lane - 0.5) - 0.22) / 0.09) ** 2))
    crack = abs(texture(tile, 2.3 * s, 2.3 * d + 50.0) - 0.5)
    if crack < 0.006 and patch < 0.5:
        grey *= 1.0 - 0.5 * fade
    mark = lane_mark(road, s, d, blur)
    worn = mark * (0.72 + 0.45 * (texture(tile, 9.0 * s, 9.0 * d) - 0.35))
    out[0] = out[1] = grey * (1 - worn) + 0.62 * worn
    out[2] = grey * 1.03 * (1 - worn) + 0.6 * worn
    return mark > 0.5


@njit(cache=True, fastmath=True)
def _paving(tile, s, e, stone, blur, out):
    """Write the albedo of a kerb of stone, or of sidewalk slabs."""
    fade = 1.0 / (1.0 + 4.0 * blur)
    grain = texture(tile, 30.0 * s, 30.0 * e) - 0.5
    broad = texture(tile, 2.0 * s, 2.0 * e + 40.0) - 0.5
    grey = (0.30 if stone else 0.25) + 0.05 * grain * fade + 0.05 * broad
    along, across = (s % 1.0, 1.0) if stone else (s % 0.5, e % 0.5)
    if min(along, across) < 0.025:
        grey *= 1.0 - 0.35 * fade
    if not stone:
        slab = texture(tile, 7.3 * np.floor(s / 0.5), 5.1 * np.floor(e / 0.5))
        grey *= 1.0 + 0.22 * (slab - 0.5) * fade
    out[0] = grey * 1.03
    out[1] = grey
    out[2] = grey * 0.94


@njit(cache=True, fastmath=True)
def _grass(tile, x, y, blur, out):
    """Write the albedo of grass: blades, tufts, dry and bare patches."""
    fade = 1.0 / (1.0 + 3.0 * blur)
    blade = (texture(tile, 60.0 * x, 60.0 * y) - 0.5) * fade
    tuft = texture(tile, 6.0 * x, 6.0 * y + 13.0) - 0.5
    dry = texture(tile, 0.8 * x + 7.0, 0.8 * y)
    light = 1.0 + 0.8 * blade + 0.6 * tuft
    red = 0.075 + 0.09 * dry * dry
    green = 0.135 + 0.03 * dry
    blue = 0.035 + 0.02 * dry
    out[0] = red * light
    out[1] = green * light
    out[2] = blue * light


@njit(cache=True, fastmath=True)
def _ground(tile, road, x, y, blur, out):
    """Write the albedo of the ground at (x, y); return its kind."""
    s, d = to_road(road, x, y)
    e = outside_asphalt(road, s, d)
    kind = ground_kind(road, s, d)
    if kind == Kind.ROAD:
        mark = _asphalt(tile, road, s, d, blur, out)
        out *= 1.0 - 0.3 * min(max((e + 0.35) / 0.35, 0.0), 1.0)
        return Kind.LANE if mark else kind
    if kind == Kind.SIDEWALK:
        _paving(tile, s if abs(d) < 40.0 else d, e, e < KERB_WIDTH, blur, out)
    else:
        _grass(tile, x, y, blur, out)
    return kind


@njit(cache=True, fastmath=True)
def _surface(tile, material, p, n, blur, out):
    """Apply the texture of the material to the albedo `out`."""
    u = -n[1] * p[0] + n[0] * p[1]
    v = p[2]
    if abs(n[2]) > 0.9:
        u = p[0]
        v = p[1]
    fade = 1.0 / (1.0 + 5.0 * blur)
    gain = 1.0
    if material == Material.PLASTER:
        fine = texture(tile, 25.0 * u, 25.0 * v) - 0.5
        broad = texture(tile, 2.5 * u, 1.2 * v) - 0.5
        gain = 1.0 + 0.16 * fine * fade + 0.3 * broad
        gain *= 0.78 + 0.22 * min(max(v / 1.2, 0.0), 1.0)
    elif material == Material.BRICK:
        row = np.floor(v / 0.09)
        shift = 0.14 * (row % 2.0)
        joint = (v / 0.09 - row) < 0.14 or ((u + shift) % 0.28) < 0.02
        one = texture(tile, 13.7 * np.floor((u + shift) / 0.28), 5.9 * row)
        gain = (1.0 + 0.6 * (one - 0.5) * fade) * (1.0 + (0.5 if joint else 0.0) * fade)
    elif material == Material.TILES:
        slant = v / max(np.sqrt(1.0 - n[2] * n[2]), 0.3)
        gain = 1.0 - 0.35 * fade * (1.0 if (slant % 0.32) < 0.07 else 0.0)
        gain *= 1.0 + 0.5 * (texture(tile, 3.0 * u, 3.0 * slant) - 0.5)
    elif material in (Material.WOOD, Material.BARK):
        gain = 1.0 + 0.7 * (texture(tile, 50.0 * u + 20.0 * p[0], 5.0 * v) - 0.5) * fade
    elif material == Material.LEAF:
        gain = 1.0 + 1.1 * (texture(tile, 45.0 * (u + p[0]), 45.0 * v + 20.0 * p[1]) - 0.5) * fade
    out *= gain


@njit(cache=True, fastmath=True)
def _mirror(tile, ray, n, light, gloss, strength, out):
    """Add the reflections of a glossy surface: sky above the horizon, dark street below it, and sun highlight."""
    sun, sun_colour, _, horizon, _, _, _ = light
    cos = -(ray[0] * n[0] + ray[1] * n[1] + ray[2] * n[2])
    rx = ray[0] + 2 * cos * n[0]
    ry = ray[1] + 2 * cos * n[1]
    rz = ray[2] + 2 * cos * n[2]
    fresnel = strength + (1.0 - strength) * (1.0 - max(cos, 0.0)) ** 5
    seen = np.empty(3, np.float32)
    if rz > 0.12:
        sky_radiance(tile, rx, ry, rz, light, seen)
    else:
        skyline = 0.10 + 0.5 * max(rz + 0.02, 0.0) + 0.12 * (texture(tile, 60.0 * np.arctan2(ry, rx), 20.0 * rz) - 0.3)
        for c in range(3):
            seen[c] = skyline * horizon[c]
    spot = max(rx * sun[0] + ry * sun[1] + rz * sun[2], 0.0) ** gloss
    for c in range(3):
        out[c] = out[c] * (1.0 - fresnel) + fresnel * min(seen[c], 1.5) + 0.7 * fresnel**0.5 * spot * sun_colour[c]


@njit(cache=True, fastmath=True)
def _shade(
    tile, road, rays, t, tri, pos, normals, colour, material, kind, sunlit, open_sky, pixel, light, radiance, kinds
):
    """Write the radiance (N, 3) and the kind (N,) of every hit."""
    sun, sun_colour, zenith, horizon, _, haze, _ = light
    n = np.empty(3, np.float32)
    albedo = np.empty(3, np.float32)
    # a compiled loop, because every material has its own branch, and one array per material would cost more
    for i in range(len(t)):
        ray = rays[i]
        out = radiance[i]
        if tri[i] < 0:
            kinds[i] = Kind.SKY
            sky_radiance(tile, ray[0], ray[1], ray[2], light, out)
            continue
        k = tri[i]
        p = pos[i]
        m = material[tri[i]]
        facing = normals[k, 0] * ray[0] + normals[k, 1] * ray[1] + normals[k, 2] * ray[2]
        flip = -1.0 if facing > 0.0 and m != Material.LEAF else 1.0
        for c in range(3):
            n[c] = flip * normals[k, c]
            albedo[c] = colour[k, c]
        blur = t[i] * pixel / max(abs(facing), 0.05)
        kinds[i] = kind[k]
        if m == Material.GROUND:
            kinds[i] = _ground(tile, road, p[0], p[1], blur if abs(n[2]) > 0.7 else t[i] * pixel, albedo)
        elif m >= Material.PLASTER:
            _surface(tile, m, p, n, t[i] * pixel, albedo)
        cos = n[0] * sun[0] + n[1] * sun[1] + n[2] * sun[2]
        if m == Material.LEAF:
            cos = 0.35 * abs(cos) + 0.65 * max(cos, 0.0) + 0.12
        direct = max(cos, 0.0) * sunlit[i]
        up = 0.5 + 0.5 * n[2]
        for c in range(3):
            ambient = up * (0.55 * zenith[c] + 0.45 * horizon[c]) + (1.0 - up) * 0.22 * horizon[c]
            out[c] = albedo[c] * (direct * sun_colour[c] + ambient * (0.12 + 0.88 * open_sky[i]))
        if m == Material.GLASS:
            _mirror(tile, ray, n, light, 300.0, 0.09, out)
        elif m == Material.PAINT:
            _mirror(tile, ray, n, light, 60.0, 0.055, out)
        elif m == Material.METAL:
            _mirror(tile, ray, n, light, 20.0, 0.04, out)
        elif m == Material.LAMP:
            out += 0.45 * albedo
        fog = 1.0 - np.exp(-haze * t[i])
        for c in range(3):
            out[c] = out[c] * (1.0 - fog) + fog * 0.92 * horizon[c]


def shade(
    hits: Hits, instant: Instant, road: Road, light: Light, sunlit: NDArray, open_sky: NDArray, pixel: float
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return the radiance and the kind of every hit.

    Parameters
    ----------
    hits : Hits
        End points of N rays.
    instant : Instant
        The world that the rays were cast into.
    road : Road
        The street, for the texture of the ground.
    light : Light
        Sun, sky and haze.
    sunlit, open_sky : (N,) float32
        Visibility of the sun and of the sky at each hit, 0..1.
    pixel : float
        Angle between neighbouring rays, rad. Finer textures are faded out.

    Returns
    -------
    radiance : (N, 3) float32
        Linear RGB.
    kinds : (N,) uint8
        Members of `Kind`.
    """
    n = len(hits.distance)
    radiance = np.empty((n, 3), np.float32)
    kinds = np.empty(n, np.uint8)
    _shade(
        noise_tile(), road, hits.directions, hits.distance, hits.triangle, hits.position,
        instant.normals, instant.colour, instant.material, instant.kind,
        sunlit, open_sky, pixel, light.packed, radiance, kinds,
    )  # fmt: skip
    return radiance, kinds
