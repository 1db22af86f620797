# SPDX-License-Identifier: GPL-3.0-or-later
"""The retarget operators as a user runs them."""

import bpy
import numpy as np
import pytest
from scope.scope_addon.retarget import bone_map
from scope.scope_addon.retarget.bone_map import PARTS
from scope.scope_addon.scene.actions import fcurves
from scope.scope_addon.scene.character.root_object import root_object
from scope.scope_addon.scene.packed_motion import pack_motion
from scope.scope_addon.scene.visibility import hide_again, show
from scope.scope_addon.ui.captured_person import captured_armature, retargeted_from, stored_person
from scope.scope_addon.ui.retarget_panel import offered_parts

from ...edit.walking import RATE, motion_of, walk
from ...scene.exported import read_back
from ...scene.made_rigs import build_rig, captured, seen


def person():
    """The captured armature of the scene."""
    return next(obj for obj in bpy.context.scene.objects if "scope_source" in obj)


@pytest.fixture
def rig():
    captured(motion_of(walk(2.0)))
    rig, _ = build_rig("unreal")
    bpy.context.scene.scope_retarget.rig = rig
    return rig


def test_guess_keep_and_retarget(rig, tmp_path):
    settings = bpy.context.scene.scope_retarget
    bpy.ops.scope.guess_bones()
    count = len(settings.pairs)
    assert count == 22
    bpy.ops.scope.save_bone_map(filepath=str(tmp_path / "bones.json"))
    settings.active = count - 1
    bpy.ops.scope.edit_bone_pair(action="REMOVE")
    assert len(settings.pairs) == count - 1
    bpy.ops.scope.load_bone_map(filepath=str(tmp_path / "bones.json"))
    assert len(settings.pairs) == count
    bpy.ops.scope.retarget()
    assert np.ptp(seen(rig, ["pelvis"])[:, 0, 1]) > 1.0  # it walks


@pytest.mark.parametrize("root", ["bone", "in-place"])
def test_the_scale_of_the_path_is_reported_where_there_is_a_path(rig, capfd, root):
    bpy.context.scene.scope_retarget.root = root
    bpy.ops.scope.retarget()
    said = capfd.readouterr().out
    assert f"'{rig.name}' is now animated by the action '{rig.animation_data.action.name}'" in said
    # the size of this rig
    assert ("positions on the floor scaled by 1.3" in said) is (root != "in-place")


def test_all_warnings_are_reported_after_the_result(rig, capfd):
    bpy.ops.scope.guess_bones()
    pairs = bpy.context.scene.scope_retarget.pairs
    pairs.remove([pair.part for pair in pairs].index("head"))
    limit = rig.pose.bones["calf_l"].constraints.new("LIMIT_ROTATION")
    limit.use_limit_x = limit.use_limit_y = limit.use_limit_z = True
    limit.owner_space = "LOCAL"
    limit.influence = 0.5
    bpy.ops.scope.retarget()
    said = capfd.readouterr().out
    order = [said.find(text) for text in ("scaled by", "no bones for 'head'", "'calf_l'")]
    assert -1 < order[0] < order[1] < order[2]


def test_saving_a_bone_map_overwrites_bone_maps_only(rig, tmp_path):
    bpy.ops.scope.guess_bones()
    other = tmp_path / "package.json"
    other.write_text(before := '{"name": "a game", "bones": {}}')
    with pytest.raises(RuntimeError, match="is not a bone map, so it is not overwritten"):
        bpy.ops.scope.save_bone_map(filepath=str(other))
    assert other.read_text("utf-8") == before
    for _ in range(2):
        bpy.ops.scope.save_bone_map(filepath=str(tmp_path / "bones"))  # the suffix is added
    assert (tmp_path / "bones.json").is_file()
    assert bpy.ops.scope.save_bone_map.get_rna_type().properties["check_existing"].default is True
    for path, message in (
        (f"{tmp_path}/", "no name"),
        ("/nowhere/a.json", "Cannot write /nowhere"),
    ):
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.scope.save_bone_map(filepath=path)


def test_choosing_another_rig_replaces_the_bone_list(rig):
    settings = bpy.context.scene.scope_retarget
    bpy.ops.scope.guess_bones()
    settings.pairs[0].part = ""  # edited by hand
    other, _ = build_rig("mixamo")
    settings.rig = other
    assert len(settings.pairs) > 15
    assert all(pair.bone in other.data.bones for pair in settings.pairs)
    bpy.ops.scope.retarget()
    assert other.animation_data.action is not None


