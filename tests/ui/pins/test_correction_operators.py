# SPDX-License-Identifier: GPL-3.0-or-later
"""Corrections through Blender's operators, checked in the evaluated scene.

Pins in frames in which the person was not seen, and where the footage has no frames.
"""

import re
from dataclasses import replace

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from scope.scope_addon.edit.clip import Clip
from scope.scope_addon.edit.corrected_motion import corrections_of
from scope.scope_addon.kinematics.foot_skin import foot_heights
from scope.scope_addon.scene.actions import fcurves, read_keys
from scope.scope_addon.scene.character.correction_list import listed_corrections
from scope.scope_addon.scene.match_rate import change_rate
from scope.scope_addon.scene.packed_motion import stored_motion
from scope.scope_addon.ui.captured_person import set_motion_of
from scope.scope_addon.ui.correction_operators import last_pin_warnings

from ...edit.walking import BETAS, BODY, NAMES, motion_of, walk
from ...scene import made_rigs
from ...scene.made_rigs import captured_with
from .changes import assert_same, keys, look_through_camera

FRAME = 46  # of the scene; the footage's frame 45, as the capture starts at frame 1
WRIST = NAMES.index("left_wrist")
ANKLE = NAMES.index("right_ankle")


@pytest.fixture
def rig():
    """A captured walk, with its motion."""
    armature = captured_with(motion_of(walk(3.0), noise=0.05))
    look_through_camera(FRAME)
    return armature


def seen(rig, frames=(FRAME,)):
    return made_rigs.seen(rig, NAMES, frames)


def in_image(place):
    x, y, _ = world_to_camera_view(bpy.context.scene, bpy.context.scene.camera, Vector(place))
    return np.array([x * 640, y * 480])


def test_a_pin_in_space_is_met_and_other_keys_stay(rig):
    before = seen(rig)[0]
    old = keys(rig)
    target = before[WRIST] + [0.1, 0.05, 0.15]
    bpy.ops.scope.add_pin(joint="left_wrist", location=target)
    assert np.linalg.norm(seen(rig)[0, WRIST] - target) < 0.01
    assert np.linalg.norm(seen(rig)[0, ANKLE] - before[ANKLE]) < 0.01
    for curve, new in keys(rig).items():
        far = np.abs(new[:, 0] - FRAME) > 0.4 * 30
        np.testing.assert_array_equal(new[far], old[curve][far])
    assert bpy.context.scene.frame_current == FRAME


def test_a_pin_in_the_image_is_met_whatever_the_smoothing(rig):
    target = seen(rig)[0, WRIST] + [0.12, 0.0, 0.1]
    bpy.ops.scope.add_pin(joint="left_wrist", location=target, in_image=True)
    pixel = in_image(target)
    assert np.linalg.norm(in_image(seen(rig)[0, WRIST]) - pixel) < 2.0
    for strength in (2.5, 1.0):
        bpy.ops.scope.smooth(strength=strength)
        assert np.linalg.norm(in_image(seen(rig)[0, WRIST]) - pixel) < 2.0
    motion = stored_motion(rig)
    assert motion.corrections["pin_joints"].tolist() == ["left_wrist"]
    assert np.isfinite(motion.corrections["pin_uv"]).all()


def test_a_pin_of_a_hidden_capture_in_an_opened_file_is_where_the_user_has_put_it(rig, tmp_path):
    target = seen(rig)[0, WRIST] + [0.1, 0.05, 0.15]
    rig.location.x = 5.0
    rig.users_collection[0].hide_viewport = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.scope.add_pin(joint="left_wrist", location=target + [5.0, 0.0, 0.0])
    (pin,) = corrections_of(stored_motion(bpy.data.objects["walk"]))
    np.testing.assert_allclose(pin.position, target, atol=1e-4)


