# SPDX-License-Identifier: GPL-3.0-or-later
"""Values over time for formats that have one rate. Free of bpy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...motion import Motion


def at_one_rate(
    motion: Motion, columns: Sequence[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times (S,) at the motion's rate, seconds, and the columns' values there, (S, N).

    Values of a motion with a variable rate are interpolated linearly.

    :param columns: N values (T,) over the motion's frames.
    """
    rate = motion.mocap_framerate
    start_s = float(motion.timestamps[0])
    count = 1 + round(float(motion.timestamps[-1] - start_s) * rate)
    times_s = start_s + np.arange(count) / rate
    rows = np.array([np.interp(times_s, motion.timestamps, column) for column in columns]).T
    return times_s, rows
