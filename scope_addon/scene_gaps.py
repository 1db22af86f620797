# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps between the times of frames, and the gaps that are put into them at scene cuts, so that
nothing is filtered, measured or interpolated across a cut.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .arrays import Float64Array, FloatArray

SCENE_GAP_S = 10.0  # longer than any filter reaches


def cut_times(times: Float64Array, scene_starts: NDArray[np.int64]) -> Float64Array:
    """Return when each cut is, (M,) seconds: midway between the frames on both sides of it.

    :param times: (T,) seconds.
    :param scene_starts: (M,) rows, from 1 on, of the frames that begin another scene.
    """
    return 0.5 * (times[scene_starts - 1] + times[scene_starts])


def with_scene_gaps(
    times: Float64Array, cuts_s: Float64Array, gap_s: float = SCENE_GAP_S
) -> Float64Array:
    """Return times (T,) in seconds, each later by a gap for every cut before it.

    :param cuts_s: (M,) seconds, in order, from `cut_times`.
    """
    return times + gap_s * np.searchsorted(cuts_s, times)


def usual_step_s(times: FloatArray | Sequence[float], alone: float = 0.0) -> float:
    """Return the seconds from most frames to the next.

    :param times: (T,) seconds.
    :param alone: what to return for a single frame, or none.
    """
    return float(np.median(np.diff(times))) if len(times) > 1 else alone


def steps_in_scenes(times: Float64Array) -> Float64Array:
    """Return the (T,) seconds from the frame before to each frame; 0 for the first frame of the
    clip, and for the first after a cut.

    :param times: (T,) of a track, seconds.
    """
    steps_s: Float64Array = np.diff(times, prepend=times[:1])
    steps_s[steps_s > SCENE_GAP_S] = 0.0
    return steps_s