def test_without_corrections_there_is_none_to_remove(rig):
    """Blender greys out the operator: it would have nothing to do."""
    assert not bpy.ops.scope.remove_correction.poll()
    with pytest.raises(RuntimeError, match="has no corrections"):
        bpy.ops.scope.remove_correction(index=-1)
    bpy.ops.scope.foot_stands(start=FRAME, end=FRAME + 6, foot="right")
    assert bpy.ops.scope.remove_correction.poll()
    with pytest.raises(RuntimeError, match="no correction 3"):
        bpy.ops.scope.remove_correction(index=3)
    assert bpy.ops.scope.remove_correction(index=-1) == {"FINISHED"}
    assert not bpy.ops.scope.remove_correction.poll()


def test_a_pin_out_of_reach_is_said_with_its_distance_and_listed(rig, capfd):
    before = seen(rig)[0]
    bpy.ops.scope.add_pin(
        joint="left_wrist", location=before[NAMES.index("left_shoulder")] + [1.1, 0, 0]
    )
    after = seen(rig)[0]
    said = capfd.readouterr().out
    (entry,) = listed_corrections(rig)
    distance = np.linalg.norm(before[NAMES.index("left_shoulder")] + [1.1, 0, 0] - after[WRIST])
    assert entry["missed"] == f"{100 * distance:.0f} cm"
    assert f"Left Wrist cannot reach the pin and stays {entry['missed']} away" in said
    (for_the_tool,) = last_pin_warnings
    assert for_the_tool in said
    assert np.linalg.norm(after[0] - before[0]) < 0.035
    bpy.ops.scope.remove_correction(index=0)
    bpy.ops.scope.add_pin(joint="left_wrist", location=before[WRIST] + [0.0, 0.05, 0.05])
    assert "cannot reach" not in capfd.readouterr().out
    assert last_pin_warnings == []
    assert listed_corrections(rig)[0]["missed"] == ""


def test_a_pin_under_the_floor_is_said_with_its_depth(rig, capfd):
    low = walk(3.0, bent=0.9)
    low.root[:, 2] -= 0.23  # crouching, so that a foot can reach below the floor
    set_motion_of(rig, motion_of(low))
    ankle = low.joints(BODY, BETAS)[48, ANKLE]
    bpy.ops.scope.smooth(strength=1.0)  # writes the keys of that motion
    bpy.ops.scope.add_pin(joint="right_ankle", frame=49, location=[*ankle[:2], 0.08])
    assert "under the floor" not in capfd.readouterr().out
    bpy.ops.scope.add_pin(joint="right_ankle", frame=49, location=[*ankle[:2], -0.03])
    heights = foot_heights(stored_motion(rig), BODY)[48, 2:]
    assert (
        f"up to {-100 * heights.min():.0f} cm under the floor in 1 of 91 frames: move the pin up"
        in capfd.readouterr().out
    )


@pytest.mark.slow
def test_a_foot_that_stands_and_goes_under_the_floor_is_said_by_name(rig, capfd):
    """A pin elsewhere on the body is not what puts it there, nor one of the same foot later."""
    hand = seen(rig)[0, WRIST] + [0.0, 0.0, 0.1]
    later = seen(rig, [85])[0, ANKLE] + [0.0, 0.0, 0.03]
    bpy.ops.scope.add_pin(joint="left_wrist", frame=FRAME, location=hand)
    bpy.ops.scope.add_pin(joint="right_ankle", frame=85, location=later)
    assert "under the floor" not in capfd.readouterr().out
    bpy.ops.scope.foot_stands(start=20, end=60, foot="right")  # while the person walks on
    said = capfd.readouterr().out
    assert "frames: remove 'Right Foot Stands', or add it for fewer frames" in said
    assert "move the pin" not in said
    bpy.ops.scope.remove_correction(index=2)
    bpy.ops.scope.foot_stands(start=FRAME, end=FRAME + 6, foot="right")
    assert "under the floor" not in capfd.readouterr().out


CORRECTIONS = {
    "pin": lambda wrist: bpy.ops.scope.add_pin(
        joint="left_wrist", frame=FRAME, location=wrist + [0.1, 0.05, 0.15]
    ),
    "foot": lambda _: bpy.ops.scope.foot_stands(start=FRAME - 4, end=FRAME + 4, foot="right"),
    "rests": lambda _: bpy.ops.scope.this_rests(start=FRAME, end=FRAME + 1, part="left_knee"),
    "sides": lambda _: bpy.ops.scope.exchange_sides(start=FRAME - 8, end=FRAME + 2),
}


