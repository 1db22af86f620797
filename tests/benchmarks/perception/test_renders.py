# SPDX-License-Identifier: GPL-3.0-or-later
"""The shots of held-out recordings: in the picture, on the floor, the same for the same seed; and
what is measured.
"""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scope.benchmarks.perception.held_out import (
    MARGIN_PX,
    SIZE,
    Take,
    draw_shot,
    held_out_takes,
    standing_feet,
)
from scope.benchmarks.perception.renders import (
    against_world,
    intervals_table,
    mean_of,
    presets_table,
)
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.solver.body_file import ASSETS
from scope.solver.rotations import log
from scope.tools.render_sample.choreography import choreograph
from scope.tools.render_sample.truth import sample_shot


@pytest.fixture(scope="module")
def take(body) -> Take:
    """The sample clip's motion as a recording in a world with y up."""
    betas = np.zeros(body.P)
    states, trans = choreograph(body, betas, 30)
    states[:, 0] = R_WORLD_MODEL.T @ states[:, 0]
    J_root = body.rest_joints(betas)[0]
    poses = log(states).reshape(len(trans), -1)
    return Take(
        9,
        "sample",
        poses,
        (trans + J_root) @ R_WORLD_MODEL - J_root,
        np.ones(len(trans), bool),
        betas,
        30.0,
    )


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_person_stands_on_the_floor_well_inside_the_picture(body, take, seed):
    shot = draw_shot(body, take, seed)
    camera_from_world = np.linalg.inv(shot.world_from_camera)
    turn = cv2.Rodrigues(camera_from_world[:3, :3])[0]
    for frame in range(0, len(shot), 6):
        skin = shot.vertices_world(body, frame)
        uv = cv2.projectPoints(skin, turn, camera_from_world[:3, 3], shot.intrinsics, None)[0][:, 0]
        assert uv.min() >= MARGIN_PX - 1e-3
        assert (uv.max(0) <= np.array(SIZE) - 1 - MARGIN_PX + 1e-3).all()
        assert -0.03 < skin[:, 2].min() < 0.05
        assert skin[:, 2].max() > 0.9  # squats, at the lowest
    # one foot or both, as in the sample: the path fits the legs
    assert shot.standing.any(axis=1).mean() > 0.8


def test_a_shot_is_the_same_for_the_same_seed_alone(body, take):
    first, again, other = (draw_shot(body, take, seed) for seed in (3, 3, 4))
    for key in ("rotations", "trans", "betas", "intrinsics", "world_from_camera", "standing"):
        assert np.array_equal(getattr(first, key), getattr(again, key)), key
    assert not np.array_equal(first.betas, other.betas)
    assert not np.array_equal(first.intrinsics, other.intrinsics)


def test_frames_that_the_fit_calls_broken_are_left_out(body, take):
    valid = np.zeros(len(take.valid), bool)
    valid[60:105] = True
    shot = draw_shot(body, Take(9, "broken", take.poses, take.trans, valid, take.betas, take.fps))
    np.testing.assert_allclose(
        log(shot.rotations[:, 1:]).reshape(45, -1), take.poses[60:105, 3:], atol=1e-9
    )
    with pytest.raises(ValueError, match="no 21 sound frames"):
        draw_shot(
            body,
            Take(9, "broken", take.poses, take.trans, np.zeros_like(valid), take.betas, take.fps),
        )


def test_only_every_tenth_take_is_drawn(tmp_path, body):
    count = 21
    path = tmp_path / "motions.npz"
    np.savez(
        path,
        poses=np.zeros((2 * count, 72)),
        trans=np.zeros((2 * count, 3)),
        valid=np.ones(2 * count, bool),
        take_start=2 * np.arange(count + 1),
        take_name=np.array([f"take {k}" for k in range(count)]),
        take_betas=np.zeros((count, body.P)),
        take_fps=np.full(count, 30.0),
        take_subject=np.array([f"performer {k // 5}" for k in range(count)]),
    )
    found = [(take.name, len(take.poses), take.performer) for take in held_out_takes(path)]
    assert found == [("take 9", 2, "performer 1"), ("take 19", 2, "performer 3")]


