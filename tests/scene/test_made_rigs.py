# SPDX-License-Identifier: GPL-3.0-or-later
"""A capture that was built before, as tests append it, is as one that is built."""

from __future__ import annotations

import bpy

from ..edit.walking import motion_of, walk
from .made_rigs import captured


def state(armature):
    action = armature.animation_data.action
    scene = bpy.context.scene
    return {
        "objects": sorted((each.name, each.type, each.select_get()) for each in bpy.data.objects),
        "action": (action.name, action.use_fake_user, action.users, tuple(action.frame_range)),
        "libraries": len(bpy.data.libraries),
        "frames": (scene.frame_start, scene.frame_end, scene.frame_current),
        "camera": scene.camera and scene.camera.name,
        "collections": sorted(each.name for each in scene.collection.children),
    }


def test_an_appended_capture_is_as_a_built_one():
    motion = motion_of(walk(0.7))
    built = state(captured(motion))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert state(captured(motion)) == built
