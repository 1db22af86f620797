# SPDX-License-Identifier: GPL-3.0-or-later
"""Each format is written, read back by Blender's importer, and compared with the solver's own
joints and skin.
"""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.output_paths import SUFFIXES, WITHOUT_SCENE
from scope.scope_addon.scene.build import NEW_SCENE, build_scene
from scope.scope_addon.scene.datablocks import captures_of
from scope.scope_addon.scene.export import formats
from scope.scope_addon.scene.export.export import ExportOptions, export, export_motions
from scope.scope_addon.scene.export.fbx_file import below

from ...made_motion import made_views
from ..exported import (
    JOINT_TOLERANCE,
    SKIN_TOLERANCE,
    corresponding,
    fbx_objects,
    glb_values,
    read_back,
    read_glb,
)

SCENE_SUFFIXES = [suffix for suffix in SUFFIXES if suffix not in WITHOUT_SCENE]


@pytest.mark.parametrize("suffix", SCENE_SUFFIXES)
def test_joints_and_skin_survive(body, make_motion, truth, joints_world, blender, tmp_path, suffix):
    rate = 30000 / 1001
    motion = make_motion(body, 12, rate=rate)
    path = tmp_path / f"walk{suffix}"
    assert export_motions([motion], body, path) == ([path], [])
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    first = read_back(path, rate)
    armature = blender.only("ARMATURE")
    assert set(armature.data.bones.keys()) == set(body.joint_names)
    expected = truth(body, motion)
    for t in (0, 4, 11):
        blender.go_to(first + t)
        joints = blender.joints(armature, body.joint_names)
        np.testing.assert_allclose(joints, joints_world(motion)[t], atol=JOINT_TOLERANCE)
        if suffix != ".bvh":
            mesh = blender.only("MESH")
            match = corresponding(mesh, body, motion.betas)
            assert len(np.unique(match)) == len(body.v_template)
            found = blender.vertices(mesh)
            np.testing.assert_allclose(found, expected.vertices(t)[match], atol=SKIN_TOLERANCE)


@pytest.mark.parametrize(
    ("suffix", "shape"), [(".glb", "baked"), (".fbx", "keys"), (".fbx", "baked"), (".usdc", "keys")]
)
def test_shape_as_morphs_or_baked(body, make_motion, truth, blender, tmp_path, suffix, shape):
    motion = make_motion(body, 4)
    path = tmp_path / f"walk{suffix}"
    export_motions([motion], body, path, export_options=ExportOptions(shape=shape))
    first = read_back(path)
    mesh = blender.only("MESH")
    blender.go_to(first + 3)
    assert (mesh.data.shape_keys is not None) == (shape == "keys")
    if shape == "keys":
        keys = mesh.data.shape_keys.key_blocks
        assert list(keys.keys())[1:] == [f"Shape{p:03d}" for p in range(body.P)]
        np.testing.assert_allclose([k.value for k in keys[1:]], motion.betas, atol=1e-4)
    match = corresponding(mesh, body, motion.betas)
    np.testing.assert_allclose(
        blender.vertices(mesh), truth(body, motion).vertices(3)[match], atol=SKIN_TOLERANCE
    )


@pytest.mark.parametrize("suffix", [".glb", ".bvh"])
def test_variable_frame_rate_keeps_its_timing(body, make_motion, truth, blender, tmp_path, suffix):
    # Frames at every second tick of 30, then at every tick: files of constant rate must hold the
    # whole ticks.
    stamps = np.array([0, 2, 4, 5, 6, 8]) / 30
    motion = make_motion(body, timestamps=stamps, rate=30.0)
    path = tmp_path / f"walk{suffix}"
    export_motions([motion], body, path)
    first = read_back(path)
    armature = blender.only("ARMATURE")
    expected = truth(body, motion)
    for t, stamp in enumerate(stamps):
        blender.go_to(first + round(stamp * 30))
        joints = blender.joints(armature, body.joint_names)
        np.testing.assert_allclose(joints, expected.joints[t], atol=JOINT_TOLERANCE)


def test_usd_counts_time_in_the_scenes_frames_and_lengths_in_metres(body, make_motion, tmp_path):
    build_scene([make_motion(body, 3, rate=29.97)], body, options=NEW_SCENE)
    path = tmp_path / "walk.usdc"
    formats.write_usd(path)
    layer = formats._usd_module().Layer.OpenAsAnonymous(str(path))
    assert layer.timeCodesPerSecond == pytest.approx(30000 / 1001, rel=1e-6)
    assert layer.pseudoRoot.GetInfo("metersPerUnit") == 1.0
    assert layer.pseudoRoot.GetInfo("upAxis") == "Z"


