# SPDX-License-Identifier: GPL-3.0-or-later
"""Straightening legs: of a made leg whose joints are wrong in a known way, and never what CMU's
solver held at 0.

Fitting our body to motion: the fit is compared with the source's own bones, and with what
bodies can do.
"""

import numpy as np
import pytest
from scope.tools.mocap import fit_body, library
from scope.tools.mocap.straight_legs import MOST_M, flexion, knee_flexions, straightened
from scope.tools.mocap.take import Take

from .archives import beginning

THIGH = 0.42


SHANK = 0.41


NAMES = ("pelvis", *(f"{s}_{j}" for s in ("left", "right") for j in ("hip", "knee", "ankle")))


def made_take(knee_deg, name="train_directing_traffic_1", source="cmu_expmap", lowered_m=0.025):
    """Somebody who stands facing +z and bends the knees by these angles (T,), hips and ankles
    displaced as CMU's are.

    ``lowered_m``: how far the hips are below where they should be.
    """
    half = 0.5 * np.radians(np.asarray(knee_deg, float))
    T = len(half)
    positions = np.zeros((T, len(NAMES), 3))
    positions[:, 0, 1] = 0.95
    orientations = np.tile(np.eye(3), (T, len(NAMES), 1, 1))
    for k, x in ((1, 0.09), (4, -0.09)):
        zero = np.zeros(T)
        hip = np.array([x, 0.9, 0.0]) + np.zeros((T, 1))
        knee = hip + np.stack([zero, -THIGH * np.cos(half), THIGH * np.sin(half)], axis=1)
        ankle = knee + np.stack([zero, -SHANK * np.cos(half), -SHANK * np.sin(half)], axis=1)
        positions[:, k : k + 3] = np.stack([hip - [0.0, lowered_m, 0.0], knee, ankle], axis=1)
    return Take(name, "expmap_someone", 30.0, NAMES, positions, source, orientations=orientations)


def legs(take):
    return {name: take.joint(name) for name in NAMES[1:]}


def test_flexion_has_the_sign_of_the_side_to_which_a_knee_bends():
    left = np.array([[1.0, 0.0, 0.0]])
    hip = np.array([[0.0, 1.0, 0.0]])
    ankle = np.array([[0.0, 0.0, 0.0]])
    assert flexion(hip, np.array([[0.0, 0.5, 0.1]]), ankle, left) == pytest.approx(
        2 * np.degrees(np.arctan(0.2))
    )
    assert flexion(hip, np.array([[0.0, 0.5, -0.1]]), ankle, left) == pytest.approx(
        -2 * np.degrees(np.arctan(0.2))
    )
    assert flexion(hip, np.array([[0.0, 0.5, 0.0]]), ankle, left) == pytest.approx(0.0)


def test_standing_knees_get_the_flexion_of_people():
    before = made_take(np.linspace(12.0, 30.0, 40))
    after = straightened(before)
    flexed = knee_flexions(legs(after))
    assert np.percentile(flexed, 5) == pytest.approx(4.0, abs=0.1)
    # The same distance turns all knees by nearly as much.
    turned = knee_flexions(legs(before)) - flexed
    assert np.ptp(turned) < 1.5
    moved = before.joint("left_knee") - after.joint("left_knee")
    x = np.linalg.norm(moved, axis=1) / np.cos(np.radians(knee_flexions(legs(after))[0]) / 2) ** 2
    assert 0.0 < x.min() < x.max() < MOST_M
    np.testing.assert_allclose(
        after.joint("left_hip") - before.joint("left_hip"), [[0.0, 0.025, 0.0]] * 40, atol=1e-12
    )
    np.testing.assert_array_equal(after.joint("pelvis"), before.joint("pelvis"))


@pytest.fixture(scope="module")
def fitted(shared, body):
    """A walk with its skeleton, one without, and DeepMimic's."""
    files = {
        "cmu_asf_amc": ("03/03.asf", "02/02.asf", "02/02_01.amc"),
        "cmu_expmap": ("cmu_mocap/test/walking_extra/walking_19.txt",),
        "deepmimic_humanoid": ("characters/humanoid3d.txt", "motions/humanoid3d_walk.txt"),
    }
    read = {}
    for archive, names in files.items():
        texts = beginning(shared / "data" / "mocap" / f"{archive}.tar.xz", names[-1])
        read[archive] = {name: texts[name] for name in names}
    takes, skeletons = library.load_asf_amc(read["cmu_asf_amc"])
    takes += library.load_expmap(read["cmu_expmap"], library.expmap.average_skeleton(skeletons))
    takes += library.load_deepmimic(read["deepmimic_humanoid"])
    return fit_body.fit_library(body, [t.resampled(30) for t in takes])


def joint(fit, body, name):
    return fit.t[:, body.joint_names.index(name)]


def test_limbs_point_where_the_source_points(fitted, body):
    for fit in fitted:
        for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow")):
            for side in ("left", "right"):
                ours = joint(fit, body, f"{side}_{b}") - joint(fit, body, f"{side}_{a}")
                theirs = fit.take.joint(f"{side}_{b}") - fit.take.joint(f"{side}_{a}")
                cosine = np.einsum("ti,ti->t", ours, theirs)
                cosine /= np.linalg.norm(ours, axis=1) * np.linalg.norm(theirs, axis=1)
                assert np.degrees(np.arccos(cosine)).max() < 10, (fit.take.name, a)


def test_the_body_walks_forwards_upright_with_its_soles_on_the_floor(fitted, body):
    keypoints = body.keypoint_set("blazepose")
    for fit in fitted:
        facing = fit.R[:, 0, :, 2]
        velocity = np.gradient(fit.t[:, 0], axis=0) * fit.take.fps
        assert np.median(np.einsum("ti,ti->t", facing, velocity)) > 0.7
        assert (fit.R[:, 0, 1, 1] > 0.95).all()
        head = fit.R[:, body.joint_names.index("head")]
        assert np.median(head[:, 1, 1]) > 0.95
        soles = [keypoints[f"{s}_{p}"] for s in ("left", "right") for p in ("heel", "foot_index")]
        lowest = body.keypoints(fit.R, fit.t, fit.betas)[:, soles, 1].min(axis=1)
        assert -0.03 < lowest.min() < lowest.max() < 0.06


def test_hinges_bend_the_human_way_and_palms_face_the_thighs(fitted, body):
    for fit in fitted:
        poses = fit.poses.reshape(len(fit.poses), -1, 3)
        for side, sign in (("left", -1.0), ("right", 1.0)):
            knee = poses[:, body.joint_names.index(f"{side}_knee")]
            elbow = poses[:, body.joint_names.index(f"{side}_elbow")]
            assert np.degrees(knee[:, 0]).min() > -8  # the rest pose is bent by 7 degrees
            assert np.degrees(np.abs(knee[:, 1:])).max() < 10
            assert (sign * elbow[:, 1]).min() > -0.1
            palm = -fit.R[:, body.joint_names.index(f"{side}_wrist"), :, 1]  # down in the T-pose
            inwards = sign * fit.R[:, 0, :, 0]
            assert np.median(np.einsum("ti,ti->t", palm, inwards)) > 0.4, (fit.take.name, side)
        assert fit.valid.all()
