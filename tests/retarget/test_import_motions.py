# SPDX-License-Identifier: GPL-3.0-or-later
"""Imported motions against the motion that the file was made from: positions in the world, on the
floor, z up.
"""

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scope.scope_addon.errors import MotionFileError, UsageError
from scope.scope_addon.motion import Motion
from scope.scope_addon.retarget.import_motions import (
    DEFAULT_RATE,
    Imported,
    convert,
    import_motions,
)
from scope.scope_addon.retarget.smpl_motion import smpl_motion
from scope.solver.rotations import exp, log

from ..edit.walking import BODY, RATE, motion_of, walk

FILE = Path("walk.npz")
CLIP = walk(2.0, bent=0.1)  # as people walk: no leg is locked straight
MOTION = motion_of(CLIP)
# Axes written out: what z up in the world is in a file with y up, and with y down.
R_FILE_WORLD = {
    "z": np.eye(3),
    "y": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "camera": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
}


def import_motion(path: Path, **arguments: Any) -> Imported:
    """The only person of a file."""
    (imported,) = import_motions(path, **arguments)
    return imported


def in_file(axis: str, height: float = 0.0) -> dict[str, np.ndarray]:
    """The walk as SMPL-style arrays whose world has this axis up, and the floor at another
    height.
    """
    R = R_FILE_WORLD[axis]
    poses = MOTION.poses.reshape(len(MOTION), -1, 3).astype(float)
    poses[:, 0] = log(R @ exp(poses[:, 0]))
    pelvis = (BODY.rest_joints()[0] + MOTION.trans + [0, 0, height]) @ R.T
    return {
        "poses": poses.reshape(len(poses), -1),
        "trans": pelvis - BODY.rest_joints()[0],
        "mocap_framerate": np.array(RATE),
    }


def joints(motion: Motion) -> np.ndarray:
    rotations = exp(motion.poses.reshape(len(motion), -1, 3).astype(float))
    return BODY.forward_kinematics(rotations, motion.trans, motion.betas)[1]


def skinned(motion: Motion, t: int) -> np.ndarray:
    R, at = BODY.forward_kinematics(
        exp(motion.poses[t].reshape(-1, 3).astype(float)), motion.trans[t], motion.betas
    )
    return BODY.skin(R, at, motion.betas)


@pytest.mark.parametrize(("axis", "up"), [("z", "auto"), ("y", "auto"), ("camera", "camera")])
def test_the_motion_stands_upright_on_the_floor(tmp_path, axis, up):
    np.savez(tmp_path / "walk.npz", **in_file(axis, height=1.3))
    found = import_motion(tmp_path / "walk.npz", up=up)
    raised = joints(found.motion) - joints(MOTION)
    np.testing.assert_allclose(raised, np.broadcast_to(raised[0, 0], raised.shape), atol=1e-3)
    np.testing.assert_allclose(raised[0, 0, :2], 0, atol=1e-3)
    lowest = [skinned(found.motion, t)[:, 2].min() for t in range(0, len(MOTION), 12)]
    assert abs(np.median(lowest)) < 0.02
    np.testing.assert_allclose(found.motion.timestamps, np.arange(len(MOTION)) / RATE)
    assert any("Scope's own body" in note for note in map(str, found.notes))
    assert found.motion.foot_contact.max() > 0.5
    world = found.motion.world_from_camera[0]
    shown = found.motion.joints_cam @ world[:3, :3].T + world[:3, 3]
    np.testing.assert_allclose(shown, joints(found.motion), atol=1e-4)


def test_a_motion_of_our_body_is_not_changed(tmp_path):
    np.savez(
        tmp_path / "walk.npz",
        body_model=np.array("scope"),
        betas=np.zeros(BODY.P),
        **in_file("z", height=1.3),
    )
    found = import_motion(tmp_path / "walk.npz")
    np.testing.assert_allclose(joints(found.motion), joints(MOTION) + [0, 0, 1.3], atol=1e-4)
    assert found.notes == []


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("poses", np.nan * MOTION.poses),
        ("mocap_framerate", 1e-300),
        ("timestamps", np.nan * MOTION.timestamps),
        ("timestamps", np.arange(len(MOTION)) * 1e37),
        ("betas", np.full(BODY.P, 1e6)),
    ],
)
def test_numbers_that_no_motion_has_are_an_error(tmp_path, key, value):
    own = motion_of(CLIP)
    setattr(own, key, value)
    own.save(tmp_path / "own.npz")
    with pytest.raises(MotionFileError, match="NaN|frame rate|betas"):
        import_motion(tmp_path / "own.npz")


