# SPDX-License-Identifier: GPL-3.0-or-later
"""Small pictures of walls, floors and grounds, which repeat without a seam."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float64]  # (SIDE, SIDE, 3) linear RGB
SIDE = 256  # pixels
JOINT_PX = 3  # between tiles and bricks
# along one side
BOARDS = 12
TILES = 4
BRICK_ROWS = 16


def noise(rng: np.random.Generator, exponent: float, stretch: float = 1.0) -> NDArray[np.float64]:
    """Return periodic noise (SIDE, SIDE) of zero mean and unit variance, with amplitudes
    f^-exponent.

    :param stretch: how many times longer its grains are along the second axis than along the first.
    """
    f = np.hypot(np.fft.fftfreq(SIDE)[:, None], stretch * np.fft.rfftfreq(SIDE)[None, :]) * SIDE
    f[0, 0] = np.inf
    waves = np.fft.rfft2(rng.standard_normal((SIDE, SIDE))) * f**-exponent
    values: NDArray[np.float64] = np.fft.irfft2(waves, (SIDE, SIDE))
    return values / values.std()


def mottled(
    rng: np.random.Generator, color: NDArray[np.float64], contrast: float, exponent: float = 1.2
) -> Picture:
    """Return plaster, asphalt, carpet or grass: one linear colour (3,), lighter and darker by a
    share.
    """
    return _shaded(color, contrast * noise(rng, exponent))


def boards(rng: np.random.Generator, color: NDArray[np.float64]) -> Picture:
    """Return wooden boards along the second axis."""
    rows = np.arange(SIDE) * BOARDS // SIDE
    shade = 0.12 * rng.standard_normal(BOARDS)[rows][:, None] + 0.08 * noise(rng, 1.0, 12.0)
    gap = np.diff(rows, append=BOARDS) > 0
    return _shaded(color, shade - 0.5 * gap[:, None])


def tiles(rng: np.random.Generator, color: NDArray[np.float64]) -> Picture:
    """Return square tiles, each with a shade of its own."""
    at = np.arange(SIDE) * TILES // SIDE
    shade = 0.06 * rng.standard_normal((TILES, TILES))[at][:, at] + 0.04 * noise(rng, 1.0)
    joint = np.arange(SIDE) % (SIDE // TILES) < JOINT_PX
    return _shaded(color, shade - 0.35 * (joint[:, None] | joint[None, :]))


def bricks(rng: np.random.Generator, color: NDArray[np.float64]) -> Picture:
    """Return courses of bricks along the second axis."""
    high = SIDE // BRICK_ROWS
    wide = 4 * SIDE // BRICK_ROWS
    row, column = np.mgrid[:SIDE, :SIDE]
    along = (column + row // high % 2 * wide // 2) % SIDE
    shade = 0.15 * rng.standard_normal((BRICK_ROWS, SIDE // wide))[
        row // high, along // wide
    ] + 0.06 * noise(rng, 0.8)
    joint = (row % high < JOINT_PX) | (along % wide < JOINT_PX)
    return np.where(
        joint[..., None], _shaded(np.full(3, 0.45), 0.1 * noise(rng, 0.8)), _shaded(color, shade)
    )


def stripes(rng: np.random.Generator, color: NDArray[np.float64]) -> Picture:
    """Return wallpaper with stripes along the first axis."""
    count = int(2 ** rng.integers(2, 5))
    dark = (np.arange(SIDE) * 2 * count // SIDE % 2).astype(float)
    return _shaded(color, -rng.uniform(0.1, 0.4) * dark[None, :] + 0.03 * noise(rng, 1.0))


def painting(rng: np.random.Generator) -> Picture:
    """Return areas of a few colours."""
    colors = rng.uniform(0.03, 0.7, (5, 3))
    which: NDArray[np.intp] = np.digitize(noise(rng, 2.4), [-0.9, -0.2, 0.4, 1.0])
    return colors[which]


def _shaded(color: NDArray[np.float64], shade: NDArray[np.float64]) -> Picture:
    picture: Picture = np.clip(color * (1.0 + shade[..., None]), 0.005, 0.9)
    return picture
