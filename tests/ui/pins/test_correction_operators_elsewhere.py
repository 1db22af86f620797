# SPDX-License-Identifier: GPL-3.0-or-later
"""What was corrected is on the rig that the motion is retargeted to, and in the files that are
exported.
"""

import bpy
import numpy as np
import pytest

from ...edit.walking import NAMES, motion_of, walk
from ...scene import made_rigs
from ...scene.exported import read_back
from ...scene.made_rigs import captured

FRAME = 46  # of the scene; the capture starts at frame 1
STANDS = (40, 47)  # the left foot swings in these frames
EXCHANGED = (12, 18)
WRIST = NAMES.index("left_wrist")
ANKLE = NAMES.index("left_ankle")
FRAMES = (*range(EXCHANGED[0], EXCHANGED[1] + 1), *range(STANDS[0], STANDS[1] + 1))
SUFFIXES = {"GLB": "glb", "FBX": "fbx", "BVH": "bvh"}


@pytest.fixture
def rig(tmp_path):
    """A captured walk, with its motion file."""
    armature = captured(motion := motion_of(walk(3.0)))
    motion.save(tmp_path / "person1.npz")
    armature["scope_motion"] = str(tmp_path / "person1.npz")
    armature["scope_body_file"] = "scope"
    return armature


def directions(places, side):
    """(T, 3) unit vectors along a thigh."""
    hip, knee = (NAMES.index(f"{side}_{joint}") for joint in ("hip", "knee"))
    along = places[:, knee] - places[:, hip]
    return along / np.linalg.norm(along, axis=1, keepdims=True)


def correct(armature):
    """Exchange the sides, let a foot stand, put it on the floor and pin a wrist; return what is
    then true.
    """
    scene = bpy.context.scene
    before = made_rigs.seen(armature, NAMES, FRAMES)
    bpy.ops.scope.exchange_sides(start=EXCHANGED[0], end=EXCHANGED[1])
    bpy.ops.scope.foot_stands(start=STANDS[0], end=STANDS[1], foot="left")
    scene.frame_set(FRAME)
    bpy.ops.scope.floor_here(foot="left")
    target = made_rigs.seen(armature, NAMES, [FRAME])[0, WRIST] + [0.1, 0.05, 0.15]
    bpy.ops.scope.add_pin(joint="left_wrist", frame=FRAME, location=target)
    return before, target


def check(places, before, target):
    """Check joints (T, K+1, 3) of `FRAMES` against what was corrected, and that it was wrong
    before.
    """
    at = FRAMES.index(FRAME)
    span = slice(len(FRAMES) - (STANDS[1] - STANDS[0] + 1), None)
    assert np.linalg.norm(places[at, WRIST] - target) < 0.01
    assert np.linalg.norm(before[at, WRIST] - target) > 0.1
    assert np.ptp(places[span, ANKLE], axis=0).max() < 0.005
    assert np.ptp(before[span, ANKLE], axis=0).max() > 0.05
    middle = slice(2, EXCHANGED[1] - EXCHANGED[0] - 1)
    ours = directions(places, "left")[middle]
    theirs = directions(before, "right")[middle]
    # A left thigh turned like a right one: the body's knees lie 5 mm outside the line from hip to
    # ankle.
    assert np.abs(ours - theirs).max() < 0.03
    assert np.abs(ours - directions(before, "left")[middle]).max() > 0.1


def test_the_rig_that_the_motion_is_retargeted_to_is_corrected(rig):
    before, target = correct(rig)
    names = [f"mixamorig:{name}" for name in NAMES]
    own = made_rigs.renamed(rig, dict(zip(NAMES, names, strict=True)))
    settings = bpy.context.scene.scope_retarget
    # the bones, without what keeps feet of other rigs on the floor
    settings.rig = own
    settings.feet = False
    bpy.ops.scope.guess_bones()
    bpy.context.view_layer.objects.active = rig
    bpy.ops.scope.retarget()
    check(made_rigs.seen(own, names, FRAMES), before, target)
    settings.feet = True
    bpy.context.view_layer.objects.active = rig
    bpy.ops.scope.retarget()
    check(made_rigs.seen(own, names, FRAMES), before, target)


@pytest.mark.parametrize("kind", SUFFIXES)
def test_exported_files_are_corrected(rig, tmp_path, kind):
    before, target = correct(rig)
    bpy.context.view_layer.objects.active = rig
    path = tmp_path / f"walk.{SUFFIXES[kind]}"
    bpy.ops.scope.export(filepath=str(path), format=kind, which="ALL")
    first = read_back(path)
    (imported,) = (o for o in bpy.data.objects if o.type == "ARMATURE")
    check(
        made_rigs.seen(imported, NAMES, [round(first) + frame - 1 for frame in FRAMES]),
        before,
        target,
    )


def test_the_exported_motion_file_is_corrected(rig, tmp_path):
    correct(rig)
    bpy.ops.scope.export(filepath=str(tmp_path / "walk.npz"), format="NPZ", which="ALL")
    with np.load(tmp_path / "walk.npz") as file:
        kinds = {
            key: len(file[key])
            for key in ("pin_frames", "contact_spans", "exchange_spans", "floor_heights")
        }
    assert kinds == dict.fromkeys(kinds, 1)
