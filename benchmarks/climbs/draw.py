# SPDX-License-Identifier: GPL-3.0-or-later
"""Climbs, always the same: people who end higher than they began, in front of a camera at rest.

They move as a performer of whom nothing was used for training (`tools.mocap.new_performers`). The
boxes that they climb are not drawn: the capture has to tell from the people that they rise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...solver import Body
from ..perception.held_out import Take
from ..scenes.draw import FPS, draw_person, film
from ..scenes.kinds import Kind
from ..scenes.people import LIMB_JOINTS, Points
from ..scenes.scene import INDOORS, NEW_PERFORMERS, STATIC, Scene

SECONDS = 4.0
SEED = 77
# in which somebody climbs: most sections of the recordings are level
DRAWS = (0, 3, 13, 16, 21, 23, 26, 27)
PERFORMERS = ("climber_a", "climber_b")
ENDS = 8  # frames at each end of the clip: a rise is the difference of their means
CAMERAS = 200  # that are drawn until one has the person in its picture
KIND = Kind(
    0,
    (640, 480),
    STATIC,
    INDOORS,
    is_child=False,
    wears_loose=False,
    has_company=False,
    has_block=False,
)
_ANKLES = [LIMB_JOINTS.index(f"{side}_ankle") for side in ("left", "right")]


def draw_climb(body: Body, takes: Sequence[Take], number: int) -> Scene:
    """Return the scene of a number, an index into `DRAWS`: one person, who moves as in one of the
    takes.

    :param takes: the recordings of `PERFORMERS`.
    :raises ValueError: when its take has no section as long, or no camera was found.
    """
    draw = DRAWS[number]
    rng = np.random.default_rng([SEED, draw])
    person = draw_person(rng, body, takes[draw % len(takes)], False, False, round(SECONDS * FPS))
    for _ in range(CAMERAS):
        scene = None if person is None else film(rng, body, (person,), number, NEW_PERFORMERS, KIND)
        if scene is not None:
            return scene
    raise ValueError(f"climb {number} cannot be drawn from these recordings")


def rise_m(limbs: Points) -> float:
    """Return by how much the lower ankle is higher in the last frames than in the first, metres.

    :param limbs: (T, 12, 3) joints `LIMB_JOINTS`, metres, z up.
    """
    lower = limbs[:, _ANKLES, 2].min(axis=1)
    return float(lower[-ENDS:].mean() - lower[:ENDS].mean())
