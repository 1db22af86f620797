# SPDX-License-Identifier: GPL-3.0-or-later
"""What a capture found, as the panel shows it: figures, and warnings with the scene frames to look at."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from ..motion import Motion
from ..scene.build import BuildResult
from ..scene.camera import pixel_aspect

_OFF_SHARE = 0.03  # of the picture's longer side: a body this far off its keypoints is worth a look
_MOST_SPANS = 6


def show_result(shown: bpy.types.PropertyGroup, footage: str, report: dict, result: BuildResult) -> None:
    """Fill the result section.

    :param report: of the capture pipeline.
    """
    shown.footage = footage
    shown.collection = result.collection
    shown.people = len(result.people)
    shown.frames = max(len(p.motion) for p in result.people)
    shown.valid_frames = int(sum(p.motion.valid.sum() for p in result.people))
    residuals = np.concatenate([p.motion.residual_px[p.motion.valid] for p in result.people])
    shown.reprojection_px = float(residuals.mean()) if residuals.size else 0.0
    shown.frames_per_second = float(report.get("fps", {}).get("total", 0.0))
    shown.camera = str(report.get("camera", ""))
    first = result.people[0].motion
    shown.resolution = [int(n) for n in first.image_size]
    shown.pixel_aspect = pixel_aspect(first)
    shown.warnings.clear()
    lines = list(report.get("warnings", ()))
    for index, person in enumerate(result.people):
        whose = "" if len(result.people) == 1 else f"person {index + 1}: "
        lines += frame_warnings(whose, person.motion, person.frames)
    for line in lines:
        shown.warnings.add().text = line[:1].upper() + line[1:]


def frame_warnings(whose: str, motion: Motion, frames: np.ndarray) -> list[str]:
    """Spans of scene frames where the motion is guessed or far from the footage.

    :param whose: put before each line, for several people.
    :param frames: (T,) scene frame of each pose.
    """
    lines = []
    if not motion.valid.all():
        lines.append(f"{whose}filled in without being seen: frames {spans(~motion.valid, frames)}")
    off = motion.valid & (motion.residual_px > _OFF_SHARE * motion.image_size.max())
    if off.any():
        lines.append(f"{whose}far from the footage, worth a look: frames {spans(off, frames)}")
    return lines


def spans(mask: np.ndarray, frames: np.ndarray) -> str:
    """``12-18, 40`` for the frames where the mask is true; ``…`` after some."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(mask, int), [0]])))
    pairs: Iterable[tuple[int, int]] = list(zip(edges[::2], edges[1::2] - 1, strict=True))
    texts = []
    for first, last in pairs:
        a, b = round(float(frames[first])), round(float(frames[last]))
        texts.append(f"{a}" if a == b else f"{a}-{b}")
    return ", ".join(texts[:_MOST_SPANS]) + (", …" if len(texts) > _MOST_SPANS else "")
