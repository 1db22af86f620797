# SPDX-License-Identifier: GPL-3.0-or-later
"""Exporting captures in various states: hidden, at rest, edited, linked, in the NLA, among other
objects.
"""

import re
from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.scope_addon.scene import actions
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.character.root_object import move_root_motion_to_object
from scope.scope_addon.scene.export.export import export

from ...made_motion import made_face
from ..character.test_expression_keys import morph_animation
from ..exported import (
    JOINT_TOLERANCE,
    SKIN_TOLERANCE,
    assert_joints,
    corresponding,
    read_back,
)


@pytest.fixture
def motion(body, make_motion):
    return make_motion(body, 4)


@pytest.fixture
def built(body, motion):
    """A capture at its own rate."""
    return build_scene([motion], body, options=BuildOptions(frame_rate="set"))


@pytest.fixture
def person(built):
    return built.people[0]


@pytest.mark.parametrize("suffix", [".fbx", ".usdc", ".blend"])
def test_only_the_capture_leaves_a_users_scene(body, motion, person, tmp_path, suffix):
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.scene.name = "Shot"
    person.mesh.hide_set(True)  # hidden things are captured things all the same
    scene = bpy.context.scene
    scene.frame_set(2)
    names = sorted(obj.name for obj in bpy.data.objects)
    path = tmp_path / f"walk{suffix}"
    assert export(path) == [path]
    assert sorted(obj.name for obj in bpy.data.objects) == names
    assert (bpy.context.scene, scene.frame_current) == (scene, 2)
    assert [s.name for s in bpy.data.scenes] == ["Shot"]
    assert person.mesh.data.shape_keys is not None
    assert_joints(path, body, motion, 0)
    assert not [obj for obj in bpy.data.objects if obj.name.startswith("Cube")]
    assert [obj.type for obj in bpy.context.scene.objects].count("MESH") == 1


@pytest.mark.parametrize("suffix", [".bvh", ".glb", ".fbx", ".usdc"])
def test_only_what_the_export_made_is_removed(person, tmp_path, suffix):
    """Another add-on makes data in a frame that the export shows, and keeps it."""

    def make_data(*_):
        if "trail" not in bpy.data.meshes:
            bpy.data.meshes.new("trail").use_fake_user = True
            bpy.data.texts.new("log")

    kinds = ("objects", "meshes", "armatures", "actions", "collections", "materials", "texts")
    before = {kind: set(getattr(bpy.data, kind).keys()) for kind in kinds}
    bpy.app.handlers.frame_change_post.append(make_data)
    try:
        export(tmp_path / f"walk{suffix}")
    finally:
        bpy.app.handlers.frame_change_post.remove(make_data)
    made = {kind: set(getattr(bpy.data, kind).keys()) - before[kind] for kind in kinds}
    assert {name for names in made.values() for name in names} == {"trail", "log"}


@pytest.mark.parametrize("overridden", [False, True])
def test_a_linked_capture_is_exported_with_its_shape_baked(
    body, motion, built, tmp_path, blender, truth, overridden
):
    file = tmp_path / "capture.blend"
    path = tmp_path / "walk.usdc"
    name = built.collection.name
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = 30
    with bpy.data.libraries.load(str(file), link=True) as (_, here):
        here.collections = [name]
    if overridden:
        here.collections[0].override_hierarchy_create(bpy.context.scene, bpy.context.view_layer)
    else:
        bpy.context.scene.collection.children.link(here.collections[0])
    before = sorted(mesh.name for mesh in bpy.data.meshes)
    export(path)
    assert sorted(mesh.name for mesh in bpy.data.meshes) == before
    first = read_back(path)
    blender.go_to(first + 3)
    mesh = blender.only("MESH")
    assert mesh.data.name == "walk_body"
    match = corresponding(mesh, body, motion.betas)
    np.testing.assert_allclose(
        blender.vertices(mesh), truth(body, motion).vertices(3)[match], atol=SKIN_TOLERANCE
    )


def _in_edit_mode(person, collection):
    bpy.context.view_layer.objects.active = person.armature
    bpy.ops.object.mode_set(mode="EDIT")