def test_a_body_of_another_tool_that_is_nobodys_is_an_error(tmp_path):
    arrays = {"body_model": np.array("scope"), "betas": np.full(BODY.P, 1e6), **in_file("z")}
    np.savez(tmp_path / "other.npz", **arrays)
    with pytest.raises(MotionFileError, match="betas"):
        import_motion(tmp_path / "other.npz")


def test_fingers_choose_the_body_with_fingers(tmp_path):
    arrays = in_file("z")
    body_joints = arrays["poses"][:, : 3 * 22]
    np.savez(tmp_path / "still.npz", **arrays | {"poses": np.pad(body_joints, ((0, 0), (0, 90)))})
    moving = np.pad(body_joints, ((0, 0), (0, 90)), constant_values=0.2)
    np.savez(tmp_path / "moving.npz", **arrays | {"poses": moving})
    assert import_motion(tmp_path / "still.npz").body.name == "scope"
    found = import_motion(tmp_path / "moving.npz")
    assert found.body.name == "scope_h"
    at = found.body.joint_names.index("left_index1")
    np.testing.assert_allclose(
        found.motion.poses.reshape(len(MOTION), -1, 3)[:, at], 0.2, atol=1e-6
    )


def test_what_is_missing_is_assumed_and_said(tmp_path):
    arrays = in_file("z")
    np.savez(tmp_path / "walk.npz", poses=arrays["poses"])
    found = import_motion(tmp_path / "walk.npz")
    assert found.motion.mocap_framerate == DEFAULT_RATE
    said = " ".join(map(str, found.notes))
    assert "frame rate" in said
    assert "translation" in said
    assert import_motion(tmp_path / "walk.npz", rate=50.0).motion.mocap_framerate == 50.0
    np.testing.assert_allclose(np.ptp(found.motion.trans, axis=0), 0, atol=1e-6)


@pytest.mark.parametrize(("per_metre", "unit"), [(100, "cm"), (1000, "mm")])
@pytest.mark.parametrize("axis", ["z", "y"])
def test_translations_in_another_unit_are_converted_and_said(tmp_path, axis, per_metre, unit):
    arrays = in_file(axis, height=0.4)
    np.savez(tmp_path / "metres.npz", **arrays)
    np.savez(tmp_path / "other.npz", **arrays | {"trans": per_metre * arrays["trans"]})
    in_metres = import_motion(tmp_path / "metres.npz")
    found = import_motion(tmp_path / "other.npz")
    np.testing.assert_allclose(joints(found.motion), joints(in_metres.motion), atol=1e-4)
    assert [str(note) for note in found.notes if note.code == "other_unit"] == [
        f"other.npz: trans is in {unit}, as only then the feet stand still on the floor, so it was "
        "converted to metres"
    ]
    assert "other_unit" not in [note.code for note in in_metres.notes]


def test_a_person_faster_than_anybody_whose_feet_never_rest_is_an_error(tmp_path):
    rng = np.random.default_rng(1)
    arrays = in_file("z")
    poses = arrays["poses"] + rng.normal(scale=0.3, size=arrays["poses"].shape)
    trans = arrays["trans"] + rng.normal(scale=0.02, size=arrays["trans"].shape)
    np.savez(tmp_path / "mm.npz", **arrays | {"poses": poses, "trans": 1000 * trans})
    with pytest.raises(MotionFileError, match=r"mm\.npz: trans moves the person at .* metres"):
        import_motion(tmp_path / "mm.npz")
    np.savez(tmp_path / "m.npz", **arrays | {"poses": poses, "trans": trans})
    assert import_motion(tmp_path / "m.npz")


@pytest.mark.parametrize("velocity", [[0.0, 8.0, 0.0], [0.0, 0.0, 2.0]])
@pytest.mark.parametrize("is_still", [False, True])
def test_whom_skates_or_a_lift_carry_is_in_metres(tmp_path, velocity, is_still):
    arrays = in_file("z")
    poses = arrays["poses"]
    poses = np.tile(poses[:1], (len(poses), 1)) if is_still else poses
    trans = arrays["trans"] + np.outer(MOTION.timestamps, velocity)
    np.savez(tmp_path / "carried.npz", **arrays | {"poses": poses, "trans": trans})
    found = import_motion(tmp_path / "carried.npz")
    np.testing.assert_allclose(
        np.diff(found.motion.trans, axis=0), np.diff(trans, axis=0), atol=1e-5
    )
    assert "other_unit" not in [note.code for note in found.notes]


