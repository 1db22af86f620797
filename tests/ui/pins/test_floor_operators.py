# SPDX-License-Identifier: GPL-3.0-or-later
"""The floor, corrected through Blender's operator."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.edit.edits import moved_motion
from scope.scope_addon.scene.character.correction_list import listed_corrections
from scope.scope_addon.scene.character.keys import read_clip, write_keys
from scope.scope_addon.scene.datablocks import captures_of, is_person
from scope.scope_addon.scene.packed_motion import stored_motion

from ...edit.walking import BODY, NAMES, RATE, motion_of, walk
from ...scene import made_rigs
from ...scene.made_rigs import captured_together, captured_with
from .changes import assert_same, everything, kinds, look_through_camera

FRAME = 20
FRAMES = (5, 20, 50)
RAISED = 0.25  # metres, of the captured world


@pytest.fixture
def rig():
    """A walk captured in a world that is too high, with its body's mesh."""
    T = np.eye(4)
    T[2, 3] = RAISED
    armature = captured_with(moved_motion(motion_of(walk(2.0), noise=0.02), BODY, T))
    look_through_camera(FRAME)
    return armature


def lowest(armature, frame=FRAME):
    """The lowest point of the body as Blender displays it."""
    bpy.context.scene.frame_set(frame)
    graph = bpy.context.evaluated_depsgraph_get()
    mesh = next(o for o in bpy.context.scene.objects if o.type == "MESH" and o.parent == armature)
    posed = mesh.evaluated_get(graph)
    vertices = posed.to_mesh().vertices
    places = np.empty(3 * len(vertices), np.float32)
    vertices.foreach_get("co", places)
    up = np.array(posed.matrix_world)[2]
    return float((places.reshape(-1, 3) @ up[:3]).min() + up[3])


def from_camera(armature):
    """(frames, joints, 3) where the scene's camera has the joints, in its own axes."""
    found = []
    for frame in FRAMES:
        places = made_rigs.seen(armature, NAMES, [frame])[0]
        inverse = np.array(bpy.context.scene.camera.matrix_world.inverted())
        found.append(places @ inverse[:3, :3].T + inverse[:3, 3])
    return np.array(found)


def test_person_and_camera_move_until_the_foot_is_on_the_floor(rig):
    before = from_camera(rig)
    assert lowest(rig) > RAISED - 0.05
    bpy.ops.scope.floor_here()
    assert abs(lowest(rig)) < 0.002
    np.testing.assert_allclose(from_camera(rig), before, atol=1e-5)
    assert [(e["kind"], e["first"], e["last"]) for e in listed_corrections(rig)] == [
        ("FLOOR", FRAME, FRAME)
    ]
    for strength in (2.5, 1.0):
        bpy.ops.scope.smooth(strength=strength)
        assert abs(lowest(rig)) < 0.03  # each smoothing has the foot a little elsewhere
    assert abs(lowest(rig)) < 0.002


def test_without_the_floor_everything_is_the_same_to_the_bit(rig):
    before = everything(rig)
    bpy.ops.scope.floor_here(foot="right")
    bpy.context.scene.frame_set(40)
    bpy.ops.scope.floor_here()
    assert kinds(rig) == ["FLOOR"]
    bpy.ops.scope.remove_correction(index=0)
    assert kinds(rig) == []
    assert_same(everything(rig), before)


def test_a_floor_with_a_pin_and_an_upright_line_is_removed_alone_and_with_them(rig):
    before = everything(rig)
    bpy.ops.scope.set_upright(start=(300, 100), end=(320, 300))
    bpy.ops.scope.floor_here()
    target = made_rigs.seen(rig, ["left_wrist"], [FRAME])[0, 0] + [0.0, 0.1, 0.1]
    bpy.ops.scope.add_pin(joint="left_wrist", location=target)
    assert kinds(rig) == ["PIN", "UPRIGHT", "FLOOR"]
    assert np.linalg.norm(made_rigs.seen(rig, ["left_wrist"], [FRAME])[0, 0] - target) < 0.01
    assert abs(lowest(rig)) < 0.02
    bpy.ops.scope.remove_correction(index=2)
    assert kinds(rig) == ["PIN", "UPRIGHT"]
    bpy.context.scene.frame_set(FRAME)
    bpy.ops.scope.floor_here()
    bpy.ops.scope.remove_correction(index=-1)
    assert kinds(rig) == []
    assert_same(everything(rig), before)


def raise_keys(rig, height):
    """Raise all keys, as a user may with the pelvis's curves."""
    clip, frames = read_clip(rig, BODY, RATE)
    raised = replace(clip, root=clip.root + [0.0, 0.0, height])
    write_keys(rig, BODY, raised, frames, np.ones(len(frames), bool))
    bpy.context.scene.frame_set(FRAME)


