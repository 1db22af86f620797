# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs with the names and rest poses of common tools, retargeted as they come, against the body's
own joints.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import bpy
import numpy as np
import pytest
from scope.benchmarks.rigs.kinds import KINDS
from scope.benchmarks.rigs.made import make_rig
from scope.benchmarks.rigs.measured import measured
from scope.scope_addon.retarget.rig_source import rig_source
from scope.scope_addon.scene.build import NEW_SCENE
from scope.scope_addon.scene.export import formats
from scope.scope_addon.scene.rig_file import export_on_rig, load_rig, rig_bone_map
from scope.scope_addon.scene.rig_retarget import retarget, usable_guess
from scope.solver.errors import InputError

from ..edit.walking import BETAS, BODY, NAMES, RATE, motion_of, walk
from .exported import fbx_models, read_glb, write_glb
from .made_rigs import captured, truth

MOTION = motion_of(walk(0.5, bent=0.2))
JOINTS = truth(MOTION)
FRAMES = np.array([0, 7, 15])
KIND = {kind.name: kind for kind in KINDS}
# VRM's name of the part at each place.
HUMANOID = {"pelvis": "hips", "spine1": "spine", "spine3": "chest", "spine4": "upperChest",
            "neck": "neck", "head": "head"}  # fmt: skip
HUMANOID_LIMBS = {"hip": "UpperLeg", "knee": "LowerLeg", "ankle": "Foot", "ball": "Toes",
                  "collar": "Shoulder", "shoulder": "UpperArm", "elbow": "LowerArm",
                  "wrist": "Hand", "thumb1": "ThumbMetacarpal", "thumb2": "ThumbProximal",
                  "middle1": "MiddleProximal"}  # fmt: skip


