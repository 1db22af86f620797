# SPDX-License-Identifier: GPL-3.0-or-later
import bpy
import numpy as np
import pytest
from scope.scope_addon.scene import actions


@pytest.fixture
def cube() -> bpy.types.Object:
    mesh = bpy.data.meshes.new("cube")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    obj = bpy.data.objects.new("cube", mesh)
    bpy.context.scene.collection.objects.link(obj)
    obj.shape_key_add(name="Basis")
    obj.shape_key_add(name="Wide")
    return obj


def test_one_action_serves_an_object_and_its_shape_keys(cube):
    action = bpy.data.actions.new("a")
    actions.Channels(cube, action).write("location", np.array([0.0]), np.array([[1.0, 2.0, 3.0]]))
    keys = cube.data.shape_keys
    actions.Channels(keys, action).write(
        actions.shape_key_path("Wide"), np.array([0.0]), np.array([0.5])
    )
    assert (len(actions.fcurves(cube)), len(actions.fcurves(keys))) == (3, 1)
    assert (keys.animation_data.action == action) == actions.has_slots()


def test_quotes_and_backslashes_in_names_are_escaped(cube):
    name = 'a "b" \\ c'
    cube.data.shape_keys.key_blocks["Wide"].name = name
    channels = actions.Channels(cube.data.shape_keys, bpy.data.actions.new("a"))
    channels.write(actions.shape_key_path(name), np.array([0.0]), np.array([0.7]))
    bpy.context.scene.frame_set(3)
    assert cube.data.shape_keys.key_blocks[name].value == pytest.approx(0.7)
    assert actions.bone_path(name, "location") == 'pose.bones["a \\"b\\" \\\\ c"].location'


@pytest.mark.skipif(
    bpy.app.version >= (5, 0, 0), reason="5.0 removed the older interface to actions"
)
def test_the_older_interface_writes_the_same_keys(cube, monkeypatch):
    monkeypatch.setattr(actions, "has_slots", lambda: False)
    action = bpy.data.actions.new("old")
    actions.Channels(cube, action).write(
        "location", np.array([0.0, 1.0]), np.eye(3)[:2], group="Object Transforms"
    )
    channels = actions.Channels(cube.data.shape_keys, action)
    channels.write(actions.shape_key_path("Wide"), np.array([0.0]), np.array([0.5]), "CONSTANT")
    assert [c.data_path for c in action.fcurves] == ["location"] * 3
    np.testing.assert_allclose(actions.read_keys(action.fcurves[1]), [[0, 0], [1, 1]])
    assert channels.action != action
    assert channels.action.id_root == "KEY"
    assert len(actions.fcurves(cube.data.shape_keys)) == 1


@pytest.mark.parametrize(("moving", "last"), [("location", 31.0), ("scale", 200.0)])
def test_a_strip_counts_where_the_active_action_does_not_replace_it(cube, moving, last):
    ends = np.array([1.0, 200.0])
    idle = actions.Channels(cube, bpy.data.actions.new("idle"))
    for channel in ("location", "scale"):
        idle.write(channel, ends, ends[:, None] * np.ones(3) * (channel == moving))
    actions.push_to_nla(cube)
    walk = actions.Channels(cube, bpy.data.actions.new("walk"))
    walk.write("location", np.array([1.0, 31.0]), np.eye(3)[:2])
    assert actions.frame_range([cube]) == (1.0, last)


def test_cycles_come_before_the_users_own_modifiers_and_keep_them(cube):
    actions.Channels(cube, bpy.data.actions.new("a")).write(
        "location", np.arange(3.0), np.zeros((3, 3))
    )
    noise = actions.fcurves(cube)[1].modifiers.new("NOISE")
    noise.strength = 0.25
    noise.phase = 3.5
    for _ in range(2):
        actions.add_cycles(cube, {("location", 0)})
        first, second, third = actions.fcurves(cube)
        assert [m.mode_after for m in first.modifiers] == ["REPEAT_OFFSET"]
        assert [m.type for m in second.modifiers] == ["CYCLES", "NOISE"]
        assert (second.modifiers[1].strength, second.modifiers[1].phase) == (0.25, 3.5)
        assert [m.mode_before for m in third.modifiers] == ["REPEAT"]


@pytest.mark.parametrize("interpolation", ["LINEAR", "BEZIER"])
@pytest.mark.parametrize("off", [-0.009, 0.003])
def test_a_key_within_a_hundredth_of_a_frame_is_changed_as_where_blender_inserts_one(
    cube, off, interpolation
):
    channels = actions.Channels(cube, bpy.data.actions.new("a"))
    frames = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 4.012, 5.0, 6.0])
    new = np.array([1.5, 3.0 + off, 4.0115, 5.0 + off, 5.5])
    values = np.arange(20.0, 25.0)
    curves = [channels.write(path, frames, frames, interpolation)[0] for path in ('["x"]', '["y"]')]
    actions.change_keys(curves[0], new, values)
    for frame, value in zip(new.tolist(), values.tolist(), strict=True):
        curves[1].keyframe_points.insert(frame, value, options={"FAST"})
    curves[1].update()
    found = actions.read_keys(curves[0])
    assert len(found) == len(frames) + 2
    np.testing.assert_array_equal(found, actions.read_keys(curves[1]))


@pytest.mark.parametrize("interpolation", ["LINEAR", "BEZIER"])
def test_keys_that_are_added_are_those_that_blender_inserts(cube, interpolation):
    """Whatever the handles, kinds and selection of the keys around them."""
    rng = np.random.default_rng(0)
    channels = actions.Channels(cube, bpy.data.actions.new("a"))
    frames, new = (np.sort(rng.choice(200, 60, replace=False)) / 2 for _ in range(2))
    curves = [
        channels.write(path, frames, np.sin(frames), interpolation)[0]
        for path in ('["x"]', '["y"]')
    ]
    for curve in curves:
        for key in list(curve.keyframe_points)[::3]:
            key.handle_left_type = key.handle_right_type = "FREE"
            key.select_control_point = True
            key.type = "EXTREME"
    actions.change_keys(curves[0], new, np.cos(new))
    missing = dict(zip(new.tolist(), np.cos(new).tolist(), strict=True))
    for key in curves[1].keyframe_points:
        key.co.y = missing.pop(key.co.x, key.co.y)
    for frame, value in missing.items():
        curves[1].keyframe_points.insert(frame, value, options={"FAST"}).interpolation = "LINEAR"
    curves[1].update()
    found, expected = (actions.read_whole_keys(curve) for curve in curves)
    for name, rows in expected.items():
        np.testing.assert_array_equal(found[name], rows, err_msg=name)