def test_the_bone_list_of_the_same_rig_or_a_copy_is_kept(rig):
    settings = bpy.context.scene.scope_retarget
    bpy.ops.scope.guess_bones()
    settings.pairs[0].part = "head"  # edited by hand
    copy = rig.copy()
    bpy.context.scene.collection.objects.link(copy)
    for chosen in (None, rig, copy):
        settings.rig = chosen
        assert settings.pairs[0].part == "head"


def test_the_bones_of_a_rig_that_a_script_has_just_made_are_listed(rig):
    """It has no pose before Blender evaluates the scene."""
    settings = bpy.context.scene.scope_retarget
    bpy.ops.scope.guess_bones()
    count = len(settings.pairs)
    data = rig.data.copy()
    for bone in data.bones:
        bone.name = f"copy:{bone.name}"
    made = bpy.data.objects.new("made", data)
    assert made.pose is None
    settings.rig = made
    assert len(settings.pairs) == count > 20
    assert all(pair.bone in data.bones for pair in settings.pairs)


def test_a_rig_without_bones_empties_the_bone_list(rig):
    settings = bpy.context.scene.scope_retarget
    bpy.ops.scope.guess_bones()
    settings.rig = bpy.data.objects.new("empty", bpy.data.armatures.new("empty"))
    assert len(settings.pairs) == 0


def test_the_captured_body_is_hidden_side_by_side_or_overlapping(rig):
    settings = bpy.context.scene.scope_retarget
    source = person()
    body = next(obj for obj in source.children if obj.type == "MESH")
    bpy.ops.scope.retarget()
    assert all(obj.hide_get() and obj.hide_render for obj in (source, body))
    assert not rig.hide_get()
    assert bpy.context.view_layer.objects.active == rig
    assert captured_armature(bpy.context) == source  # so that it can be refined
    there = seen(rig, ["pelvis"])
    settings.captured = "beside"
    bpy.ops.scope.retarget()
    assert not any(obj.hide_get() or obj.hide_render for obj in (source, body))
    np.testing.assert_allclose(
        seen(rig, ["pelvis"]) - there, np.broadcast_to([1.5, 0, 0], there.shape), atol=1e-4
    )
    body.hide_render = True  # a manual setting
    settings.captured = "keep"
    bpy.ops.scope.retarget()
    np.testing.assert_allclose(seen(rig, ["pelvis"]), there, atol=1e-4)
    assert body.hide_render


def test_side_by_side_is_as_far_for_a_person_of_a_scene_in_centimetres(rig):
    scene = bpy.context.scene
    source = person()
    scene.unit_settings.scale_length = 0.01
    source.scale = rig.scale = (100.0,) * 3
    bpy.ops.scope.retarget()
    there = seen(rig, ["pelvis"])
    scene.scope_retarget.captured = "beside"
    bpy.ops.scope.retarget()
    expected = np.broadcast_to([150.0, 0, 0], there.shape)
    np.testing.assert_allclose(seen(rig, ["pelvis"]) - there, expected, atol=1e-2)


def test_the_captured_persons_collection_may_be_excluded_from_the_view_layer(rig):
    source = person()
    layers = bpy.context.view_layer.layer_collection.children
    next(c for c in layers if c.collection in source.users_collection).exclude = True
    bpy.context.scene.scope.capture = source.users_collection[0]
    assert bpy.ops.scope.retarget() == {"FINISHED"}
    assert np.ptp(seen(rig, ["pelvis"])[:, 0, 1]) > 1.0


def test_what_the_user_has_parented_to_the_captured_armature_is_not_hidden_with_it(rig):
    source = person()
    sword = bpy.data.objects.new("sword", bpy.data.meshes.new("sword"))
    bpy.context.scene.collection.objects.link(sword)
    sword.parent = source
    bpy.ops.scope.retarget()
    body = next(obj for obj in source.children if obj != sword)
    assert body.hide_render
    assert body.hide_get()
    assert not sword.hide_render
    assert not sword.hide_get()


def test_a_hidden_body_is_shown_temporarily_for_comparison(rig):
    layer = bpy.context.view_layer
    source = person()
    bpy.ops.scope.retarget()
    show(source, layer, temporarily=True)
    assert not source.hide_get()
    hide_again(source, layer)
    assert source.hide_get()
    show(source, layer)
    hide_again(source, layer)
    assert not source.hide_get()