def test_the_limbs_of_every_rig_are_guessed():
    parts = {place: place for place in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")}
    parts["ball"] = "foot"
    for kind in KINDS:
        rig = make_rig(kind)
        found = usable_guess(rig.armature).parts
        for side, place in product(("left", "right"), parts):
            if bone := rig.bone_at.get(f"{side} {place}"):
                assert found[bone] == f"{side}_{parts[place]}", kind.name


@pytest.mark.parametrize(
    "name", ["Mixamo, three.js", "Unreal 5", "VRM, VRoid", "MMD", "Xsens MVN", "Roblox R15"]
)
def test_a_rig_follows_the_motion_and_stands_on_the_floor(name):
    source = captured(MOTION)
    rig = make_rig(KIND[name])
    bone_map = usable_guess(rig.armature)
    result = retarget(source, BODY, BETAS, rig.armature, bone_map, RATE)
    assert result.warnings == []
    seen = measured(rig, JOINTS, NAMES, FRAMES)
    assert seen["limbs"].max() < 6
    assert seen["hands"].max() < 13
    assert seen["trunk"].max() < 6
    # This walk is above its floor at times, in proportion to the rig's legs.
    expected = result.travel * lowest_of_body(source)
    np.testing.assert_allclose(seen["lowest"], expected, atol=0.02)


@pytest.mark.parametrize("name", ["MetaHuman", "Roblox R15"])
def test_a_rig_whose_names_say_nothing_is_guessed_from_its_rest_pose(name):
    source = captured(MOTION)
    rig = make_rig(KIND[name])
    names = {bone.name: f"Bone.{k:03d}" for k, bone in enumerate(rig.armature.data.bones)}
    for bone in list(rig.armature.data.bones):
        bone.name = names[bone.name]
    rig = replace(rig, bone_at={place: names[bone] for place, bone in rig.bone_at.items()})
    bone_map = usable_guess(rig.armature)
    (warning,) = retarget(source, BODY, BETAS, rig.armature, bone_map, RATE).warnings
    assert warning.code == "guessed_bones"
    seen = measured(rig, JOINTS, NAMES, FRAMES)
    assert seen["limbs"].max() < 6
    assert seen["trunk"].max() < 6


def lowest_of_body(source):
    """Return the height of the captured mesh's lowest vertex in each frame, metres."""
    mesh = next(child for child in source.children if child.type == "MESH")
    heights = []
    for frame in FRAMES:
        bpy.context.scene.frame_set(int(frame) + 1)
        posed = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
        evaluated = posed.to_mesh()
        heights.append(min((posed.matrix_world @ v.co).z for v in evaluated.vertices))
        posed.to_mesh_clear()
    return np.array(heights)


@pytest.mark.parametrize("version", [0, 1])
def test_an_avatar_is_read_by_its_humanoid_table(tmp_path, version):
    """Its bones have names that say nothing."""
    rig = make_rig(KIND["VRM, VRoid"])
    bone_of = {}
    expected = {}
    for place, name in list(rig.bone_at.items()):
        side, _, at = place.partition(" ")
        bone = rig.armature.data.bones[name]
        bone.name = f"node{len(bone_of)}"
        part = HUMANOID.get(at) if side == "left" else None
        if at in HUMANOID_LIMBS:
            part = f"{side}{HUMANOID_LIMBS[at]}"
            expected[bone.name] = f"{side}_{ {'ball': 'foot'}.get(at, at) }"
        if part:
            bone_of[part] = bone.name
    expected |= {bone_of["hips"]: "pelvis", bone_of["neck"]: "neck", bone_of["head"]: "head"}
    expected |= {bone_of[part]: f"spine{k}" for k, part in
                 enumerate(("spine", "chest", "upperChest"), 1)}  # fmt: skip
    path = tmp_path / "avatar.vrm"
    formats.write_glb(tmp_path / "avatar.glb")
    gltf, binary = read_glb(tmp_path / "avatar.glb")
    node_of = {node.get("name"): index for index, node in enumerate(gltf["nodes"])}
    nodes = {part: node_of[bone] for part, bone in bone_of.items()}
    if version == 1:
        bones = {part: {"node": node} for part, node in nodes.items()}
        gltf["extensions"] = {"VRMC_vrm": {"humanoid": {"humanBones": bones}}}
    else:
        for side in ("left", "right"):  # Version 0 has no metacarpal in a thumb.
            nodes[f"{side}ThumbIntermediate"] = nodes.pop(f"{side}ThumbProximal")
            nodes[f"{side}ThumbProximal"] = nodes.pop(f"{side}ThumbMetacarpal")
        entries = [{"bone": part, "node": node} for part, node in nodes.items()]
        gltf["extensions"] = {"VRM": {"humanoid": {"humanBones": entries}}}
    write_glb(path, gltf, binary)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    source = rig_source(path)
    armature = load_rig(source, bpy.context.scene.collection)
    assert rig_bone_map(source, armature).parts == expected


def test_a_rig_in_centimetres_is_the_same_in_an_fbx_file_as_one_in_metres(tmp_path):
    """Under an object of scale 0.01, as Blender imports characters from Mixamo."""
    shapes = []
    for unit in (1.0, 0.01):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        make_rig(replace(KIND["Mixamo"], unit=unit, fingers=""))
        formats.write_blend(tmp_path / "rig.blend", bpy.context.scene)
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        out = tmp_path / "out.fbx"
        options = replace(NEW_SCENE, name="walk")
        export_on_rig([MOTION], BODY, [out], rig_source(tmp_path / "rig.blend"), options)
        models = fbx_models(out)
        scales = [np.ravel(values.get("Lcl Scaling", [1.0] * 3)) for values in models.values()]
        np.testing.assert_allclose(np.array(scales), 1.0, atol=1e-4)
        at = np.array(models["mixamorig:Hips"]["Lcl Translation"])
        assert 85 < np.linalg.norm(at) < 120  # Centimetres.
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        bpy.ops.import_scene.fbx(filepath=str(out), anim_offset=0.0)
        (skin,) = (each for each in bpy.context.scene.objects if each.type == "MESH")
        for frame in (0, 9):
            bpy.context.scene.frame_set(frame)
            posed = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
            mesh = posed.to_mesh()
            shapes.append(np.array([posed.matrix_world @ v.co for v in mesh.vertices]))
            posed.to_mesh_clear()
    np.testing.assert_allclose(shapes[2], shapes[0], atol=1e-4)
    np.testing.assert_allclose(shapes[3], shapes[1], atol=1e-4)
    assert np.abs(shapes[1] - shapes[0]).max() > 0.1


def test_a_file_in_centimetres_gives_a_person_of_the_right_size(tmp_path):
    """The unit of its scene says that a length of 1 is a centimetre; no object is scaled."""
    rig = make_rig(replace(KIND["Unity humanoid"], unit=0.01))
    for obj in (rig.armature, *rig.skins):
        if obj.parent is None:
            obj.scale = (1.0, 1.0, 1.0)
    bpy.context.scene.unit_settings.scale_length = 0.01
    formats.write_blend(tmp_path / "rig.blend", bpy.context.scene)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scenes = len(bpy.data.scenes)
    armature = load_rig(rig_source(tmp_path / "rig.blend"), bpy.context.scene.collection)
    heights = [(armature.matrix_world @ bone.head_local).z for bone in armature.data.bones]
    assert 1.4 < max(heights) < 1.8
    assert len(bpy.data.scenes) == scenes


def test_a_rig_that_lies_is_refused_in_one_sentence():
    rig = make_rig(KIND["Mixamo"]).armature
    rig.rotation_euler = (0.0, 0.0, 0.0)
    bpy.context.view_layer.update()
    with pytest.raises(InputError, match="do not stand upright at rest"):
        usable_guess(rig)
