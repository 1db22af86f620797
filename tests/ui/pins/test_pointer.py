# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a drag began and ended, from events as a busy Blender 4.3 gives them in a window without
the focus.
"""

from types import SimpleNamespace

from scope.scope_addon.ui.pins.pointer import Pointer


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
