# SPDX-License-Identifier: GPL-3.0-or-later
"""What corrections change, to compare before and after, in the view of the capture's camera."""

import bpy
import numpy as np
from scope.scope_addon.scene.actions import fcurves, read_keys
from scope.scope_addon.scene.character.correction_list import listed_corrections
from scope.scope_addon.scene.packed_motion import stored_motion


def look_through_camera(frame):
    """Make the capture's camera and its resolution the scene's, in a frame."""
    scene = bpy.context.scene
    scene.camera = next(obj for obj in scene.objects if obj.type == "CAMERA")
    scene.render.resolution_x = 640
    scene.render.resolution_y = 480
    scene.frame_set(frame)


def keys(*objects):
    """The keys of objects, by object, path and index of their curves."""
    return {
        (obj.name, curve.data_path, curve.array_index): read_keys(curve)
        for obj in objects
        for curve in fcurves(obj)
    }


def everything(armature):
    """Keys of the armature and the camera, the camera's place, and the motion's arrays."""
    camera = next(obj for obj in bpy.context.scene.objects if obj.type == "CAMERA")
    motion = stored_motion(armature)
    names = ("poses", "trans", "poses_raw", "trans_raw", "world_from_camera")
    found = keys(armature, camera) | {name: getattr(motion, name) for name in names}
    if not fcurves(camera):
        found["camera"] = np.array(camera.matrix_basis)
    return found


def kinds(armature):
    """The kinds of the listed corrections."""
    return [entry["kind"] for entry in listed_corrections(armature)]


def assert_same(found, expected, atol=0.0):
    """Compare what `keys` or `everything` have found."""
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=0.0, atol=atol, err_msg=str(name))
