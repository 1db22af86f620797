# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape of a person from the frames that have a mask: all of the capture's measurements, and the outline.

The keypoints say how long limbs are, and little about breadth. A first fit without the outline places the body; then
rim and contour are matched and everything is fitted again, a few times.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .....solver import ClipFit, fit_clip
from ...perception.observation import PersonMask
from ..frame_measurements import Measurer
from ..prepared_track import PreparedTrack
from ..weights import ROBUST, cold_stages, warm_stages
from .rim import OutlineMeasurer

MIN_MASKS, MAX_MASKS = 4, 32  # fewer, such as that of a still image, can mislead, and more add little
ROUNDS = 3
THREADS = 2
# A rim point's inverse variance: 0.0018 in normalized coordinates, 7 mm at 4 m. The outline says more of the shape than
# keypoints do, so the prior may weigh less. MPJPE-root on the four pose2sim cameras with other weights of outline and
# prior: 72.7 mm with 0 and 10, 72.5 with 0 and 2, 72.1 with 5e4 and 10, 68.7 with 3e5 and 2, which are today's.
OUTLINE_WEIGHT = 3e5
PRIOR_SHARE = 2 / 3


def usable_masks(prepared: PreparedTrack) -> list[tuple[int, PersonMask]]:
    """Return masks of the track, evenly spread over it, each with its row; none where there are too few."""
    if prepared.camera is None:
        return []
    seen = [(row, mask) for row, mask in prepared.track.masks if prepared.track.seen[row]]
    if len(seen) < MIN_MASKS:
        return []
    chosen = np.unique(np.linspace(0, len(seen) - 1, min(MAX_MASKS, len(seen))).round().astype(int))
    return [seen[k] for k in chosen]


def fit_shape_to_outline(
    prepared: PreparedTrack, masks: list[tuple[int, PersonMask]], root_cam: NDArray[np.floating[Any]] | None
) -> ClipFit:
    """Estimate one shape from the frames of some masks, as `usable_masks` returns them.

    A larger weight of few masks among many other frames moves the poses of their frames rather than the shape, so the
    frames of the masks decide alone.

    :param masks: each with its row.
    :param root_cam: (T, 3) known positions of the pelvis, camera frame, metres.
    """
    assert prepared.camera is not None
    outline = OutlineMeasurer(prepared.body, prepared.camera)
    measurer = Measurer(outline.body, prepared.measurer.intrinsics)
    extended = replace(prepared, body=outline.body, measurer=measurer)
    measured = [extended.measure(row, None if root_cam is None else root_cam[row]) for row, _ in masks]
    base = prepared.weights
    shape = PRIOR_SHARE * base.shape * len(masks)
    weights = replace(base, shape=shape, tables={**base.tables, "outline": OUTLINE_WEIGHT})
    cold, warm = (replace(ROBUST, stages=stages(weights)) for stages in (cold_stages, warm_stages))
    found = fit_clip(outline.body, measured, priors=prepared.priors, options=cold)
    with ThreadPoolExecutor(THREADS, "scope-outline") as pool:
        for _ in range(ROUNDS):
            tables = pool.map(outline.measure, found.frames, [mask for _, mask in masks])
            matched = [replace(frame, tables={"outline": rows}) for frame, rows in zip(measured, tables, strict=True)]
            states = [fit.state for fit in found.frames]
            found = fit_clip(outline.body, matched, init=states, priors=prepared.priors, options=warm)
    return found