@pytest.mark.parametrize("suffix", [".glb", ".fbx", ".usdc"])
def test_the_camera_keeps_its_field_of_view_in_a_scene_of_another_shape(
    body, make_motion, tmp_path, blender, suffix
):
    fx, fy = 600.0, 900.0  # pixels need not be square
    motion = make_motion(body, 2, intrinsics=np.array([[fx, 0, 320], [0, fy, 240], [0, 0, 1]]))
    bpy.context.scene.render.resolution_x = 1920
    bpy.context.scene.render.resolution_y = 1080
    build_scene([motion], body)
    path = tmp_path / f"walk{suffix}"
    export(path, options=ExportOptions(camera=True))
    assert bpy.context.scene.render.resolution_x == 1920
    expected = 2 * np.arctan([320 / fx, 240 / fy])
    if suffix == ".glb":
        lens = read_glb(path)[0]["cameras"][0]["perspective"]
        found = 2 * np.arctan(np.tan(lens["yfov"] / 2) * lens["aspectRatio"]), lens["yfov"]
    else:
        read_back(path)
        lens = blender.only("CAMERA").data
        found = 2 * np.arctan(np.array([lens.sensor_width, lens.sensor_height]) / 2 / lens.lens)
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_every_camera_of_a_glb_has_a_field_of_view_of_its_own(body, make_motion, tmp_path):
    views = made_views(0.0) | {"view_image_sizes": np.array([[400, 600]])}
    motion = replace(make_motion(body, 2, image_size=(640, 480)), views=views)
    first_focal = motion.intrinsics[0, 0], motion.intrinsics[1, 1]
    second_focal = 500.0, 510.0  # of `made_views`
    build_scene([motion], body)
    own = bpy.data.cameras.new("own")  # the user's, with the scene's picture
    captures_of(bpy.context.scene)[0].objects.link(bpy.data.objects.new("own", own))
    path = tmp_path / "walk.glb"
    export(path, options=ExportOptions(camera=True))
    lenses = {each["name"]: each["perspective"] for each in read_glb(path)[0]["cameras"]}
    assert lenses.pop("own")["aspectRatio"] == pytest.approx(640 / 480)
    first, second = (lenses[name] for name in sorted(lenses))
    for lens, width, height, focal in (
        (first, 640, 480, first_focal),
        (second, 400, 600, second_focal),
    ):
        assert lens["yfov"] == pytest.approx(2 * np.arctan(height / 2 / focal[1]), rel=1e-5)
        half_width = np.tan(lens["yfov"] / 2) * lens["aspectRatio"]
        assert half_width == pytest.approx(width / 2 / focal[0], rel=1e-5)


def test_blend_opens_with_camera_rate_and_shape_keys(body, make_motion, tmp_path, blender):
    path = tmp_path / "walk.blend"
    motion = make_motion(body, 6, rate=29.97, image_size=(1080, 1920))
    motion.valid[3:5] = False
    export_motions([motion], body, path)
    read_back(path)
    scene = bpy.context.scene
    assert [(marker.name, marker.frame) for marker in scene.timeline_markers] == [
        ("not seen 3-4", 3)
    ]
    assert {bone.custom_shape.type for bone in blender.only("ARMATURE").pose.bones} == {"MESH"}
    assert (scene.name, scene.frame_start, scene.frame_end) == ("Capture", 0, 5)
    assert (scene.render.resolution_x, scene.render.resolution_y) == (1080, 1920)
    assert scene.camera == blender.only("CAMERA")
    assert captures_of(scene)[0].name == "walk"
    keys = blender.only("MESH").data.shape_keys.key_blocks
    assert (keys["Shape001"].slider_min, keys["Shape001"].slider_max) == (-10, 10)


def test_a_capture_without_its_armature_is_reported(body, make_motion, tmp_path):
    person = build_scene([make_motion(body, 2)], body).people[0]
    bpy.data.objects.remove(person.armature)
    with pytest.raises(UsageError, match="armature was removed"):
        export(tmp_path / "walk.glb")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".glb", ".blend"])
def test_a_file_for_each_of_several_people(body, make_motion, tmp_path, blender, truth, suffix):
    """Each file has one armature and mesh with that person's motion; all start at the same time."""
    late = make_motion(body, timestamps=np.arange(2, 6) / 30, seed=1)
    motions = [make_motion(body, 6), late]
    before = sorted(c.name for c in bpy.data.collections)
    written, _ = export_motions(
        motions,
        body,
        tmp_path / f"pair{suffix}",
        export_options=ExportOptions(separate=True, camera=True),
    )
    assert [p.name for p in written] == [f"pair.person{n}{suffix}" for n in (1, 2)]
    assert sorted(c.name for c in bpy.data.collections) == before
    for path, motion, first in zip(written, motions, (0, 2), strict=True):
        start = read_back(path)
        armature = blender.only("ARMATURE")
        assert (
            len(
                [
                    o
                    for o in bpy.data.objects
                    if o.type == "MESH" and o.users_scene and o.find_armature()
                ]
            )
            == 1
        )
        blender.go_to(start + first + 1)
        posed = blender.joints(armature, body.joint_names)
        np.testing.assert_allclose(posed, truth(body, motion).joints[1], atol=2e-3)


def test_fbx_and_glb_begin_at_zero_and_are_named_after_the_clip(body, make_motion, tmp_path):
    """Read from the files themselves, because importers move and rename animation."""
    built = build_scene(
        [make_motion(body, 5, rate=20.0)],
        body,
        None,
        replace(NEW_SCENE, name="A walk", start_frame=7.0),
    )
    export(tmp_path / "out.glb", [built.collection])
    export(tmp_path / "out.fbx", [built.collection])
    gltf, binary = read_glb(tmp_path / "out.glb")
    (animation,) = gltf["animations"]
    assert animation["name"] == "A walk"
    times_s = [glb_values(gltf, binary, s["input"]) for s in animation["samplers"]]
    assert min(each[0] for each in times_s) == 0.0
    assert max(each[-1] for each in times_s) == pytest.approx(0.2)
    objects = fbx_objects(tmp_path / "out.fbx")
    second = 46186158000
    curves = objects[b"AnimationCurve"]
    times = [t for e in curves for k in below(e, b"KeyTime") for t in k.props[0]]
    assert min(times) == 0
    assert max(times) / second == pytest.approx(0.2)
    (stack,) = objects[b"AnimationStack"]
    assert stack.props[1] == b"A walk\0\x01AnimStack"
    (takes,) = below(objects[b""][0], b"Takes")
    (take,) = below(takes, b"Take")
    assert take.props == [b"A walk"]
    (span,) = below(take, b"LocalTime")
    assert span.props == [0, pytest.approx(0.2 * second)]
