# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of other tools' files: names, shapes, rotation matrices, and everything that may be wrong
with them.
"""

from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.errors import MotionFileError
from scope.scope_addon.retarget.smpl_motion import (
    HAND_JOINTS,
    SmplMotion,
    read_smpl_motions,
    smpl_motion,
)
from scope.solver.names import BODY_JOINTS
from scope.solver.rotations import exp
from scope.solver.smpl_family import FACE_JOINTS

T = 5
FILE = Path("walk.npz")
RANDOM = np.random.default_rng(0).uniform(-0.6, 0.6, (T, 55, 3)).astype(np.float32)


def read_one(path: Path) -> SmplMotion:
    """The only motion of a file."""
    (motion,) = read_smpl_motions(path)
    return motion


def flat(first: int, last: int) -> np.ndarray:
    return RANDOM[:, first:last].reshape(T, -1)


LAYOUTS = {
    "SMPL": ({"poses": flat(0, 24)}, 24),
    "SMPL-X": ({"poses": flat(0, 55)}, 55),
    "body only": ({"poses": flat(0, 22)}, 22),
    "AIST++": (
        {"smpl_poses": flat(0, 24), "smpl_trans": np.ones((T, 3)), "smpl_scaling": np.array([2.0])},
        24,
    ),
    "AMASS parts": (
        {"root_orient": flat(0, 1), "pose_body": flat(1, 22), "pose_hand": flat(22, 52)},
        52,
    ),
    "SMPL parameters": ({"global_orient": flat(0, 1), "body_pose": flat(1, 24)}, 24),
    "hands apart, one in six numbers": (
        {
            "global_orient": flat(0, 1),
            "body_pose": flat(1, 22),
            "left_hand_pose": flat(22, 37),
            "right_hand_pose": exp(RANDOM[:, 37:52])[..., :2].reshape(T, 15, 6),
        },
        52,
    ),
    "matrices": ({"global_orient": exp(RANDOM[:, :1]), "body_pose": exp(RANDOM[:, 1:24])}, 24),
    "one root matrix": (
        {"global_orient": exp(RANDOM[:, 0]), "body_pose": exp(RANDOM[:, 1:22])},
        22,
    ),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_same_rotations(tmp_path, layout):
    arrays, joints = LAYOUTS[layout]
    np.savez(tmp_path / "walk.npz", **arrays)
    motion = read_one(tmp_path / "walk.npz")
    assert motion.joint_names[:22] == BODY_JOINTS
    assert len(motion.joint_names) == joints
    np.testing.assert_allclose(exp(motion.poses), exp(RANDOM[:, :joints]), atol=1e-5)
    if layout == "AIST++":
        np.testing.assert_allclose(motion.trans, 0.5)
    if joints == 52:
        assert motion.joint_names[22:] == HAND_JOINTS["left"] + HAND_JOINTS["right"]
    assert motion.has_fingers == (joints >= 52)


BODY = {"global_orient": flat(0, 1), "body_pose": flat(1, 22)}
FACE = {
    "apart": ({"jaw_pose": flat(22, 23), "leye_pose": flat(23, 24), "reye_pose": flat(24, 25)}, 3),
    "both eyes": ({"pose_jaw": RANDOM[:, 22:23], "pose_eye": flat(23, 25)}, 3),
    "two rows": ({"jaw_pose": exp(RANDOM[:, 22:23])[..., :2, :].reshape(T, 1, 6)}, 1),
}


@pytest.mark.parametrize("layout", FACE)
def test_jaw_and_eyes_apart_are_read(tmp_path: Path, layout: str) -> None:
    arrays, count = FACE[layout]
    np.savez(tmp_path / "walk.npz", **arrays, **BODY)
    motion = read_one(tmp_path / "walk.npz")
    assert motion.joint_names == (*BODY_JOINTS, *FACE_JOINTS[:count])
    np.testing.assert_allclose(exp(motion.poses), exp(RANDOM[:, : 22 + count]), atol=1e-5)
    assert motion.has_face
    assert not motion.has_fingers


def test_a_jaw_that_nobody_has_set_is_at_rest_in_every_frame() -> None:
    motion = smpl_motion(BODY | {"jaw_pose": np.zeros((1, 3))}, FILE)
    assert len(motion) == T
    assert not motion.has_face


def test_expressions_are_named_as_left_out(tmp_path: Path) -> None:
    np.savez(tmp_path / "walk.npz", **GOOD, expression=np.ones((T, 10)))
    assert read_one(tmp_path / "walk.npz").left_out == ("expression",)
    for nothing in (np.zeros((T, 10)), np.array("smile")):
        assert smpl_motion(GOOD | {"expression": nothing}, FILE).left_out == ()


def test_hands_as_components_are_named_as_left_out() -> None:
    hands = {"left_hand_pose": np.ones((T, 6)), "right_hand_pose": np.zeros((T, 6))}
    assert smpl_motion(BODY | hands, FILE).left_out == ("left_hand_pose",)
    assert smpl_motion({"poses": flat(0, 52), "hand_pose": np.ones((T, 12))}, FILE).left_out == ()


@pytest.mark.parametrize("shape", [(6,), (T, 1, 6)])
def test_components_have_other_axes_in_some_files(shape: tuple[int, ...]) -> None:
    motion = smpl_motion(BODY | {"left_hand_pose": np.ones(shape)}, FILE)
    assert motion.left_out == ("left_hand_pose",)
    assert not motion.has_fingers


@pytest.mark.parametrize(
    "jaw", [np.ones(3), np.ones((T + 1, 3)), np.full((T, 3), np.nan), np.ones((T, 6))]
)
def test_a_face_that_does_not_fit_is_left_out_rather_than_the_file_refused(jaw: np.ndarray) -> None:
    motion = smpl_motion(BODY | {"jaw_pose": jaw}, FILE)
    assert motion.left_out == ("jaw_pose",)
    np.testing.assert_allclose(motion.poses, RANDOM[:, :22], atol=1e-6)


@pytest.mark.parametrize("jaw", [np.zeros((T, 0)), np.array(None)])
def test_a_face_of_nothing_says_nothing(jaw: np.ndarray) -> None:
    assert smpl_motion(BODY | {"jaw_pose": jaw}, FILE).left_out == ()


def test_frame_rate_gender_and_shape_are_read():
    betas = np.arange(T * 10.0).reshape(T, 10)
    arrays = {
        "poses": flat(0, 24),
        "fps": np.array(120),
        "gender": np.array(b"female"),
        "betas": betas,
    }
    motion = smpl_motion(arrays, FILE)
    assert (motion.rate, motion.gender) == (120.0, "female")
    np.testing.assert_allclose(motion.betas, betas.mean(0))
    bare = smpl_motion({"poses": flat(0, 24)}, FILE)
    assert (bare.rate, bare.trans, bare.betas.size, bare.gender) == (None, None, 0, "neutral")


def test_other_arrays_may_hold_anything(tmp_path):
    np.savez(tmp_path / "walk.npz", poses=flat(0, 24), meta=np.array([{"a": 1}], object))
    assert len(read_one(tmp_path / "walk.npz")) == T


def test_somebody_may_spin_many_times():
    """About the up axis: a fit that starts from the frame before adds up the turns."""
    poses = RANDOM[:, :24].copy()
    poses[:, 0] = np.linspace(0.0, 20.0 * np.pi, T)[:, None] * [0.0, 1.0, 0.0]
    for arrays in (
        {"smpl_poses": poses.reshape(T, -1)},
        {"global_orient": poses[:, :1], "body_pose": poses[:, 1:]},
    ):
        np.testing.assert_allclose(smpl_motion(arrays, FILE).poses, poses, rtol=1e-6)


def with_nan() -> np.ndarray:
    poses = flat(0, 24).copy()
    poses[3, 7] = np.nan
    return poses


GOOD = {"poses": flat(0, 24)}
PARTS = {"global_orient": flat(0, 1), "body_pose": flat(1, 24)}
BROKEN = {
    "nothing": ({}, "no SMPL-style motion"),
    "root alone": ({"global_orient": flat(0, 1)}, "no SMPL-style motion"),
    "no frames": ({"poses": np.zeros((0, 72))}, "no frames"),
    "another skeleton": ({"poses": np.zeros((T, 75))}, "75 numbers per frame"),
    "several people": ({"poses": np.zeros((2, T, 24, 3, 3))}, "shape"),
    "quaternions": ({"poses": np.zeros((T, 24, 4))}, "quaternions that are not of length 1"),
    "degrees": ({"poses": np.degrees(flat(0, 24))}, "poses holds .* degrees"),
    "degrees of the body": (
        PARTS | {"body_pose": np.degrees(RANDOM[:, 1:24])},
        "body_pose holds .* degrees",
    ),
    "NaN": ({"poses": with_nan()}, "NaN or infinity, first in frame 3"),
    "too long": ({"poses": np.broadcast_to(np.float32(0), (10_000_000, 72))}, "at most 500000"),
    "not rotations": (
        {"global_orient": 2 * exp(RANDOM[:, :1]), "body_pose": exp(RANDOM[:, 1:24])},
        "not rotations",
    ),
    "reflections": (
        {"global_orient": -exp(RANDOM[:, :1]), "body_pose": exp(RANDOM[:, 1:24])},
        "not rotations",
    ),
    "short body": (PARTS | {"body_pose": flat(1, 24)[:2]}, "as many frames"),
    "wrong body": (PARTS | {"body_pose": flat(1, 20)}, "21 or 23"),
    "wrong hand": (
        PARTS | {"body_pose": flat(1, 22), "left_hand_pose": flat(22, 30)},
        "must have 15 joints",
    ),
    "short trans": (GOOD | {"trans": np.zeros((2, 3))}, "trans must have shape"),
    "infinite trans": (GOOD | {"trans": np.full((T, 3), np.inf)}, "NaN or infinity"),
    "far away": (GOOD | {"trans": np.full((T, 3), 1e30)}, "metres"),
    "rate of NaN": (GOOD | {"mocap_framerate": np.array(np.nan)}, "frames per second"),
    "rate of text": (GOOD | {"mocap_framerate": np.array("fast")}, "frames per second"),
    "wrong betas": (GOOD | {"betas": np.zeros((3, 4, 5))}, "betas has shape"),
    "betas of text": (GOOD | {"betas": np.array(["a"])}, "must hold numbers"),
    "scaling of zero": (
        GOOD | {"trans": np.zeros((T, 3)), "smpl_scaling": np.array([0.0])},
        "smpl_scaling",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_arrays_are_an_error_in_one_sentence(name):
    arrays, says = BROKEN[name]
    with pytest.raises(MotionFileError, match=says) as caught:
        smpl_motion(arrays, FILE)
    assert str(caught.value).startswith("walk.npz")
    assert "\n" not in str(caught.value)


def test_many_people_who_do_not_move_are_refused_and_those_who_do_are_not(tmp_path, monkeypatch):
    """Each is short enough, but all of them would take gigabytes of memory."""
    monkeypatch.setattr("scope.scope_addon.retarget.smpl_motion.MAX_FRAMES", 100)
    moving = np.random.default_rng(1).uniform(-1.0, 1.0, (100, 72)).astype(np.float32)
    for name, poses in (("moving.npz", moving), ("still.npz", np.zeros((100, 72), np.uint8))):
        np.savez_compressed(tmp_path / name, **{f"{k}/poses": poses for k in range(10)})
    assert len(read_smpl_motions(tmp_path / "moving.npz")) == 10
    with pytest.raises(MotionFileError, match=r"10 people .* frames together, but hardly any"):
        read_smpl_motions(tmp_path / "still.npz")


def test_pickled_objects_are_no_poses(tmp_path):
    np.savez(tmp_path / "walk.npz", poses=np.array([{}], object))
    with pytest.raises(MotionFileError, match="holds no SMPL-style motion.*it holds poses"):
        read_one(tmp_path / "walk.npz")
