# SPDX-License-Identifier: GPL-3.0-or-later
"""Spans of frames that should be reviewed: filled in, far from the footage, unsure, not plausible,
or under the floor. Numpy only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..solver.names import BODY_JOINTS
from .motion import Motion
from .plausibility import implausible

# reprojection error above which a frame should be reviewed, as a share of the image's longer side
FAR_SHARE = 0.03
LOW_CONFIDENCE = 0.35  # mean over the joints that keypoints determine


@dataclass(frozen=True)
class Span:
    """Rows ``first`` to ``last`` of a motion, inclusive, and why they should be reviewed: a key of
    ``notices.REASONS``.
    """

    reason: str
    first: int
    last: int


def find_review_spans(
    motion: Motion, gap_s: float = 0.0, under_floor: NDArray[np.bool_] | None = None
) -> list[Span]:
    """Find the spans of a motion that should be reviewed.

    :param gap_s: spans of the same reason that are less than this many seconds apart are merged.
    :param under_floor: (T,) frames in which a foot is under the floor; None: not known.
    :return: the spans of each reason in turn, in chronological order; of not seen, far and unsure,
        a frame has at most one.
    """
    unseen = ~motion.valid
    far = ~unseen & (motion.residual_px > FAR_SHARE * motion.image_size.max())
    unsure = ~unseen & ~far & (body_confidence(motion) < LOW_CONFIDENCE)
    masks = {"unseen": unseen, "far": far, "unsure": unsure, **implausible(motion)}
    if under_floor is not None:
        masks["floor"] = under_floor
    return [
        Span(why, *pair)
        for why, mask in masks.items()
        for pair in _spans(mask, motion.timestamps, gap_s)
    ]


def body_confidence(motion: Motion) -> NDArray[np.float32] | NDArray[np.float64]:
    """Return the mean confidence of each frame, (T,), over the body's joints that are seen in at
    least one frame.

    Fingers, which are often occluded, do not count.
    """
    confidence = motion.joint_confidence[:, : len(BODY_JOINTS)]
    shown = confidence.max(axis=0) > 0
    return confidence[:, shown].mean(axis=1) if shown.any() else np.zeros(len(motion))


def _spans(
    mask: NDArray[np.bool_], timestamps: NDArray[np.float64], gap_s: float
) -> list[tuple[int, int]]:
    """Return the first and last row of each run of True in ``mask``, (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(mask, int), [0]])))
    out: list[tuple[int, int]] = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if out and timestamps[first] - timestamps[out[-1][1]] < gap_s:
            out[-1] = out[-1][0], end - 1
        else:
            out.append((first, end - 1))
    return out
