# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures with a user's networks, which are ours with the outputs of others."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.perception.adapters import graph
from scope.scope_addon.capture.perception.adapters.graph import NetworkProcess
from scope.scope_addon.capture.pipeline import Capture, capture
from scope.scope_addon.capture.tracking.tracker import PeopleTracker
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.errors import NoPersonError
from scope.solver.body_file import load_body

from .small_graphs import fixed
from .wrapped_networks import box_rows, coco_simcc

Frames = Callable[..., Iterator[np.ndarray]]


@pytest.fixture(scope="module")
def own_networks(networks: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Write a user's detector and keypoint network."""
    folder = tmp_path_factory.mktemp("networks")
    return box_rows(folder / "detector.onnx"), coco_simcc(folder / "keypoints.onnx")


@pytest.fixture(scope="module", autouse=True)
def processes_are_started_once() -> Iterator[None]:
    """Keep the processes of the networks, which have no state: each takes half a second to
    start.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(graph, "NetworkProcess", cache(NetworkProcess))
        yield


def captured(detector: Path | None = None, keypoints: Path | None = None) -> Capture:
    options = CaptureOptions(
        quality="fast",
        wanted=VideoRange(0.0, 0.6),
        threads=1,
        detector=detector,
        keypoints=keypoints,
    )
    return capture(SAMPLE, load_body("scope"), options)


@pytest.mark.slow
def test_a_capture_with_both_is_as_good_as_ours(own_networks: tuple[Path, Path]) -> None:
    ours = captured()
    theirs = captured(*own_networks)
    assert theirs.report.detector == str(own_networks[0])
    assert theirs.report.execution == "CPU, 1 thread"
    motion = theirs.motions[0]
    assert motion.valid.all()
    truth = np.load(SAMPLE.with_name("sample_truth.npz"))["joints_cam"][motion.frames]
    errors = []
    for found in (ours.motions[0].joints_cam, motion.joints_cam):
        a, b = (j - j[:, :1] for j in (found[:, :22], truth[:, :22]))
        errors.append(np.linalg.norm(a - b, axis=-1).mean())
    assert errors[1] < 1.25 * errors[0] + 0.01
    # what COCO lacks: eye corner, mouth, finger, toe
    assert not motion.keypoints2d[:, [1, 9, 17, 31], 2].any()


def test_a_network_that_finds_nobody_is_named(tmp_path: Path) -> None:
    blind = fixed(
        tmp_path / "blind.onnx", 640, 640, {"output0": np.zeros((1, 84, 8400), np.float32)}
    )
    with pytest.raises(
        NoPersonError,
        match=r"crop footage of .*; if .* without blind\.onnx, state "
        r"in blind\.json",
    ):
        captured(detector=blind)


def test_a_lost_person_is_found_again(own_networks: tuple[Path, Path]) -> None:
    video = cv2.VideoCapture(str(SAMPLE))
    images = [np.ascontiguousarray(video.read()[1][:, :, ::-1]) for _ in range(6)]
    tracker = PeopleTracker("fast", 1, detector=own_networks[0], keypoints=own_networks[1])
    before = [tracker.step(image) for image in images[:3]]
    assert [tracker.step(np.zeros_like(images[0])) for _ in range(3)] == [[]] * 3
    after = [tracker.step(image) for image in images[3:]]
    assert all(len(seen) == 1 for seen in before + after)
    assert after[0][0][1].acquired
    assert after[0][0][1].region.resembles(before[-1][0][1].region, 0.15)


@pytest.mark.parametrize("quarter_turns", [1, 2])
def test_a_detector_of_upright_boxes_finds_people_who_are_not_upright(
    own_networks: tuple[Path, Path], frames: Frames, quarter_turns: int
) -> None:
    """Boxes do not say which way up a person is; the built-in detector does, and is the truth."""
    theirs = PeopleTracker("fast", 1, detector=own_networks[0])
    ours = PeopleTracker("fast", 1)
    for clip in ("clips/squats_5fps", "people/inputs/labval_squat"):
        theirs.reset()
        ours.reset()
        for image in frames(clip, stop=2):
            turned = np.ascontiguousarray(np.rot90(image, quarter_turns))
            ((_, expected),) = ours.step(turned)
            ((_, found),) = theirs.step(turned)
            off_px = np.linalg.norm(found.keypoints_px - expected.keypoints_px, axis=1)
            assert off_px.mean() < 0.02 * expected.region.side_px


def test_a_runner_is_tracked_at_a_low_frame_rate(
    own_networks: tuple[Path, Path], frames: Frames
) -> None:
    """Without auxiliary points, at 7.5 frames per second, every limb stays in the predicted
    region.
    """
    tracker = PeopleTracker("fast", 1, detector=own_networks[0], keypoints=own_networks[1])
    numbers = set()
    for image in frames("clips/run_moving_camera", every=4, stop=60):
        ((number, seen),) = tracker.step(image)
        numbers.add(number)
        in_region = seen.region.crop_from_image(
            seen.keypoints_px[[0, *range(11, 17), *range(23, 29)]]
        )
        assert ((in_region > 0.03) & (in_region < 0.97)).all()
    assert numbers == {0}
