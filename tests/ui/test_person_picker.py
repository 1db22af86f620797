# SPDX-License-Identifier: GPL-3.0-or-later
"""The person who is captured, chosen by a click; ./scripts/blender --part details clicks with the
mouse.
"""

import shutil
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from scope.scope_addon.capture.options import parse_person
from scope.scope_addon.job.footage_picture import FootagePicture
from scope.scope_addon.ui import person_picker
from scope.scope_addon.ui.capture_job import capture_request
from scope.scope_addon.ui.person_picker import SCOPE_OT_pick_person, box_of_picture, person_at
from scope.solver.errors import ScopeError

SIZE = (1920, 1080)
VISIBLE = (60.0, 1020.0, 0.0, 700.0)


def test_a_click_on_a_pixel_gives_that_pixel():
    left, right, bottom, top = box = box_of_picture(SIZE, VISIBLE)
    assert (left, right) == (60.0, 1020.0)
    assert (bottom + top) / 2 == 350.0
    assert (top - bottom) / (right - left) == pytest.approx(1080 / 1920)
    for pixel in ((0, 0), (1919, 1079), (640, 360)):
        across, down = (np.array(pixel) + 0.5) / SIZE
        mouse = left + across * (right - left), top - down * (top - bottom)
        chosen = parse_person(person_at(mouse, box, SIZE, 2.517))
        assert (chosen.x, chosen.y) == pixel
        assert chosen.time_s == pytest.approx(2.52)


def test_a_click_beside_the_frame_chooses_nobody():
    box = box_of_picture(SIZE, VISIBLE)
    for mouse in ((59.0, 350.0), (1021.0, 350.0), (500.0, 0.0), (500.0, 699.0)):
        assert person_at(mouse, box, SIZE, 0.0) is None


class Tool:
    """The operator without a window, over a viewport that is all visible."""

    _listen = SCOPE_OT_pick_person._listen

    def __init__(self, answers):
        self.asked = []
        self.ended = False
        self.reported = []
        self._area = 1
        self._time_s = 0.0
        self._pointer = SimpleNamespace(place=lambda event: event.place)
        self._picture = None
        self._process = SimpleNamespace(answer=lambda: answers.pop(0), close=lambda: None)

    def report(self, kind, text):
        self.reported.append((kind, text))

    def cancel(self, _context):
        self.ended = True

    def _ask(self, _context, time_s):
        self.asked.append(time_s)
        return True

    def send(self, kind, place=(0, 0)):
        event = SimpleNamespace(type=kind, value="PRESS", place=place)
        return SCOPE_OT_pick_person.modal(self, bpy.context, event)


@pytest.fixture
def viewport(monkeypatch):
    region = SimpleNamespace(x=100, y=20)
    monkeypatch.setattr(person_picker, "region_at", lambda _: (None, region))
    monkeypatch.setattr(person_picker, "redraw_viewport", lambda _: None)
    monkeypatch.setattr(
        person_picker.comparison, "visible_part", lambda *_: (0.0, 400.0, 0.0, 300.0)
    )


def test_a_click_stores_the_place_and_the_time_of_the_frame(viewport):
    scene = bpy.context.scene
    tool = Tool([None, FootagePicture(b"", (400, 300), (800, 600), 2.0)])
    assert tool.send("LEFTMOUSE", (300, 170)) == {"RUNNING_MODAL"}  # before the frame is there
    assert tool.send("TIMER") == tool.send("TIMER") == {"PASS_THROUGH"}
    assert tool.send("RIGHT_ARROW") == {"RUNNING_MODAL"}
    assert tool.asked == [3.0]
    assert tool.send("LEFTMOUSE", (99, 170)) == {"RUNNING_MODAL"}  # beside it
    assert not tool.ended
    assert tool.send("LEFTMOUSE", (300, 170)) == {"FINISHED"}
    assert tool.ended
    chosen = parse_person(scene.scope.person)
    assert (chosen.x, chosen.y) == pytest.approx((400, 300), abs=1.0)
    assert chosen.time_s == 2.0


@pytest.mark.parametrize("key", ["ESC", "RIGHTMOUSE"])
def test_escape_leaves_the_choice_as_it_was(viewport, key):
    bpy.context.scene.scope.person = "3,4"
    tool = Tool([FootagePicture(b"", (4, 3), (4, 3), 0.0)])
    tool.send("TIMER")
    assert tool.send(key) == {"CANCELLED"}
    assert tool.ended
    assert bpy.context.scene.scope.person == "3,4"


def test_the_request_has_the_chosen_person_until_other_footage_is_chosen(footage):
    scene = bpy.context.scene
    bpy.ops.scope.choose_footage(filepath=str(footage))
    assert capture_request(scene).values["person"] == ""
    scene.scope.person = "640,360@2.50"
    assert capture_request(scene).values["person"] == "640,360@2.50"
    bpy.ops.scope.choose_footage(filepath=str(footage))
    assert scene.scope.person == "640,360@2.50"
    other = footage.with_name("other.png")
    shutil.copy(footage, other)
    bpy.ops.scope.choose_footage(filepath=str(other))
    assert scene.scope.person == ""


def test_it_needs_one_video(footage):
    context = SimpleNamespace(area=SimpleNamespace(type="VIEW_3D"), scene=bpy.context.scene)
    assert not SCOPE_OT_pick_person.poll(context)
    bpy.ops.scope.choose_footage(filepath=str(footage))
    assert SCOPE_OT_pick_person.poll(context)
    context.scene.scope.person = "640,360@2.50"
    bpy.ops.scope.add_view(filepath=str(footage))
    assert not SCOPE_OT_pick_person.poll(context)
    with pytest.raises(ScopeError, match="Person is a place in one video"):
        capture_request(context.scene)
    bpy.ops.scope.remove_view(index=0)
    assert SCOPE_OT_pick_person.poll(context)
    context.scene.scope.queue.add().footage = str(footage)
    assert not SCOPE_OT_pick_person.poll(context)