def _hidden_at_rest(person, collection):
    person.armature.data.pose_position = "REST"
    collection.hide_viewport = person.armature.hide_viewport = person.mesh.hide_viewport = True
    collection.hide_render = person.armature.hide_render = person.mesh.hide_render = True


@pytest.mark.parametrize(
    ("suffix", "hide"),
    [
        (".bvh", _in_edit_mode),
        (".glb", _hidden_at_rest),
        (".fbx", _hidden_at_rest),
        (".usdc", _hidden_at_rest),
    ],
)
def test_motion_disabled_in_the_viewport_is_exported(
    body, motion, built, person, tmp_path, suffix, hide
):
    collection = built.collection
    hide(person, collection)

    def state():
        hidden = [
            (o.hide_viewport, o.hide_render) for o in (collection, person.armature, person.mesh)
        ]
        return hidden, person.armature.data.pose_position, person.armature.mode

    before = state()
    path = tmp_path / f"walk{suffix}"
    export(path)
    assert state() == before
    assert_joints(path, body, motion, 3)


def _to_nla(datablock, *starts):
    """Move a datablock's action to NLA strips that start at these frames."""
    animation = datablock.animation_data
    action = animation.action
    slot = getattr(animation, "action_slot", None)
    animation.action = None
    for start in starts:
        strip = animation.nla_tracks.new().strips.new(f"from {start}", start, action)
        if slot is not None:
            strip.action_slot = slot
    return animation


@pytest.mark.parametrize("suffix", [".glb", ".usdc"])
def test_a_capture_with_a_parent_moves_with_it_in_the_file(body, person, tmp_path, blender, suffix):
    stage = bpy.data.objects.new("Stage", None)
    bpy.context.scene.collection.objects.link(stage)
    stage.rotation_euler = (0.2, -0.1, 0.7)
    person.armature.parent = stage
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.parent = stage
    for frame, x in ((0, 2.0), (3, 2.5)):
        stage.location = (x, -1.0, 0.3)
        stage.keyframe_insert("location", frame=frame)
    blender.go_to(3)
    wanted = blender.joints(person.armature, body.joint_names)
    export(tmp_path / f"walk{suffix}")
    assert person.armature.parent == stage
    np.testing.assert_allclose(blender.joints(person.armature, body.joint_names), wanted, atol=1e-6)
    first = read_back(tmp_path / f"walk{suffix}")
    assert not bpy.data.objects.get("Cube")
    blender.go_to(first + 3)
    seen = blender.joints(blender.only("ARMATURE"), body.joint_names)
    np.testing.assert_allclose(seen, wanted, atol=JOINT_TOLERANCE)


@pytest.mark.parametrize("in_place", [False, True])
def test_the_t_pose_of_a_bvh_faces_forwards_with_root_motion_on_an_object(
    body, person, tmp_path, blender, in_place
):
    export(tmp_path / "bones.bvh")
    move_root_motion_to_object(person.armature, body, 30.0, in_place=in_place, heading=True)
    blender.go_to(3)
    wanted = blender.joints(person.armature, body.joint_names)
    export(tmp_path / "object.bvh")
    hierarchies = [
        re.findall(r"\S+", (tmp_path / f"{name}.bvh").read_text("utf-8").partition("MOTION")[0])
        for name in ("bones", "object")
    ]
    for one, other in zip(*hierarchies, strict=True):
        is_number = re.fullmatch(r"-?\d+\.\d+", one)
        assert float(other) == pytest.approx(float(one), abs=1e-3) if is_number else other == one
    first = read_back(tmp_path / "object.bvh")
    blender.go_to(first + 3)
    seen = blender.joints(blender.only("ARMATURE"), body.joint_names)
    np.testing.assert_allclose(seen, wanted, atol=JOINT_TOLERANCE)


@pytest.mark.parametrize("suffix", [".glb", ".fbx", ".usdc"])
def test_a_motion_in_the_nla_is_exported_as_displayed(
    body, motion, person, tmp_path, blender, truth, suffix
):
    animation = _to_nla(person.armature, 40)
    actions_before = set(bpy.data.actions)
    path = tmp_path / f"walk{suffix}"
    export(path)
    assert (animation.action, animation.use_nla, set(bpy.data.actions)) == (
        None,
        True,
        actions_before,
    )
    read_back(path)
    armature = blender.only("ARMATURE")
    first, last = actions.frame_range([armature])
    assert last - first == pytest.approx(3, abs=0.01)
    blender.go_to(first + 3)
    joints = blender.joints(armature, body.joint_names)
    np.testing.assert_allclose(joints, truth(body, motion).joints[3], atol=JOINT_TOLERANCE)


