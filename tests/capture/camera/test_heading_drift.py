# SPDX-License-Identifier: GPL-3.0-or-later
"""Heading drift: the edges of a hall seen by a camera of known rotation, and a runner on a straight
path.

The same runner's start without smoothing.
"""

import numpy as np
import pytest
from scope.scope_addon.capture.camera.heading_drift import FrameEdges, remove_heading_drift
from scope.scope_addon.capture.camera.intrinsics import Camera, pinhole
from scope.scope_addon.capture.camera.line_segments import Segments
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.pipeline import capture
from scope.solver import load_body
from scope.solver.rotations import exp, log

WIDTH = 1280
HEIGHT = 720
CAMERA = Camera(pinhole(WIDTH, HEIGHT, 1100.0), np.zeros(5), "given")


def edges(rng, directions, count=25):
    """(n, 2, 3) ends of edges in space along each of the directions."""
    starts = rng.uniform([-8, -3, 5], [14, 3, 12], (len(directions) * count, 3))
    steps = np.repeat(directions, count, axis=0) * rng.uniform(1, 4, (len(starts), 1))
    return np.stack([starts, starts + steps], axis=1)


def seen(rng, ends, R_camera_hall, center, noise_px=0.5):
    """The edges in a camera's picture, the longest first, with noise."""
    points = (ends - center) @ R_camera_hall.T
    points = points[(points[..., 2] > 1).all(axis=1)]
    pixels = points @ CAMERA.intrinsics.T
    pixels = pixels[..., :2] / pixels[..., 2:] + rng.normal(0, noise_px, points[..., :2].shape)
    inside = ((pixels >= 0) & (pixels < [WIDTH, HEIGHT])).all(axis=(1, 2))
    lengths = np.linalg.norm(pixels[inside, 1] - pixels[inside, 0], axis=1) / WIDTH
    order = np.argsort(-lengths)
    return Segments(pixels[inside][order], lengths[order])


def run(clutter, directions=None):
    """Errors in degrees before and after, of a camera that pans and travels, and whose rotation is
    overestimated.
    """
    rng = np.random.default_rng(3)
    T = 150
    times = np.arange(T) / 25
    s = np.linspace(0, 1, T)[:, None]
    hall = exp([0.05, 0.4, 0.02])
    truth = exp(s * [0.02, 0.25, -0.01])  # R_first_camera
    drifted = exp(s * [0.01, 0.4, 0.02]) @ truth
    ends = edges(rng, np.eye(3) if directions is None else directions)
    ends = np.concatenate([ends, edges(rng, rng.standard_normal((clutter, 3)), 1)])
    edge_frames = [
        FrameEdges(k, seen(rng, ends, truth[k].T @ hall, np.array([4.0 * k / T, 0, 0])))
        for k in (0, *range(12, T, 12))
    ]
    found = remove_heading_drift(drifted, times, edge_frames, CAMERA, (WIDTH, HEIGHT))
    error = [
        np.degrees(np.linalg.norm(log(np.swapaxes(truth, 1, 2) @ R), axis=1)).max()
        for R in (drifted, found)
    ]
    np.testing.assert_allclose(found[0], np.eye(3), atol=1e-9)
    return error, found, drifted


@pytest.mark.parametrize("clutter", [0, 25])
def test_orthogonal_edges_remove_the_drift(clutter):
    (before, after), *_ = run(clutter)
    assert before > 20
    assert after < 1.6


def test_edges_in_any_direction_change_nothing():
    rng = np.random.default_rng(8)
    _, found, drifted = run(0, directions=rng.standard_normal((75, 3)))
    assert found is drifted


@pytest.mark.slow
def test_a_runner_alongside_the_camera_stays_on_a_straight_path(shared, observe_frames):
    clip = shared / "data/clips/run_moving_camera.mp4"
    options = CaptureOptions(quality="fast")
    (motion,) = capture(clip, load_body("scope"), options, observe_frames=observe_frames).motions
    facing = exp(motion.poses[:, :3].astype(float))[:, :2, 2]
    angle = np.degrees(np.unwrap(np.arctan2(facing[:, 1], facing[:, 0])))
    stride = np.ones(22) / 22  # two steps, in which the pelvis rotates to and fro
    assert np.ptp(np.convolve(angle, stride, "valid")) < 12
    path = motion.trans[:, :2] - motion.trans[0, :2]
    along = path[-1] / np.linalg.norm(path[-1])
    across = path @ [-along[1], along[0]]
    # Of about three metres, as far as a focal length that is known to 25 percent tells.
    assert np.linalg.norm(path[-1]) > 2.25
    assert np.abs(np.convolve(across, stride, "valid")).max() < 0.35


@pytest.mark.slow
def test_without_smoothing_the_camera_travels_as_far(shared, observe_frames):
    """Where every frame is fitted alone, positions are still estimated in the same way."""
    body = load_body("scope")
    clip = shared / "data/clips/run_moving_camera.mp4"
    wanted = VideoRange(end_s=1.5)
    smooth, raw = (
        capture(
            clip,
            body,
            CaptureOptions(quality="fast", wanted=wanted, smoothing=smoothing),
            observe_frames=observe_frames,
        ).motions[0]
        for smoothing in (True, False)
    )
    way = np.linalg.norm(raw.trans[-1] - raw.trans[0])
    assert way > 0.8
    assert abs(way - np.linalg.norm(smooth.trans[-1] - smooth.trans[0])) < 0.1
    np.testing.assert_array_equal(raw.trans, raw.trans_raw)
    assert np.abs(smooth.trans - smooth.trans_raw).max() > 0.001
