# SPDX-License-Identifier: GPL-3.0-or-later
"""Cuts are found, similar events are not mistaken for them, and scenes are captured separately."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.capture.tracking.scene_cuts import SceneCuts
from scope.solver import Body

from ..media.made_video import write_video

W = 320
H = 180


def scene(seed: int, width: int = W) -> np.ndarray:
    coarse = np.random.default_rng(seed).integers(
        0, 256, (9, max(2, width // 20), 3), dtype=np.uint8
    )
    return cv2.resize(coarse, (width, H), interpolation=cv2.INTER_CUBIC)


def cuts(frames: Sequence[np.ndarray], fps: float = 30.0) -> list[float]:
    found = SceneCuts(fps)
    cuts = []
    for t, (frame, upcoming) in enumerate(zip(frames, [*frames[1:], None], strict=True)):
        if found.is_cut(frame, upcoming):
            cuts.append(float(t))
    return cuts


def test_each_scene_begins_with_a_cut() -> None:
    assert cuts([scene(k // 10) for k in range(40)]) == [10.0, 20.0, 30.0]
    assert cuts([scene(k // 10) for k in range(11)]) == [10.0]  # in the last frame


def brightened(picture: np.ndarray, factor: float) -> np.ndarray:
    return np.clip(picture * factor, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("frames", [1, 2, 5])
@pytest.mark.parametrize("grey", [0, 255])
def test_a_scene_after_a_gap_begins_with_a_cut(grey: int, frames: int) -> None:
    """Scenes are often parted by black or white."""
    gap = [np.full((H, W, 3), grey, np.uint8)] * frames
    begin = 2 * frames + 10
    assert cuts([*gap, *[scene(0)] * 10, *gap, *[scene(1)] * 10]) == [begin]
    fade = [brightened(scene(1), k / 20) for k in range(1, 21)]
    (cut,) = cuts([*gap, *[scene(0)] * 10, *gap, *fade])
    assert begin <= cut < begin + 5


@pytest.mark.parametrize(
    "factors",
    [np.linspace(1.5, 1.0, 21), np.linspace(0.0, 1.0, 21), np.linspace(0.0, 1.0, 4)],
    ids=["a camera sets its exposure", "a fade", "a quick fade"],
)
def test_the_same_scene_in_another_light_after_a_gap_is_not_a_cut(factors: np.ndarray) -> None:
    gap = [np.zeros((H, W, 3), np.uint8)] * 15
    back = [brightened(scene(0), factor) for factor in factors]
    assert cuts([*[scene(0)] * 10, *gap, *back, *[scene(0)] * 10]) == []


@pytest.mark.parametrize(
    "frames",
    [
        [scene(0)] * 10 + [np.full((H, W, 3), 250, np.uint8)] + [scene(0)] * 10,
        [scene(0)] * 40 + [scene(1)] + [scene(0)] * 40,
        [scene(0)] * 10 + [np.zeros((H, W, 3), np.uint8)] * 10 + [scene(0)] * 10,
        [scene(0, 4000)[:, 60 * k : 60 * k + W] for k in range(40)],
        [brightened(scene(0), 0.2 + k / 60) for k in range(60)],
        [np.clip(scene(0) * (k / 20), 0, 255).astype(np.uint8) for k in range(30)],
    ],
    ids=["a flash", "a frame of something else", "a gap", "a fast pan", "a slow light", "a fade"],
)
def test_other_changes_are_not_cuts(frames: list[np.ndarray]) -> None:
    assert cuts(frames) == []


@pytest.mark.parametrize("frames", [6, 12, 24])
@pytest.mark.parametrize("through", [None, 0, 255])
def test_a_dissolve_and_a_fade_are_a_cut(frames: int, through: int | None) -> None:
    """It is where the new scene is seen better than the old one; a quick fade may have two."""
    colour = None if through is None else np.full((H, W, 3), through, np.uint8)
    middle = [mixed(scene(0), scene(1), (k + 1) / (frames + 1), colour) for k in range(frames)]
    found = cuts([*[scene(0)] * 40, *middle, *[scene(1)] * 40])
    assert 40 + frames / 2 - 1 <= found[-1] <= 40 + frames + 5
    assert len(found) == 1 or (frames == 6 and through is not None and found[0] >= 40)


@pytest.mark.parametrize("through", [None, 0, 255])
def test_a_dissolve_of_a_second_is_a_cut_at_any_rate(through: int | None) -> None:
    colour = None if through is None else np.full((H, W, 3), through, np.uint8)
    for fps in (60, 120):
        middle = [mixed(scene(0), scene(1), (k + 1) / (fps + 1), colour) for k in range(fps)]
        (cut,) = cuts([*[scene(0)] * fps, *middle, *[scene(1)] * fps], fps)
        assert 1.5 * fps - 1 <= cut <= 2.2 * fps


def test_a_dissolve_between_real_clips_is_a_cut(
    frames: Callable[..., Iterator[np.ndarray]],
) -> None:
    """People move in both, one of whom comes near."""
    one, other = (
        [cv2.resize(each, (W, H)) for each in frames(f"clips/{name}", stop=52)]
        for name in ("gesture_square", "sit_stand_close")
    )
    for colour in (None, np.zeros((H, W, 3), np.uint8)):
        middle = [mixed(one[40 + k], other[k], (k + 1) / 13, colour) for k in range(12)]
        (cut,) = cuts([*one[:40], *middle, *other[12:]])
        assert 45 <= cut <= 57
    assert cuts(one) == cuts(other) == []


def mixed(
    before: np.ndarray, after: np.ndarray, share: float, colour: np.ndarray | None
) -> np.ndarray:
    """A frame of a dissolve, or of a fade through a colour."""
    if colour is None:
        return cv2.addWeighted(before, 1 - share, after, share, 0)
    if share < 0.5:
        return cv2.addWeighted(before, 1 - 2 * share, colour, 2 * share, 0)
    return cv2.addWeighted(colour, 2 - 2 * share, after, 2 * share - 1, 0)


@pytest.mark.slow
@pytest.mark.usefixtures("networks")
def test_scenes_are_captured_separately(
    frames: Callable[..., Iterator[np.ndarray]], body: Body, tmp_path: Path
) -> None:
    """A man from two sides, one after the other: the cut is reported, and he is followed before and
    after it.
    """
    pictures = [
        cv2.resize(picture, (540, 960), interpolation=cv2.INTER_AREA)
        for camera in ("cam3", "cam1")
        for picture in frames(f"pose2sim/{camera}", stop=30, every=2)
    ]
    clip = write_video(tmp_path / "two.mp4", pictures)
    found = capture(clip, body, CaptureOptions(quality="fast"))
    (motion,) = found.motions
    assert list(found.report.cuts_s) == [pytest.approx(15 / 30, abs=1e-3)]
    assert any(
        "two.mp4 cuts to another scene at 0.5 s" in text for text in map(str, found.report.warnings)
    )
    assert np.allclose(np.diff(motion.timestamps), 1 / 30, atol=1e-3)
    assert motion.scene_starts.tolist() == [15]
    seen = motion.valid
    assert seen.mean() > 0.4  # one of the two, if not both
    assert motion.residual_px[seen].max() < 12
