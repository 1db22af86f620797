# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting our body to motion: the fit is compared with the source's own bones, and with what bodies
can do.
"""

import numpy as np
import pytest
from scope.tools.mocap import fit_body, library

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
