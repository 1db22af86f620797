# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
import numpy as np
import scope
from scope.scope_addon.scene.build import build_scene
from scope.scope_addon.scene.character import armature


def test_sides_have_their_colours_and_collections(body, make_motion):
    armature = build_scene([make_motion(body, 2)], body).people[0].armature
    bones = armature.data.bones
    assert {bone.color.palette for bone in bones} == {"CUSTOM"}
    colours = {
        side: {tuple(bones[n].color.custom.normal) for n in names}
        for side, names in sides(body).items()
    }
    assert all(len(found) == 1 for found in colours.values())
    assert len(set.union(*colours.values())) == 3
    collections = {c.name: {b.name for b in c.bones} for c in armature.data.collections}
    assert collections == {side: set(names) for side, names in sides(body).items()}


def sides(body) -> dict[str, list[str]]:
    left = [n for n in body.joint_names if n.startswith("left")]
    right = [n for n in body.joint_names if n.startswith("right")]
    return {
        "Left": left,
        "Right": right,
        "Middle": [n for n in body.joint_names if n not in left + right],
    }


def test_rings_lie_around_the_limbs(body, make_motion):
    """The ring is just outside the surface of the mesh in the middle of the bone."""
    person = build_scene([make_motion(body, 2)], body).people[0]
    rest = np.array([v.co for v in person.mesh.data.shape_keys.reference_key.data])
    for key in person.mesh.data.shape_keys.key_blocks[1:]:
        rest = rest + key.value * (
            np.array([v.co for v in key.data]) - [v.co for v in key.relative_key.data]
        )
    for name in ("left_hip", "right_knee", "left_elbow", "spine2"):
        bone = person.armature.data.bones[name]
        posed = person.armature.pose.bones[name]
        head = np.array(bone.head_local)
        tail = np.array(bone.tail_local)
        along = (tail - head) / bone.length
        groups = person.mesh.vertex_groups[name].index
        mine = [
            any(g.group == groups and g.weight > 0.5 for g in v.groups)
            for v in person.mesh.data.vertices
        ]
        offset = rest[mine] - head
        height = offset @ along
        # In a shorter piece of the bone, a mesh of few faces has no vertices on some sides.
        near = np.abs(height - 0.5 * bone.length) < 0.25 * bone.length
        reach = np.linalg.norm(offset[near] - np.outer(height[near], along), axis=1)
        ring = posed.custom_shape_scale_xyz[0]
        assert np.median(reach) < ring < 1.6 * reach.max(), name
        np.testing.assert_allclose(
            posed.custom_shape_translation, [0, bone.length / 2, 0], atol=1e-6
        )
        assert not posed.use_custom_shape_bone_size


def test_an_armature_that_is_appended_leaves_no_ring_in_the_scene(body, make_motion, tmp_path):
    scope.register()
    try:
        build_scene([make_motion(body, 2)], body)
        name = bpy.context.view_layer.objects.active.name
        path = tmp_path / "person.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        for _ in range(2):
            bpy.ops.wm.append(directory=f"{path}/Object/", filename=name)
            ring = bpy.data.objects[name].pose.bones["head"].custom_shape
            if hasattr(bpy.app.handlers, "blend_import_post"):  # from Blender 4.3 on
                assert not ring.users_collection
                rings = [o for o in bpy.context.scene.objects if armature.RING in o.name]
                assert rings == []
    finally:
        scope.unregister()