def test_retargeting_again_after_an_edit_updates_the_rig(rig):
    source = person()
    pack_motion(source, motion_of(walk(2.0), noise=0.1).to_bytes())
    bpy.ops.scope.retarget()
    before = seen(rig, ["upperarm_l", "hand_l"])
    count = len(bpy.data.actions)
    name = rig.animation_data.action.name
    bpy.ops.scope.smooth(strength=0.0)
    bpy.ops.scope.retarget()
    assert np.abs(seen(rig, ["upperarm_l", "hand_l"]) - before).max() > 0.02
    bpy.ops.scope.smooth(strength=1.0)
    bpy.ops.scope.retarget()
    assert (len(bpy.data.actions), rig.animation_data.action.name) == (count, name)
    bpy.context.scene.scope_retarget.root = "object"
    bpy.ops.scope.retarget()
    assert root_object(rig) is not None
    assert np.ptp(seen(rig, ["pelvis"])[:, 0, 1]) > 1.0


def test_a_renamed_take_still_replaces_its_action(rig):
    bpy.ops.scope.retarget()
    before = len(bpy.data.actions)
    bpy.context.scene.scope.capture = next(c for c in bpy.data.collections if "scope_capture" in c)
    bpy.ops.scope.rename_take(name="Scene 3")
    bpy.ops.scope.retarget()
    assert rig.animation_data.action.name == "unreal_Scene 3"
    assert len(bpy.data.actions) == before


def test_with_several_people_the_panels_ask_for_a_selection(rig):
    people = [person(), captured(motion_of(walk(2.0)))]
    panels = (bpy.types.SCOPE_PT_retarget, bpy.types.SCOPE_PT_edit)
    layer = bpy.context.view_layer
    layer.objects.active = rig
    assert all(panel.poll(bpy.context) for panel in panels)
    with pytest.raises(RuntimeError, match="Several people are captured: select the armature"):
        bpy.ops.scope.retarget()
    layer.objects.active = people[1]
    bpy.ops.scope.retarget()
    assert people[1].hide_get()
    assert not people[0].hide_get()
    for each in people:
        assert all(panel.poll(bpy.context) for panel in panels)
        bpy.data.objects.remove(each)
    assert not any(panel.poll(bpy.context) for panel in panels)


def test_body_parts_are_suggested_while_typing():
    assert offered_parts(None, bpy.context, "LEFT_h") == ["left_hip"]
    assert offered_parts(None, bpy.context, "") == list(PARTS)


def test_a_bone_map_without_legs_is_an_error(rig):
    bpy.ops.scope.guess_bones()
    for pair in bpy.context.scene.scope_retarget.pairs:
        if pair.part == "left_knee":
            pair.bone = ""
    with pytest.raises(RuntimeError, match="left_knee"):
        bpy.ops.scope.retarget()
    assert rig.animation_data is None or rig.animation_data.action is None


@pytest.mark.parametrize(("operator", "listed"), [("guess_bones", False), ("retarget", True)])
def test_a_rig_of_thousands_of_bones_is_refused(rig, monkeypatch, operator, listed):
    """Whether the map is listed or guessed, and before anything is posed."""
    if listed:
        bpy.ops.scope.guess_bones()
    monkeypatch.setattr(bone_map, "MOST_BONES", 5)
    with pytest.raises(RuntimeError, match=r"'unreal' has \d+ bones, .* may have 5: choose"):
        getattr(bpy.ops.scope, operator)()
    assert rig.animation_data is None or rig.animation_data.action is None


def test_what_fails_leaves_the_bone_list_empty(rig):
    settings = bpy.context.scene.scope_retarget
    settings.pairs.clear()
    del captured_armature(bpy.context)["scope_betas"]
    with pytest.raises(RuntimeError, match="no stored body shape"):
        bpy.ops.scope.retarget()
    assert len(settings.pairs) == 0


