# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that leave room for suffixes, and objects of one name in two files."""

import bpy
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.datablocks import SUFFIX_BYTES, holds, is_in_layer, short_name


def test_a_long_name_keeps_its_beginning_and_its_suffix():
    for letter in ("x", "é", "歩", "🏃"):
        name = short_name(letter * 300)
        assert letter * 300 == name + letter * (300 - len(name))
        block = bpy.data.objects.new(name + "_" * SUFFIX_BYTES, None)
        assert block.name == name + "_" * SUFFIX_BYTES
    assert short_name("Scene 3, 歩く") == "Scene 3, 歩く"


def test_the_objects_of_a_long_name_say_what_they_are(body, make_motion):
    name = (
        "2026-11-27 a long name that says all about the footage, by camera B, take 3, final "
        "version, graded and cut"
    )
    motions = [
        make_motion(body, 2, source=f"{name} {'and more of it ' * 10}.mp4") for _ in range(2)
    ]
    collection = build_scene(motions, body, None, BuildOptions(with_camera=True)).collection
    assert name.startswith(collection.name[:39])
    found = sorted(obj.name.removeprefix(collection.name) for obj in collection.all_objects)
    assert found == ["_camera", "_person1", "_person1_body", "_person2", "_person2_body"]


def test_an_object_of_the_same_name_in_another_file_is_another_one(tmp_path):
    scene = bpy.context.scene
    path = str(tmp_path / "other.blend")
    own = bpy.data.collections.new("walk")
    own.objects.link(bpy.data.objects.new("walk", None))
    scene.collection.children.link(own)
    bpy.data.libraries.write(path, {own})
    with bpy.data.libraries.load(path, link=True) as (_, there):
        there.collections = ["walk"]
    linked = there.collections[0]
    scene.collection.children.link(linked)
    mine = own.objects[0]
    other = linked.objects[0]
    assert mine.name == other.name
    assert [holds(c, o) for c in (own, linked) for o in (mine, other)] == [True, False, False, True]
    assert [holds(scene.collection, o) for o in (mine, other)] == [True, True]
    (layer := bpy.context.view_layer).update()
    assert [is_in_layer(layer, o) for o in (mine, other)] == [True, True]
    next(each for each in layer.layer_collection.children if each.collection == own).exclude = True
    layer.update()
    assert [is_in_layer(layer, o) for o in (mine, other)] == [False, True]
