# SPDX-License-Identifier: GPL-3.0-or-later
"""Offsets that change abruptly, shown without a jump: what a change would add is taken over, and
dies away.

The remainder r of an offset follows r''' = −3ω r'' − 3ω² r' − ω³ r. At a change, the difference of
the old and the new offset and that of their velocities are added to r and r', so that position,
velocity and acceleration continue; with c₀ = r, c₁ = r' + ω r and c₂ = (r'' + 2ω r' + ω² r) / 2, a
time t later r = (c₀ + c₁ t + c₂ t²) exp(−ω t).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class Transition:
    """The remainders of some offsets (n, 3).

    :param hz: ω / 2π.
    """

    def __init__(self, n: int, hz: float) -> None:
        self._omega = 2 * np.pi * hz
        self._r: NDArray[np.float64] = np.zeros((n, 3))
        self._v = np.zeros((n, 3))
        self._a = np.zeros((n, 3))

    @property
    def remainder(self) -> NDArray[np.float64]:
        """What is to be added to the present offsets (n, 3)."""
        return self._r

    def advance(self, step_s: float) -> None:
        """Let time pass."""
        w = self._omega
        t = step_s
        c0 = self._r
        c1 = self._v + w * self._r
        c2 = (self._a + 2 * w * self._v + w * w * self._r) / 2
        value = c0 + (c1 + c2 * t) * t
        slope = c1 + 2 * c2 * t
        decay = np.exp(-w * t)
        self._r = value * decay
        self._v = (slope - w * value) * decay
        self._a = (2 * c2 - 2 * w * slope + w * w * value) * decay

    def change(
        self,
        where: NDArray[np.bool_],
        old: tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]],
        new: tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]],
        step_s: float,
    ) -> None:
        """Take over the difference of two courses of the offsets as of the frame before; `advance`
        comes after it.

        A long step then leaves time for the difference to die away.

        :param where: (n,) which offsets change from one to the other.
        :param old: (n, 3) as they were in the frame before, and would be now.
        :param new: (n, 3) as they would have been in the frame before, and are now.
        :param step_s: seconds between the two frames.
        """
        self._r = self._r + where[:, None] * (old[0] - new[0])
        if step_s > 0:
            self._v = self._v + where[:, None] * ((old[1] - old[0]) - (new[1] - new[0])) / step_s