def test_arrays_that_no_body_can_have_are_said(tmp_path):
    np.savez(tmp_path / "walk.npz", **PIECES, pose_hand=np.ones((9, 12)))
    notes = import_motion(tmp_path / "walk.npz", up="z").notes
    assert "were left out: 'pose_hand'" in " ".join(map(str, notes))


def test_an_unclear_up_axis_is_said(tmp_path):
    arrays = in_file("z")
    lying = arrays["poses"].copy()
    lying[:, :3] = [0.0, 0.0, np.pi / 2]  # along x
    np.savez(tmp_path / "lying.npz", **arrays | {"poses": lying})
    unsure = import_motion(tmp_path / "lying.npz").notes
    told = import_motion(tmp_path / "lying.npz", up="z").notes
    assert any("up axis is not clear" in note for note in map(str, unsure))
    assert not any("not clear" in note for note in map(str, told))


def test_somebody_who_lies_has_the_up_axis_of_the_others(tmp_path):
    """The walk in camera axes, and the same clip of somebody whose trunk points away from it."""
    arrays = in_file("camera")
    lying = arrays | {"poses": arrays["poses"].copy()}
    pelvis = lying["poses"][:, :3].astype(float)
    lying["poses"][:, :3] = log(exp(np.array([np.pi / 2, 0.0, 0.0])) @ exp(pelvis))
    people = {"0": arrays | {"mocap_framerate": RATE}, "1": lying | {"mocap_framerate": RATE}}
    with (tmp_path / "people.pkl").open("wb") as file:
        pickle.dump(people, file)
    first, second = import_motions(tmp_path / "people.pkl")
    trunk = [BODY.joint_names.index(name) for name in ("pelvis", "neck")]
    for imported, rise in ((first, 0.9), (second, 0.0)):
        along = np.diff(joints(imported.motion)[:, trunk], axis=1)[:, 0]
        up = (along / np.linalg.norm(along, axis=1, keepdims=True))[:, 2].mean()
        assert up == pytest.approx(rise, abs=0.15)


