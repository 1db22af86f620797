# SPDX-License-Identifier: GPL-3.0-or-later
"""BVH files that Blender has written, and that Scope has, read by Scope."""

import bpy
import numpy as np
from scope.scope_addon.retarget.import_motions import import_motions
from scope.scope_addon.scene.export.export import export_motions
from scope.solver.rotations import exp

from ...retarget.made_bvh import FRAMES, TOOLS, assert_is_the_motion, bvh, joints_of


def test_blenders_own_exporter(tmp_path):
    path = tmp_path / "in.bvh"
    path.write_text(bvh(TOOLS["mixamo without prefix"]))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = 30
    bpy.ops.import_anim.bvh(filepath=str(path), global_scale=0.01, frame_start=1)
    written = tmp_path / "out.bvh"
    bpy.ops.export_anim.bvh(filepath=str(written), frame_start=1, frame_end=FRAMES)
    (found,) = import_motions(written)
    assert_is_the_motion(found)


def test_our_own_files(body, make_motion, tmp_path):
    motion = make_motion(body, 12)
    motion.betas[:] = 0.0
    rotations = exp(motion.poses.reshape(len(motion), -1, 3).astype(float))
    wanted = body.forward_kinematics(rotations, motion.trans, motion.betas)[1]
    export_motions([motion], body, tmp_path / "walk.bvh")
    (found,) = import_motions(tmp_path / "walk.bvh")
    moved = joints_of(found) - wanted
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0, 0], moved.shape), atol=1e-3)
