# SPDX-License-Identifier: GPL-3.0-or-later
"""All frames of a track at once, on motions whose truth is known.

The joints' standard deviations along the line of sight and across it.

A limb that starts on the wrong side of the image plane, on motions whose truth is known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.fitting.prepared_track import Stance
from scope.scope_addon.capture.fitting.weights import motion_priors
from scope.scope_addon.capture.perception.landmark_network import HIPS
from scope.scope_addon.capture.world import clip_fit
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.scope_addon.capture.world.clip_fit import ACROSS, ALONG, joint_sigma
from scope.scope_addon.capture.world.placement import place_track
from scope.scope_addon.kinematics.body_surface import BodySurface, with_arm_points
from scope.solver.rotations import exp

from ...exact_tracks import centred
from .waving_person import (
    ARM,
    BODY,
    FPS,
    FRAMES,
    JOINTS,
    LEG,
    fit,
    joints,
    keypoints,
    moving_path,
    person,
    prepare,
)


def stance_of(true, resting=(0.0,) * 6):
    """Somebody upright far above the floor, whose contact points rest with these probabilities."""
    T = len(true.t_camera_root)
    return Stance(
        true.t_camera_root,
        np.tile(np.eye(3), (T, 1, 1)),
        np.tile([0.0, -1.0, 0.0], (T, 1)),
        np.full(T, -5.0),
        np.zeros((T, 6)),
        np.tile(resting, (T, 1)),
    )


LEFT_FOOT = (1.0, 1.0, 0.0, 0.0, 0.0, 0.0)


def shaken(track, deviation_px, seed):
    noise = np.random.default_rng(seed).normal(0.0, deviation_px, track.keypoints_px.shape)
    return replace(track, keypoints_px=track.keypoints_px + noise)


def with_mirrored_leg(true, span):
    """The states with the right leg on the other side of the image plane in some frames."""
    start = replace(true, rotations=true.rotations.copy())
    for joint, angle in (("right_hip", -0.3), ("right_knee", -0.9)):
        start.rotations[span, BODY.joint_names.index(joint)] = exp(np.array([angle, 0.0, 0.0]))
    return start


@pytest.mark.parametrize("flipped", [1, 8])
def test_a_limb_that_is_lifted_to_its_mirror_image_for_some_frames_stays_where_it_was(flipped):
    """The image shows a leg bent towards the camera as one bent away; the lifter is half as sure
    where it is wrong.
    """
    track, true = person()
    wrong = track.world_landmarks.copy()
    sigma = np.full((FRAMES, JOINTS), 0.1)
    span = slice(6, 6 + flipped)
    mirrored = 2 * wrong[:, HIPS[1], None, 2] - wrong[:, LEG, 2]
    wrong[span, LEG, 2] = mirrored[span]
    sigma[span, LEG] = 0.25
    start = with_mirrored_leg(true, span)
    found = fit(prepare(track, wrong, sigma), start)
    ankle = BODY.joint_names.index("right_ankle")
    truth, before, after = (joints(each)[:, ankle, 2] for each in (true, start, found))
    assert np.abs(before - truth)[span].min() > 0.5
    np.testing.assert_allclose(after, truth, atol=0.06)


def test_noise_of_single_frames_is_averaged_and_a_motion_keeps_its_amplitude():
    track, true = person(32)
    rng = np.random.default_rng(1)
    lifted = track.world_landmarks + rng.normal(0.0, 0.03, track.world_landmarks.shape)
    prepared = prepare(shaken(track, 4.0, seed=0), lifted)
    together = fit(prepared, true)
    some = range(2, 32, 4)
    alone = [fit(prepared, replace(true, valid=np.arange(32) == k)) for k in some]
    wrist = BODY.joint_names.index("left_wrist")
    truth = joints(true)
    one_by_one = np.array([joints(each)[k] for k, each in zip(some, alone, strict=True)])
    without_noise = joints(fit(prepare(track), true))  # its trunk leans more than the true one

    def error(found):
        return np.linalg.norm(found - without_noise[some], axis=-1).mean()

    assert error(joints(together)[some]) < 0.4 * error(one_by_one)
    assert abs(np.ptp(joints(together)[:, wrist, 1]) / np.ptp(truth[:, wrist, 1]) - 1) < 0.05


def test_a_limb_that_nothing_shows_has_larger_deviations_than_its_twin():
    track, true = person()
    sigma = np.full((FRAMES, JOINTS), 0.1)
    track.confidence[12:, ARM] = 0.0
    sigma[12:, ARM] = 10.0
    found = fit(prepare(track, sigma_m=sigma), true).joint_sigma_m
    left, right = (found[:, BODY.joint_names.index(f"{side}_wrist")] for side in ("left", "right"))
    assert (left[18:] > 2.0 * right[18:]).all()
    assert (left[:6] < 1.5 * right[:6]).all()


def test_soles_that_rest_stay_in_place():
    track, true = person()
    unsteady = prepare(shaken(track, 6.0, seed=1))
    slides = []
    for stance in (stance_of(true), stance_of(true, LEFT_FOOT)):
        prepared = unsteady.with_stance(stance, true.betas)
        soles = place_track(BODY, track, fit(prepared, true), smoothing=False).soles[:, :2]
        slides.append(np.linalg.norm(np.diff(soles, axis=0), axis=-1).mean())
    assert slides[0] > 5e-4
    assert slides[1] < 0.2 * slides[0]


def test_soles_that_rest_do_not_drift():
    path = moving_path(60)
    track, first = person(60, path)
    true = path.to_frames(first)
    track.keypoints_px[..., 0] += np.linspace(-4.0, 4.0, 60)[:, None]  # 2 cm at 4 m
    prepared = prepare(track).with_stance(stance_of(true, LEFT_FOOT), true.betas)
    found = fit(prepared, true, path)
    soles = place_track(BODY, track, found, smoothing=False, path=path).soles[:, :2]
    assert np.linalg.norm(soles[-1] - soles[0], axis=-1).max() < 0.004


def test_a_moving_camera_gives_the_same_motion_as_a_static_one():
    path = moving_path()
    still, true = person()
    moved, _ = person(path=path)
    static = fit(prepare(still), true)
    start = path.to_frames(true)
    assert np.abs(start.t_camera_root - true.t_camera_root).max() > 0.2
    moving = path.to_first(fit(prepare(moved), start, path))
    assert (
        np.linalg.norm(joints(moving) - joints(static), axis=-1).max() < 0.025
    )  # the depth of a limb is another direction
    np.testing.assert_allclose(path.to_first(start).t_camera_root, true.t_camera_root, atol=1e-12)
    np.testing.assert_allclose(path.to_first(start).rotations, true.rotations, atol=1e-12)


def test_windows_agree_with_the_whole_and_join_smoothly(monkeypatch):
    track, true = person(64)  # a little longer than trials of mirrored limbs may be
    prepared = prepare(shaken(track, 3.0, seed=2))
    whole = fit(prepared, true)
    monkeypatch.setattr(clip_fit, "WINDOW_UNKNOWNS", 34 * 3 * (BODY.K + 2))
    monkeypatch.setattr(clip_fit, "OVERLAP", 8 * 3 * (BODY.K + 2))
    parts = fit(prepared, true)
    off_m = np.linalg.norm(joints(parts) - joints(whole), axis=-1)
    assert off_m.max() < 0.008  # the whole itself is only that near to its minimum
    jerk = [np.abs(np.diff(joints(each), n=3, axis=0)).max() for each in (whole, parts)]
    assert jerk[1] < 1.5 * jerk[0]
    np.testing.assert_allclose(parts.joint_sigma_m[4:-4], whole.joint_sigma_m[4:-4], rtol=0.35)


def test_windows_cover_all_frames_and_overlap():
    assert clip_fit.overlapping_slices(100, 100, 20) == [slice(0, 100)]
    for count, most, overlap in ((101, 100, 20), (1000, 320, 64), (1001, 320, 64), (7, 5, 1)):
        found = clip_fit.overlapping_slices(count, most, overlap)
        assert found[0].start == 0
        assert found[-1].stop == count
        # no more than is needed
        assert sum(w.stop - w.start for w in found) < count + len(found) * (overlap + 1)
        for a, b in zip(found[:-1], found[1:], strict=True):
            assert b.stop - b.start == a.stop - a.start <= most
            assert a.stop - b.start >= overlap


def test_longer_gaps_separate_what_is_fitted_together():
    times = np.arange(60) / FPS
    valid = np.ones(60, bool)
    # 0.17 s and 0.7 s
    valid[10:14] = False
    valid[30:50] = False
    first, second = clip_fit.frames_between_gaps(valid, times)
    assert first.tolist() == [*range(10), *range(14, 30)]
    assert second.tolist() == [*range(50, 60)]
    assert list(clip_fit.frames_between_gaps(np.zeros(3, bool), times[:3])) == []
    (slow,) = clip_fit.frames_between_gaps(
        np.ones(4, bool), np.arange(4.0)
    )  # one frame a second has no gaps
    assert len(slow) == 4


def test_frames_that_were_not_seen_and_the_states_to_start_from_stay_as_they_are():
    track, true = person()
    start = replace(true, valid=np.arange(FRAMES) < 12)
    before = start.rotations.copy(), start.t_camera_root.copy()
    found = fit(prepare(track), start)
    np.testing.assert_array_equal(found.rotations[12:], start.rotations[12:])
    np.testing.assert_array_equal(found.valid, start.valid)
    np.testing.assert_array_equal(start.rotations, before[0])
    np.testing.assert_array_equal(start.t_camera_root, before[1])


def test_acceleration_weighs_more_the_more_frames_there_are():
    at = {rate: motion_priors(BODY, np.arange(5) / rate)[0] for rate in (10.0, 30.0, 60.0, 120.0)}
    reference = at[60.0].root_position
    scales = [at[rate].root_position / reference for rate in (10.0, 30.0, 120.0)]
    np.testing.assert_allclose(scales, [1 / 36, 1 / 4, 2.0])
    assert motion_priors(BODY, np.zeros(1))[0].root_position == reference
    assert len({prior.contact for prior in at.values()}) == 1


def test_the_second_fit_lets_go_of_what_is_three_times_as_fast_as_usual():
    first, second = motion_priors(BODY, np.arange(5) / 60.0)
    assert first.robust_root_position == np.inf
    assert second.robust_root_position == pytest.approx((3 * 3.8) ** 2)
    spine, knee = (BODY.joint_names.index(name) - 1 for name in ("spine2", "left_knee"))
    for prior in (first, second):  # a knee accelerates more than a spine
        assert np.asarray(prior.joints)[spine] > 5 * np.asarray(prior.joints)[knee]


def test_a_hand_that_is_lifted_into_the_trunk_lies_on_it():
    """The image does not show the left arm, and the lifting network has it hanging through the
    hips.
    """
    track, true = person()
    shoulder = BODY.joint_names.index("left_shoulder")
    start = replace(true, rotations=true.rotations.copy())
    start.rotations[:, shoulder] = exp(np.array([0.0, 0.0, -1.8]))
    track.confidence[:, ARM] = 0.0
    points = keypoints(start.rotations, start.t_camera_root)
    surface = BodySurface(with_arm_points(BODY), np.zeros(BODY.P))

    def lowest(states):
        root = states.t_camera_root - BODY.rest_joints()[0]
        poses = BODY.forward_kinematics(states.rotations, root)
        return surface.planes(*poses).height.min(axis=1)

    assert lowest(start).max() < -0.03
    found = fit(prepare(track, centred(points)).with_stance(stance_of(true), true.betas), start)
    assert lowest(found).min() > -0.015


def _covariances(sights, along_m, across_m):
    """Covariances (T, K+1, 3, 3) with these deviations along unit vectors (T, K+1, 3) and at right
    angles to them.
    """
    outer = sights[..., :, None] * sights[..., None, :]
    return along_m**2 * outer + across_m**2 * (np.eye(3) - outer)


def test_deviations_are_those_along_each_joints_own_line_of_sight():
    rng = np.random.default_rng(0)
    joints = rng.normal(0.0, 1.0, (5, 4, 3)) + [0.0, 0.0, 4.0]
    sights = joints / np.linalg.norm(joints, axis=-1, keepdims=True)
    pelvis = _covariances(sights, 0.03, 0.01)
    others = _covariances(sights, 0.006, 0.002)
    sigma = joint_sigma(pelvis[:, 0], others, joints, np.arange(5) / 60.0)
    np.testing.assert_allclose(sigma[:, 0], np.tile([0.03 * ALONG, 0.01 * ACROSS], (5, 1)))
    np.testing.assert_allclose(sigma[:, 1:], np.tile([0.006 * ALONG, 0.002 * ACROSS], (5, 3, 1)))


def test_the_same_covariance_says_less_of_more_frames_and_a_single_one_is_as_one_of_few():
    joints = np.tile([0.0, 0.0, 3.0], (3, 2, 1))
    covariance = np.tile(1e-5 * np.eye(3), (3, 2, 1, 1))
    at_1, at_10, at_30, at_60 = (
        joint_sigma(covariance[:, 0], covariance, joints, np.arange(3) / rate)
        for rate in (1.0, 10.0, 30.0, 60.0)
    )
    np.testing.assert_allclose(at_60, 2**0.3 * at_30)
    np.testing.assert_allclose(at_10, at_1)
    one = joint_sigma(covariance[:1, 0], covariance[:1], joints[:1], np.zeros(1))
    np.testing.assert_allclose(one, at_10[:1])


LIMB_SEARCH_FRAMES = 64


SPAN = slice(12, 52)


@pytest.mark.slow
def test_a_limb_that_starts_mirrored_for_long_ends_where_it_was() -> None:
    """For forty frames of a moving camera, the lifter cannot tell the thigh before the hip from one
    behind it, and the start is wrong.
    """
    angles = np.linspace(0.0, 0.3, LIMB_SEARCH_FRAMES)
    turns = exp(angles[:, None] * [0.0, 1.0, 0.0])
    path = CameraPath(turns, np.linspace([0.0, 0.0, 0.0], [0.4, 0.0, 0.0], LIMB_SEARCH_FRAMES))
    track, true = person(LIMB_SEARCH_FRAMES, path)
    unsure = track.world_landmarks.copy()
    sigma = np.full((LIMB_SEARCH_FRAMES, JOINTS), 0.1)
    unsure[SPAN, LEG, 2] = unsure[SPAN, HIPS[1], None, 2]
    sigma[SPAN, LEG] = 0.8
    start = with_mirrored_leg(true, SPAN)
    ankle = BODY.joint_names.index("right_ankle")
    found = path.to_first(fit(prepare(track, unsure, sigma), path.to_frames(start), path))
    truth, before, after = (joints(each)[:, ankle] for each in (true, start, found))
    assert np.linalg.norm(before - truth, axis=1)[SPAN].min() > 0.5
    assert np.linalg.norm(after - truth, axis=1).max() < 0.1