EDITS = {
    "reduced": lambda: bpy.ops.scope.reduce_keys(degrees=2.0),
    "bridged": lambda: bpy.ops.scope.interpolate_span(start=FRAME - 5, end=FRAME + 5),
    "on an object": lambda: bpy.ops.scope.root_motion(mode="OBJECT"),
}


@pytest.mark.parametrize(
    ("edit", "order"),
    [("reduced", ("pin", "rests")), ("bridged", ("sides",)), ("on an object", ("foot",))],
)
def test_without_corrections_keys_and_motion_are_again_the_same_to_the_bit(rig, edit, order):
    EDITS[edit]()
    before = keys(rig)
    motion = stored_motion(rig)
    wrist = seen(rig)[0, WRIST]
    for name in order:
        CORRECTIONS[name](wrist)
    assert any(not np.array_equal(now, before[curve]) for curve, now in keys(rig).items())
    while added := [
        k for k, e in enumerate(listed_corrections(rig)) if e["kind"] != "INTERPOLATION"
    ]:
        bpy.ops.scope.remove_correction(index=added[len(added) // 2])
    assert_same(keys(rig), before)
    again = stored_motion(rig)
    for name in ("poses", "trans", "poses_raw", "trans_raw", "joints_cam", "world_from_camera"):
        np.testing.assert_array_equal(getattr(again, name), getattr(motion, name))
    assert again.corrections.keys() == motion.corrections.keys()


def test_removing_one_of_several_leaves_what_the_others_alone_give(rig):
    wrist = seen(rig)[0, WRIST]
    CORRECTIONS["foot"](wrist)
    alone = keys(rig)
    CORRECTIONS["pin"](wrist)
    bpy.ops.scope.remove_correction(index=0)
    assert [e["kind"] for e in listed_corrections(rig)] == ["CONTACT"]
    assert_same(keys(rig), alone)


def test_after_another_smoothing_the_last_removal_gives_that_smoothing_to_the_bit(rig):
    bpy.ops.scope.smooth(strength=2.5)
    expected = keys(rig)
    bpy.ops.scope.smooth(strength=1.0)
    CORRECTIONS["pin"](seen(rig)[0, WRIST])
    bpy.ops.scope.smooth(strength=2.5)
    bpy.ops.scope.remove_correction(index=0)
    assert_same(keys(rig), expected)


def test_keys_that_were_edited_after_a_correction_keep_the_edit_when_it_is_removed(rig):
    before = keys(rig)
    CORRECTIONS["pin"](seen(rig)[0, WRIST])
    curve = next(c for c in fcurves(rig) if c.data_path == 'pose.bones["pelvis"].location')
    curve.keyframe_points[FRAME - 1].co.y += 0.5
    bpy.ops.scope.remove_correction(index=0)
    now = keys(rig)
    for name, values in before.items():
        assert now[name].shape == values.shape
        shift = np.where(now[name][:, 0] == FRAME, 0.5, 0.0) * (
            name == (rig.name, curve.data_path, curve.array_index)
        )
        np.testing.assert_allclose(now[name][:, 1], values[:, 1] + shift, atol=1e-5)


def test_removal_is_exact_at_another_frame_rate_too(rig):
    change_rate(bpy.context.scene, 24.0, {rig: stored_motion(rig)}, [])
    bpy.ops.scope.smooth(strength=1.0)  # keys between frames
    before = keys(rig)
    CORRECTIONS["pin"](seen(rig)[0, WRIST])
    bpy.ops.scope.remove_correction(index=0)
    assert_same(keys(rig), before)


def test_a_damaged_record_of_earlier_keys_is_left_out(rig):
    before = keys(rig)
    CORRECTIONS["pin"](seen(rig)[0, WRIST])
    rig["scope_motion"]["uncorrected_keys"] = b"PK\x03\x04 damaged"
    bpy.ops.scope.remove_correction(index=0)
    assert_same(keys(rig), before, atol=1e-5)


def test_a_pin_is_met_without_root_motion(rig):
    bpy.ops.scope.root_motion(mode="IN_PLACE")
    before = seen(rig)[0]
    target = before[WRIST] + [0.1, 0.05, 0.15]
    bpy.ops.scope.add_pin(joint="left_wrist", location=target)
    assert np.linalg.norm(seen(rig)[0, WRIST] - target) < 0.01
    assert np.linalg.norm(seen(rig)[0, ANKLE] - before[ANKLE]) < 0.01


def test_a_flip_mirrors_depth_and_once_more_mirrors_it_back(rig):
    """The camera looks along y, and the person walks towards it."""
    before = seen(rig, [30, 46, 70])
    flips = (
        lambda: bpy.ops.scope.flip_limb(start=40, end=52, limb="left_leg"),
        lambda: bpy.ops.scope.turn_around(start=40, end=52),
    )
    hip, knee = NAMES.index("left_hip"), NAMES.index("left_knee")
    toes = NAMES.index("left_foot"), NAMES.index("left_ankle")
    for flip, text, bone in zip(
        flips, ("Left Leg", "Turned Around"), ((hip, knee), toes), strict=True
    ):
        flip()
        after = seen(rig, [30, 46, 70])
        np.testing.assert_allclose(after[[0, 2]], before[[0, 2]], atol=1e-6)
        was, now = (at[1, bone[1], 1] - at[1, bone[0], 1] for at in (before, after))
        assert was * now < 0
        assert [(e["text"], e["first"], e["last"]) for e in listed_corrections(rig)] == [
            (text, 40, 52)
        ]
        bpy.ops.scope.smooth(strength=2.0)
        smooth = seen(rig, [46])[0]
        assert was * (smooth[bone[1], 1] - smooth[bone[0], 1]) < 0
        bpy.ops.scope.smooth(strength=1.0)
        flip()
        np.testing.assert_allclose(seen(rig, [30, 46, 70]), before, atol=1e-5)
        assert listed_corrections(rig) == []


@pytest.mark.slow
def test_what_rests_is_on_the_floor_or_it_is_said_how_far_it_stays_away(rig, capfd):
    """The person walks upright: the body can sit down, but no hand reaches the floor."""
    bpy.ops.scope.this_rests(start=46, end=48, part="left_hand")
    said = capfd.readouterr().out
    assert re.search(r"Left Hand stays up to \d\d cm above the floor", said)
    (entry,) = listed_corrections(rig)
    assert (entry["text"], entry["first"], entry["last"]) == ("Left Hand", 46, 48)
    bpy.ops.scope.remove_correction(index=0)
    bpy.ops.scope.this_rests(start=46, end=48, part="seat")
    assert "Seat stays" not in capfd.readouterr().out
    body = next(child for child in rig.children if child.type == "MESH")
    bpy.context.scene.frame_set(47)
    evaluated = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
    heights = np.array([(evaluated.matrix_world @ v.co).z for v in evaluated.data.vertices])
    parts = [NAMES.index(name) for name in ("pelvis", "left_hip", "right_hip")]
    assert abs(heights[np.isin(BODY.strongest_joints, parts)].min()) < 0.02


@pytest.mark.slow
def test_what_another_correction_pulls_under_the_floor_is_said_to_be_there(rig, capfd):
    pelvis = seen(rig, [47])[0, 0]
    bpy.ops.scope.add_pin(joint="pelvis", frame=47, location=[*pelvis[:2], -0.2])
    bpy.ops.scope.this_rests(start=46, end=48, part="seat")
    (depth,) = re.findall(r"Seat gets up to (\d+) cm under the floor", capfd.readouterr().out)
    assert seen(rig, [47])[0, 0, 2] == pytest.approx(-0.2, abs=0.01)
    assert 20 < int(depth) < 40


def test_an_exchange_swaps_the_sides_and_once_more_swaps_them_back(rig):
    left = NAMES.index("left_knee")
    right = NAMES.index("right_knee")
    before = seen(rig, [40, 46, 70])
    bpy.ops.scope.exchange_sides(start=40, end=52)
    after = seen(rig, [40, 46, 70])
    np.testing.assert_allclose(after[2], before[2], atol=1e-6)
    assert (
        abs((after[1, left] - after[1, right])[1] + (before[1, left] - before[1, right])[1]) < 0.02
    )
    bpy.ops.scope.exchange_sides(start=40, end=52)
    np.testing.assert_allclose(seen(rig, [40, 46, 70]), before, atol=1e-5)
    assert listed_corrections(rig) == []


def measured(armature, frame, bones, what):
    """Custom properties of bones in a frame, as drivers read them."""
    bpy.context.scene.frame_set(frame)
    posed = armature.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones
    return [posed[name][what] for name in bones]


@pytest.mark.parametrize("limbs", ["legs", "arms", "both"])
def test_the_contact_and_confidence_of_exchanged_limbs_are_exchanged(limbs):
    rng = np.random.default_rng(7)
    motion = motion_of(walk(3.0))
    contact = rng.uniform(size=(len(motion), 4)).astype(np.float32)
    confidence = rng.uniform(size=motion.joint_confidence.shape).astype(np.float32)
    armature = captured_with(replace(motion, foot_contact=contact, joint_confidence=confidence))
    legs = ["left_ankle", "left_foot", "right_ankle", "right_foot"]
    arms = ["left_wrist", "right_wrist"]
    other = {"legs": [2, 3, 0, 1], "arms": [1, 0]}
    for exchanges in range(3):  # the second one undoes the first
        for frame in (20, FRAME, 70):
            row = frame - 1
            is_exchanged = frame == FRAME and exchanges == 1
            at = {"legs": contact[row], "arms": confidence[row, [NAMES.index(n) for n in arms]]}
            for part in at:
                if is_exchanged and limbs in (part, "both"):
                    at[part] = at[part][other[part]]
            found = measured(armature, frame, legs, "contact")
            np.testing.assert_allclose(found, at["legs"], atol=1e-6)
            found = measured(armature, frame, arms, "confidence")
            np.testing.assert_allclose(found, at["arms"], atol=1e-6)
        bpy.ops.scope.exchange_sides(start=40, end=52, limbs=limbs)


def test_sides_are_exchanged_where_the_deviation_of_one_is_unknown():
    motion = motion_of(walk(3.0))
    sigma_m = np.full(motion.joint_confidence.shape, 0.01, np.float32)
    sigma_m[:, NAMES.index("right_wrist")] = np.nan
    armature = captured_with(replace(motion, joint_sigma_m=sigma_m))
    bpy.ops.scope.exchange_sides(start=1, end=len(motion), limbs="arms")
    assert len(listed_corrections(armature)) == 1
    assert measured(armature, 20, ["left_wrist"], "sigma_cm") == pytest.approx([1.0])


def move_keys(rig, factor, shift):
    """Move all keys in time as in the Dope Sheet."""
    for curve in fcurves(rig):
        for key in curve.keyframe_points:
            for point in (key.co, key.handle_left, key.handle_right):
                point.x = factor * point.x + shift
        curve.update()


@pytest.mark.parametrize(("factor", "shift"), [(1.0, 20.0), (1.0, -1.0), (1.2, 0.0)])
def test_keys_that_were_moved_in_time_are_not_corrected_at_another_moment(rig, factor, shift):
    move_keys(rig, factor, shift)
    before = keys(rig)
    for change in (
        lambda: bpy.ops.scope.exchange_sides(start=40, end=52),
        lambda: bpy.ops.scope.add_pin(joint="left_wrist", location=(0.0, 0.0, 1.0)),
        lambda: bpy.ops.scope.smooth(),
    ):
        with pytest.raises(RuntimeError, match="was captured in frames 1 to 91: put them back"):
            change()
    assert_same(keys(rig), before)


def enter_tweak_mode(rig, start, scale):
    """Push the motion to a strip that begins at a frame, and enter Tweak Mode on it."""
    bpy.ops.scope.push_to_nla()
    animation = rig.animation_data
    track = animation.nla_tracks[0]
    strip = track.strips[0]
    strip.scale = scale
    strip.frame_start_raw, strip.frame_end_raw = start, start + 90 * scale
    strip.select = track.select = True
    animation.nla_tracks.active = track
    animation.use_tweak_mode = True


@pytest.mark.parametrize(("start", "scale"), [(21, 1.0), (1, 2.0)])
def test_a_strip_that_was_moved_is_not_edited_at_another_moment(rig, start, scale):
    enter_tweak_mode(rig, start, scale)
    before = keys(rig)
    for change in (
        lambda: bpy.ops.scope.exchange_sides(start=40, end=52),
        lambda: bpy.ops.scope.loop(start=40, end=80),
        lambda: bpy.ops.scope.root_motion(mode="OBJECT"),
    ):
        with pytest.raises(RuntimeError, match="set the strip's start to 1 and its end to 91"):
            change()
    assert_same(keys(rig), before)


def test_a_strip_at_its_own_frames_is_edited(rig):
    enter_tweak_mode(rig, 1, 1.0)
    left = NAMES.index("left_knee")
    before = seen(rig, [50])[0, left]
    bpy.ops.scope.exchange_sides(start=40, end=52)
    assert np.linalg.norm(seen(rig, [50])[0, left] - before) > 0.1


def test_keys_that_were_added_after_the_motion_do_not_prevent_corrections(rig):
    for curve in fcurves(rig):
        for frame in range(110, 151):
            curve.keyframe_points.insert(frame, curve.evaluate(91))
    before = keys(rig)
    bpy.ops.scope.exchange_sides(start=40, end=52)
    for curve, now in keys(rig).items():
        np.testing.assert_array_equal(now[-41:], before[curve][-41:])


def delete_beginning(rig, before):
    """Delete the keys before a frame."""
    for curve in fcurves(rig):
        points = curve.keyframe_points
        for index in reversed(range(int((read_keys(curve)[:, 0] < before).sum()))):
            points.remove(points[index])


CHANGES = {
    "reduced": lambda rig: bpy.ops.scope.reduce_keys(degrees=40, millimetres=50),
    "loop": lambda rig: bpy.ops.scope.loop(start=12, end=80),
    "cut": lambda rig: delete_beginning(rig, 21),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_poses_beside_fewer_keys_do_not_prevent_corrections(rig, change):
    change(rig)
    for frame in (-20, 150):
        rig.pose.bones["pelvis"].keyframe_insert("rotation_quaternion", frame=frame)
    bpy.ops.scope.foot_stands(start=50, end=55, foot="left")
    assert len(listed_corrections(rig)) == 1
    bpy.ops.scope.smooth()


def test_a_loop_that_was_moved_within_the_captured_frames_is_not_corrected(rig):
    bpy.ops.scope.loop(start=12, end=80)
    first, last = bpy.context.scene.frame_start, bpy.context.scene.frame_end + 1
    move_keys(rig, 1.0, 4.0)
    with pytest.raises(RuntimeError, match=f"loop was made in frames {first} to {last}: put them"):
        bpy.ops.scope.foot_stands(start=50, end=55, foot="left")
    move_keys(rig, 1.0, -4.0)
    bpy.ops.scope.foot_stands(start=50, end=55, foot="left")


def outside(frame):
    return (
        f"Frame {frame} is outside of the captured motion of 'walk', which has frames 1 to 91; go "
        f"to one of these"
    )


def test_the_last_frame_can_be_pinned_and_the_frame_after_it_moves_nothing(rig):
    last = seen(rig, [91])[0]
    bpy.ops.scope.add_pin(joint="left_wrist", frame=91, location=last[WRIST] + [0.1, 0.0, 0.1])
    assert np.linalg.norm(seen(rig, [91])[0, WRIST] - last[WRIST] - [0.1, 0.0, 0.1]) < 0.01
    # frames of the scene between those of the motion, and half a frame after it
    change_rate(bpy.context.scene, 60.0, {rig: None}, [])
    bpy.context.scene.frame_set(182)
    with pytest.raises(RuntimeError, match="Frame 182 is outside .* frames 1 to 181"):
        bpy.ops.scope.add_pin(joint="left_wrist", location=(0, 0, 1))


def test_a_span_is_corrected_as_far_as_there_is_a_motion(rig):
    bpy.ops.scope.foot_stands(start=88, end=92, foot="left")
    (entry,) = listed_corrections(rig)
    assert (entry["first"], entry["last"]) == (88, 91)


def test_a_span_the_wrong_way_round_is_said_with_the_frames_of_the_scene(rig):
    swaps = ("exchange_sides", "flip_limb", "turn_around")
    for operator in ("foot_stands", *swaps, "interpolate_span", "loop"):
        with pytest.raises(
            RuntimeError,
            match="The span ends in frame 30, before it begins in frame 40; swap them",
        ):
            getattr(bpy.ops.scope, operator)(start=40, end=30)


def test_a_span_outside_of_the_motion_is_refused(rig):
    before = keys(rig)
    with pytest.raises(RuntimeError, match=outside(92)):
        bpy.ops.scope.foot_stands(start=92, end=95, foot="left")
    assert_same(keys(rig), before)


def test_a_failure_changes_nothing(rig, monkeypatch):
    before = keys(rig)
    stored = rig["scope_motion"]
    for arguments, message in (
        ({"joint": "left_paw"}, "no joint 'left_paw'"),
        *(({"joint": "head", "frame": frame}, outside(frame)) for frame in (92, -3)),
    ):
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.scope.add_pin(location=(0, 0, 1), **arguments)

    def fail(*_):
        raise OSError("no room")

    monkeypatch.setattr("scope.scope_addon.motion.Motion.to_bytes", fail)
    with pytest.raises(RuntimeError, match="No room"):
        bpy.ops.scope.add_pin(joint="head", location=(0, 0, 2))
    assert rig["scope_motion"] == stored
    assert listed_corrections(rig) == []
    assert bpy.context.scene.frame_current == FRAME
    assert_same(keys(rig), before)


GAPS_FRAMES = range(1, 92)  # of the scene


def pinned(motion, frame):
    """Pin the left wrist of a capture in a scene frame; return the armature, the target, and all
    joints before.
    """
    armature = captured_with(motion)
    before = made_rigs.seen(armature, NAMES, GAPS_FRAMES)
    target = before[frame - 1, NAMES.index("left_wrist")] + [0.1, 0.05, 0.1]
    bpy.ops.scope.add_pin(joint="left_wrist", frame=frame, location=target)
    return armature, target, before


def test_a_pin_in_frames_in_which_the_person_was_not_seen_is_met():
    motion = motion_of(walk(3.0))
    hidden = np.arange(len(motion.valid))[30:60]
    motion.valid[hidden] = False
    motion.joint_confidence[hidden] = 0.0
    motion.residual_px[hidden] = np.nan
    armature, target, before = pinned(motion, 46)
    after = made_rigs.seen(armature, NAMES, GAPS_FRAMES)
    assert np.linalg.norm(after[45, NAMES.index("left_wrist")] - target) < 0.01
    far = np.abs(np.arange(1, 92) - 46) > 0.4 * 30
    np.testing.assert_allclose(after[far], before[far], atol=1e-6)
    assert not stored_motion(armature).valid[hidden].any()  # a pin does not make them seen


def test_a_pin_in_a_gap_of_the_footage_is_refused_and_one_at_its_edge_is_met():
    whole = walk(3.0)
    rows = np.r_[0:31, 60:91]  # as numbered images of which some are missing
    clip = Clip(whole.times[rows], whole.rotations[rows], whole.root[rows])
    motion = replace(motion_of(clip), frames=rows)
    with pytest.raises(
        RuntimeError,
        match="Frame 46 is in a gap of the captured motion of 'walk', where the footage",
    ):
        pinned(motion, 46)
    (armature,) = (obj for obj in bpy.context.scene.objects if "scope_source" in obj)
    assert listed_corrections(armature) == []
    before = made_rigs.seen(armature, NAMES, GAPS_FRAMES)
    target = before[30, NAMES.index("left_wrist")] + [0.1, 0.05, 0.1]
    bpy.ops.scope.add_pin(joint="left_wrist", frame=31, location=target)
    after = made_rigs.seen(armature, NAMES, GAPS_FRAMES)
    assert np.linalg.norm(after[30, NAMES.index("left_wrist")] - target) < 0.01
    np.testing.assert_allclose(after[60:], before[60:], atol=1e-6)
