# SPDX-License-Identifier: GPL-3.0-or-later
"""Climbs: who rises, by how much, and how far a capture is from the truth in the world."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scope.benchmarks.climbs.accuracy import compare, world_mm
from scope.benchmarks.climbs.draw import draw_climb, rise_m
from scope.benchmarks.perception.held_out import Take
from scope.benchmarks.scenes.draw import FPS
from scope.benchmarks.scenes.people import LIMB_JOINTS
from scope.benchmarks.scenes.scene import Scene, write_truth
from scope.solver import Body
from scope.solver.rotations import exp, log

BOX_M = 0.5


@pytest.fixture(scope="module")
def takes(body: Body) -> list[Take]:
    """One recording of somebody who is lifted onto a box half-way, in a world with y up."""
    frames = 130
    poses = np.zeros((frames, 3 * (body.K + 1)))
    trans = np.zeros((frames, 3))
    trans[:, 1] = 1.0 + BOX_M * np.clip((np.arange(frames) - 50) / 30, 0, 1)
    return [Take(0, "up_0", poses, trans, np.ones(frames, bool), np.zeros(body.P), FPS * 2)]


@pytest.fixture(scope="module")
def scene(body: Body, takes: list[Take]) -> Scene:
    return draw_climb(body, takes, 0)


def captured(body: Body, scene: Scene, share: float) -> SimpleNamespace:
    """Return the true motion as a capture would, but with a share of the rise alone, in the world
    and in the image.
    """
    person = scene.people[0]
    T = len(scene)
    trans = person.trans.copy()
    trans[:, 2] = trans[0, 2] + share * (trans[:, 2] - trans[0, 2])
    joints = scene.to_camera(replace(person, trans=trans).joints(body))
    poses = log(person.rotations).reshape(T, -1)
    world = {
        "poses": poses,
        "trans": trans,
        "poses_raw": poses,
        "trans_raw": trans,
        "betas": person.betas,
    }
    camera = {
        "world_from_camera": scene.world_from_camera,
        "intrinsics": scene.intrinsics,
        "mocap_framerate": FPS,
    }
    return SimpleNamespace(
        joints_cam=joints, valid=np.ones(T, bool), frames=np.arange(T), **world, **camera
    )


def test_a_rise_is_that_of_the_lower_ankle_and_not_of_a_knee():
    limbs = np.zeros((40, len(LIMB_JOINTS), 3))
    # a foot in the air
    limbs[:, LIMB_JOINTS.index("left_ankle"), 2] = np.where(np.arange(40) < 20, 0.3, 1.0)
    limbs[:, LIMB_JOINTS.index("right_ankle"), 2] = np.where(np.arange(40) < 20, 0.1, 0.6)
    limbs[:, LIMB_JOINTS.index("left_knee"), 2] = np.linspace(-1, -9, 40)
    assert rise_m(limbs) == pytest.approx(0.5)


def test_the_world_error_ignores_heading_and_place_but_not_tilt_and_height():
    true = np.random.default_rng(0).normal(0, 0.5, (20, 12, 3))
    turned = true @ exp(np.array([0.0, 0.0, 2.5])).T + [3.0, -1.0, 0.7]
    assert world_mm(turned, true) == pytest.approx(0, abs=1e-9)
    tilted = true @ exp(np.array([0.2, 0.0, 0.0])).T
    assert world_mm(tilted, true) > 50
    flat = true.copy()
    flat[10:, :, 2] -= 0.2  # the second half is 20 cm too low: 10 cm from the mean either way
    assert world_mm(flat, true) == pytest.approx(100, abs=1e-6)


def test_a_capture_that_is_the_truth_has_no_error_and_half_the_rise_is_half(body, scene, tmp_path):
    path = tmp_path / "climb_0_truth.npz"
    write_truth(path, body, scene)
    with np.load(path) as data:
        truth = {key: data[key] for key in data.files}
    found = compare(body, captured(body, scene, 1.0), "climb_0", truth)
    assert found["rise_share"] == pytest.approx(1, abs=1e-3)
    assert found["found"] == 1
    assert max(found["mpjpe_root"], found["pa_mpjpe"], found["world_mm"]) < 0.1
    low = compare(body, captured(body, scene, 0.5), "climb_0", truth)
    assert low["rise_share"] == pytest.approx(0.5, abs=1e-3)
    assert low["world_mm"] > 50
