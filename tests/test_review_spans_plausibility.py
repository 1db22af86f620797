# SPDX-License-Identifier: GPL-3.0-or-later
"""What nobody can do, put into the motion of somebody who walks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.motion import Motion
from scope.scope_addon.review_spans import (
    find_review_spans,
    has_bent_knees,
    implausible,
    joints_in_world,
)
from scope.solver.names import BODY_JOINTS

from .edit.walking import motion_of, walk

WALK = motion_of(walk(6.0))
WALK = replace(WALK, image_size=np.array([1280, 720]))
AT = {name: k for k, name in enumerate(BODY_JOINTS)}


def moved(change: dict[str, np.ndarray]) -> Motion:
    """The walk with joints moved by these vectors (T, 3) or (3,) in the world."""
    joints = WALK.joints_cam.astype(float).copy()
    for name, vector in change.items():
        R = WALK.world_from_camera[:, :3, :3]
        joints[:, AT[name]] += np.einsum("tji,tj->ti", R, np.broadcast_to(vector, (len(WALK), 3)))
    return replace(WALK, joints_cam=joints.astype(np.float32))


def test_a_walk_is_plausible() -> None:
    assert not any(frames.any() for frames in implausible(WALK).values())
    assert not has_bent_knees(WALK)


@pytest.mark.parametrize("limb", [("left_ankle", "left_hip"), ("right_wrist", "right_shoulder")])
def test_a_limb_that_passes_to_the_other_side_in_depth_alone_is_found(
    limb: tuple[str, str],
) -> None:
    end, root = limb
    joints = WALK.joints_cam.copy()
    joints[:, AT[end]] = joints[:, AT[root]] + np.array([0.05, 0.4, -0.35], np.float32)
    joints[61:, AT[end], 2] += 0.7
    found = implausible(replace(WALK, joints_cam=joints))
    rows = np.flatnonzero(found["swing"])
    assert 50 <= rows[0] <= 60
    assert rows[-1] - rows[0] < 20
    assert not found["lean"].any()
    spans = find_review_spans(replace(WALK, joints_cam=joints))
    assert "swing" in [span.reason for span in spans]
    # The same in half a second is a movement.
    slow = WALK.joints_cam.copy()
    depth = np.interp(WALK.timestamps, [2.0, 2.6], [-0.35, 0.35])
    slow[:, AT[end]] = slow[:, AT[root]] + np.array([0.05, 0.4, 0.0], np.float32)
    slow[:, AT[end], 2] += depth.astype(np.float32)
    assert not implausible(replace(WALK, joints_cam=slow))["swing"].any()


def leaning(degrees: float, rows: slice) -> Motion:
    """The walk with everything above the ankles turned about them."""
    joints = joints_in_world(WALK)
    angle = np.zeros(len(WALK))
    angle[rows] = np.radians(degrees)
    feet = joints[:, [AT["left_ankle"], AT["right_ankle"]]].mean(axis=1)
    height = joints[..., 2] - feet[:, None, 2]
    # Only sideways, so that no joint leaves the image's depth.
    shift = np.zeros_like(joints)
    shift[..., 0] = np.tan(angle)[:, None] * np.maximum(height, 0)
    leans = moved({name: shift[:, k] for name, k in AT.items()})
    return replace(leans, foot_contact=np.ones((len(leans), 4)))


def test_a_lean_that_is_held_is_found_and_a_short_one_is_a_step() -> None:
    held = implausible(leaning(35.0, slice(30, 150)))["lean"]
    assert held[40:140].all()
    assert not held[:30].any()
    assert not implausible(leaning(35.0, slice(30, 60)))["lean"].any()
    assert not implausible(leaning(8.0, slice(30, 150)))["lean"].any()


def test_two_people_who_lean_shortly_before_and_after_a_cut_do_not_hold_that() -> None:
    held = leaning(35.0, slice(40, 120))
    assert implausible(held)["lean"].any()
    assert not implausible(replace(held, scene_starts=np.array([80])))["lean"].any()


def test_a_limb_does_not_swing_over_a_cut() -> None:
    joints = WALK.joints_cam.copy()
    wrist = AT["left_wrist"]
    joints[:, wrist] = joints[:, AT["left_shoulder"]] + np.array([0.05, 0.4, -0.35], np.float32)
    joints[61:, wrist, 2] += 0.7
    moved_in_depth = replace(WALK, joints_cam=joints)
    assert implausible(moved_in_depth)["swing"].any()
    assert not implausible(replace(moved_in_depth, scene_starts=np.array([61])))["swing"].any()


def test_a_person_who_floats_is_found_but_not_one_who_jumps() -> None:
    def lifted(rows: slice) -> Motion:
        height = np.zeros((len(WALK), 3))
        height[rows, 2] = 0.8
        return moved(dict.fromkeys(AT, height))

    floats = implausible(lifted(slice(40, 120)))["floating"]
    assert floats[40:120].all()
    assert floats.sum() == 80
    assert not implausible(lifted(slice(40, 60)))["floating"].any()
    # On the hands, somebody is not in the air.
    wrists = [AT["left_wrist"], AT["right_wrist"]]
    on_hands = lifted(slice(40, 120))
    joints = on_hands.joints_cam.copy()
    joints[:, wrists] = WALK.joints_cam[:, [AT["left_foot"], AT["right_foot"]]]
    assert not implausible(replace(on_hands, joints_cam=joints))["floating"].any()
    uneven = replace(lifted(slice(40, 120)), uneven_ground=True)
    assert not implausible(uneven)["floating"].any()


def test_the_pose_that_is_kept_while_a_jumper_is_not_seen_does_not_float() -> None:
    height = np.zeros((len(WALK), 3))
    height[40:120, 2] = 0.8
    floats = moved(dict.fromkeys(AT, height))
    lost = np.arange(len(WALK)) >= 60
    assert not implausible(replace(floats, valid=~lost))["floating"].any()
    now_and_then = np.arange(len(WALK)) % 10 == 5
    found = implausible(replace(floats, valid=~now_and_then))["floating"]
    assert found.sum() == 72


def test_knees_that_are_never_straight_are_said_of_who_stands() -> None:
    bent = motion_of(walk(6.0, bent=0.5))
    bent = replace(bent, image_size=np.array([1280, 720]))
    assert has_bent_knees(bent)
    assert not has_bent_knees(motion_of(walk(1.0, bent=0.5)))


def test_bent_knees_are_said_of_who_stands_in_most_of_the_frames_that_show_them() -> None:
    bent = motion_of(walk(14.0, bent=0.5))
    seen = np.arange(len(bent)) < 150
    half = replace(bent, image_size=np.array([1280, 720]), valid=seen)
    assert has_bent_knees(half)


def test_an_imported_motion_which_no_camera_has_seen_is_not_judged() -> None:
    imported = replace(WALK, image_size=np.zeros(2, int))
    assert not any(frames.any() for frames in implausible(imported).values())


def test_a_body_that_is_elsewhere_from_one_frame_to_the_next_is_found() -> None:
    """Beside where it was, as in footage that leaves a second out, or nearer; not a little, nor at
    a cut, nor somebody who is as fast for a while.
    """
    across = np.zeros((len(WALK), 3))
    across[90:, 0] = 1.0
    leaps = moved(dict.fromkeys(AT, across))
    assert np.flatnonzero(implausible(leaps)["leap"]).tolist() == [89, 90]
    assert not implausible(moved(dict.fromkeys(AT, 0.2 * across)))["leap"].any()
    nearer = moved(dict.fromkeys(AT, across[:, [1, 0, 2]]))
    assert np.flatnonzero(implausible(nearer)["leap"]).tolist() == [89, 90]
    assert not implausible(replace(leaps, scene_starts=np.array([90])))["leap"].any()
    seen = WALK.valid.copy()
    seen[80:90] = False
    assert not implausible(replace(leaps, valid=seen))["leap"].any()
    across[90:, 0] = np.minimum(9.0 * (WALK.timestamps[90:] - WALK.timestamps[90]), 9.0)
    assert not implausible(moved(dict.fromkeys(AT, across)))["leap"].any()


def seen_at(at: np.ndarray) -> Motion:
    """The walk, from a camera 10 m to the side, with keypoints where these points (T, K, 3) in the
    world are seen; the body stays where it was, as if it had been fitted loosely.
    """
    R = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # looks along minus x
    T = np.tile(np.eye(4), (len(WALK), 1, 1))
    T[:, :3, :3] = R
    T[:, :3, 3] = [10.0, at[0, 0, 1], 1.0]
    pixels = (at - T[:, None, :3, 3]) @ R @ WALK.intrinsics.T
    before = WALK.world_from_camera
    joints = np.einsum("tij,tkj->tki", before[:, :3, :3], WALK.joints_cam) + before[:, None, :3, 3]
    sure = np.ones_like(pixels[..., :1])
    return replace(
        WALK,
        world_from_camera=T,
        joints_cam=((joints - T[:, None, :3, 3]) @ R).astype(np.float32),
        keypoints2d=np.concatenate([pixels[..., :2] / pixels[..., 2:], sure], axis=2),
        keypoints2d_names=np.array([f"point{k}" for k in range(at.shape[1])]),
    )


def test_a_pose_that_is_another_one_from_one_frame_to_the_next_is_found() -> None:
    """As at a jump cut while the person stays; not at a marked cut, nor within half a second."""
    at = joints_in_world(WALK)
    other = np.random.default_rng(1).normal(scale=0.3, size=(at.shape[1], 3))
    other[0] = 0.0
    jumps = at.copy()
    jumps[90:] += other
    found = seen_at(jumps)
    assert np.flatnonzero(implausible(found)["leap"]).tolist() == [89, 90]
    assert not implausible(replace(found, scene_starts=np.array([90])))["leap"].any()
    share = np.clip((WALK.timestamps - WALK.timestamps[90]) / 0.5, 0.0, 1.0)
    moves = at + share[:, None, None] * other
    assert not implausible(seen_at(moves))["leap"].any()


def test_a_file_s_intrinsics_need_no_inverse() -> None:
    """Focal lengths and sides above 0 are all that a motion file must have."""
    singular = WALK.intrinsics.copy()
    singular[2, 2] = 0.0
    assert not implausible(replace(WALK, intrinsics=singular))["leap"].any()


def boxing() -> np.ndarray:
    """Both hands strike in turn, 0.6 m at 10 m/s, with the elbows half as far."""
    at = joints_in_world(WALK)
    for k, side in enumerate(("left", "right")):
        phase = (WALK.timestamps + 0.3 * k) % 0.6
        reach = 0.3 * (1.0 - np.cos(2.0 * np.pi * np.clip(phase / 0.19, 0.0, 1.0)))
        at[:, AT[f"{side}_wrist"], 1] += reach
        at[:, AT[f"{side}_elbow"], 1] += 0.5 * reach
    return at


def sprinting() -> np.ndarray:
    """Starts to run at 10 m/s within half a second, past the camera."""
    at = joints_in_world(WALK)
    t = np.maximum(WALK.timestamps - WALK.timestamps[60], 0.0)
    at[..., 1] += np.where(t < 0.5, 10.0 * t**2, 10.0 * (t - 0.25))[:, None]
    return at


def one_limb_mistaken() -> np.ndarray:
    at = joints_in_world(WALK)
    arm = [AT[f"left_{part}"] for part in ("shoulder", "elbow", "wrist")]
    other = [AT[f"right_{part}"] for part in ("shoulder", "elbow", "wrist")]
    at[90:, arm] = at[90:, other]
    return at


@pytest.mark.parametrize("acting", [boxing, sprinting, one_limb_mistaken])
def test_what_a_body_can_do_is_no_leap(acting: Callable[[], np.ndarray]) -> None:
    assert not implausible(seen_at(acting()))["leap"].any()


def standing(shift_m: np.ndarray, fps: float) -> Motion:
    """Return a standing person whose body moves sideways by (T,) metres."""
    at = np.repeat(joints_in_world(WALK)[:1], len(WALK), axis=0)
    at[..., 0] += shift_m[:, None]
    joints = WALK.joints_cam.astype(float)
    T = WALK.world_from_camera
    joints[:, : at.shape[1]] = (at - T[:, None, :3, 3]) @ T[:, :3, :3]
    timestamps = np.arange(len(WALK)) / fps
    return replace(WALK, joints_cam=joints.astype(np.float32), timestamps=timestamps)


def test_a_small_step_at_a_high_rate_is_no_leap() -> None:
    """The fit of a slow-motion clip shifts by 6 cm in one frame, which are 14 m/s."""
    shift_m = np.where(np.arange(len(WALK)) < 90, 0.0, 0.06)
    assert not implausible(standing(shift_m, 240.0))["leap"].any()


@pytest.mark.parametrize("fps", [60, 120, 240])
def test_a_leap_that_smoothing_spreads_over_frames_is_found_at_any_rate(fps: int) -> None:
    """A metre in a tenth of a second."""
    shift_m = np.clip((np.arange(len(WALK)) - 90) / (0.1 * fps), 0.0, 1.0)
    found = implausible(standing(shift_m, fps))["leap"]
    assert np.flatnonzero(found).tolist() == list(range(90, 91 + fps // 10))


@pytest.mark.parametrize("fps", [30, 60, 120])
@pytest.mark.parametrize("end", ["left_ankle", "right_wrist"])
def test_a_limb_that_is_elsewhere_from_one_frame_to_the_next_is_found(end: str, fps: int) -> None:
    """By half a metre; not by 5 cm, nor at a cut, nor in a sixth of a second, as in a kick."""
    across = np.zeros((len(WALK), 3))
    across[90:, 0] = 0.5

    def at_rate(shift_m: np.ndarray) -> Motion:
        still = standing(np.zeros(len(WALK)), fps)
        joints = still.joints_cam.astype(float)
        R = still.world_from_camera[:, :3, :3]
        joints[:, AT[end]] += np.einsum("tji,tj->ti", R, shift_m)
        return replace(still, joints_cam=joints.astype(np.float32))

    found = implausible(at_rate(across))
    rows = np.flatnonzero(found.pop("snap"))
    assert {89, 90} <= set(rows.tolist())
    assert np.abs(rows - 89.5).max() / fps < 0.06
    assert not any(frames.any() for frames in found.values())
    assert not implausible(at_rate(0.1 * across))["snap"].any()
    cut = replace(at_rate(across), scene_starts=np.array([90]))
    assert not implausible(cut)["snap"].any()
    t = np.clip((np.arange(len(WALK)) - 90) / (fps / 6), 0.0, 1.0)
    across[:, 0] = 0.5 * (1.0 - np.cos(np.pi * t))
    assert not implausible(at_rate(across))["snap"].any()


@pytest.mark.parametrize("acting", [boxing, sprinting])
def test_what_a_limb_can_do_is_no_snap(acting: Callable[[], np.ndarray]) -> None:
    at = acting()
    T = WALK.world_from_camera
    joints = WALK.joints_cam.astype(float)
    joints[:, : at.shape[1]] = (at - T[:, None, :3, 3]) @ T[:, :3, :3]
    acted = replace(WALK, joints_cam=joints.astype(np.float32))
    assert not implausible(acted)["snap"].any()
    assert not implausible(acted)["spin"].any()


def turned(degrees: np.ndarray) -> Motion:
    """Return a standing person who is turned by (T,) degrees."""
    still = standing(np.zeros(len(WALK)), 30.0)
    at = joints_in_world(still)
    pelvis = at[:, :1]
    c = np.cos(np.radians(degrees))[:, None]
    s = np.sin(np.radians(degrees))[:, None]
    x, y, z = np.moveaxis(at - pelvis, 2, 0)
    at = pelvis + np.stack([c * x - s * y, s * x + c * y, z], axis=2)
    T = still.world_from_camera
    joints = still.joints_cam.astype(float)
    joints[:, : at.shape[1]] = (at - T[:, None, :3, 3]) @ T[:, :3, :3]
    return replace(still, joints_cam=joints.astype(np.float32))


def test_a_body_that_faces_the_other_way_at_once_is_found() -> None:
    """Within a tenth of a second; not in half a second, nor a dancer's pirouettes."""
    frames = np.arange(len(WALK)) - 90
    found = implausible(turned(np.clip(60.0 * frames, 0.0, 180.0)))["spin"]
    assert np.flatnonzero(found).tolist() == [90, 91, 92, 93]
    assert not implausible(turned(np.clip(12.0 * frames, 0.0, 180.0)))["spin"].any()
    assert not implausible(turned(np.clip(30.0 * frames, 0.0, 1800.0)))["spin"].any()


def test_a_body_that_misses_the_footage_for_its_size_is_found() -> None:
    """By 8 cm at its distance for a third of a second; not for a moment, nor by 3 cm."""
    walk_past = seen_at(joints_in_world(WALK))
    px_per_m = walk_past.intrinsics[0, 0] / walk_past.joints_cam[:, AT["pelvis"], 2]
    during = np.zeros(len(WALK))
    during[60:70] = 1.0
    found = implausible(replace(walk_past, residual_px=0.08 * px_per_m * during))["far"]
    assert np.flatnonzero(found).tolist() == list(range(60, 70))
    missed = replace(walk_past, residual_px=0.08 * px_per_m * during)
    assert [(s.reason, s.first, s.last) for s in find_review_spans(missed)] == [("far", 60, 69)]
    assert not implausible(replace(walk_past, residual_px=0.03 * px_per_m * during))["far"].any()
    during[63:] = 0.0
    assert not implausible(replace(walk_past, residual_px=0.08 * px_per_m * during))["far"].any()
