# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether an observation that was read from a file can be one: the forms of its arrays, and rows
that exist.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..camera.background_record import BackgroundRecord
from ..frame_observer import Observed
from ..perception.face_record import RECORD
from ..perception.landmark_network import KEYPOINT_COUNT
from ..perception.region import Region
from ..tracking.appearance import SIZE as APPEARANCE_SIZE
from ..tracking.track import Tracklet

MASK_SIDE = 256


def is_sound(observed: Observed) -> bool:
    """Return whether the numbers of an observation fit each other.

    :raises TypeError, ValueError, AttributeError: they are of another kind.
    """
    frames = len(observed.frames)
    times = observed.timestamps
    return (
        all(isinstance(index, int) for index in [*observed.frames, *observed.checksums])
        and len(times) == len(observed.checksums) == len(observed.picture_changes) == frames
        and all(map(math.isfinite, [*times, *observed.picture_changes]))
        and all(a < b for a, b in pairwise(times))
        and 0 <= observed.first <= observed.anchor <= frames
        and _are_rows(observed.cut_rows, observed.first, frames)
        and all(a < b for a, b in pairwise(observed.cut_rows))
        and all(map(_is_region, observed.anchor_regions))
        and _is_background(observed.background, frames)
        and all(_is_tracklet(tracklet, frames) for tracklet in observed.tracklets.values())
    )


def _is_background(background: BackgroundRecord, frames: int) -> bool:
    corners = background.corners
    seen = len(corners.rows)
    return (
        _has_form(background.times, "f", frames)
        and _has_form(background.R_first_camera, "f", frames, 3, 3)
        and _has_form(background.known, "b", frames)
        and all(map(math.isfinite, background.inlier_shares))
        and all(_has_form(bar, "f", 4) for bar in background.bars)
        and _are_rows([edge.row for edge in background.edge_frames], 0, frames)
        and all(
            _has_form(edge.segments.ends_px, "f", len(edge.segments.lengths), 2, 2)
            and _has_form(edge.segments.lengths, "f", len(edge.segments.lengths))
            for edge in background.edge_frames
        )
        and _has_form(corners.rows, "i", seen)
        and _has_form(corners.numbers, "i", seen)
        and _has_form(corners.points_px, "f", seen, 2)
        and _are_rows(corners.rows.tolist(), 0, frames)
        and bool((np.diff(corners.rows) >= 0).all())
        # Each is at least once in the file, so that its number says nothing about memory.
        and _are_rows(corners.numbers.tolist(), 0, seen)
    )


def _is_tracklet(tracklet: Tracklet, frames: int) -> bool:
    count = len(tracklet.rows)
    found = [call.result() for _, call in tracklet.references]
    masks = [mask for _, mask in tracklet.masks]
    return (
        _are_rows(tracklet.rows, 0, frames)
        and all(a < b for a, b in pairwise(tracklet.rows))
        and _have_form(tracklet.values, count, KEYPOINT_COUNT, 6)
        and _have_form(tracklet.centers_px, count, 2)
        and len(tracklet.sides_px) == count
        and all(0 < side < math.inf for side in tracklet.sides_px)
        and _has_form(tracklet.appearance, "f", APPEARANCE_SIZE)
        and (not tracklet.hands or _have_form(tracklet.hands, count, 2, 21, 7))
        and (not tracklet.faces or _have_form(tracklet.faces, count, RECORD))
        and _are_rows([row for row, _ in (*tracklet.references, *tracklet.masks)], 0, frames)
        and all(each is None or _has_form(each, "f", KEYPOINT_COUNT, 3) for each in found)
        and all(_has_form(mask.probability, "f", MASK_SIDE, MASK_SIDE) for mask in masks)
        and all(_is_region(mask.region) for mask in masks)
    )


def _is_region(region: Region) -> bool:
    numbers = (*region.center_px, region.side_px, region.rotation)
    return len(numbers) == 4 and all(map(math.isfinite, numbers)) and region.side_px > 0


def _are_rows(rows: Iterable[int], first: int, end: int) -> bool:
    return all(isinstance(row, int) and first <= row < end for row in rows)


def _have_form(arrays: Sequence[Any], count: int, *shape: int) -> bool:
    return len(arrays) == count and all(_has_form(each, "f", *shape) for each in arrays)


def _has_form(array: Any, kind: str, *shape: int) -> bool:
    """Return whether something is an array of a kind and shape, without what is not finite."""
    is_one = isinstance(array, np.ndarray) and array.dtype.kind == kind and array.shape == shape
    return is_one and bool(np.isfinite(array).all())
