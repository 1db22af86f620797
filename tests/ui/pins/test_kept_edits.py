# SPDX-License-Identifier: GPL-3.0-or-later
"""Interpolated frames, swapped sides and feet on the floor outlive smoothing, and can be taken
back.

Edits are on the rig that the smoothed motion is retargeted to, and in the files that are
exported. The capture is wrong where it is edited, so that with its edits it is the walk again
from which it was made.
"""

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.character.correction_list import listed_corrections
from scope.scope_addon.scene.character.keys import read_clip, write_clip
from scope.scope_addon.scene.packed_motion import stored_motion
from scope.scope_addon.ui.captured_person import set_motion_of
from scope.solver.rotations import exp

from ...edit.walking import BETAS, BODY, NAMES, RATE, motion_of, walk
from ...scene import made_rigs
from ...scene.made_rigs import captured_together, captured_with
from .changes import assert_same, keys, kinds

BAD = range(41, 46)  # frames of the scene in which the arms and legs are elsewhere
SWAPPED = range(62, 71)


RAISED = 0.25  # metres, of the captured world
KNEES = [NAMES.index(f"{side}_knee") for side in ("left", "right")]


WRIST = NAMES.index("left_wrist")


def damaged():
    """A capture of the walk with wrong frames, in a world that is too high."""
    clip = walk(3.0)
    clip.rotations[40:45, 1:] = clip.rotations[40:45, 1:] @ exp(np.array([0.5, 0.3, -0.4]))
    clip.root[:, 2] += RAISED
    return motion_of(clip, noise=0.02)


@pytest.fixture
def rig():
    """That capture, whose armature is active and stores its motion."""
    armature = captured_with(damaged())
    bpy.context.scene.frame_set(20)
    return armature


def seen(rig, frames):
    return made_rigs.seen(rig, NAMES, frames)


def lowest(rig):
    """(T,) heights of the lower sole."""
    return read_clip(rig, BODY, RATE)[0].soles(BODY, BETAS)[..., 2].min(axis=1)


def shaking(rig):
    """The largest acceleration of the wrist in the wrong frames, metres per frame squared."""
    places = seen(rig, range(BAD[0] - 2, BAD[-1] + 3))[:, WRIST]
    return np.linalg.norm(np.diff(places, 2, axis=0), axis=1).max()


def is_interpolated(rig):
    return shaking(rig) < 0.02


def is_swapped(rig):
    """Whether the knees are where the walk has the other one, as far as they still swing after
    smoothing.
    """
    left, right = seen(rig, SWAPPED)[1:-1, KNEES].transpose(1, 0, 2)
    truth = walk(3.0).joints(BODY, BETAS)[SWAPPED[1] - 1 : SWAPPED[-1] - 1, KNEES]
    # along the walk
    ours = (left - right)[:, 1]
    theirs = (truth[:, 0] - truth[:, 1])[:, 1]
    return ours @ theirs / (theirs @ theirs) < -0.5


def is_on_floor(rig):
    heights = lowest(rig)
    return abs(np.median(heights)) < 0.03 and heights.min() > -1e-3


EDITS = {
    "interpolated": (
        lambda: bpy.ops.scope.interpolate_span(start=39, end=47),
        is_interpolated,
    ),
    "swapped": (
        lambda: bpy.ops.scope.exchange_sides(start=62, end=70, limbs="legs"),
        is_swapped,
    ),
    "on the floor": (lambda: bpy.ops.scope.refloor(), is_on_floor),
}


def edit_all():
    for edit, _ in EDITS.values():
        edit()


def check_all(rig):
    assert {name: holds(rig) for name, (_, holds) in EDITS.items()} == dict.fromkeys(EDITS, True)


def test_edits_are_kept_together_and_with_pins(rig):
    edit_all()
    target = seen(rig, [43])[0, WRIST] + [0.05, 0.05, 0.1]
    bpy.ops.scope.add_pin(joint="left_wrist", frame=43, location=target)
    assert kinds(rig) == ["PIN", "EXCHANGE", "INTERPOLATION", "FEET"]
    for strength in (None, 2.5):
        if strength is not None:
            bpy.ops.scope.smooth(strength=strength)
        assert np.linalg.norm(seen(rig, [43])[0, WRIST] - target) < 0.01
        check_all(rig)
    bpy.ops.scope.remove_correction(index=0)
    check_all(rig)


