# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a capture as the panel shows it: figures, and warnings with the scene frames to
review.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...motion import Motion
from ...review_spans import REASONS, Span, find_review_spans
from ...scene.build import BuildResult
from ...scene.camera import pixel_aspect
from ..reporting import sentence

_MAX_SPANS = 12  # number of buttons


def show_result(
    shown: bpy.types.PropertyGroup, footage: str, report: dict[str, Any], result: BuildResult
) -> None:
    """Fill the properties that the result panel shows.

    :param shown: the properties, which are overwritten.
    :param report: report of the capture pipeline.
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
        _height(person) for person in report.get("per_person", ()) if "height_m" in person
    )
    shown.frames_per_second = float(report.get("fps", {}).get("total", 0.0))
    first = result.people[0].motion
    shown.footage_rate = first.mocap_framerate if len(first) > 1 else 0.0
    shown.camera = str(report.get("camera", ""))
    shown.execution = str(report.get("execution", ""))
    shown.resolution = [int(n) for n in first.image_size]
    shown.pixel_aspect = pixel_aspect(first)
    shown.warnings.clear()
    for line in report.get("warnings", ()):
        _add_warning(shown, sentence(str(line), first.source))
    for index, person in enumerate(result.people):
        whose = "" if len(result.people) == 1 else f"person {index + 1}: "
        for reason, spans in frame_warnings(
            person.motion, person.frames, person.under_floor
        ).items():
            _add_warning(shown, sentence(whose + REASONS[reason]), spans)


def frame_warnings(
    motion: Motion, frames: NDArray[np.float64], under_floor: NDArray[np.bool_]
) -> dict[str, str]:
    """Return the review spans of a motion in scene frames, by reason; at most the longest
    ``_MAX_SPANS`` of each.

    :param frames: (T,) scene frame of each pose.
    :param under_floor: (T,) poses with a foot under the floor.
    :return: reason, a key of ``REASONS``, to spans such as ``12-18,40``.
    """
    by_reason: dict[str, list[Span]] = {}
    for span in find_review_spans(motion, under_floor=under_floor):
        by_reason.setdefault(span.reason, []).append(span)
    return {reason: _text(spans, frames) for reason, spans in by_reason.items()}


def _height(person: dict[str, Any]) -> str:
    """Return a stature with its standard deviation, where that is known, from the report about a
    person.
    """
    sigma_m = person.get("height_sigma_m")
    if sigma_m is None:
        return f"{person['height_m']:.2f} m"
    return f"{person['height_m']:.2f} m ± {sigma_m:.{2 if sigma_m >= 0.01 else 3}f}"


def _text(spans: list[Span], frames: NDArray[np.float64]) -> str:
    longest = sorted(spans, key=lambda span: span.first - span.last)[:_MAX_SPANS]
    texts = []
    for span in sorted(longest, key=lambda span: span.first):
        a = round(float(frames[span.first]))
        b = round(float(frames[span.last]))
        texts.append(f"{a}" if a == b else f"{a}-{b}")
    return ",".join(texts)


def _add_warning(shown: bpy.types.PropertyGroup, text: str, spans: str = "") -> None:
    warning = shown.warnings.add()
    warning.text = text
    warning.spans = spans