def test_objects_without_bones_may_be_in_the_nla_too(body, motion, person, tmp_path):
    _to_nla(person.armature, 1)
    person.camera.keyframe_insert("location", frame=1)
    layered = _to_nla(person.camera, 1)
    person.camera.keyframe_insert("location", frame=1)  # an action of its own over the strip
    layered.action_blend_type = "ADD"
    action = layered.action
    export(tmp_path / "walk.glb")
    assert (layered.action, layered.action_blend_type, layered.use_nla) == (action, "ADD", True)
    assert_joints(tmp_path / "walk.glb", body, motion, 3)


@pytest.mark.slow
def test_a_face_in_the_nla_moves_in_a_glb(whole_body, make_motion, tmp_path):
    jaw = np.array([0.0, 0.3, 0.9, 0.2, 0.5])
    face = made_face(5, jawOpen=jaw, eyeBlinkLeft=0.4)
    motion = replace(make_motion(whole_body, 5), face=face)
    person = build_scene([motion], whole_body, options=BuildOptions(frame_rate="set")).people[0]
    kept = [_to_nla(block, 40) for block in (person.armature, person.mesh.data.shape_keys)]
    actions_before = set(bpy.data.actions)
    export(tmp_path / "talk.glb")
    assert [(animation.action, animation.use_nla) for animation in kept] == [(None, True)] * 2
    assert set(bpy.data.actions) == actions_before
    weights = morph_animation(tmp_path / "talk.glb")
    assert list(weights)[-52:] == list(EXPRESSIONS)
    np.testing.assert_allclose(weights["jawOpen"], jaw, atol=1e-5)
    np.testing.assert_allclose(weights["eyeBlinkLeft"], 0.4, atol=1e-5)
    assert not weights["mouthSmileLeft"].any()
    np.testing.assert_allclose(weights["Shape000"], motion.betas[0], atol=1e-5)


def test_a_solo_track_determines_the_frame_range(person):
    animation = _to_nla(person.armature, 1, 1000)
    assert actions.frame_range([person.armature])[1] > 1000
    animation.nla_tracks[0].is_solo = True
    assert actions.frame_range([person.armature])[1] < 10


@pytest.mark.parametrize(
    ("suffix", "size"),
    [(".glb", 1.0), (".glb", 100.0), (".fbx", 100.0)],
)
def test_a_capture_in_a_scene_in_centimetres_has_its_true_size(
    body, motion, person, tmp_path, size, suffix
):
    bpy.context.scene.unit_settings.scale_length = 0.01
    path = tmp_path / f"walk{suffix}"
    person.armature.scale = (size,) * 3  # as the warning of the build suggests
    bpy.context.view_layer.update()
    export(path)
    assert person.armature.parent is None
    assert bpy.data.objects.get("Unit") is None
    assert_joints(path, body, motion, 3)


def test_hidden_objects_stay_hidden_in_a_blend(person, tmp_path):
    person.armature.data.pose_position = "REST"
    person.armature.hide_render = person.mesh.hide_viewport = person.mesh.hide_render = True
    name = person.mesh.name
    export(tmp_path / "walk.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "walk.blend"))
    mesh = bpy.data.objects[name]
    assert (mesh.hide_viewport, mesh.hide_render, mesh.parent.hide_render) == (True, True, True)
    assert mesh.parent.data.pose_position == "REST"


def test_a_motion_that_begins_before_frame_0_is_not_cut_off(body, make_motion, tmp_path):
    build_scene([make_motion(body, 60)], body, options=BuildOptions(start_frame=-20))
    with pytest.raises(UsageError, match="begins at frame -20"):
        export(tmp_path / "walk.glb")
    assert list(tmp_path.iterdir()) == []
    assert [s.name for s in bpy.data.scenes] == ["Scene"]
