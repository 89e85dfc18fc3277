"""Light and weather of a drive, and the noise for textures and clouds."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

TILE = 512
"""Side of the repeating noise texture, texels."""


@dataclass(frozen=True)
class Light:
    """Sun, sky and camera exposure.

    Parameters
    ----------
    sun : (float, float, float)
        Unit vector towards the sun, in the world.
    sun_colour, sky_colour, horizon_colour : (float, float, float)
        Linear radiance: of a surface that faces the sun, of the zenith, and of the horizon.
    softness : float
        Angular spread of the sunlight, rad: 0.01 for a clear sky, 0.5 under clouds.
    clouds : float
        Cloud cover, a share of the sky.
    haze : float
        Extinction, 1/m: contrast falls to 37 % over 1/haze.
    exposure : float
        Gain of the camera.
    balance : (float, float, float)
        Gains of red, green and blue: the camera's white-balance error.
    phase : float
        Offset of the clouds, different for every drive.
    """

    sun: tuple[float, float, float]
    sun_colour: tuple[float, float, float]
    sky_colour: tuple[float, float, float]
    horizon_colour: tuple[float, float, float]
    softness: float
    clouds: float
    haze: float
    exposure: float
    balance: tuple[float, float, float]
    phase: float

    @classmethod
    def random(cls, rng: np.random.Generator) -> "Light":
        """Draw the light of a day: clear, hazy, with a low sun, or overcast.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of randomness.
        """
        overcast = rng.random() < 0.3
        elevation = np.radians(rng.uniform(18, 62))
        azimuth = rng.uniform(0, 2 * np.pi)
        low = float(np.clip((np.radians(35) - elevation) / np.radians(20), 0, 1))
        sun = (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation))
        warm = np.array([1.0, 0.95 - 0.12 * low, 0.86 - 0.3 * low])
        if overcast:
            strength = 0.25
            sky = np.array([0.62, 0.66, 0.72])
            horizon = np.array([0.78, 0.80, 0.83])
        else:
            strength = rng.uniform(1.3, 1.8)
            sky = np.array([0.16, 0.30, 0.62]) * rng.uniform(0.8, 1.2)
            horizon = np.array([0.66, 0.75, 0.86]) * (1 - 0.25 * low) + np.array([0.22, 0.10, 0.0]) * low
        clouds = rng.uniform(0.75, 1.0) if overcast else rng.uniform(0.0, 0.6)
        haze = 10 ** rng.uniform(-3.5, -2.5)
        exposure = rng.uniform(0.85, 1.2) * (1.5 if overcast else 1.15)
        balance = 1 + rng.normal(0, 0.025, 3)
        phase = rng.uniform(0, 100)
        colours = (tuple(map(float, colour)) for colour in (sun, strength * warm, sky, horizon))
        softness = 0.45 if overcast else 0.012
        return cls(*colours, softness, clouds, haze, exposure, tuple(map(float, balance)), phase)

    @property
    def packed(self) -> tuple:
        """Sun, sun colour, zenith and horizon, each (3,) float32, then clouds, haze and phase, for numba."""
        vectors = (self.sun, self.sun_colour, self.sky_colour, self.horizon_colour)
        return *(np.asarray(v, np.float32) for v in vectors), self.clouds, self.haze, self.phase


@cache
def noise_tile() -> NDArray[np.float32]:
    """Return seamless fractal noise, (TILE, TILE) float32, uniformly distributed in 0..1."""
    rng = np.random.default_rng(81)
    frequency = np.fft.fftfreq(TILE)
    radius = np.hypot(frequency[:, None], frequency[None, :])
    amplitude = 1 / np.maximum(radius, 2 / TILE) ** 1.1
    amplitude[0, 0] = 0
    spectrum = np.fft.fft2(rng.normal(0, 1, (TILE, TILE))) * amplitude
    rank = np.real(np.fft.ifft2(spectrum)).ravel().argsort().argsort()
    return (rank.reshape(TILE, TILE) / TILE**2).astype(np.float32)


@njit(cache=True, fastmath=True, inline="always")
def texture(tile, u, v):
    """Return the noise at one place, 0..1, bilinearly interpolated.

    Parameters
    ----------
    tile : (TILE, TILE) float32
        From `noise_tile`; it repeats in both directions.
    u, v : float
        The place, texels.
    """
    i = np.floor(u)
    j = np.floor(v)
    a = np.float32(u - i)
    b = np.float32(v - j)
    i0 = int(i) & 511
    j0 = int(j) & 511
    i1 = (i0 + 1) & 511
    j1 = (j0 + 1) & 511
    top = tile[i0, j0] * (1 - b) + tile[i0, j1] * b
    bottom = tile[i1, j0] * (1 - b) + tile[i1, j1] * b
    return top * (1 - a) + bottom * a


@njit(cache=True, fastmath=True)
def sky_radiance(tile, x, y, z, light, out):
    """Compute the radiance of the sky in one direction: gradient, glow of the sun, clouds.

    Parameters
    ----------
    tile : (TILE, TILE) float32
        From `noise_tile`, for the clouds.
    x, y, z : float
        Unit vector of the direction, in the world.
    light : tuple
        From `Light.packed`.
    out : (3,) float32
        Written in place: linear radiance, red, green and blue.
    """
    sun, sun_colour, zenith, horizon, clouds, _, phase = light
    up = max(z, 0.0)
    mix = (1.0 - up) ** 5
    glow = max(x * sun[0] + y * sun[1] + z * sun[2], 0.0)
    halo = 0.25 * glow**8 + 0.6 * glow**200
    cover = 0.0
    if clouds > 0.0 and z > 0.0:
        scale = 22.0 / (up + 0.12)
        u = x * scale + 37.0 * phase
        v = y * scale + 11.0 * phase
        n = 0.65 * texture(tile, u, v) + 0.35 * texture(tile, 3.1 * u, 3.1 * v)
        cover = min(max((n - 1.0 + clouds) / 0.35, 0.0), 1.0) * min(up * 12.0, 1.0)
    bright = (0.55 + 0.5 * sun_colour[1]) if sun_colour[1] > 0.5 else 0.85
    shade = bright * (0.8 + 0.25 * texture(tile, 40.0 * x + 9.0, 40.0 * y + phase))
    for c in range(3):
        clear = mix * horizon[c] + (1.0 - mix) * zenith[c] + halo * sun_colour[c]
        out[c] = (1.0 - 0.85 * cover) * clear + 0.85 * cover * shade
