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
    Take,
    held_out_takes,
)
from scope.benchmarks.perception.renders import (
    against_world,
    intervals_table,
)
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.solver.body_file import ASSETS
from scope.solver.rotations import log
from scope.tools.render_sample.choreography import choreograph


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
