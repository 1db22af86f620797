# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawn walkers: feet that stand do not move, and pictures show the body where the truth says."""

from types import SimpleNamespace

import numpy as np
import pytest
from scope.benchmarks.drawn.footage import (
    FOCAL_PX,
    HEIGHT,
    READOUT_BANDS,
    Camera,
    draw_clip,
)
from scope.benchmarks.drawn.surroundings import Surroundings
from scope.benchmarks.drawn.view_scenes import FIRST, SECOND
from scope.benchmarks.drawn.views import _score_camera
from scope.benchmarks.drawn.walk import RUNS, Walk, Walker
from scope.scope_addon.capture.media.video import open_video


@pytest.mark.parametrize("walk", [Walk(1.3), Walk(3.0, 0.72, style=RUNS), Walk(1.0, turn=0.3)])
def test_feet_that_stand_stay_where_they_are(body, walk):
    walker = Walker(body, walk)
    times = np.arange(60) / 30.0
    poses = [walker.pose(time_s) for time_s in times]
    lowest = np.array([walker.vertices(pose)[:, 2].min() for pose in poses if pose.stands.any()])
    assert np.abs(lowest).max() < 0.03
    ankles = [body.joint_names.index(f"{side}_ankle") for side in ("left", "right")]
    joints = np.array([walker.joints(pose)[ankles] for pose in poses])
    stands = np.array([pose.stands for pose in poses])
    moved = np.linalg.norm(np.diff(joints[..., :2], axis=0), axis=-1)
    both = stands[:-1] & stands[1:]
    # An ankle turns about heel and toes.
    assert moved[both].max() < 0.04
    assert moved[~both].max() > walk.speed_m_s / 30.0
    travelled = np.linalg.norm(joints[-1].mean(axis=0)[:2] - joints[0].mean(axis=0)[:2])
    assert travelled == pytest.approx(walk.speed_m_s * 59 / 30, rel=0.2)


def test_rows_that_are_read_out_later_show_a_later_moment(tmp_path):
    walls = np.zeros((4, 8, 8, 3), np.float32)
    walls[1] = 200.0
    shell = np.array([[-5.0, -5.0, -200.0], [5.0, 5.0, 300.0]])
    column = np.array([[[-0.5, 1.0, -100.0], [0.5, 2.0, 100.0]]])
    scene = Surroundings(shell, column, np.array([1]), (walls,) * 7, is_plain=False)
    eye = np.array([0.0, -4.0, 1.0])
    turn_rad_s = 0.5
    camera = Camera(
        lambda _: eye,
        lambda t: eye + [np.sin(turn_rad_s * t), np.cos(turn_rad_s * t), 0.0],
        readout_s=0.03,
    )
    clip = tmp_path / "column.mp4"
    draw_clip(clip, scene, [], camera, 0.1)
    with open_video(clip) as video:
        image = next(iter(video)).image_rgb
    left = [np.flatnonzero(image[row, :, 0] > 100).min() for row in (1, HEIGHT - 2)]
    # To the left, as the camera turns to the right, from the middle of the first band of rows to
    # that of the last one.
    share = (READOUT_BANDS - 1) / READOUT_BANDS
    assert left[0] - left[1] == pytest.approx(FOCAL_PX * turn_rad_s * 0.03 * share, abs=1.5)


def test_score_of_a_camera():
    truths = []
    for camera, start_s in ((FIRST, 0.0), (SECOND, 0.5)):
        R, centers = camera.path(np.zeros(1))
        truths.append({"R_world_camera": R, "centers": centers, "start_s": np.array(start_s)})
    R_first, R_second = (truth["R_world_camera"][0] for truth in truths)
    center = R_first.T @ (truths[1]["centers"][0] - truths[0]["centers"][0])
    R = R_second.T @ R_first
    about = {"offset_s": -0.49, "R_camera_first": R, "t_camera_first_m": -1.1 * R @ center}
    found = SimpleNamespace(**_score_camera(about, *truths))
    assert found.offset_ms == pytest.approx(10.0)
    assert found.rotation_deg == pytest.approx(0.0, abs=1e-6)
    assert found.baseline_deg == pytest.approx(0.0, abs=1e-4)
    assert found.scale == pytest.approx(1.1)
