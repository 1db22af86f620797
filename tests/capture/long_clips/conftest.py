# SPDX-License-Identifier: GPL-3.0-or-later
"""A clip of three windows with synthetic people of known places."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture import observe as observe_module
from scope.scope_addon.capture.frame_observer import FrameObserver
from scope.scope_addon.capture.long_clips.windowed_clip import lasting
from scope.scope_addon.capture.media.frame import Frame
from scope.scope_addon.capture.media.video import Video, open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.observe import observe
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.tracking import landmark_estimator
from scope.scope_addon.capture.tracking.track import Track
from scope.scope_addon.clock import StageClock
from scope.scope_addon.errors import CancelledError
from scope.solver import load_body

from ..fake_people import FakeDetector, FakeLandmarks, Person, pictures

BODY = load_body("scope")
RED = (220, 30, 30)
BLUE = (30, 30, 220)
# three windows: frames 0 to 29, 30 to 59, and the rest
FPS = 15
FRAMES = 90
WINDOW_S = 2.0
SMALL = Person(lambda t: (150 + t, 130), RED, size_px=45)
# Present when the second window's trackers begin, and so large that they would not care about the
# other one.
LARGE = Person(lambda t: (430, 130) if 10 <= t < 38 else None, BLUE, size_px=115)


@contextmanager
def frames_from(change: Callable[[int, Frame], Frame]) -> Iterator[None]:
    """Let a decoder that begins within a clip give other frames.

    :param change: from a frame's number, counted from where it begins, and the frame to the one
        that it gives.
    """
    sought = Video.frames_from

    def changed(video: Video, start_s: float) -> Iterator[Frame]:
        return (change(k, frame) for k, frame in enumerate(sought(video, start_s)))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Video, "frames_from", changed)
        yield


@pytest.fixture(scope="package")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clip")
    for t, image in enumerate(pictures([SMALL, LARGE], FRAMES, (600, 260))):
        cv2.imwrite(str(folder / f"frame{t:04d}.png"), cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    return folder


@pytest.fixture
def windows_of(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Callable[..., list[Track]]:
    """``windows_of(options, parts=None, unfinished=None, stop_at=inf)``: the tracks of the clip.

    They are joined from a folder of windows, or what is found is kept in a folder; cancelled at a
    frame.
    """
    people = [SMALL, LARGE]
    monkeypatch.setattr(
        landmark_estimator,
        "LandmarkNetwork",
        lambda name, *_: FakeLandmarks(people, "heavy" in name),
    )
    monkeypatch.setattr(landmark_estimator, "PersonDetector", lambda *_: FakeDetector(people))
    monkeypatch.setattr(observe_module, "LiveBody", lambda *_: SimpleNamespace(load=lambda: None))

    def observed(
        options: CaptureOptions,
        parts: Path | None = None,
        unfinished: Path | None = None,
        stop_at: float = np.inf,
    ) -> list[Track]:
        def progress(stage: str, done: int, total: int) -> None:
            if done >= stop_at:
                raise CancelledError("cancelled")

        with open_video(folder, options.wanted) as video:
            return observe(
                video,
                BODY,
                options,
                StageClock(),
                progress,
                lambda *_: None,
                lasting(unfinished, parts),
            )[1]

    return observed


@pytest.fixture(scope="package")
def found() -> dict[int | str, list[Track]]:
    """What `undisturbed` has found, by the people who were asked for."""
    return {}


@pytest.fixture
def undisturbed(
    windows_of: Callable[..., list[Track]], found: dict[int | str, list[Track]]
) -> Callable[..., list[Track]]:
    """``undisturbed(people="largest")``: the tracks of the clip without a stop; computed once."""

    def tracks(people: int | str = "largest") -> list[Track]:
        if people not in found:
            found[people] = windows_of(options(people))
        return found[people]

    return tracks


@pytest.fixture
def observed_times(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The times of all frames that were observed, in order."""
    times: list[float] = []
    add = FrameObserver.add

    def recorded(run: FrameObserver, frame: Frame, upcoming: Frame | None) -> Any:
        times.append(frame.timestamp_s)
        return add(run, frame, upcoming)

    monkeypatch.setattr(FrameObserver, "add", recorded)
    return times


def options(people: int | str = "largest") -> CaptureOptions:
    wanted = VideoRange(fps=Fraction(FPS))
    return CaptureOptions(
        quality="fast", threads=1, people=people, window_s=WINDOW_S, wanted=wanted
    )


def assert_same(a: list[Track], b: list[Track]) -> None:
    assert len(a) == len(b)
    for one, other in zip(a, b, strict=True):
        for name in (
            "frames",
            "times",
            "seen",
            "keypoints_px",
            "confidence",
            "world_landmarks",
            "acquired",
        ):
            assert np.array_equal(getattr(one, name), getattr(other, name)), name
        assert np.array_equal(one.reference_rows, other.reference_rows)
        assert np.array_equal(one.reference_landmarks, other.reference_landmarks)
