# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets of joint positions: made files with gaps and odd spines, and the true ones."""

import numpy as np
import pytest
from scope.tools.mocap.position_sets import LAYOUTS, load_set
from scope.tools.mocap.straight_legs import knee_flexions

from ...required import missing
from .test_new_performers import standing

T = 60
LEGS = tuple(f"{s}_{j}" for s in ("left", "right") for j in ("hip", "knee", "ankle"))
# Minutes of each set; of `markers`, of the takes with all joints.
MINUTES = {
    "accad": 10.9,
    "cmu_more": 15.3,
    "markers": 0.8,
    "mesh2motion": 0.3,
    "reactidle": 46.7,
    "rocketbox": 33.5,
    "style100": 1.3,
}


def write_set(path, spine_behind_m=0.07, gaps=(), fps=30.0, knee_deg=3.0, name="a"):
    """Write a set of one take of somebody who stands facing +z, whose lower spine lies behind the
    hips.
    """
    at = {name: np.resize(place, (T, 3)) for name, place in standing(knee_deg=knee_deg).items()}
    at["spine1"], at["spine2"] = (
        at["pelvis"] + [0.0, 0.1, -spine_behind_m],
        at["chest"] - [0.0, 0.0, spine_behind_m],
    )
    for side in ("left", "right"):
        at[f"{side}_foot"] = at[f"{side}_foot_end"]
    names = sorted(at)
    positions = np.stack([at[name] for name in names], axis=1)
    for frame, joint in gaps:
        positions[frame, names.index(joint)] = np.nan
    np.savez(
        path,
        take_name=np.array([name]),
        subject=np.array(["s"]),
        fps=np.array([fps]),
        start=np.array([0, T]),
        joint_names=np.array(names),
        positions=positions.astype(np.float32),
    )
    return path


def test_pelvis_and_rib_cage_are_upright_wherever_the_spine_lies(tmp_path):
    (take,) = load_set(write_set(tmp_path / "accad.npz"))
    assert take.source == "accad"
    for segment in ("pelvis", "chest"):
        up = take.orientations[:, take.index(segment), :, 1]
        np.testing.assert_allclose(up, [[0.0, 1.0, 0.0]] * len(take), atol=1e-4)
    hips = 0.5 * (take.joint("left_hip") + take.joint("right_hip"))
    np.testing.assert_allclose(take.joint("pelvis"), hips)


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_the_true_sets(shared, name):
    """Their length, left and right, and segments along their bones."""
    path = shared / "data" / "mocap2" / f"{name}.npz"
    if not path.is_file():
        missing(f"the tests on real sets need {path}", allowed_by="SCOPE_WITHOUT_SHARED")
    takes = load_set(path)
    minutes = sum(take.seconds for take in takes) / 60
    assert minutes == pytest.approx(MINUTES[name], abs=0.2)
    for take in takes[:: max(1, len(takes) // 8)]:
        R = take.orientations
        np.testing.assert_allclose(
            R @ R.swapaxes(-1, -2), np.broadcast_to(np.eye(3), R.shape), atol=1e-6
        )
        left = take.joint("left_hip") - take.joint("right_hip")
        assert np.einsum("ti,ti->t", R[:, take.index("pelvis"), :, 0], left).min() > 0.0
        assert np.median(knee_flexions({joint: take.joint(joint) for joint in LEGS})) > -10.0
        for side in ("left", "right"):  # segments lie along their bones
            bone = take.joint(f"{side}_hip") - take.joint(f"{side}_knee")
            along = np.einsum("ti,ti->t", R[:, take.index(f"{side}_hip"), :, 1], bone)
            np.testing.assert_allclose(along, np.linalg.norm(bone, axis=1), rtol=1e-6)
