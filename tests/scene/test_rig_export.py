# SPDX-License-Identifier: GPL-3.0-or-later
"""Retargeting from a rig file to exported files."""

import json
from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.cli import SAMPLE, main
from scope.scope_addon.errors import UsageError
from scope.scope_addon.retarget import bone_map
from scope.scope_addon.retarget.bone_map import BoneMap, save_bone_map
from scope.scope_addon.retarget.rig_source import rig_source
from scope.scope_addon.scene import actions
from scope.scope_addon.scene.build import NEW_SCENE
from scope.scope_addon.scene.export import formats
from scope.scope_addon.scene.export.export import ExportOptions
from scope.scope_addon.scene.rig_file import check_rig, export_on_rig, export_rig
from scope.scope_addon.scene.rig_retarget import guess_bone_map
from scope.solver.errors import InputError

from ..edit.walking import BODY, motion_of, walk
from ..retarget.naming_schemes import names_of
from .exported import glb_values, read_back, read_glb, write_glb
from .made_rigs import ARMS, build_rig, captured, direction_error, run, seen, truth

MOTION = motion_of(walk(0.5))
FRAMES = range(1, 16, 3)


def save_rig(path, scheme="mixamo", armatures=1, animated=False, hung=True):
    """Write a file of rigs, each with its mesh, and an unrelated object; the session is empty
    afterwards.

    :param hung: whether the mesh is a child of its armature.
    """
    for k in range(armatures):
        rig, bone_of = build_rig(scheme, seed=k)
        rig.name = f"Rig{k}"
        mesh = bpy.data.meshes.new("Skin")
        heads = [rig.data.bones[name].head_local for name in bone_of.values()]
        mesh.from_pydata(heads, [], [(i, i + 1, i + 2) for i in range(len(heads) - 2)])
        skin = bpy.data.objects.new("Skin", mesh)
        bpy.context.scene.collection.objects.link(skin)
        for i, name in enumerate(bone_of.values()):
            skin.vertex_groups.new(name=name).add([i], 1.0, "REPLACE")
        skin.parent = rig if hung else None
        skin.modifiers.new("Armature", "ARMATURE").object = rig
        rig.data.pose_position = "REST"  # as it may well have been saved
        if animated:
            rig.pose.bones[0].location = (0, 9, 0)
            rig.pose.bones[0].keyframe_insert("location", frame=3)
            track = rig.animation_data.nla_tracks.new()
            track.strips.new("old", 1, rig.animation_data.action)
            skin.shape_key_add(name="Basis")
            old = skin.shape_key_add(name="old")
            for frame, value in ((1, 0.0), (9, 1.0)):
                old.value = value
                old.keyframe_insert("value", frame=frame)
    stone = bpy.data.objects.new("Stone", bpy.data.meshes.new("Stone"))
    bpy.context.scene.collection.objects.link(stone)
    writers = {
        ".blend": lambda: formats.write_blend(path, bpy.context.scene),
        ".fbx": lambda: formats.write_fbx(path),
        ".glb": lambda: formats.write_glb(path),
    }
    with formats.quiet():
        writers[path.suffix]()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return path