def test_feet_stand_where_the_sample_says(body):
    shot = sample_shot(*choreograph(body, np.zeros(body.P), 30))
    assert np.mean(standing_feet(body, shot) == shot.standing) > 0.95


def test_worlds_are_compared_by_up_floor_and_focal_length(body):
    truth = dict(np.load(Path(ASSETS) / "sample" / "sample_truth.npz"))
    rows = np.arange(10, 60)
    tilted = truth["world_from_camera"].copy()
    tilted[:3, :3] = cv2.Rodrigues(np.array([np.radians(5), 0, 0]))[0] @ tilted[:3, :3]
    motion = SimpleNamespace(
        frames=rows,
        valid=rows != 20,
        poses=truth["poses"][rows],
        trans=truth["trans"][rows] + [0, 0, 0.03],
        betas=truth["betas"],
        world_from_camera=np.repeat(tilted[None], len(rows), axis=0),
        intrinsics=truth["intrinsics"] * 0.8,
    )
    found = against_world(body, motion, truth)
    assert found == pytest.approx({"up_deg": 5.0, "floor_cm": 3.0, "focal": 0.8}, abs=1e-4)


def test_a_mean_leaves_out_what_a_clip_does_not_have():
    means = mean_of(
        [{"floor_cm": 2.0, "coverage": 1.0}, {"floor_cm": None, "coverage": 0.0}, {"coverage": 1.0}]
    )
    assert means["floor_cm"] == 2.0
    assert means["coverage"] == pytest.approx(2 / 3)
    assert means["up_deg"] is None


def test_intervals_are_over_clips_and_differences_between_the_same_clips():
    best = {"a": 40.0, "b": 60.0, "c": 50.0, "sample": 900.0, "mean": 950.0}
    figures = {
        quality: {
            "nothing given": {
                name: {"mpjpe_root": mm + more, "pa_mpjpe": mm / 2} for name, mm in best.items()
            }
            | {"lost": {"coverage": 0.0}}
        }
        for quality, more in (("fast", 7.0), ("best", 0.0))
    }
    head, _, fast, ours = intervals_table(figures).splitlines()
    assert [cell.strip() for cell in fast.strip("|").split("|")] == [
        "fast, nothing given",
        "3",
        "57.0 (47.0 to 67.0)",
        "25.0 (20.0 to 30.0)",
        "7.0 (7.0 to 7.0)",
    ]
    assert [cell.strip() for cell in ours.strip("|").split("|")][1:3] == [
        "3",
        "50.0 (40.0 to 60.0)",
    ]
    assert ours.rstrip("| ").endswith("(20.0 to 30.0)")
    assert "more than the default" in head


def test_clips_are_listed_with_every_preset_the_best_captured_first():
    walk = {"mpjpe_root": 40.0, "pa_mpjpe": 30.0}
    best = {
        "roll": {"coverage": 0.0},
        "walk": walk,
        "sample": {"mpjpe_root": 35.0, "pa_mpjpe": 20.0},
        "mean": walk,
    }
    fast = best | {"roll": {"mpjpe_root": 90.0, "pa_mpjpe": 70.06}}
    figures = {"best": {"nothing given": best}, "fast": {"nothing given": fast}}
    head, _, *lines = presets_table(figures).splitlines()
    assert [[cell.strip() for cell in line.strip("|").split("|")] for line in (head, *lines)] == [
        ["MPJPE-root / PA-MPJPE mm, nothing given", "best", "fast"],
        ["sample", "35.0 / 20.0", "35.0 / 20.0"],
        ["walk", "40.0 / 30.0", "40.0 / 30.0"],
        ["roll", "not found", "90.0 / 70.1"],
        ["mean", "40.0 / 30.0", "40.0 / 30.0"],
    ]
