# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tool with the handles says when a drag ends. ./scripts/blender --part pins moves the
mouse.

Where a drag began and ended, from events as a busy Blender 4.3 gives them in a window without
the focus.
"""

from types import SimpleNamespace

import bpy
import bpy_extras.view3d_utils
import pytest
from mathutils import Vector
from scope.scope_addon.scene.character.correction_list import listed_corrections
from scope.scope_addon.ui import pin_tool
from scope.scope_addon.ui.viewports import Pointer

from ...edit.walking import motion_of, walk
from ...scene.made_rigs import captured_with


class Tool:
    """The operator without a window: what it reports, and the texts of the status bar, the last one
    last.
    """

    def __init__(self, armature):
        self.reported = []
        self.status = []
        self._session = SimpleNamespace(
            armature=armature.name,
            dragged="",
            hovered="",
            start=(0.0, 0.0),
            mouse=(0.0, 0.0),
            area=0,
        )

    def report(self, kind, text):
        self.reported.append((kind, text))

    def drop(self, monkeypatch, place):
        """End a drag of the left wrist at a place in the scene."""
        monkeypatch.setattr(
            bpy_extras.view3d_utils, "location_3d_to_region_2d", lambda *_: Vector((0.0, 0.0))
        )
        monkeypatch.setattr(bpy_extras.view3d_utils, "region_2d_to_location_3d", lambda *_: place)
        self._session.dragged = "left_wrist"
        self._session.mouse = (50.0, 0.0)
        workspace = SimpleNamespace(status_text_set=self.status.append)
        context = SimpleNamespace(
            scene=bpy.context.scene,
            view_layer=bpy.context.view_layer,
            selected_objects=[],
            workspace=workspace,
        )
        space = SimpleNamespace(region_3d=SimpleNamespace(view_perspective="ORTHO"))
        area = SimpleNamespace(spaces=SimpleNamespace(active=space))
        pin_tool.SCOPE_OT_pin_limb._drop(self, context, area, None)


@pytest.fixture
def rig():
    armature = captured_with(motion_of(walk(1.0)))
    bpy.context.scene.frame_set(15)
    return armature


def head_of(rig, joint):
    bpy.context.view_layer.update()
    return rig.matrix_world @ rig.pose.bones[joint].head


def test_a_pin_that_was_missed_is_in_the_status_bar_and_reported(rig, monkeypatch):
    tool = Tool(rig)
    tool.drop(monkeypatch, head_of(rig, "left_shoulder") + Vector((1.1, 0.0, 0.0)))
    missed = listed_corrections(rig)[0]["missed"]
    [text] = tool.status
    assert text.startswith(f"Left Wrist cannot reach the pin and stays {missed} away")
    assert tool.reported == [({"WARNING"}, text)]


def test_a_pin_that_was_met_leaves_the_status_bar_as_it_is(rig, monkeypatch):
    tool = Tool(rig)
    tool.drop(monkeypatch, head_of(rig, "left_wrist") + Vector((0.03, 0.0, 0.05)))
    assert [entry["missed"] for entry in listed_corrections(rig)] == [""]
    assert (tool.status, tool.reported) == ([], [])


def test_a_drag_in_a_scene_without_the_person_is_refused_with_the_reason(rig, monkeypatch):
    tool = Tool(rig)
    bpy.context.window.scene = bpy.data.scenes.new("other")
    tool.drop(monkeypatch, Vector((0.0, 0.0, 1.0)))
    ((kind, text),) = tool.reported
    assert kind == {"ERROR"}
    assert text.startswith("'walk' is not in the scene's view layer: ")
    assert listed_corrections(rig) == []


def test_a_late_press_was_where_the_mouse_had_moved_before():
    pointer = Pointer()
    events = (
        ("INBETWEEN_MOUSEMOVE", 397, 501),
        ("MOUSEMOVE", 400, 501),
        ("LEFTMOUSE", 460, 461),  # pressed at (400, 501), handled when the drag was over
        ("INBETWEEN_MOUSEMOVE", 430, 481),
        ("MOUSEMOVE", 460, 461),
        ("LEFTMOUSE", 500, 400),  # released at (460, 461)
    )
    places = [pointer.place(SimpleNamespace(type=t, mouse_x=x, mouse_y=y)) for t, x, y in events]
    assert places == [(397, 501), (400, 501), (400, 501), (430, 481), (460, 461), (460, 461)]


def test_before_any_movement_the_place_is_that_of_the_event():
    assert Pointer().place(SimpleNamespace(type="LEFTMOUSE", mouse_x=3, mouse_y=4)) == (3, 4)