@pytest.mark.parametrize(("name", "smoothing"), [("interpolated", None), ("on the floor", 2.5)])
def test_taken_back_the_keys_are_again_the_same_to_the_bit(rig, name, smoothing):
    if smoothing is not None:
        bpy.ops.scope.smooth(strength=smoothing)
    before = keys(rig)
    motion = stored_motion(rig)
    EDITS[name][0]()
    if smoothing is not None:
        bpy.ops.scope.smooth(strength=1.0)
        bpy.ops.scope.smooth(strength=smoothing)
    assert any(not np.array_equal(now, before[curve]) for curve, now in keys(rig).items())
    bpy.ops.scope.remove_correction(index=0)
    assert kinds(rig) == []
    assert_same(keys(rig), before)
    for array in ("poses", "trans", "poses_raw", "trans_raw", "joints_cam"):
        np.testing.assert_array_equal(getattr(stored_motion(rig), array), getattr(motion, array))


def test_all_are_taken_back_at_once(rig):
    before = keys(rig)
    edit_all()
    bpy.ops.scope.floor_here()
    bpy.ops.scope.remove_correction()
    assert kinds(rig) == []
    assert_same(keys(rig), before)


def test_undo_takes_an_edit_back_also_for_later_smoothing(rig):
    bpy.ops.ed.undo_push(message="before")
    edit_all()
    bpy.ops.ed.undo_push(message="edited")
    bpy.ops.ed.undo()
    rig = bpy.context.view_layer.objects.active
    assert kinds(rig) == []
    bpy.ops.scope.smooth(strength=1.0)
    assert not any(holds(rig) for _, holds in EDITS.values())


def test_a_reopened_file_and_a_duplicate_have_the_edits(rig, tmp_path):
    edit_all()
    bpy.ops.object.select_all(action="DESELECT")
    rig.select_set(True)
    bpy.ops.object.duplicate()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "walk.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "walk.blend"))
    people = [o for o in bpy.data.objects if "scope_source" in o]
    assert len(people) == 2
    for person in people:
        bpy.context.view_layer.objects.active = person
        bpy.ops.scope.smooth(strength=2.5)
        check_all(person)
    bpy.ops.scope.remove_correction()  # of the last one only
    assert [len(kinds(person)) for person in people] == [3, 0]


def test_an_imported_motion_file_has_the_edits(rig, tmp_path):
    edit_all()
    bpy.ops.scope.export(filepath=str(tmp_path / "walk.npz"), format="NPZ", which="ALL")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = int(RATE)
    bpy.ops.scope.import_motion(filepath=str(tmp_path / "walk.npz"))
    person = bpy.context.view_layer.objects.active
    first = round(float(read_clip(person, BODY, RATE)[1][0]))
    assert kinds(person) == ["EXCHANGE", "INTERPOLATION", "FEET"]
    assert is_on_floor(person)
    bpy.ops.scope.smooth(strength=2.5)
    assert is_on_floor(person)
    spans = [(e["first"] - first, e["last"] - first) for e in listed_corrections(person)]
    assert spans == [(61, 69), (38, 46), (0, 90)]


def test_where_the_motion_is_lost_an_edit_changes_the_keys_only(rig):
    del rig["scope_motion"]
    assert not is_interpolated(rig)
    for name in ("interpolated", "on the floor"):
        edit, holds = EDITS[name]
        edit()
        assert holds(rig), name
    assert kinds(rig) == []
    with pytest.raises(RuntimeError, match="is not stored in this .blend file"):
        bpy.ops.scope.exchange_sides(start=62, end=70)
    with pytest.raises(RuntimeError, match="is not stored in this .blend file"):
        bpy.ops.scope.smooth(strength=1.0)


def test_damaged_edits_in_a_file_are_a_sentence(rig):
    EDITS["interpolated"][0]()
    motion = stored_motion(rig)
    motion.corrections["interpolated_spans"] = np.zeros((5000, 2), int)
    set_motion_of(rig, motion)
    before = keys(rig)
    with pytest.raises(RuntimeError, match="interpolated spans|corrections are damaged"):
        bpy.ops.scope.smooth(strength=2.5)
    assert_same(keys(rig), before)
    assert bpy.ops.scope.refloor() == {"FINISHED"}  # edits what is displayed, as without a motion


def test_feet_of_uneven_ground_are_not_put_on_one_floor(rig):
    assert bpy.ops.scope.refloor.poll()
    rig["scope_uneven_ground"], before = True, keys(rig)
    assert not bpy.ops.scope.refloor.poll()
    with pytest.raises(RuntimeError, match="uneven ground"):
        bpy.ops.scope.refloor()
    assert_same(keys(rig), before)
    assert bpy.ops.scope.floor_here.poll()


