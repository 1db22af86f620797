# SPDX-License-Identifier: GPL-3.0-or-later
"""Where captures are wrong: their worst moments against ground truth, and what is known to fail
without one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.motion import Motion
from ...scope_addon.report import page
from ...scope_addon.report.page import Markup, small_picture
from ...solver.body import Body
from ...tools.readme_pictures.clips import error_mm
from ...tools.readme_pictures.panel import OURS, TRUTH, Panel, next_to_each_other
from ...tools.readme_pictures.shapes import joints, posed, true_joints
from ...tools.readme_pictures.view import View, from_around, from_the_camera
from .shots import figures

# how many are shown, and how far they are apart
MOMENTS = 2
APART_S = 0.5
# of a panel, in pixels; height of the view from the side; share of it
SIZE = (320, 380)
SHOWN_M = 2.35
FILL = 0.76
_BOTH = [("Scope", OURS), ("ground truth", TRUTH)]


@dataclass(frozen=True)
class KnownFailure:
    """What is wrong in a clip without ground truth, as seen by eye, and from when to when, in
    seconds.
    """

    first_s: float
    last_s: float
    what: str


KNOWN = {  # by the clip's name; docs/limitations.md has more
    "walk_side_static": KnownFailure(
        3.3,
        7.2,
        "Failure: there is one floor for the clip, the roof on which he stands at first. He lands "
        "two metres below it, "
        "where feet are not held; while he is upside down he can be lost, and the pose is filled "
        "in.",
    ),
}


def limb_errors(motion: Motion, truth: Path) -> NDArray[np.float64]:
    """Return the mean distance (T,) of the limb joints from ground truth, hips aligned, in mm; NaN
    without truth.
    """
    with np.load(truth) as file:
        known = np.isin(motion.frames, file["frame_index"])
    return np.array(
        [error_mm(motion, row, truth) if known[row] else np.nan for row in range(len(motion))]
    )


def worst_rows(errors: NDArray[np.float64], timestamps: NDArray[np.float64]) -> list[int]:
    """Return the rows of the largest errors that are above the mean, `APART_S` or more apart, the
    largest first.
    """
    found: list[int] = []
    for row in np.argsort(-np.nan_to_num(errors, nan=-1.0)):
        if len(found) == MOMENTS or not errors[row] > np.nanmean(errors):
            break
        if all(abs(timestamps[row] - timestamps[other]) >= APART_S for other in found):
            found.append(int(row))
    return found


def worst_moments(motion: Motion, truth: Path, body: Body) -> Markup:
    """Return pictures of a capture's worst moments: from its camera and from the side, with the
    true joints.
    """
    errors = limb_errors(motion, truth)
    pictures = []
    for row in worst_rows(errors, motion.timestamps):
        image = next_to_each_other(
            [_panel(motion, row, truth, body, side) for side in (False, True)]
        )
        text = f"frame {motion.frames[row]}, {motion.timestamps[row]:.2f} s: {errors[row]:.0f} mm"
        pictures.append((image, text))
    note = (
        "The worst moments, ground truth in red. The captions give the mean distance of the limb "
        "joints, hips aligned; "
        f"its mean over the clip is {np.nanmean(errors):.0f} mm."
    )
    return captioned(pictures, note)


def captioned(pictures: Sequence[tuple[NDArray[np.uint8], str]], note: str) -> Markup:
    """Return pictures with a caption each, below a note about all of them."""
    images = [small_picture(0, image) for image, _ in pictures]
    captions = [text for _, text in pictures]
    return Markup(page.paragraph(note) + figures(images, captions, large=True))


def _panel(motion: Motion, row: int, truth: Path, body: Body, side: bool) -> NDArray[np.uint8]:
    vertices = posed(motion, body, row)
    true = true_joints(motion, row, truth)
    panel = Panel(
        _view(motion, row, np.concatenate([vertices, list(true.values())]), side),
        joints(motion, row)[0],
    )
    panel.body(body, vertices)
    panel.sticks(true)
    panel.heading("turned by 90 degrees" if side else "as the camera sees it")
    if not side:
        panel.legend(_BOTH)
    return panel.finished()


def _view(motion: Motion, row: int, shown: NDArray[np.float64], side: bool) -> View:
    if not side:
        return from_the_camera(motion, row, shown, SIZE, FILL)
    middle = (shown.min(axis=0) + shown.max(axis=0)) / 2
    return from_around(motion, row, middle, SIZE, 90, SHOWN_M)