def test_the_rig_is_exported_with_its_animation_and_only_its_mesh(rig, tmp_path):
    """Neither the captured body nor siblings of the rig are exported, and the scene stays."""
    scene = bpy.context.scene
    layer = bpy.context.view_layer
    active = layer.objects.active
    bpy.ops.mesh.primitive_plane_add(location=(1.0, 2.0, 0.5))
    stage = bpy.context.object
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.parent = rig.parent = stage
    bpy.ops.mesh.primitive_cube_add()
    skin = bpy.context.object
    skin.name = "skin"
    skin.modifiers.new("rig", "ARMATURE").object = rig
    skin.vertex_groups.new(name="pelvis").add(range(8), 1.0, "REPLACE")
    layer.objects.active = active
    bpy.ops.scope.retarget()
    wanted = seen(rig, ["pelvis", "hand_l"], [10, 40])
    before = sorted(bpy.data.collections.keys()), sorted(bpy.data.objects.keys())
    path = str(tmp_path / "rig.fbx")
    bpy.ops.scope.export(filepath=path, format="FBX", which="RIG")
    assert (sorted(bpy.data.collections.keys()), sorted(bpy.data.objects.keys())) == before
    assert rig.parent == stage
    rate = scene.render.fps
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = rate
    bpy.ops.import_scene.fbx(filepath=path, anim_offset=0.0)
    assert [obj.name for obj in bpy.data.objects if obj.type == "MESH"] == ["skin"]
    (exported,) = (obj for obj in bpy.data.objects if obj.type == "ARMATURE")
    # the file starts at 0 s
    np.testing.assert_allclose(seen(exported, ["pelvis", "hand_l"], [9, 39]), wanted, atol=1e-3)


def test_the_shape_keys_of_the_rigs_own_face_move_in_usd(rig, tmp_path):
    mesh = bpy.data.meshes.new("head")
    mesh.from_pydata([(0, 0, 1.6), (0.1, 0, 1.6), (0, 0, 1.7)], [], [(0, 1, 2)])
    face = bpy.data.objects.new("head", mesh)
    bpy.context.scene.collection.objects.link(face)
    face.modifiers.new("rig", "ARMATURE").object = face.parent = rig
    face.vertex_groups.new(name="head").add([0, 1, 2], 1.0, "REPLACE")
    face.shape_key_add(name="Basis", from_mix=False)
    face.shape_key_add(name="Fcl_MTH_A", from_mix=False).data[0].co.y = 0.05
    bpy.ops.scope.retarget()
    for frame, value in ((1, 0.0), (41, 0.8)):
        mesh.shape_keys.key_blocks["Fcl_MTH_A"].value = value
        mesh.shape_keys.keyframe_insert('key_blocks["Fcl_MTH_A"].value', frame=frame)
    path = tmp_path / "hero.usdc"
    assert bpy.ops.scope.export(filepath=str(path), format="USDC", which="RIG") == {"FINISHED"}
    read_back(path, RATE)
    (read,) = (obj for obj in bpy.data.objects if obj.type == "MESH")
    for frame, value in ((1, 0.0), (41, 0.8)):
        bpy.context.scene.frame_set(frame)
        assert read.data.shape_keys.key_blocks["Fcl_MTH_A"].value == pytest.approx(value, abs=1e-4)


def test_the_rig_is_exported_also_when_the_person_was_deleted(rig, tmp_path):
    bpy.ops.scope.retarget()
    bpy.data.objects.remove(rig["scope_person"])
    path = tmp_path / "hero.bvh"
    assert bpy.ops.scope.export(filepath=str(path), format="BVH", which="RIG") == {"FINISHED"}
    assert path.is_file()


def test_a_rig_whose_capture_was_changed_since_is_said_to_be_outdated(rig, tmp_path, capfd):
    """Until it is retargeted again. Another frame rate moves the keys of both alike."""
    source = person()

    def exported():
        capfd.readouterr()
        bpy.ops.scope.export(filepath=str(tmp_path / "hero.bvh"), format="BVH", which="RIG")
        return f"'{rig.name}' has the motion that '{source.name}' had before" in (
            capfd.readouterr().out
        )

    bpy.ops.scope.retarget()
    assert not exported()
    bpy.context.scene.scope.result.footage_rate = 24.0
    assert bpy.ops.scope.match_frame_rate() == {"FINISHED"}
    assert not exported()
    (curve, *_) = fcurves(source)
    curve.keyframe_points[7].co.y += 0.1
    assert exported()
    bpy.ops.scope.retarget()
    assert not exported()


def test_a_root_object_outdates_no_rig_unless_it_keeps_the_person_in_place(rig, tmp_path, capfd):
    bpy.ops.scope.retarget()
    bpy.context.view_layer.objects.active = person()
    for mode, outdated in (("OBJECT", False), ("BONES", False), ("IN_PLACE", True)):
        assert bpy.ops.scope.root_motion(mode=mode) == {"FINISHED"}
        capfd.readouterr()
        bpy.ops.scope.export(filepath=str(tmp_path / "hero.bvh"), format="BVH", which="RIG")
        assert ("before it was changed" in capfd.readouterr().out) is outdated, mode


