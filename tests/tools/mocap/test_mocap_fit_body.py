# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting our body to motion: the fit is compared with the source's own bones, and with what bodies
can do.
"""

import numpy as np
import pytest
from scope.solver.errors import ShapeError
from scope.solver.rotations import exp
from scope.tools.mocap import fit_body, library, retarget
from scope.tools.mocap.take import Take

from .archives import beginning


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


def test_the_joints_meet_their_targets(fitted):
    assert [f.take.source for f in fitted] == ["cmu_asf_amc", "cmu_expmap", "deepmimic"]
    for fit in fitted:
        error = fit.error[np.isfinite(fit.error)]
        assert np.median(error) < 0.006
        assert np.quantile(error, 0.95) < 0.02


def test_limbs_point_where_the_source_points(fitted, body):
    for fit in fitted:
        for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow")):
            for side in ("left", "right"):
                ours = joint(fit, body, f"{side}_{b}") - joint(fit, body, f"{side}_{a}")
                theirs = fit.take.joint(f"{side}_{b}") - fit.take.joint(f"{side}_{a}")
                cosine = np.einsum("ti,ti->t", ours, theirs)
                cosine /= np.linalg.norm(ours, axis=1) * np.linalg.norm(theirs, axis=1)
                assert np.degrees(np.arccos(cosine)).max() < 10, (fit.take.name, a)


def test_bones_have_the_source_s_lengths(fitted, body):
    for fit in fitted:
        J = body.rest_joints(fit.betas)
        # CMU's shoulders lie further in than ours, which makes their upper arms longer.
        for a, b, most in (("left_hip", "left_knee", 0.03), ("right_knee", "right_ankle", 0.03),
                           ("left_shoulder", "left_elbow", 0.05)):  # fmt: skip
            ours = np.linalg.norm(J[body.joint_names.index(a)] - J[body.joint_names.index(b)])
            theirs = np.linalg.norm(fit.take.joint(a)[0] - fit.take.joint(b)[0])
            assert ours == pytest.approx(theirs, abs=most)


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


def test_poses_and_trans_give_the_joints_back(fitted, body):
    for fit in fitted:
        _, t = body.forward_kinematics(
            exp(fit.poses.reshape(len(fit.poses), -1, 3)), fit.trans, fit.betas
        )
        np.testing.assert_allclose(t, fit.t, atol=1e-6)


def test_a_broken_recording_is_marked(body):
    Omega = np.tile(np.eye(3), (9, body.K + 1, 1, 1))
    assert fit_body.plausible(body, Omega, 30.0).all()
    ankle, hip = (body.joint_names.index(n) for n in ("left_ankle", "left_hip"))
    Omega[3, ankle] = exp([0.0, 0.0, np.pi])
    np.testing.assert_array_equal(
        fit_body.plausible(body, Omega, 30.0), [True] * 2 + [False] * 3 + [True] * 4
    )
    Omega[3, ankle] = np.eye(3)
    Omega[7:, hip] = exp([1.5, 0.0, 0.0])
    np.testing.assert_array_equal(np.flatnonzero(~fit_body.plausible(body, Omega, 30.0)), [6, 7])


def test_the_file_holds_every_take(fitted, body, tmp_path):
    path = tmp_path / "mocap" / "motions.npz"
    fit_body.save(path, body, fitted)
    with np.load(path) as data:
        assert data["poses"].shape == (sum(len(f.take) for f in fitted), 72)
        assert list(data["take_name"]) == ["02_01", "test_walking_19", "walk"]
        start = data["take_start"]
        np.testing.assert_allclose(data["trans"][start[1] : start[2]], fitted[1].trans, atol=1e-6)
        assert data["take_betas"].shape == (3, body.P)
        assert str(data["up"]) == "y"
    assert [p.name for p in path.parent.iterdir()] == ["motions.npz"]


def test_positions_alone_are_refused(body):
    take = Take("a", "s", 30.0, ("pelvis",), np.zeros((2, 1, 3)), "cmu_asf_amc")
    with pytest.raises(ShapeError, match="orientations"):
        retarget.segment_rotations(take, retarget.Follow("pelvis"))
