# SPDX-License-Identifier: GPL-3.0-or-later
import dataclasses

import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import MotionFileError, UsageError, VideoError
from scope.scope_addon.scene import actions
from scope.scope_addon.scene.build import NEW_SCENE, BuildOptions, build_scene
from scope.scope_addon.scene.datablocks import CAPTURE_TAG


def data_counts() -> dict[str, int]:
    kinds = (
        "collections",
        "objects",
        "meshes",
        "armatures",
        "cameras",
        "actions",
        "materials",
        "movieclips",
        "images",
    )
    return {kind: len(getattr(bpy.data, kind)) for kind in kinds}


@pytest.mark.parametrize("shape", ["keyed", "baked"])
def test_joints_and_skin_are_the_bodys(body, make_motion, truth, joints_world, blender, shape):
    motion = make_motion(body, 40)
    expected = truth(body, motion)
    person = build_scene(
        [motion], body, options=dataclasses.replace(NEW_SCENE, shape=shape)
    ).people[0]
    for t in (0, 13, 39):
        blender.go_to(t)
        joints = blender.joints(person.armature, body.joint_names)
        np.testing.assert_allclose(joints, expected.joints[t], atol=1e-5)
        np.testing.assert_allclose(joints, joints_world(motion)[t], atol=1e-5)
        np.testing.assert_allclose(blender.vertices(person.mesh), expected.vertices(t), atol=1e-5)


def test_a_still_image_leaves_the_scenes_frame_rate(body, make_motion, truth, blender):
    scene = bpy.context.scene
    scene.render.fps = 24
    motion = make_motion(body, 1)
    person = build_scene([motion], body, options=NEW_SCENE).people[0]
    assert scene.render.fps == 24
    joints = blender.joints(person.armature, body.joint_names)
    np.testing.assert_allclose(joints, truth(body, motion).joints[0], atol=1e-5)


def test_the_body_with_fingers(make_motion, truth, blender):
    from scope.solver.body_file import load_body

    hands = load_body("scope_h")
    motion = make_motion(hands, 5)
    person = build_scene([motion], hands).people[0]
    blender.go_to(person.frames[4])
    expected = truth(hands, motion)
    np.testing.assert_allclose(
        blender.joints(person.armature, hands.joint_names), expected.joints[4], atol=1e-5
    )
    np.testing.assert_allclose(blender.vertices(person.mesh), expected.vertices(4), atol=1e-5)


def test_bones_are_the_joints_at_the_fitted_shape(body, make_motion):
    motion = make_motion(body)
    armature = build_scene([motion], body).people[0].armature
    bones = armature.data.bones
    assert sorted(bones.keys()) == sorted(body.joint_names)
    parents = [bones[name].parent.name if bones[name].parent else None for name in body.joint_names]
    assert parents == [body.joint_names[p] if p >= 0 else None for p in body.parents]
    assert all(0.015 < bone.length < 0.7 for bone in bones)
    tail = np.array(bones["left_shoulder"].tail_local)
    np.testing.assert_allclose(tail, bones["left_elbow"].head_local, atol=1e-5)
    assert bones["pelvis"].tail_local[2] > bones["pelvis"].head_local[2]


def test_the_rest_pose_stands_on_the_floor(body, make_motion, blender):
    person = build_scene([make_motion(body)], body).people[0]
    person.armature.data.pose_position = "REST"
    bpy.context.view_layer.update()
    vertices = blender.vertices(person.mesh)
    assert vertices[:, 2].min() == pytest.approx(0.0, abs=1e-5)
    assert 1.4 < vertices[:, 2].max() < 2.2
    toes = person.armature.data.bones["left_foot"]
    assert toes.head_local[1] < person.armature.data.bones["left_ankle"].head_local[1]  # faces −y