def test_edited_keys_are_where_they_were_without_the_floor(rig):
    before = lowest(rig)
    raise_keys(rig, 0.1)
    assert lowest(rig) == pytest.approx(before + 0.1, abs=1e-4)
    edited = everything(rig)
    bpy.context.scene.frame_set(FRAME)
    bpy.ops.scope.floor_here()
    assert abs(lowest(rig)) < 0.002
    bpy.ops.scope.foot_stands(foot="left", start=40, end=44)
    assert abs(lowest(rig)) < 0.002
    bpy.ops.scope.remove_correction(index=0)
    assert kinds(rig) == ["FLOOR"]
    assert abs(lowest(rig)) < 0.002
    raise_keys(rig, 0.03)  # These are no longer the keys that were written.
    bpy.ops.scope.floor_here()
    assert abs(lowest(rig)) < 0.002
    bpy.ops.scope.remove_correction(index=0)
    assert kinds(rig) == []
    assert lowest(rig) == pytest.approx(before + 0.13, abs=1e-3)
    raise_keys(rig, -0.03)
    bpy.ops.scope.floor_here()
    bpy.ops.scope.remove_correction(index=0)
    assert_same(everything(rig), edited, atol=1e-3)


def test_keys_that_were_put_on_the_floor_before_are_on_it_afterwards(rig):
    bpy.ops.scope.refloor()
    snapped = lowest(rig)
    bpy.ops.scope.floor_here()
    assert abs(snapped) < 0.1
    assert abs(lowest(rig)) < 0.002
    bpy.ops.scope.smooth(strength=1.0)  # keeps both
    assert abs(lowest(rig)) < 0.002
    assert kinds(rig) == ["FLOOR", "FEET"]


def test_feet_under_the_floor_in_other_frames_are_said(rig, capfd):
    high = max(range(10, 50), key=lambda frame: lowest(rig, frame))
    bpy.context.scene.frame_set(high)
    bpy.ops.scope.floor_here()
    depth = -min(lowest(rig, frame) for frame in range(1, 62))
    assert depth > 0.01
    said = capfd.readouterr().out
    assert f"A foot is up to {100 * depth:.0f} cm under this floor in" in said
    assert "of 61 frames" in said


def test_the_floor_of_one_person_is_that_of_everybody_of_the_capture():
    people = captured_together()
    before = [everything(person) for person in people]
    bpy.ops.scope.floor_here()
    assert [kinds(person) for person in people] == [["FLOOR"]] * 2
    heights = [stored_motion(person).corrections["floor_heights"] for person in people]
    np.testing.assert_array_equal(*heights)
    bpy.context.view_layer.objects.active = people[1]
    bpy.ops.scope.remove_correction(index=0)
    for person, expected in zip(people, before, strict=True):
        assert_same(everything(person), expected)


def test_the_floor_is_also_that_of_somebody_whom_a_live_recording_saw_longer():
    people = captured_together(seconds=1.5)
    bpy.ops.scope.floor_here()
    assert [kinds(person) for person in people] == [["FLOOR"]] * 2


def test_the_floor_is_that_of_everybody_whose_file_of_one_clip_was_imported(tmp_path):
    walks = {"one": walk(1.0), "two": walk(1.0, speed=0.8), "other": walk(1.0)}
    for name, clip in walks.items():
        source = "elsewhere.mp4" if name == "other" else "walk.mp4"
        replace(motion_of(clip), source=source).save(tmp_path / f"{name}.npz")
    files = [{"name": f"{name}.npz"} for name in walks]
    bpy.ops.scope.import_motion(directory=str(tmp_path), files=files)
    scene = bpy.context.scene
    people = [o for c in captures_of(scene) for o in c.all_objects if is_person(o)]
    cameras = [o for c in captures_of(scene) for o in c.all_objects if o.type == "CAMERA"]
    assert len(people) == len(cameras) == 3
    before = [np.array(camera.matrix_basis) for camera in cameras]
    keys = [everything(person) for person in people]
    bpy.context.view_layer.objects.active = people[0]
    scene.frame_set(10)
    bpy.ops.scope.floor_here()
    assert [kinds(person) for person in people] == [["FLOOR"], ["FLOOR"], []]
    rise = [np.array(c.matrix_basis)[2, 3] - b[2, 3] for c, b in zip(cameras, before, strict=True)]
    assert rise[0] == pytest.approx(rise[1])
    assert rise[0] != 0.0
    assert rise[2] == 0.0
    bpy.context.view_layer.objects.active = people[1]
    bpy.ops.scope.remove_correction(index=0)
    for person, expected in zip(people, keys, strict=True):
        assert_same(everything(person), expected)


def test_refused_changes_nothing(rig):
    before = everything(rig)
    bpy.context.scene.frame_set(500)
    with pytest.raises(RuntimeError, match="outside of the captured motion"):
        bpy.ops.scope.floor_here()
    bpy.context.scene.frame_set(FRAME)
    assert_same(everything(rig), before)
    bpy.ops.scope.root_motion(mode="OBJECT")
    with pytest.raises(RuntimeError, match="In Bones"):
        bpy.ops.scope.floor_here()
    assert kinds(rig) == []