def test_feet_of_poses_that_were_moved_by_hand_are_put_on_the_floor_and_stay_there(rig):
    clip, frames = read_clip(rig, BODY, RATE)
    clip.root[:, 2] += 0.1 + 0.2 * (np.arange(len(clip)) > 45)
    write_clip(rig, BODY, clip, frames)
    by_hand = keys(rig)
    bpy.ops.scope.refloor()
    snapped = lowest(rig)
    assert snapped.min() > -1e-3
    assert abs(np.median(snapped[:44])) < 0.03 or abs(np.median(snapped[48:])) < 0.03
    target = seen(rig, [20])[0, WRIST] + [0.05, 0.05, 0.1]
    bpy.ops.scope.add_pin(joint="left_wrist", frame=20, location=target)
    assert np.linalg.norm(seen(rig, [20])[0, WRIST] - target) < 0.01
    np.testing.assert_allclose(lowest(rig), snapped, atol=2e-3)
    bpy.ops.scope.remove_correction()
    assert_same(keys(rig), by_hand)


def test_keys_edited_by_hand_since_a_pin_are_put_on_the_floor(rig):
    bpy.ops.scope.add_pin(
        joint="left_wrist", frame=20, location=seen(rig, [20])[0, WRIST] + [0, 0.1, 0.1]
    )
    clip, frames = read_clip(rig, BODY, RATE)
    clip.root[:, 2] += 0.1
    write_clip(rig, BODY, clip, frames)
    bpy.ops.scope.refloor()
    assert is_on_floor(rig)


def test_with_root_motion_on_an_object_edits_are_kept_too(rig):
    bpy.ops.scope.root_motion(mode="OBJECT")
    edit_all()
    assert is_on_floor(rig)
    bpy.ops.scope.smooth(strength=2.5)
    check_all(rig)


def test_a_floor_after_feet_on_the_floor_moves_them_and_snapping_again_puts_them_back(rig):
    bpy.ops.scope.refloor()
    scene = bpy.context.scene
    camera = next(o for o in scene.objects if o.type == "CAMERA")
    heights = lowest(rig)
    high = max(range(10, 80), key=lambda frame: heights[frame - 1])
    height = heights[high - 1]
    z = camera.matrix_world.translation.z
    assert height > 0.005
    scene.frame_set(high)
    bpy.ops.scope.floor_here()
    assert kinds(rig) == ["FLOOR", "FEET"]
    assert lowest(rig)[high - 1] < height
    moved = z - camera.matrix_world.translation.z
    floor = lowest(rig)
    for strength in (2.5, 1.0):
        bpy.ops.scope.smooth(strength=strength)
    np.testing.assert_allclose(lowest(rig), floor, atol=1e-5)
    bpy.ops.scope.refloor()
    assert is_on_floor(rig)
    assert z - camera.matrix_world.translation.z == pytest.approx(moved, abs=1e-6)
    bpy.ops.scope.smooth(strength=1.0)
    assert is_on_floor(rig)
    bpy.ops.scope.remove_correction(index=0)
    assert kinds(rig) == ["FEET"]
    assert is_on_floor(rig)
    scene.frame_set(high)
    assert camera.matrix_world.translation.z == pytest.approx(z, abs=1e-6)


def test_an_upright_line_and_feet_on_the_floor_in_either_order(rig):
    for first, second in ((_upright, bpy.ops.scope.refloor), (bpy.ops.scope.refloor, _upright)):
        first()
        second()
        assert kinds(rig) == ["UPRIGHT", "FEET"]
        assert is_on_floor(rig)
        bpy.ops.scope.smooth(strength=2.5)
        assert is_on_floor(rig)
        bpy.ops.scope.remove_correction()


def _upright():
    bpy.ops.scope.set_upright(start=(300, 100), end=(310, 400))


def test_feet_of_one_person_are_put_on_the_floor_of_everybody():
    people = captured_together()
    bpy.context.view_layer.objects.active = people[0]
    bpy.ops.scope.refloor()
    assert [kinds(person) for person in people] == [["FEET"], []]
    bpy.ops.scope.floor_here()
    assert [kinds(person) for person in people] == [["FLOOR", "FEET"], ["FLOOR"]]
    bpy.ops.scope.remove_correction(index=0)
    assert [kinds(person) for person in people] == [["FEET"], []]


def test_an_interpolation_of_what_was_edited_by_hand_is_of_what_is_displayed(rig):
    clip, frames = read_clip(rig, BODY, RATE)
    turn = exp(np.array([0.0, 0.0, 0.6]))
    head = NAMES.index("head")
    clip.rotations[:, head] = turn
    clip.rotations[49:55, head] = np.eye(3)
    write_clip(rig, BODY, clip, frames)
    bpy.ops.scope.interpolate_span(start=49, end=56)
    bpy.ops.scope.foot_stands(start=70, end=73, foot="left")  # changes the keys once more
    now = read_clip(rig, BODY, RATE)[0].rotations[:, head]
    assert np.abs(now - turn).max() < 0.02