def test_quaternions_stay_on_one_hemisphere_through_a_turn(body, make_motion, blender):
    # its root turns through 180 degrees, where axis-angle vectors flip
    motion = make_motion(body, 60)
    person = build_scene([motion], body).people[0]
    path = actions.bone_path("pelvis", "rotation_quaternion")
    curves = [c for c in actions.fcurves(person.armature) if c.data_path == path]
    q = np.stack([actions.read_keys(c)[:, 1] for c in curves], axis=1)
    assert (np.sum(q[1:] * q[:-1], axis=1) > 0.9).all()
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-5)
    assert {key.interpolation for c in curves for key in c.keyframe_points} == {"LINEAR"}


def test_variable_frame_rate_keeps_its_timing(body, make_motion, truth, blender):
    stamps = np.array([0.0, 0.021, 0.093, 0.1, 0.27])
    motion = make_motion(body, timestamps=stamps, rate=25.0)
    person = build_scene([motion], body, options=NEW_SCENE).people[0]
    np.testing.assert_allclose(person.frames, stamps * 25, atol=1e-9)
    expected = truth(body, motion)
    for t in range(len(stamps)):
        blender.go_to(stamps[t] * 25)
        np.testing.assert_allclose(
            blender.joints(person.armature, body.joint_names), expected.joints[t], atol=1e-4
        )
    assert (bpy.context.scene.frame_start, bpy.context.scene.frame_end) == (0, 7)


def test_the_scene_rate_is_kept_unless_asked(body, make_motion, truth, blender):
    scene = bpy.context.scene
    scene.render.fps = 24
    scene.render.fps_base = 1.0
    motion = make_motion(body, 31, rate=30.0)
    result = build_scene([motion], body)
    assert (scene.render.fps, result.frame_rate) == (24, 24.0)
    blender.go_to(24.0)  # one second
    joints = blender.joints(result.people[0].armature, body.joint_names)
    np.testing.assert_allclose(joints, truth(body, motion).joints[30], atol=1e-4)


def test_a_new_scene_takes_rate_size_and_range(body, make_motion):
    motion = make_motion(body, 10, rate=29.97, image_size=(1080, 1920))
    result = build_scene([motion], body, options=NEW_SCENE)
    scene = bpy.context.scene
    assert (scene.render.fps, scene.render.fps_base) == (30, pytest.approx(1.001))
    assert (scene.render.resolution_x, scene.render.resolution_y) == (1080, 1920)
    assert (scene.frame_start, scene.frame_end) == (0, 9)
    assert scene.camera == result.people[0].camera


def test_a_further_capture_keeps_the_range_of_those_before(body, make_motion):
    scene = bpy.context.scene
    ranges = []
    for count, start in ((30, 5), (10, 8), (12, 30)):
        build_scene(
            [make_motion(body, count)],
            body,
            options=BuildOptions(frame_rate="set", start_frame=start),
        )
        ranges.append((scene.frame_start, scene.frame_end))
    assert ranges == [(5, 34), (5, 34), (5, 41)]


def test_a_scene_in_centimetres_gives_a_warning(body, make_motion):
    assert build_scene([make_motion(body, 2)], body).warnings == []
    bpy.context.scene.unit_settings.scale_length = 0.01
    built = build_scene([make_motion(body, 2)], body)
    (warning,) = built.warnings
    assert "by 100," in str(warning)
    assert built.people[0].camera.data.clip_end >= 100_000.0  # a kilometre


def test_a_scene_that_stretches_time_gives_a_warning(body, make_motion, truth, blender):
    scene = bpy.context.scene
    scene.render.frame_map_old = 100
    scene.render.frame_map_new = 200
    motion = make_motion(body, 30)
    built = build_scene([motion], body, options=BuildOptions(frame_rate="set"))
    (warning,) = built.warnings
    assert "at 0.5 times its speed" in str(warning)
    # Blender shows the pose of frame 10 at frame 20.
    blender.go_to(20)
    joints = blender.joints(built.people[0].armature, body.joint_names)
    np.testing.assert_allclose(joints, truth(body, motion).joints[10], atol=1e-5)