def read(path):
    """Load a file into the active scene and return its armatures."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = 30
    with formats.quiet():
        if path.suffix == ".blend":
            with bpy.data.libraries.load(str(path)) as (there, here):
                here.objects = list(there.objects)
            for obj in here.objects:
                bpy.context.scene.collection.objects.link(obj)
        elif path.suffix == ".fbx":
            bpy.ops.import_scene.fbx(filepath=str(path), anim_offset=0.0)
        else:
            bpy.ops.import_scene.gltf(filepath=str(path))
    return [obj for obj in bpy.context.scene.objects if obj.type == "ARMATURE"]


OPTIONS = replace(NEW_SCENE, name="walk")


@pytest.mark.parametrize("kind", [".blend", ".fbx", ".glb"])
def test_a_rig_from_a_file_goes_into_every_format(tmp_path, kind):
    """One of a .blend file; another into its own format."""
    source = rig_source(save_rig(tmp_path / f"rig{kind}", animated=kind == ".blend"))
    suffixes = (".blend", ".fbx", ".glb", ".bvh", ".usdc") if kind == ".blend" else (kind,)
    targets = [tmp_path / f"out{suffix}" for suffix in suffixes]
    before = {
        k: len(getattr(bpy.data, k))
        for k in ("objects", "meshes", "armatures", "actions", "collections")
    }
    written, _ = export_on_rig([MOTION], BODY, targets, source, OPTIONS)
    assert written == targets
    assert {k: len(getattr(bpy.data, k)) for k in before} == before
    for path in targets[:3]:
        rigs = read(path)
        assert len(rigs) == 1
        skins = [
            o
            for o in bpy.context.scene.objects
            if o.type == "MESH" and o.find_armature() == rigs[0]
        ]
        assert len(skins) == 1
        assert "Stone" not in bpy.data.objects
        # in a file, row 1 of the motion is in frame 1
        joints = truth(MOTION)[1:]
        assert direction_error(rigs[0], names_of("mixamo"), ARMS, joints, FRAMES) < 1.0, path
        for keys in bpy.data.shape_keys:
            assert keys.key_blocks["old"].value == 0.0
            assert not any(actions.read_keys(curve)[:, 1].any() for curve in actions.fcurves(keys))


@pytest.mark.parametrize("suffix", [".glb", ".fbx", ".usdc"])
def test_a_rig_of_a_scene_in_centimetres_has_its_true_size(tmp_path, suffix):
    bpy.context.scene.unit_settings.scale_length = 0.01
    source = captured(MOTION)
    rig, bones = build_rig("unreal", size=130.0)
    stage = bpy.data.objects.new("Stage", None)
    bpy.context.scene.collection.objects.link(stage)
    rig.parent = stage
    stage.location = (50.0, 20.0, 0.0)
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.parent = stage  # so that the parent is not exported
    run(source, rig)
    wanted = seen(rig, bones.values(), [11])
    (path,) = export_rig(tmp_path / f"rig{suffix}", rig, ExportOptions())
    np.testing.assert_allclose(seen(rig, bones.values(), [11]), wanted, atol=1e-6)
    first = max(read_back(path), suffix == ".usdc")  # which keeps the scene's frames
    read = next(obj for obj in bpy.data.objects if obj.type == "ARMATURE")
    np.testing.assert_allclose(
        seen(read, bones.values(), [int(first) + 10]), wanted / 100, atol=1e-3
    )


@pytest.mark.parametrize("suffix", [".glb", ".fbx", ".usdc"])
def test_controls_that_deform_nothing_are_left_out_on_request(tmp_path, suffix):
    """Each bone that deforms follows a control by a constraint and lies below another one."""
    source = captured(MOTION)
    rig, bone_of = build_rig("unreal")
    limbs = [bone_of[part] for pair in ARMS for part in pair]
    bpy.ops.object.mode_set(mode="EDIT")
    for name in limbs:
        control = rig.data.edit_bones[name]
        deforming = rig.data.edit_bones.new(f"DEF_{name}")
        deforming.head = control.head
        deforming.tail = control.tail
        deforming.roll = control.roll
        if control.parent.name in limbs:
            deforming.parent = rig.data.edit_bones[f"DEF_{control.parent.name}"]
    bpy.ops.object.mode_set(mode="OBJECT")
    for bone in rig.data.bones:
        bone.use_deform = bone.name.startswith("DEF_")
    for name in limbs:
        constraint = rig.pose.bones[f"DEF_{name}"].constraints.new("COPY_TRANSFORMS")
        constraint.target = rig
        constraint.subtarget = name
    run(source, rig, guess_bone_map(rig))
    names = [f"DEF_{name}" for name in limbs]
    wanted = seen(rig, names, [11])
    for deform_bones in (False, True):
        path = tmp_path / f"rig{deform_bones}{suffix}"
        export_rig(path, rig, ExportOptions(deform_bones=deform_bones))
    for deform_bones in (False, True):
        first = read_back(tmp_path / f"rig{deform_bones}{suffix}")
        read = next(obj for obj in bpy.data.objects if obj.type == "ARMATURE")
        assert set(read.data.bones.keys()) >= set(names)
        assert (bone_of["pelvis"] in read.data.bones) != deform_bones
        frame = int(first) + (11 if suffix == ".usdc" else 10)  # which keeps the frames' numbers
        np.testing.assert_allclose(seen(read, names, [frame]), wanted, atol=1e-3)


@pytest.mark.parametrize("suffix", [".glb", ".fbx", ".usdc"])
def test_a_rig_of_controls_alone_is_not_written_without_them(tmp_path, suffix):
    """The file would hold no motion at all."""
    rig, _ = build_rig("unreal")
    for bone in rig.data.bones:
        bone.use_deform = False
    with pytest.raises(UsageError, match="no bone of 'unreal' deforms anything"):
        export_rig(tmp_path / f"rig{suffix}", rig, ExportOptions(deform_bones=True))
    assert list(tmp_path.iterdir()) == []
    export_rig(tmp_path / f"rig{suffix}", rig, ExportOptions())


def test_a_stretched_rig_has_its_joints_in_place_in_bvh(tmp_path):
    rig, bone_of = build_rig("unreal")
    rig.scale = (1.0, 1.3, 0.8)
    rng = np.random.default_rng(1)
    for frame in (1, 3):
        for bone in rig.pose.bones:
            bone.rotation_mode = "QUATERNION"
            bone.rotation_quaternion = (1.0, *rng.uniform(-0.4, 0.4, 3))
            bone.keyframe_insert("rotation_quaternion", frame=frame)
    wanted = seen(rig, bone_of.values(), [1, 2, 3])
    export_rig(tmp_path / "rig.bvh", rig, ExportOptions())
    read_back(tmp_path / "rig.bvh")
    (read,) = bpy.data.objects
    np.testing.assert_allclose(seen(read, bone_of.values(), [1, 2, 3]), wanted, atol=1e-3)


def test_a_pelvis_moves_under_a_bone_on_the_ground_in_bvh(tmp_path):
    rig, bone_of = build_rig("unreal")
    bpy.ops.object.mode_set(mode="EDIT")
    ground = rig.data.edit_bones.new("ground")
    ground.tail = (0.0, 0.1, 0.0)
    rig.data.edit_bones[bone_of["pelvis"]].parent = ground
    bpy.ops.object.mode_set(mode="OBJECT")
    for frame in (1, 3):
        for name in ("ground", bone_of["pelvis"]):
            bone = rig.pose.bones[name]
            bone.rotation_mode = "XYZ"
            bone.rotation_euler.z = bone.location.x = 0.3 * frame
            bone.keyframe_insert("location", frame=frame)
            bone.keyframe_insert("rotation_euler", frame=frame)
    wanted = seen(rig, bone_of.values(), [1, 2, 3])
    export_rig(tmp_path / "rig.bvh", rig, ExportOptions())
    assert (tmp_path / "rig.bvh").read_text().count("CHANNELS 6") == 2
    read_back(tmp_path / "rig.bvh")
    (read,) = bpy.data.objects
    np.testing.assert_allclose(seen(read, bone_of.values(), [1, 2, 3]), wanted, atol=1e-3)


def test_two_people_have_a_rig_each(tmp_path):
    source = rig_source(save_rig(tmp_path / "rig.glb"))
    other = walk(0.5)
    other.root[:, 0] += 2.0
    motions = [MOTION, motion_of(other)]
    export_on_rig(motions, BODY, [tmp_path / "out.glb"], source, OPTIONS)
    rigs = read(tmp_path / "out.glb")
    places = [seen(rig, [names_of("mixamo")["pelvis"]], [8])[0, 0, 0] for rig in rigs]
    assert len(rigs) == 2
    assert abs(places[0] - places[1]) > 1.5


def test_each_of_two_people_has_the_mesh_of_their_own_rig_in_a_file(tmp_path):
    """The mesh is not below its armature, only deformed by it."""
    path = save_rig(tmp_path / "rig.blend", hung=False)
    options = ExportOptions(separate=True)
    motions = [motion_of(walk(0.2))] * 2
    written, _ = export_on_rig(
        motions, BODY, [tmp_path / "out.glb"], rig_source(path), OPTIONS, export_options=options
    )
    assert len(written) == 2
    for each in written:
        (rig,) = read(each)
        assert [o for o in bpy.data.objects if o.type == "MESH" and o.find_armature()] == [
            o for o in bpy.data.objects if o.name.startswith("Skin")
        ]


def test_several_armatures_need_a_name(tmp_path):
    path = save_rig(tmp_path / "rig.blend", armatures=2)
    with pytest.raises(UsageError, match="'Rig0', 'Rig1'.*--rig-object"):
        check_rig(rig_source(path))
    with pytest.raises(UsageError, match="no armature 'Rig9'"):
        check_rig(rig_source(path, "Rig9"))
    check_rig(rig_source(path, "Rig1"))
    assert not bpy.data.armatures


def test_a_file_without_an_armature_is_refused(tmp_path):
    save_rig(tmp_path / "rig.blend", armatures=0)
    with pytest.raises(InputError, match="no armature"):
        check_rig(rig_source(tmp_path / "rig.blend"))


@pytest.mark.parametrize("instanced", [False, True])
def test_a_linked_rig_is_refused_with_the_file_that_it_is_linked_from(tmp_path, instanced):
    save_rig(tmp_path / "hero.blend")
    with bpy.data.libraries.load(str(tmp_path / "hero.blend"), link=True) as (there, here):
        here.objects = list(there.objects)
    collection = bpy.data.collections.new("Hero") if instanced else bpy.context.scene.collection
    for obj in here.objects:
        collection.objects.link(obj)
    if instanced:
        empty = bpy.data.objects.new("Hero", None)
        empty.instance_type = "COLLECTION"
        empty.instance_collection = collection
        bpy.context.scene.collection.objects.link(empty)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    for name in ("", "Rig0"):
        with pytest.raises(InputError, match=r"shot\.blend: 'Rig0' is linked from .*hero\.blend;"):
            check_rig(rig_source(tmp_path / "shot.blend", armature=name))


def test_a_file_with_thousands_of_bones_is_refused_before_they_are_probed(tmp_path, monkeypatch):
    """A .blend file says it only when it is read, unlike the formats that are imported."""
    save_rig(tmp_path / "rig.blend", armatures=1)
    monkeypatch.setattr(bone_map, "MOST_BONES", 5)
    with pytest.raises(InputError, match=r"rig\.blend has \d+ bones, with which .* may have 5: "):
        check_rig(rig_source(tmp_path / "rig.blend"))
    assert not bpy.data.armatures


def test_a_files_scripts_and_drivers_run_no_code(tmp_path, capfd):
    marks = [tmp_path / "driver ran", tmp_path / "script ran"]
    rig, _ = build_rig("mixamo")
    bpy.data.texts.new("script").write(f"open({str(marks[1])!r}, 'w')")
    rig["script"] = bpy.data.texts["script"]
    bpy.data.texts["script"].use_module = True
    driver = rig.pose.bones[0].driver_add("scale", 0).driver
    driver.expression = f"open({str(marks[0])!r}, 'w') and 1.0"
    formats.write_blend(tmp_path / "rig.blend", bpy.context.scene)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    check_rig(rig_source(tmp_path / "rig.blend"))
    assert not [mark for mark in marks if mark.exists()]
    assert "restricted access disallows name 'open'" in capfd.readouterr().err


def test_a_rig_with_blocked_bones_is_refused_before_the_capture(tmp_path):
    rig, bone_of = build_rig("mixamo")
    limit = rig.pose.bones[bone_of["left_knee"]].constraints.new("LIMIT_ROTATION")
    limit.owner_space = "LOCAL"
    limit.use_limit_x = limit.use_limit_y = limit.use_limit_z = True
    formats.write_blend(tmp_path / "rig.blend", bpy.context.scene)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with pytest.raises(InputError, match="'mixamorig:LeftLeg' of 'mixamo' does not move"):
        check_rig(rig_source(tmp_path / "rig.blend"))


def test_a_map_of_another_rig_is_refused(tmp_path):
    path = save_rig(tmp_path / "rig.glb")
    save_bone_map(
        BoneMap({bone: part for part, bone in names_of("unreal").items()}), tmp_path / "map.json"
    )
    with pytest.raises(InputError, match="'pelvis' is not a bone of 'Rig0'"):
        check_rig(rig_source(path, bone_map=tmp_path / "map.json"))


def test_bones_that_are_nowhere_are_refused(tmp_path):
    """The inverse bind matrices, 24 of them, are the only matrices in the file."""
    path = save_rig(tmp_path / "rig.glb")
    gltf, binary = read_glb(path)
    (matrices,) = (k for k, each in enumerate(gltf["accessors"]) if each["type"] == "MAT4")
    glb_values(gltf, binary, matrices)[:] = np.nan
    write_glb(path, gltf, binary)
    with pytest.raises(
        InputError,
        match=r"rig\.glb: .*(bones of 'Rig0' have positions that are not "
        r"numbers|cannot import)",
    ):
        check_rig(rig_source(path))
    assert not bpy.data.armatures


@pytest.mark.parametrize(
    ("suffix", "damage"),
    [
        *((".glb", "missing"), (".fbx", "empty"), (".gltf", "text"), (".obj", "text")),
        *((".blend", "half"), (".fbx", "half"), (".glb", "half"), (".blend", "head")),
    ],
)
def test_damaged_files_are_refused_in_one_sentence(tmp_path, suffix, damage):
    path = tmp_path / f"rig{suffix}"
    if damage in ("half", "head"):
        whole = save_rig(path).read_bytes()
        path.write_bytes(whole[: len(whole) // 2] if damage == "half" else whole[:40])
    elif damage != "missing":
        path.write_bytes({"empty": b"", "text": b"{this is no rig\n" * 50}[damage])
    with pytest.raises((InputError, UsageError), match=f"rig{suffix}") as caught:
        check_rig(rig_source(path))
    assert "\n" not in str(caught.value)
    assert not bpy.data.armatures


def test_an_importer_that_fails_prints_no_traceback(tmp_path, capfd):
    """The file is whole, but one model's name lacks its class, at which Blender's importer
    raises.
    """
    path = save_rig(tmp_path / "rig.fbx")
    path.write_bytes(path.read_bytes().replace(b"\0\x01Model", b"..Model"))
    with pytest.raises(InputError, match=r"rig\.fbx: Blender cannot import this file"):
        check_rig(rig_source(path))
    said = capfd.readouterr()
    assert (said.out, said.err) == ("", "")


@pytest.fixture
def command(capfd):
    """``command(*arguments)``: the exit status of a command line, its output and its messages."""

    def run(*arguments):
        status = main([str(each) for each in arguments])
        out, err = capfd.readouterr()
        return status, out, err

    return run


def test_the_command_line_retargets_a_capture(command, tmp_path):
    rig = save_rig(tmp_path / "rig.glb", "nameless")
    argv = ["capture", SAMPLE, "--quality", "fast", "--end", "0.1", "--json", "--retarget", rig]
    argv += ["--retarget-root", "object", "--threads", "1"]
    status, out, err = command(*argv, "-o", tmp_path / "out.glb", "-o", tmp_path / "out.npz")
    assert status == 0, err
    report = json.loads(out)
    assert report["outputs"] == [str(tmp_path / "out.npz"), str(tmp_path / "out.glb")]
    (guessed,) = (each for each in report["notices"] if each["code"] == "guessed_bones")
    assert set(guessed["values"]["bones"]) == set(names_of("nameless").values())
    assert sum("guessed from its rest pose" in warning for warning in report["warnings"]) == 1
    assert err.count("guessed from its rest pose") == 1
    rigs = read(tmp_path / "out.glb")
    assert [rig.name for rig in rigs] == ["Rig0"]
    assert set(names_of("nameless").values()) <= set(rigs[0].data.bones.keys())


def test_the_command_line_checks_the_rig_before_the_capture(command, tmp_path):
    out = tmp_path / "out.glb"
    status, _, err = command("capture", SAMPLE, "--retarget-root", "object", "-o", out)
    assert status == 2
    assert "--retarget-root applies to a rig" in err
    rig = save_rig(tmp_path / "rig.blend", armatures=2)
    status, _, err = command("capture", SAMPLE, "--retarget", rig, "-o", out)
    assert status == 2
    # Blender 5.2 has its own lines
    assert sum(line.startswith("scope:") for line in err.splitlines()) == 1
    assert "Traceback" not in err
    assert "--rig-object" in err
    before = rig.read_bytes()
    named = ["capture", SAMPLE, "--retarget", rig, "--rig-object", "Rig1", "-o"]
    status, _, err = command(*named, rig)
    assert status == 2
    assert "is the input itself" in err
    assert command(*named, tmp_path / "out.npz")[0] == 2
    assert rig.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rig.blend"]


def test_several_rigs_have_an_output_each(command, tmp_path):
    MOTION.save(tmp_path / "walk.npz")
    given = []
    for skeleton in ("mixamo", "nameless"):
        rig = save_rig(tmp_path / f"{skeleton}_rig.glb", skeleton)
        given += ["--retarget", rig, "-o", tmp_path / f"{skeleton}.glb"]
    walked = ["import", tmp_path / "walk.npz", "--json"]
    status, out, err = command(*walked, *given, "-o", tmp_path / "out.npz")
    assert status == 0, err
    written = [str(tmp_path / name) for name in ("out.npz", "mixamo.glb", "nameless.glb")]
    assert json.loads(out)["outputs"] == written
    for skeleton in ("mixamo", "nameless"):
        (rig,) = read(tmp_path / f"{skeleton}.glb")
        assert set(names_of(skeleton).values()) <= set(rig.data.bones.keys())


def test_a_batch_takes_one_good_rig(command, tmp_path):
    (tmp_path / "clips").mkdir()
    out = tmp_path / "out"
    batch = ["batch", tmp_path / "clips", "--out", out, "--retarget"]
    status, _, err = command(*batch, "a.glb", "--retarget", "b.glb", "--formats", "glb,fbx")
    assert status == 2
    assert "a batch takes one rig" in err
    status, _, err = command(*batch, tmp_path / "rig.fbx")
    assert status == 1
    assert sum(line.startswith("scope:") for line in err.splitlines()) == 1
    assert "rig.fbx" in err
    assert not out.exists()
