# SPDX-License-Identifier: GPL-3.0-or-later
"""Heel and ball of the rig, as evaluated by Blender, are at rest in every contact of the body."""

import bpy
import numpy as np
import pytest
from mathutils import Vector
from scope.solver.rotations import exp

from ..edit.rolling import STRIDE, joint, rolling_walk
from ..edit.walking import motion_of, walk
from .made_rigs import FBX, build_rig, captured, run, seen

_, STANDS = rolling_walk()
PART = {"thigh": "hip", "shin": "knee", "foot": "ankle", "toe": "foot"}


@pytest.fixture
def source():
    return captured(motion_of(rolling_walk()[0]))


def contacts(stands):
    """Return the spans of frames in which a point is in contact."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], stands.astype(int), [0]])))
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 2]


def points(rig, feet):
    """Return for each (foot, ball): heel and ball (T, 2, 3) in the world, and their positions at
    rest.
    """
    heels_of_bones = []
    rests = []
    moved = []
    for foot, ball in feet:
        ankle = np.array(rig.matrix_world @ rig.data.bones[foot].head_local)
        rest_ball = np.array(rig.matrix_world @ rig.data.bones[ball].head_local)
        heel = ankle + (ankle - rest_ball) * [1, 1, 0] * 0.3
        heel[2] = 0.0
        heels_of_bones.append(
            np.linalg.inv(np.array(rig.matrix_world @ rig.data.bones[foot].matrix_local))
            @ [*heel, 1]
        )
        rests.append(np.array([heel, rest_ball]))
    for frame in range(1, len(STANDS["left"]) + 1):
        bpy.context.scene.frame_set(frame)
        posed = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
        world = np.array(posed.matrix_world)
        bones = posed.pose.bones
        heels = [
            world @ np.array(bones[foot].matrix) @ at
            for (foot, _), at in zip(feet, heels_of_bones, strict=True)
        ]
        balls = [world @ [*bones[ball].head, 1] for _, ball in feet]
        moved.append([[heel[:3], ball[:3]] for heel, ball in zip(heels, balls, strict=True)])
    return list(zip(np.swapaxes(moved, 0, 1), rests, strict=True))


def leg_length(rig, spell):
    places = [
        rig.matrix_world @ rig.data.bones[spell("left", part)].head_local
        for part in ("thigh", "shin", "foot")
    ]
    return (places[1] - places[0]).length + (places[2] - places[1]).length


def check_contacts(rig, spell):
    """Check that in every contact a point slides and rises by less than 1 cm, and that steps
    scale.
    """
    scale = leg_length(rig, spell) / sum(
        np.linalg.norm(joint(f"left_{a}") - joint(f"left_{b}"))
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    )
    feet = points(rig, [(spell(side, "foot"), spell(side, "toe")) for side in STANDS])
    for side, (moved, rest) in zip(STANDS, feet, strict=True):
        for k, what in enumerate(("heel", "ball")):
            spans = contacts(STANDS[side][:, k])
            assert spans
            for span in spans:
                p = moved[span, k]
                slide = np.linalg.norm(p[:, None, :2] - p[None, :, :2], axis=-1).max()
                off = np.abs(p[:, 2] - rest[k, 2]).max()
                assert slide < 0.01, (side, what, span, slide)
                assert off < 0.01, (side, what, span, off)
            first, second = (moved[span, k, :2].mean(axis=0) for span in spans[-2:])
            assert abs(np.linalg.norm(second - first) - scale * STRIDE) < 0.02


@pytest.mark.parametrize(("scheme", "size"), [("mixamo", 0.7), ("unreal", 1.0)])
def test_feet_in_contact_stay_in_place(source, scheme, size):
    rig, bone_of = build_rig(scheme, size=size, matrix=FBX if scheme == "mixamo" else None)
    run(source, rig)
    check_contacts(rig, lambda side, part: bone_of[f"{side}_{PART[part]}"])


def test_a_rig_whose_bones_do_not_inherit_rotation_moves_as_one_whose_bones_do():
    clip = walk(2.0)
    frames = range(1, 60, 6)
    clip.rotations[:, 0] = (
        exp(0.4 * np.sin(5 * clip.times)[:, None] * [0.3, 1.0, 0.5]) @ clip.rotations[:, 0]
    )
    source = captured(motion_of(clip))
    rig, bone_of = build_rig("unreal")
    run(source, rig)
    wanted = seen(rig, bone_of.values(), frames)
    for bone in rig.data.bones:
        bone.use_inherit_rotation = False
    run(source, rig)
    np.testing.assert_allclose(seen(rig, bone_of.values(), frames), wanted, atol=1e-3)


def test_feet_that_are_long_for_their_legs_stay_above_the_floor(source):
    """As of a cartoon character: the ball is more than three times as far from the ankle as the
    body's, scaled.
    """
    rig, bone_of = build_rig("unreal")
    bpy.ops.object.mode_set(mode="EDIT")
    for side in STANDS:
        ankle, ball = (rig.data.edit_bones[bone_of[f"{side}_{part}"]] for part in ("ankle", "foot"))
        ahead = (ball.head - ankle.head) * Vector((3.0, 3.0, 0.0))
        for end in ("head", "tail"):
            setattr(ball, end, getattr(ball, end) + ahead)
    bpy.ops.object.mode_set(mode="OBJECT")
    run(source, rig)
    feet = points(rig, [(bone_of[f"{side}_ankle"], bone_of[f"{side}_foot"]) for side in STANDS])
    for moved, rest in feet:
        assert (moved[:, 1, 2] - rest[1, 2]).min() > -0.01


def feet_of_lowered_walk(by):
    """Heel and ball of each foot of a rig that follows somebody who walks lower by metres, and the
    rig's bones.
    """
    clip, _ = rolling_walk()
    clip.root[:, 2] -= by
    rig, bone_of = build_rig("mixamo")
    run(captured(motion_of(clip)), rig)
    feet = points(rig, [(bone_of[f"{side}_ankle"], bone_of[f"{side}_foot"]) for side in STANDS])
    return feet, rig, bone_of


def test_feet_of_a_capture_below_the_floor_stay_on_it():
    feet, _, _ = feet_of_lowered_walk(0.05)
    for side, (moved, rest) in zip(STANDS, feet, strict=True):
        assert (moved[..., 2] - rest[:, 2]).min() > -0.01
        assert np.abs(moved[STANDS[side][:, 1], 1, 2] - rest[1, 2]).max() < 0.01


def test_feet_of_somebody_on_a_lower_floor_go_down_to_it():
    feet, rig, bone_of = feet_of_lowered_walk(0.5)
    scale = leg_length(rig, lambda side, part: bone_of[f"{side}_{PART[part]}"]) / sum(
        np.linalg.norm(joint(f"left_{a}") - joint(f"left_{b}"))
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    )
    for side, (moved, rest) in zip(STANDS, feet, strict=True):
        on_floor = moved[STANDS[side][:, 1], 1, 2] - rest[1, 2]
        np.testing.assert_allclose(on_floor, -0.5 * scale, atol=0.02)


def test_toes_without_captured_bending_stay_flat():
    rig, bone_of = build_rig("mixamo")
    run(captured(motion_of(rolling_walk(stiff_toes=True)[0])), rig)
    bpy.context.view_layer.update()
    for side in ("left", "right"):
        bone = bone_of[f"{side}_foot"]
        rest = np.array(rig.matrix_world @ rig.data.bones[bone].matrix_local)[:3, 1]
        for frame in np.flatnonzero(STANDS[side][:, 1]):
            bpy.context.scene.frame_set(int(frame) + 1)
            posed = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
            along = np.array(posed.matrix_world @ posed.pose.bones[bone].matrix)[:3, 1]
            assert np.degrees(np.arccos(np.clip(along @ rest, -1, 1))) < 2.0


@pytest.mark.slow
def test_feet_of_rigify_stand(source, rigify_rigs):
    for rig, prefix in rigify_rigs:
        run(source, rig)
        check_contacts(rig, lambda side, part, prefix=prefix: f"{prefix}{part}.{side[0].upper()}")
