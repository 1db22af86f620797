# SPDX-License-Identifier: GPL-3.0-or-later
"""What kinds of scenes there are, in shares that hold for the first scenes as for all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from .scene import (
    DEVELOPMENT,
    INDOORS,
    NEW_PERFORMERS,
    OUTDOORS,
    PANNING,
    SPLITS,
    STATIC,
    TEST,
    TRAVELLING,
)

SEED = 11
TEST_OF = 3  # every third scene is for development, the others are for testing
SIZES = ((640, 480), (854, 480), (480, 640), (640, 360), (640, 480))
CAMERAS = (STATIC, STATIC, STATIC, PANNING, TRAVELLING)
CHILDREN = (True, False, False, False, False)
CLOTHES = (True, False)
COMPANY = (True, True, True, *7 * (False,))
BLOCKS = (True, False, False, False)
SURROUNDINGS = (INDOORS, OUTDOORS)
Value = TypeVar("Value")


@dataclass(frozen=True)
class Kind:
    """What is the same in all tries to draw a scene."""

    # of the first person, into the recordings of the split, or into the new performers
    recording: int
    size: tuple[int, int]  # width, height
    camera: str
    surroundings: str
    is_child: bool  # the first person
    wears_loose: bool
    has_company: bool  # a second person
    has_block: bool


def split_of(number: int) -> str:
    """Return whether a numbered scene of the recordings in ``shared/data`` is for testing or for
    development.
    """
    return TEST if number % TEST_OF != 0 else DEVELOPMENT


def kind_of(number: int, split: str, recordings: int) -> Kind:
    """Return the kind of a scene. Scenes of new performers are numbered by themselves.

    Every property takes each of its values once, in random order, before it takes them again in
    another order.

    :param recordings: how many recordings, or new performers, the scene's split has.
    """
    passed = (number - 1) // TEST_OF + 1  # scenes for development before this one
    turn = {DEVELOPMENT: number // TEST_OF, TEST: number - passed, NEW_PERFORMERS: number}[split]

    def pick(which: int, values: Sequence[Value]) -> Value:
        rng = np.random.default_rng([SEED, which, SPLITS.index(split), turn // len(values)])
        return values[rng.permutation(len(values))[turn % len(values)]]

    return Kind(
        pick(0, range(recordings)),
        pick(1, SIZES),
        pick(2, CAMERAS),
        pick(3, SURROUNDINGS),
        pick(4, CHILDREN),
        pick(5, CLOTHES),
        pick(6, COMPANY),
        pick(7, BLOCKS),
    )