def test_one_collection_and_one_camera_for_the_people_of_a_capture(
    body, make_motion, truth, blender
):
    motions = [
        make_motion(body, 6, betas=[-1.5] + [0.0] * 9),
        make_motion(body, 6, seed=1, offset=(1.0, 0, 0)),
    ]
    result = build_scene(motions, body)
    assert result.collection[CAPTURE_TAG] == "walk.mp4"
    names = {obj.name for obj in result.collection.objects}
    assert names == {
        "walk_person1",
        "walk_person1_body",
        "walk_person2",
        "walk_person2_body",
        "walk_camera",
    }
    assert [c.name for c in bpy.context.scene.collection.children] == ["walk"]
    blender.go_to(result.people[1].frames[5])
    for motion, person in zip(motions, result.people, strict=True):
        expected = truth(body, motion)
        np.testing.assert_allclose(
            blender.joints(person.armature, body.joint_names), expected.joints[5], atol=1e-4
        )
        np.testing.assert_allclose(blender.vertices(person.mesh), expected.vertices(5), atol=1e-4)


def test_mesh_has_quads_uvs_materials_and_smooth_faces(body, make_motion):
    mesh = build_scene([make_motion(body)], body).people[0].mesh.data
    assert len(mesh.vertices) == len(body.v_template)
    assert {p.loop_total for p in mesh.polygons} == {4}
    assert all(p.use_smooth for p in mesh.polygons)
    assert [m.name for m in mesh.materials] == list(body.material_names)
    used = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("material_index", used)
    np.testing.assert_array_equal(used, body.face_material)
    uv = np.empty(2 * len(mesh.loops), np.float32)
    mesh.uv_layers[0].data.foreach_get("uv", uv)
    np.testing.assert_allclose(uv.reshape(-1, 4, 2), body.uv[body.uv_faces], atol=1e-6)
    assert not mesh.validate()


@pytest.mark.parametrize("wrong", ["poses", "betas", "joints"])
def test_a_motion_of_another_body_is_refused_and_nothing_is_built(body, make_motion, wrong):
    motion = make_motion(body)
    if wrong == "poses":
        motion.poses[2, 5] = np.nan
    elif wrong == "betas":
        motion.betas = motion.betas[:-1]
    else:
        motion.joints_cam = motion.joints_cam[:, :-1]
    before = data_counts()
    with pytest.raises(MotionFileError):
        build_scene([motion], body)
    assert data_counts() == before


def test_unknown_options_are_refused():
    with pytest.raises(UsageError, match="keyed, baked"):
        BuildOptions(shape="melted")
    with pytest.raises(UsageError, match="keep, set"):
        BuildOptions(frame_rate="guess")


def test_failures_leave_the_scene_as_it_was(body, make_motion, tmp_path):
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    bpy.ops.object.mode_set(mode="EDIT")
    scene = bpy.context.scene
    scene.render.fps = 25
    scene.render.fps_base = 1.0
    scene.frame_start = 3
    scene.frame_end = 77
    scene.frame_set(12)

    def state():
        render = scene.render
        settings = (
            render.fps,
            render.fps_base,
            render.resolution_x,
            scene.frame_start,
            scene.frame_end,
        )
        active = bpy.context.view_layer.objects.active
        return (
            data_counts(),
            settings,
            scene.frame_current,
            scene.camera,
            active.name,
            active.mode,
            cube.select_get(),
        )

    before = state()

    motions = [make_motion(body), make_motion(body, seed=1)]
    broken = dataclasses.replace(motions[1], timestamps=np.zeros(len(motions[1])))
    with pytest.raises(MotionFileError, match="increasing"):
        build_scene([motions[0], broken], body, options=NEW_SCENE)
    assert state() == before
    with pytest.raises(VideoError, match="does not exist"):
        build_scene(motions, body, footage=tmp_path / "gone.mp4", options=NEW_SCENE)
    assert state() == before
