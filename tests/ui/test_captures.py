# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of captures: one result each, which survives whatever is done to the collection and its
armatures.
"""

from functools import partial
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.datablocks import captures_of
from scope.scope_addon.ui.captured_person import PERSON, captured_armature
from scope.scope_addon.ui.captures import (
    elided,
    hide_others,
    people_of,
    shown_capture,
    unit_text,
)
from scope.scope_addon.ui.comparison import camera_of

from ..edit.walking import BODY, motion_of, walk


def capture(fake_worker, footage, people=1, warnings=("a warning",)):
    fake_worker(f"finish(people={people}, warnings={list(warnings)})")
    bpy.context.scene.scope.footage = str(footage)
    assert bpy.ops.scope.capture() == {"FINISHED"}
    return shown_capture(bpy.context.scene)


@pytest.fixture(scope="module")
def file_of_two(tmp_path_factory):
    """Where the first test that asks for `two` saves them."""
    return tmp_path_factory.mktemp("captures") / "two.blend"


@pytest.fixture
def two(fake_worker, footage, file_of_two):
    """A file with two captures, of one person and of two; return their names."""
    if not file_of_two.exists():
        capture(fake_worker, footage, 1, ["first"])
        other = footage.with_name("other.png")
        footage.rename(other)
        capture(fake_worker, other, 2, ["second"])
        bpy.ops.wm.save_as_mainfile(filepath=str(file_of_two))
    bpy.ops.wm.open_mainfile(filepath=str(file_of_two))
    return "person", "other"


def shown() -> tuple[str, int, str]:
    result = bpy.context.scene.scope.result
    return result.collection.name, result.people, result.warnings[0].text


def select(name: str) -> None:
    settings = bpy.context.scene.scope
    settings.capture_index = bpy.data.collections.find(name)


def listed() -> list[str]:
    """Names of the captures that the list would draw."""
    fake = type("List", (), {"filter_name": "", "bitflag_filter_item": 1})()
    flags, _ = bpy.types.SCOPE_UL_captures.filter_items(fake, bpy.context, bpy.data, "collections")
    return [each.name for each, flag in zip(bpy.data.collections, flags, strict=True) if flag]


def test_a_capture_that_is_shown_again_has_the_pose_of_the_current_frame():
    """Blender alone shows the pose from before it was hidden, over the footage of another frame."""
    scene = bpy.context.scene
    motion = motion_of(walk(1.5))
    first, second = (build_scene([motion], BODY, None, BuildOptions(name=n)) for n in "ab")
    armature = first.people[0].armature

    def ankle():
        seen = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return np.array(seen.matrix_world @ seen.pose.bones["left_ankle"].head)

    scene.frame_set(1)
    before = ankle()
    hide_others(scene, [second.collection])
    scene.frame_set(40)
    select("a")
    shown_again = ankle()
    scene.frame_set(40)
    assert np.linalg.norm(ankle() - before) > 0.1
    np.testing.assert_allclose(shown_again, ankle(), atol=1e-6)


def test_each_capture_keeps_its_result(two):
    assert shown() == ("other", 2, "Second")
    select("person")
    assert shown() == ("person", 1, "First")
    assert bpy.context.scene.scope.result.footage.endswith("person.png")
    assert listed() == ["other", "person"]


def test_what_is_edited_is_what_is_selected_in_the_list(two):
    second = people_of(bpy.data.collections["other"])
    bpy.context.view_layer.objects.active = second[1]
    select("person")
    assert captured_armature(bpy.context).name == "person"
    assert [obj.name for obj in bpy.context.selected_objects] == ["person"]
    select("other")
    assert captured_armature(bpy.context) == second[0]


def test_a_rig_with_the_motion_of_the_selected_capture_stays_active(two):
    rig = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    bpy.context.scene.collection.objects.link(rig)
    rig[PERSON] = bpy.data.objects["person"]
    bpy.context.view_layer.objects.active = rig
    select("person")
    assert bpy.context.view_layer.objects.active == rig


def test_comparison_and_active_person_follow_the_selection(two):
    bpy.context.view_layer.objects.active = None
    select("person")
    assert captured_armature(bpy.context).name == "person"
    bpy.ops.scope.look_through()
    assert bpy.context.scene.camera.name == "person_camera"
    select("other")
    bpy.ops.scope.look_through()
    assert bpy.context.scene.camera.name == "other_camera"


def test_undoing_a_capture_shows_the_previous_result(one, fake_worker, footage):
    bpy.ops.ed.undo_push(message="first")
    other = footage.with_name("other.png")
    footage.rename(other)
    capture(fake_worker, other, 2, ["second"])
    bpy.ops.ed.undo_push(message="second")
    bpy.ops.ed.undo()
    assert shown() == ("person", 1, "A warning")
    assert listed() == ["person"]
    bpy.ops.ed.redo()
    assert shown() == ("other", 2, "Second")
    assert listed() == ["other", "person"]
    assert bpy.ops.scope.smooth(strength=2.5) == {"FINISHED"}  # the motion is redone, too


@pytest.mark.parametrize(("which", "files"), [("SHOWN", 1), ("ALL", 3), ("ACTIVE", 2)])
def test_what_is_chosen_is_exported_and_not_remembered(two, tmp_path, which, files):
    select("person")
    bpy.context.view_layer.objects.active = people_of(bpy.data.collections["other"])[0]
    export = partial(bpy.ops.scope.export, "INVOKE_DEFAULT", format="BVH")
    export(filepath=str(tmp_path / "a.bvh"), which=which)
    assert len(list(tmp_path.glob("a*.bvh"))) == files
    assert bpy.ops.scope.export.get_rna_type().properties["which"].is_skip_save
    export(filepath=str(tmp_path / "b.bvh"))
    assert len(list(tmp_path.glob("b*.bvh"))) == 1
    bpy.context.view_layer.objects.active = None
    with pytest.raises(RuntimeError, match="belongs to no capture"):
        bpy.ops.scope.export(filepath=str(tmp_path / "c.bvh"), format="BVH", which="ACTIVE")


def test_renaming_breaks_nothing(two):
    select("person")
    collection = bpy.data.collections["person"]
    # the collections are sorted by name
    collection.name = "zzz"
    bpy.data.objects["person"].name = "hero"
    bpy.data.collections["other"].name = "person"
    assert shown() == ("zzz", 1, "First")
    assert [obj.name for obj in people_of(collection)] == ["hero"]
    assert bpy.ops.scope.smooth(strength=2.0) == {"FINISHED"}


def test_duplicating_an_armature_breaks_nothing(two):
    select("person")
    copy = bpy.data.objects["person"].copy()
    bpy.data.collections["person"].objects.link(copy)
    assert shown() == ("person", 1, "First")
    bpy.context.view_layer.objects.active = copy
    assert captured_armature(bpy.context) == copy
    assert bpy.ops.scope.smooth(strength=0.0) == {"FINISHED"}


def test_deleting_armature_and_collection(two):
    select("person")
    bpy.data.objects.remove(bpy.data.objects["person"])
    assert people_of(bpy.data.collections["person"]) == []
    assert shown() == ("person", 1, "First")
    bpy.data.collections.remove(bpy.data.collections["person"])
    assert shown() == ("other", 2, "Second")
    bpy.data.collections.remove(bpy.data.collections["other"])
    assert not bpy.types.SCOPE_PT_result.poll(bpy.context)
    assert bpy.context.scene.scope.result.collection is None
    assert listed() == []


def test_a_capture_from_the_command_line_is_listed_without_figures(body, standing, tmp_path):
    from scope.scope_addon.scene.export.export import export_motions

    export_motions([standing], body, [tmp_path / "walk.blend"])
    with bpy.data.libraries.load(str(tmp_path / "walk.blend")) as (source, wanted):
        wanted.collections = source.collections
    for each in wanted.collections:
        bpy.context.scene.collection.children.link(each)
    assert bpy.types.SCOPE_PT_result.poll(bpy.context)
    assert bpy.context.scene.scope.result.frames == 0
    assert bpy.ops.scope.look_through() == {"FINISHED"}
    assert bpy.context.scene.render.resolution_x == 640


def test_an_appended_capture_brings_its_result(two, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "saved.blend")) as (_, wanted):
        wanted.collections = ["person"]
    bpy.context.scene.collection.children.link(wanted.collections[0])
    assert shown() == ("person", 1, "First")
    assert len(captures_of(bpy.context.scene)) == 1


def test_a_rig_finds_its_person_after_renaming(two):
    rig = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    bpy.context.scene.collection.objects.link(rig)
    person = bpy.data.objects["person"]
    rig[PERSON] = person
    person.name = "hero"
    bpy.context.view_layer.objects.active = rig
    assert captured_armature(bpy.context) == person
    bpy.context.scene.scope.capture = bpy.data.collections["person"]
    bpy.data.collections["person"].objects.unlink(person)
    assert captured_armature(bpy.context) != person


LONG = [f"2026-03-14_interview_camera_left_take_{k:03d}" for k in (1, 2)]


def drawn(name: str, width: int) -> MagicMock:
    """Draw a capture in the list of a sidebar of a width; return its row."""
    layout = MagicMock()
    region = SimpleNamespace(width=width)
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))
    context = SimpleNamespace(preferences=preferences, region=region)
    item = bpy.data.collections[name]
    bpy.types.SCOPE_UL_captures.draw_item(None, context, layout, bpy.data, item, 0, None, "")
    return layout.split.return_value


def test_long_names_are_told_apart_in_a_narrow_sidebar(two):
    for former, name in zip(two, LONG, strict=True):
        bpy.data.collections[former].name = name
    texts = []
    for name in LONG:
        narrow = drawn(name, 260)
        narrow.prop.assert_not_called()
        cell = narrow.row.return_value
        properties = cell.operator.return_value
        assert properties.name == name  # the tooltip and what a click shows
        tip = bpy.types.SCOPE_OT_show_capture.description(bpy.context, properties)
        assert tip == f"{name}\nRename it with Object > Motion Capture > Rename Take"
        text = cell.operator.call_args.kwargs["text"]
        assert "…" in text
        assert text.startswith(LONG[0][:4])
        assert 10 < len(text) < 30
        assert drawn(name, 700).prop.call_args.args == (bpy.data.collections[name], "name")
        texts.append(text)
    assert texts[0] != texts[1]
    for width, people in ((260, "1"), (700, "1 person")):
        labels = drawn(LONG[0], width).row.return_value.label.call_args_list
        assert [label.kwargs["text"] for label in labels] == [people, ""]


def test_a_name_that_is_clicked_is_shown(two):
    assert bpy.ops.scope.show_capture(name="person") == {"FINISHED"}
    assert shown() == ("person", 1, "First")
    assert captured_armature(bpy.context).name == "person"
    bpy.data.collections.new("no capture")
    assert bpy.ops.scope.show_capture(name="no capture") == {"CANCELLED"}
    assert shown()[0] == "person"


@pytest.mark.parametrize("width", range(0, 14))
def test_a_text_without_its_middle_is_as_long_as_it_may_be(width):
    text = elided("abcdefghij", width, len)
    assert len(text) <= max(width, 1)
    if 1 < width < 10:
        assert len(text) == width
        head, tail = text.split("…")
        assert "abcdefghij".startswith(head)
        assert "abcdefghij".endswith(tail)
    elif width >= 10:
        assert text == "abcdefghij"


def is_visible(name: str) -> bool:
    bpy.context.view_layer.update()
    people = people_of(bpy.data.collections[name])
    in_renders = not bpy.data.collections[name].hide_render
    assert in_renders == all(person.visible_get() for person in people)
    return in_renders


def test_a_new_capture_hides_the_earlier_ones_and_the_list_shows_them_again(two, tmp_path):
    assert (is_visible("person"), is_visible("other")) == (False, True)
    select("person")
    assert (is_visible("person"), is_visible("other")) == (True, True)
    # Hidden by the user, a capture stays so.
    bpy.data.collections["other"].hide_viewport = True
    select("other")
    assert bpy.data.collections["other"].hide_viewport


def test_a_new_capture_hides_none_that_another_scene_has_too(two):
    select("person")
    person = bpy.data.collections["person"]
    shot = bpy.data.scenes.new("Shot")
    shot.collection.children.link(person)
    hide_others(bpy.context.scene, [])
    assert not person.hide_render
    assert not person.hide_viewport
    assert bpy.data.collections["other"].hide_render


def test_several_motions_that_are_imported_together_do_not_hide_each_other(two, standing, tmp_path):
    for number in (1, 2):
        standing.save(tmp_path / f"take{number}.npz")
    files = [{"name": f"take{number}.npz"} for number in (1, 2)]
    bpy.ops.scope.import_motion(
        filepath=str(tmp_path / "take1.npz"), directory=str(tmp_path), files=files
    )
    visible = {c.name for c in captures_of(bpy.context.scene) if is_visible(c.name)}
    assert visible == {"take1", "take2"}


def test_a_deleted_capture_leaves_nothing_and_the_one_before_it_is_shown(two, contents):
    scene = bpy.context.scene
    scene.timeline_markers.new("mine", frame=3)
    before = set(scene.timeline_markers.keys())
    person = bpy.data.objects["person"]
    own = bpy.data.objects.new("prop", None)
    bpy.data.collections["other"].objects.link(own)
    own.parent = people_of(bpy.data.collections["other"])[0]
    own.location = (1.0, 2.0, 3.0)
    bpy.context.view_layer.update()
    assert bpy.ops.scope.delete_capture() == {"FINISHED"}
    assert listed() == ["person"]
    assert shown() == ("person", 1, "First")
    assert is_visible("person")
    found = contents()
    assert found["collections"] == ["person"]
    assert found["armatures"] == ["person"]
    assert found["cameras"] == ["person_camera"]
    assert found["actions"] == ["person"]
    assert not [name for name in found["images"] + found["movieclips"] if "other" in name]
    assert sorted(scene.objects.keys()) == ["person", "person_body", "person_camera", "prop"]
    assert tuple(own.matrix_world.translation) == (1.0, 2.0, 3.0)
    # Of both captures, only the first had markers that were not there before.
    assert set(scene.timeline_markers.keys()) <= before
    assert "mine" in scene.timeline_markers
    person.name = "hero"
    assert bpy.ops.scope.delete_capture() == {"FINISHED"}
    found = contents()
    del found["range"], found["rate"]
    assert {kind for kind, names in found.items() if names} == {"objects"}
    assert found["objects"] == ["prop"]
    assert [marker.name for marker in scene.timeline_markers] == ["mine"]
    assert not bpy.data.texts
    assert not bpy.ops.scope.delete_capture.poll()


def test_what_the_user_has_put_into_a_capture_is_not_deleted_with_it(one):
    body = bpy.data.objects["person_body"]
    garment = body.copy()
    garment.data = body.data.copy()
    garment.name = "coat"
    camera = bpy.data.objects.new("Close-up", bpy.data.cameras.new("Close-up"))
    path = bpy.data.objects.new("Rig_root", None)
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    rig.parent = path
    path["scope_root"] = "Rig"
    for obj in (garment, camera, path, rig):
        one.objects.link(obj)
    garment.pop("scope_part")
    assert camera_of(bpy.context.scene).name == "person_camera"
    bpy.ops.scope.root_motion(mode="OBJECT")
    bpy.ops.scope.delete_capture()
    assert sorted(bpy.context.scene.objects.keys()) == ["Close-up", "Rig", "Rig_root", "coat"]
    assert rig.parent == path


def test_the_users_objects_stay_in_every_scene_that_had_the_capture(one):
    scene = bpy.context.scene
    shot = bpy.data.scenes.new("Shot")
    shot.collection.children.link(one)
    props = bpy.data.collections.new("Props")
    shot.collection.children.link(props)
    for name in ("chair", "table"):
        one.objects.link(bpy.data.objects.new(name, None))
    props.objects.link(bpy.data.objects["table"])
    bpy.ops.scope.delete_capture()
    assert sorted(scene.objects.keys()) == sorted(shot.objects.keys()) == ["chair", "table"]
    assert shot.collection.objects.keys() == ["chair"]


def test_the_users_own_actions_are_not_deleted_with_a_capture(one):
    person = bpy.data.objects["person"]
    bpy.ops.scope.push_to_nla()
    own = bpy.data.actions.new("my edit")
    own.use_fake_user = True
    person.animation_data.action = own
    person.keyframe_insert("location", frame=1)
    bpy.ops.scope.delete_capture()
    assert bpy.data.actions.keys() == ["my edit"]


def test_the_action_of_a_capture_in_the_nla_is_deleted_with_it(one):
    bpy.ops.scope.push_to_nla()
    bpy.ops.scope.delete_capture()
    assert not bpy.data.actions


def test_a_motion_that_is_an_asset_is_not_deleted_with_its_capture(one):
    bpy.ops.scope.mark_asset()
    bpy.ops.scope.delete_capture()
    assert bpy.data.actions["person"].asset_data is not None


def test_a_capture_whose_armature_was_deleted_can_be_deleted(one, contents):
    bpy.data.objects.remove(bpy.data.objects["person"])
    assert "person_body" in bpy.data.objects
    bpy.ops.scope.delete_capture()
    assert contents()["objects"] == []
    assert contents()["collections"] == []


def test_data_that_something_else_uses_stays(one):
    copy = bpy.data.objects["person"].copy()
    bpy.context.scene.collection.objects.link(copy)
    bpy.ops.scope.delete_capture()
    assert copy.animation_data.action.name == "person"
    assert copy.data.name == "person"
    assert isinstance(copy["scope_motion"], bpy.types.Text)


def test_a_scene_with_another_unit_is_said_at_once(fake_worker, footage):
    scene = bpy.context.scene
    scene.unit_settings.scale_length = 0.3048
    capture(fake_worker, footage)
    text = unit_text(scene)
    assert "unit is 0.3048 m" in text
    assert f"by {1 / 0.3048:g}" in text
    assert not any("unit" in warning.text for warning in scene.scope.result.warnings)
    bpy.data.objects["person"].scale = [1.0 / 0.3048] * 3
    bpy.context.view_layer.update()
    assert unit_text(scene) == ""