def test_the_motion_of_a_former_capture_is_not_called_outdated(rig, tmp_path, capfd):
    bpy.ops.scope.retarget()
    former = rig.animation_data.action
    bpy.context.view_layer.objects.active = captured(motion_of(walk(1.0)))
    bpy.ops.scope.retarget()
    assert rig.animation_data.action != former
    rig.animation_data.action = former
    capfd.readouterr()
    bpy.ops.scope.export(filepath=str(tmp_path / "hero.bvh"), format="BVH", which="RIG")
    assert "before it was changed" not in capfd.readouterr().out


def test_exporting_without_a_rig_is_an_error_that_says_what_to_do(rig, tmp_path):
    bpy.context.scene.scope_retarget.rig = None
    with pytest.raises(RuntimeError, match="choose a rig there"):
        bpy.ops.scope.export(filepath=str(tmp_path / "hero.fbx"), format="FBX", which="RIG")


def _linked_character(folder, person=""):
    """A rig in a collection that is linked from another file.

    :param person: name of the captured armature that it was retargeted from there, if any.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig, _ = build_rig("unreal")
    if person:
        source = captured(motion_of(walk(1.0)))
        source.name = person
        bpy.context.scene.scope_retarget.rig = rig
        bpy.ops.scope.retarget()
    character = bpy.data.collections.new("Character")
    character.objects.link(rig)
    bpy.data.libraries.write(str(folder / "hero.blend"), {character})
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    captured(motion_of(walk(2.0)))
    with bpy.data.libraries.load(str(folder / "hero.blend"), link=True) as (_, here):
        here.collections = ["Character"]
    bpy.context.scene.collection.children.link(here.collections[0])
    bpy.context.view_layer.update()
    return here.collections[0]


def test_retargeting_to_a_linked_rig_is_an_error_that_says_what_to_do(tmp_path):
    bpy.context.scene.scope_retarget.rig = _linked_character(tmp_path).objects["unreal"]
    with pytest.raises(RuntimeError, match=r"linked from .*hero\.blend.*make an override"):
        bpy.ops.scope.retarget()


def test_a_library_override_is_animated_and_saved(tmp_path):
    _linked_character(tmp_path).override_hierarchy_create(bpy.context.scene, bpy.context.view_layer)
    settings = bpy.context.scene.scope_retarget
    settings.rig = next(obj for obj in bpy.context.scene.objects if obj.override_library)
    settings.root = "object"
    bpy.ops.scope.retarget()
    moving = seen(settings.rig, ["pelvis", "hand_l"])
    assert np.ptp(moving[:, 0, 1]) > 1.0
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    rig = bpy.context.scene.scope_retarget.rig
    np.testing.assert_allclose(seen(rig, ["pelvis", "hand_l"]), moving, atol=1e-4)
    assert retargeted_from(bpy.context.scene, rig) == bpy.data.objects["walk"]


def test_an_override_of_a_retargeted_rig_has_the_person_of_its_own_action(tmp_path):
    character = _linked_character(tmp_path, "walk")
    scene = bpy.context.scene
    character.override_hierarchy_create(scene, bpy.context.view_layer)
    rig = next(obj for obj in scene.objects if obj.override_library)
    assert retargeted_from(scene, rig) is None  # the library's person is not in the scene
    assert stored_person(rig).library is not None
    scene.scope_retarget.rig = rig
    bpy.ops.scope.retarget()
    walk_here = bpy.data.objects["walk", None]
    assert retargeted_from(scene, rig) == walk_here
    walk_here.name = "renamed"
    assert retargeted_from(scene, rig) == walk_here
    walk_here.name = "walk"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    rig = bpy.context.scene.scope_retarget.rig
    walk_here = bpy.data.objects["walk", None]
    assert retargeted_from(bpy.context.scene, rig) == walk_here
    bpy.data.objects.remove(walk_here)
    assert retargeted_from(bpy.context.scene, rig) is None


def test_a_rig_outside_the_view_layer_is_an_error(rig):
    aside = bpy.data.collections.new("Aside")
    bpy.context.scene.collection.children.link(aside)
    aside.objects.link(rig)
    bpy.context.scene.collection.objects.unlink(rig)
    bpy.context.view_layer.layer_collection.children["Aside"].exclude = True
    with pytest.raises(RuntimeError, match="'unreal' is not in the scene's view layer"):
        bpy.ops.scope.retarget()
