# SPDX-License-Identifier: GPL-3.0-or-later
"""Dark frames are brightened without flicker, others are unchanged; a person in the dark is
captured.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.frame import AutoExposure
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.pipeline import capture
from scope.solver import Body

from .made_video import write_video


def picture(level: float) -> np.ndarray:
    """Create a grey gradient up to ``level``."""
    return (
        np.repeat(np.linspace(0, level, 320)[None, :, None], 180, axis=0)
        .repeat(3, axis=2)
        .round()
        .astype(np.uint8)
    )


@pytest.mark.parametrize(("level", "becomes"), [(6, 96), (25, 200), (100, 200)])
def test_highlights_are_raised(level: int, becomes: int) -> None:
    """Highlights become about 200 of 255, with at most 16-fold gain, and everything else in
    proportion.
    """
    before = picture(level)
    found = AutoExposure().brighten(before).astype(float)
    assert np.percentile(found, 98) == pytest.approx(becomes, rel=0.05)
    np.testing.assert_allclose(found, before * (becomes / level), atol=0.08 * becomes)


def test_a_black_frame_is_returned_itself() -> None:
    black = picture(2)
    assert AutoExposure().brighten(black) is black


def test_brightness_does_not_flicker() -> None:
    exposure = AutoExposure()
    levels = [40 + 8 * (k % 2) for k in range(40)]
    gains = [float(exposure.brighten(picture(level))[:, -1].mean()) / level for level in levels]
    assert np.abs(np.diff(np.log(gains[20:]))).max() < 0.05
    assert exposure.brighten(picture(200)).max() <= 201  # the light is switched on


@pytest.mark.slow
@pytest.mark.usefixtures("networks")
def test_a_person_in_the_dark_is_captured(
    frames: Callable[..., Iterator[np.ndarray]], body: Body, tmp_path: Path
) -> None:
    """At 6 % of the light, at which the networks find nobody without the gain."""
    dark = [
        (0.06 * cv2.resize(image, (540, 960), interpolation=cv2.INTER_AREA)).astype(np.uint8)
        for image in frames("pose2sim/cam2", stop=40, every=4)
    ]
    clip = write_video(tmp_path / "dark.mp4", dark, 15)
    (motion,) = capture(clip, body, CaptureOptions(quality="fast")).motions
    assert motion.valid.all()
    assert motion.residual_px.mean() < 6
