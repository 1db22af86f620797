# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frames of a motion deserve a look: filled in, far from the footage, or hardly seen. Numpy alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..solver.names import BODY_JOINTS
from .motion import Motion

FAR_SHARE = 0.03  # of the picture's longer side: a body this far off its keypoints is worth a look
LOW_CONFIDENCE = 0.35  # mean over the joints that keypoints can show
REASONS = {
    "unseen": "filled in without being seen",
    "far": "far from the footage, worth a look",
    "unsure": "hardly visible, worth a look",
}


@dataclass(frozen=True)
class Span:
    """Rows ``first`` to ``last`` of a motion, both included, and why: a key of ``REASONS``."""

    reason: str
    first: int
    last: int


def find_review_spans(motion: Motion, gap_s: float = 0.0) -> list[Span]:
    """The spans of each reason in turn, in order of time; a frame has one reason at most.

    :param gap_s: spans of one reason that lie nearer together than these seconds are one.
    """
    unseen = ~motion.valid
    far = ~unseen & (motion.residual_px > FAR_SHARE * motion.image_size.max())
    unsure = ~unseen & ~far & (body_confidence(motion) < LOW_CONFIDENCE)
    masks = {"unseen": unseen, "far": far, "unsure": unsure}
    return [Span(why, *pair) for why, mask in masks.items() for pair in _spans(mask, motion.timestamps, gap_s)]


def body_confidence(motion: Motion) -> np.ndarray:
    """(T,) mean confidence over the body's joints that are ever seen; fingers, which often hide, do not count."""
    confidence = motion.joint_confidence[:, : len(BODY_JOINTS)]
    shown = confidence.max(axis=0) > 0
    return confidence[:, shown].mean(axis=1) if shown.any() else np.zeros(len(motion))


def _spans(mask: np.ndarray, timestamps: np.ndarray, gap_s: float) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(mask, int), [0]])))
    out: list[tuple[int, int]] = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if out and timestamps[first] - timestamps[out[-1][1]] < gap_s:
            out[-1] = out[-1][0], end - 1
        else:
            out.append((first, end - 1))
    return out