def test_people_whom_a_tracker_saw_at_other_times_begin_then(tmp_path):
    arrays = in_file("z")
    count = len(arrays["poses"])
    late = np.arange(count) + 100
    late[count // 2 :] += 7  # somebody stood before them
    people = {
        "0": arrays | {"frame_ids": np.arange(count) + 40},
        "1": arrays | {"frame_ids": late},
        "2": arrays | {"frame_ids": np.zeros(count, int)},  # are no numbers of frames
    }
    with (tmp_path / "people.pkl").open("wb") as file:
        pickle.dump(people, file)
    first, second, _ = (each.motion for each in import_motions(tmp_path / "people.pkl"))
    # The third one's begin at 0, as its file says nothing of them.
    np.testing.assert_array_equal(first.frames, np.arange(count) + 40)
    np.testing.assert_array_equal(second.frames, late)
    np.testing.assert_allclose(second.timestamps, late / RATE)


@pytest.mark.parametrize("missing", [7, 2 * int(RATE)])
def test_seconds_in_which_a_tracker_saw_nobody_are_said_to_be_guessed(tmp_path, missing):
    arrays = in_file("z")
    count = len(arrays["poses"])
    frames = np.arange(count)
    frames[10:] += missing
    np.savez(tmp_path / "gap.npz", **arrays, frame_ids=frames)
    imported = import_motion(tmp_path / "gap.npz")
    assert imported.motion.timestamps[10] - imported.motion.timestamps[9] == pytest.approx(
        (missing + 1) / RATE
    )
    said = [note.values for note in imported.notes if note.code == "frames_without_poses"]
    if missing == 7:
        assert said == []  # half a second or less is between two poses that show the way
    else:
        ((begin,), longest) = said[0]["times"], said[0]["longest_s"]
        assert begin == pytest.approx(9 / RATE)
        assert longest == pytest.approx((missing + 1) / RATE)


def test_a_file_of_one_frame_per_second_lacks_no_poses(tmp_path):
    np.savez(tmp_path / "slow.npz", **in_file("z") | {"mocap_framerate": 1.0})
    imported = import_motion(tmp_path / "slow.npz")
    assert imported.motion.mocap_framerate == 1.0
    assert "frames_without_poses" not in [note.code for note in imported.notes]


def test_another_rate_than_the_file_states_is_said_to_be_ignored(tmp_path):
    np.savez(tmp_path / "other.npz", **in_file("z"))
    (tmp_path / "own.npz").write_bytes(MOTION.to_bytes())
    for name in ("other.npz", "own.npz"):
        for rate in (12.0, RATE):
            found = import_motion(tmp_path / name, rate=rate)
            assert found.motion.mocap_framerate == RATE
            codes = [note.code for note in found.notes if note.code == "rate_stated"]
            assert len(codes) == (rate != RATE)


def test_another_up_axis_of_our_own_file_is_refused(tmp_path):
    (tmp_path / "own.npz").write_bytes(MOTION.to_bytes())
    assert import_motion(tmp_path / "own.npz", up="z").notes == []
    with pytest.raises(UsageError, match=r"own.npz was written by Scope, with z up"):
        import_motion(tmp_path / "own.npz", up="y")


@pytest.mark.parametrize("arguments", [{"up": "x"}, {"rate": np.nan}])
def test_invalid_arguments(tmp_path, arguments):
    np.savez(tmp_path / "walk.npz", **in_file("z"))
    with pytest.raises(UsageError):
        import_motion(tmp_path / "walk.npz", **arguments)


def spread(joint_count: int) -> dict[str, np.ndarray]:
    """A file with an array of all joints, which stand still, and a shape."""
    poses = np.zeros((9, joint_count, 3))
    poses[:, 0] = [np.pi / 2, 0, 0]  # the model's y axis is up
    trans = np.tile([0.0, 0.0, 1.3], (9, 1))
    return {"poses": poses.reshape(9, -1), "trans": trans, "betas": np.array([0.5, -1.0, 0.3])}


PIECES = {"root_orient": np.zeros((9, 3)), "pose_body": np.zeros((9, 63))}


@pytest.mark.parametrize(
    ("arrays", "model", "is_exact"),
    [
        (spread(24), "smplh", True),
        (spread(24), "smplx", False),
        (spread(52), "smpl", True),
        (spread(55), "smplh", False),
        (PIECES, "smplx", True),  # it may be of either
        (PIECES, "smplh", True),
        (PIECES, "star", False),
        ({**spread(52), "body_model": np.array("SMPL-X")}, "smplx", True),
        ({**spread(24), "body_model": np.array("star")}, "smpl", False),
    ],
)
def test_a_shape_is_only_that_of_the_model_that_it_is_of(arrays, model, is_exact):
    """SMPL+H is SMPL with fingers; the coefficients of the others stand for other shapes."""
    body = replace(BODY, name=model)
    betas = np.array([0.5, -1.0, 0.3])
    found = convert(smpl_motion({**arrays, "betas": betas}, FILE), body, FILE, up="z")
    expected = betas if is_exact else np.zeros(3)
    np.testing.assert_allclose(found.motion.betas[:3], expected, atol=1e-6)
    said = f"the file's body is of another model than '{model}'"
    assert any(said in note for note in map(str, found.notes)) is not is_exact
    assert not any("Scope's own body" in note for note in map(str, found.notes))


@pytest.mark.parametrize("axis", ["z", "camera"])
def test_on_the_users_own_smpl_body_shape_and_pelvis_are_exact(axis):
    """Its rest pelvis is not at the model's origin, unlike ours; SMPL adds it in the file's
    axes.
    """
    smpl = replace(
        BODY, name="smpl", J_template=BODY.J_template + [0.01, -0.2, 0.03], gender="female"
    )
    betas = np.array([0.5, -1.0, 0.3])
    R = R_FILE_WORLD[axis]
    rotations = exp(MOTION.poses.reshape(len(MOTION), -1, 3).astype(float))
    rotations[:, 0] = R @ rotations[:, 0]
    trans = MOTION.trans @ R.T
    source = smpl_motion(
        {"poses": log(rotations).reshape(len(MOTION), -1), "trans": trans, "betas": betas}, FILE
    )
    full = np.pad(betas, (0, BODY.P - 3))
    expected = smpl.forward_kinematics(rotations, trans, full)[1] @ R  # in the world
    found = convert(source, smpl, FILE)
    np.testing.assert_allclose(found.motion.betas, full, atol=1e-6)
    got = smpl.forward_kinematics(
        exp(found.motion.poses.reshape(rotations.shape[:2] + (3,)).astype(float)),
        found.motion.trans,
        full,
    )[1]
    raised = got - expected
    np.testing.assert_allclose(raised, np.broadcast_to(raised[0, 0], raised.shape), atol=1e-4)
    np.testing.assert_allclose(raised[0, 0, :2], 0, atol=1e-4)
    if axis == "z":  # the floor of such a file is known
        np.testing.assert_allclose(raised, 0, atol=1e-4)
    assert any("neutral body" in note for note in map(str, found.notes))
    assert not any("Scope's own body" in note for note in map(str, found.notes))
