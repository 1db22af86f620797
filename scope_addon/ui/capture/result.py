# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a capture as the panel shows it: figures, and warnings with the scene frames to
review.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...capture_report import Report
from ...motion import Motion
from ...notices import notice
from ...review_spans import Span, find_review_spans
from ...scene.build import BuildResult
from ...scene.camera import pixel_aspect
from ...scene.stored_values import FrameSpan, in_scene
from ..reporting import add_warning

_MAX_SPANS = 12  # number of buttons


def show_result(
    shown: bpy.types.PropertyGroup, footage: str, report: Report, result: BuildResult
) -> None:
    """Fill the properties that the result panel shows.

    :param shown: the properties, which are overwritten.
    """
    shown.footage = footage
    shown.people = len(result.people)
    shown.frames = max(len(p.motion) for p in result.people)
    shown.valid_frames = int(sum(p.motion.valid.sum() for p in result.people))
    residuals = np.concatenate([p.motion.residual_px[p.motion.valid] for p in result.people])
    shown.reprojection_px = float(residuals.mean()) if residuals.size else 0.0
    sigmas = np.concatenate(
        [np.ravel(np.asarray(p.motion.joint_sigma_m, float)) for p in result.people]
    )
    sigmas = sigmas[np.isfinite(sigmas)]
    shown.sigma_cm = 100.0 * float(np.median(sigmas)) if sigmas.size else 0.0
    shown.heights = ", ".join(
        _height(person) for person in report.per_person if "height_m" in person
    )
    shown.frames_per_second = float(report.fps.get("total", 0.0))
    first = result.people[0].motion
    shown.footage_rate = first.mocap_framerate if len(first) > 1 else 0.0
    shown.camera = str(report.camera)
    shown.execution = str(report.execution)
    shown.resolution = [int(n) for n in first.image_size]
    shown.pixel_aspect = pixel_aspect(first)
    shown.warnings.clear()
    for warning in report.warnings:
        # The frames of the first are among the spans; the panel itself says the second.
        if warning.code not in ("implausible", "scene_unit"):
            add_warning(shown, warning)
    for index, person in enumerate(result.people, 1):
        number = 0 if len(result.people) == 1 else index
        spans = review_spans(person.motion, person.frames, person.under_floor)
        for reason, of_reason in spans.items():
            add_warning(shown, notice("review", person=number, reason=reason), of_reason)


def review_spans(
    motion: Motion, frames: NDArray[np.float64], under_floor: NDArray[np.bool_]
) -> dict[str, list[FrameSpan]]:
    """Return the review spans of a motion in scene frames, by reason; at most the longest
    ``_MAX_SPANS`` of each.

    :param frames: (T,) scene frame of each pose.
    :param under_floor: (T,) poses with a foot under the floor.
    :return: reason, a key of ``REASONS``, to spans.
    """
    by_reason: dict[str, list[Span]] = {}
    for span in find_review_spans(motion, under_floor=under_floor):
        by_reason.setdefault(span.reason, []).append(span)
    found = {}
    for reason, spans in by_reason.items():
        longest = sorted(spans, key=lambda span: span.first - span.last)[:_MAX_SPANS]
        in_order = sorted(longest, key=lambda span: span.first)
        found[reason] = [in_scene(span, frames) for span in in_order]
    return found


def _height(person: Mapping[str, Any]) -> str:
    """Return a stature with its standard deviation, where that is known, from the report about a
    person.
    """
    sigma_m = person.get("height_sigma_m")
    if sigma_m is None:
        return f"{person['height_m']:.2f} m"
    return f"{person['height_m']:.2f} m ± {sigma_m:.{2 if sigma_m >= 0.01 else 3}f}"
