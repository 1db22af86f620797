# SPDX-License-Identifier: GPL-3.0-or-later
"""What the readers of the data sets give: footage, and the ground truth of the people in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .subjects import Subject


@dataclass(frozen=True)
class Person:
    """The ground truth of one person in the frames that are evaluated.

    ``rows`` (T,): ascending positions of these frames in the footage; ``camera``: the person in the
    axes of each frame's camera; ``world``: the same in the world, None where the data set has no
    world.
    """

    name: str
    rows: NDArray[np.int64]
    camera: Subject
    world: Subject | None = None


@dataclass(frozen=True)
class Truth:
    """The people of a clip who have ground truth, and the camera's intrinsics (3, 3), where the
    data set has them.
    """

    people: list[Person]
    intrinsics: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Clip:
    """Footage with ground truth, which is read on demand.

    ``pictures``: the frames in order, or one video; ``rate``: frames per second; ``protocols``:
    those that the clip is part of; ``alone``: nobody but the person with ground truth is in view.
    """

    name: str
    pictures: list[Path]
    rate: float
    protocols: tuple[str, ...]
    truth: Callable[[], Truth] = field(repr=False)
    alone: bool = True
