# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of a rendered person: skin, lips, brows, lashes, hair and eyes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.face import expressions_of
from ...solver.body import Body

SKINS = ((0.58, 0.36, 0.27), (0.5, 0.29, 0.2), (0.3, 0.16, 0.1), (0.12, 0.06, 0.04))  # linear
LIPS = np.array([0.85, 0.5, 0.5])  # times the skin's colour
HAIR = np.array([0.03, 0.018, 0.012])
IRISES = ((0.1, 0.055, 0.025), (0.08, 0.14, 0.2), (0.07, 0.11, 0.05))
# metres from the middle, in the model frame
_BROW_ENDS = (0.012, 0.052)
_BROW_HEIGHT = 0.702
_BROW_HALF_M = 0.004


@dataclass(frozen=True)
class Look:
    """Linear colours: ``skin`` (V, 3) of each vertex, hair and iris (3,)."""

    skin: NDArray[np.float64]
    hair: NDArray[np.float64]
    iris: NDArray[np.float64]


def draw_look(body: Body, rng: np.random.Generator) -> Look:
    """Draw the colours of a person."""
    skin = np.array(SKINS[rng.integers(len(SKINS))]) * rng.uniform(0.85, 1.15)
    hair = HAIR * rng.uniform(0.5, 4.0)
    colors = np.tile(skin, (len(body.v_template), 1))
    lips, brows, lashes = (mask[:, None] for mask in masks(body))
    for mask, strength, color in (
        (lips, rng.uniform(0.4, 1.0), skin * LIPS),
        (brows, rng.uniform(0.5, 0.95), hair),
        (lashes, rng.uniform(0.3, 0.9), hair),
    ):
        colors += strength * mask * (color - colors)
    return Look(colors, hair, np.array(IRISES[rng.integers(len(IRISES))]))


def with_beard(look: Look, covered: NDArray[np.float64]) -> Look:
    """Return a look whose skin under the beard is darker, as between hairs.

    :param covered: (V,) 1 where the beard is, otherwise 0.
    """
    return replace(look, skin=look.skin + 0.7 * covered[:, None] * (look.hair - look.skin))


def masks(body: Body) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return how far each vertex (V,) belongs to the lips, the brows and the lashes, 0 to 1."""
    V = body.v_template
    keys = {e.name: e for e in expressions_of(body)}
    lips = np.zeros(len(V))
    lashes = np.zeros(len(V))
    for mask, names, share in (
        (lips, ("mouthRollLower", "mouthRollUpper"), 0.7),
        (lashes, ("eyeBlinkLeft", "eyeBlinkRight"), 0.85),
    ):
        for name in names:
            length = np.linalg.norm(keys[name].offsets, axis=1)
            mask[keys[name].vertices] = np.maximum(
                mask[keys[name].vertices], length > share * length.max()
            )
    x = abs(V[:, 0])
    y = V[:, 1]
    inner, outer = _BROW_ENDS
    across = np.clip((x - inner) / 0.006, 0, 1) * np.clip((outer - x) / 0.006 + 1, 0, 1)
    arch = _BROW_HEIGHT - 12.0 * (x - 0.033) ** 2
    brows = across * np.exp(-(((y - arch) / _BROW_HALF_M) ** 2)) * (V[:, 2] > 0.1)
    return lips, brows, lashes
