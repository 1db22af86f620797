# SPDX-License-Identifier: GPL-3.0-or-later
"""Correct a captured motion in a Blender with a window: drag handles with the mouse, undo, smooth,
remove.

Usage: ``blender --python pins.py -- VIDEO OUT_FOLDER``
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from shared.file_state import curves_of
from shared.session import (
    FOOTAGE,
    OUT,
    captured,
    click,
    invoke,
    key,
    picture,
    press,
    run,
    show_tab,
    until,
    use,
    viewport,
)

# On a screen of 1600 x 1000, in the comparison of the only capture.
DOCUMENTATION = (1222, 97)
RAW = (1086, 529)
NORMAL = (1165, 529)
STRONG = (1244, 529)
LEFT_FOOT_STANDS = (1105, 811)
EXCHANGE = (1175, 836)
UPRIGHT_LINE = (1175, 863)
FLOOR_HERE = (1175, 888)
report: dict[str, object] = {"blender": bpy.app.version_string}


def rig() -> bpy.types.Object:
    """Return the captured armature."""
    return next(o for o in bpy.data.objects if o.type == "ARMATURE" and "scope_source" in o)


def listed() -> list[dict]:
    """Return the corrections that the panel lists."""
    return json.loads(rig().get("scope_corrections", "[]"))


def on_screen(joint: str, area: bpy.types.Area | None = None) -> tuple[float, float]:
    """Return where a joint is on the screen, in pixels from the top left, by default in the first
    viewport.
    """
    here = viewport()
    armature = rig()
    here["window"].view_layer.update()
    place = armature.matrix_world @ armature.pose.bones[joint].head
    area = area or here["area"]
    region = next(region for region in area.regions if region.type == "WINDOW")
    x, y = location_3d_to_region_2d(region, area.spaces.active.region_3d, place)
    return region.x + x, here["window"].height - (region.y + y)


def xdotool(*steps: object) -> None:
    """Send steps of the mouse while Blender keeps running."""
    subprocess.Popen(["xdotool", *map(str, steps)])


def move(x: float, y: float) -> list[object]:
    """Return xdotool's step that moves the mouse."""
    return ["mousemove", round(x), round(y), "sleep", "0.3"]


def drag(joint: str, by: tuple[int, int], name: str = "") -> Iterator[float]:
    """Drag a handle; take a screenshot before it is dropped."""
    x, y = on_screen(joint)
    xdotool(
        *move(x - 3, y),
        *move(x, y),
        "mousedown",
        1,
        "sleep",
        "0.3",
        *move(x + by[0] / 2, y + by[1] / 2),
    )
    yield 2.5
    xdotool(*move(x + by[0], y + by[1]))
    yield 1.5
    if name:
        picture(name)
    count = len(listed())
    xdotool("mouseup", 1)
    yield from until(lambda: len(listed()) == count + 1, 30, f"the correction of {joint}")
    yield 1.0


def off(joint: str, target: tuple[float, float], area: bpy.types.Area | None = None) -> float:
    """Return how far a joint is from a place on the screen, pixels."""
    x, y = on_screen(joint, area)
    return round(((x - target[0]) ** 2 + (y - target[1]) ** 2) ** 0.5, 2)


def steps() -> Iterator[float]:
    """Run the session."""
    scene = bpy.context.scene
    viewport()["area"].spaces.active.show_region_ui = True
    yield 1.0
    show_tab()
    yield 1.0
    bpy.ops.scope.choose_footage(filepath=FOOTAGE)
    scene.scope.quality = "FAST"
    yield from captured(1300.0)
    use(bpy.ops.scope.look_through)
    first = scene.frame_start
    frame = first + (scene.frame_end - first) // 2
    scene.frame_set(frame)
    invoke(bpy.ops.ed.undo_push, message="Frame")  # as scrubbing does
    yield 1.5
    yield from pressed()
    yield from upright_line_from_the_side()
    invoke(bpy.ops.scope.pin_limb, "INVOKE_DEFAULT")
    yield 1.0
    picture("pins_1_handles")
    yield from hidden_by_its_button()

    was = on_screen("left_wrist")
    shoulder = on_screen("left_shoulder")
    # where a bent arm reaches
    by = round(0.3 * (shoulder[0] - was[0])), round(0.3 * (shoulder[1] - was[1]))
    yield from dragged(was, by)
    yield from corrected(first, frame)
    yield from disabled()
    missed = {k: v for k, v in report.items() if k.endswith("_px") and v > 2.5}
    (OUT / "pins.json").write_text(json.dumps(report))
    assert not missed, missed


def pressed() -> Iterator[float]:
    """Press the buttons of the panel with the mouse, and the OK of their dialogs; undo each."""
    browser = OUT / "browser.sh"
    opened = OUT / "opened"
    browser.write_text(f'#!/bin/sh\necho "$1" >{opened}\n')
    browser.chmod(0o755)
    os.environ["BROWSER"] = str(browser)
    yield from press(DOCUMENTATION, opened.exists)
    page = opened.read_text("utf-8").strip()
    assert Path(page.removeprefix("file://")).is_file(), page
    found = []
    for place in (RAW, STRONG, NORMAL):
        before = keys()
        yield from press(place, lambda before=before: keys() != before)
        found.append(keys())
    assert found[0] != found[1] != found[2] != found[0]
    before = keys()
    for place, kind in ((LEFT_FOOT_STANDS, "CONTACT"), (EXCHANGE, "EXCHANGE")):
        yield from confirmed(
            place, lambda kind=kind: [entry["kind"] for entry in listed()] == [kind]
        )
        assert keys() != before
        yield from undone(before)
    # Blender's preferences would warn of the extension.
    assert not [name for name in sys.modules if name.partition(".")[0] == "scope"]
    yield from press(FLOOR_HERE, lambda: [entry["kind"] for entry in listed()] == ["FLOOR"])
    yield from undone(before)


def undone(before: list[list[float]]) -> Iterator[float]:
    """Undo the only correction: the keys are as before."""
    invoke(bpy.ops.ed.undo)
    yield 0.5
    assert listed() == []
    assert keys() == before


def confirmed(place: tuple[int, int], happened: Callable[[], bool]) -> Iterator[float]:
    """Click a button that opens a dialog, and confirm it, until something has happened."""
    for _ in range(6):
        click(*place)
        yield 2.0
        # with the mouse on the dialog, which stays open then
        subprocess.run(["xdotool", "key", "Return"], check=True)
        for _ in range(20):
            yield 0.1
            if happened():
                return
        subprocess.run(["xdotool", "key", "Escape"], check=True)
        yield 0.5
    raise RuntimeError(f"the dialog of the button at {place} was not confirmed")


def upright_line_from_the_side() -> Iterator[float]:
    """Draw the upright line in the view from the side; the tool begins with its button beside the
    footage.
    """
    use(bpy.ops.scope.side_view)
    yield 2.0
    window = viewport()["window"]
    camera = bpy.context.scene.camera
    before = keys()
    area = next(
        a for a in window.screen.areas if a.type == "VIEW_3D" and a.spaces.active.lock_object
    )
    yield from press(UPRIGHT_LINE, lambda: len(window.modal_operators) > 0)
    was = camera.matrix_world.copy()
    (x, y) = on_screen("left_ankle", area)
    xdotool(*move(x - 3, y), *move(x, y), "mousedown", 1, "sleep", "0.3", *move(x + 12, y - 180))
    yield 2.0
    xdotool(*move(x + 20, y - 300))
    yield 1.0
    picture("pins_9_upright_from_the_side")
    xdotool("mouseup", 1)
    yield from until(
        lambda: [entry["kind"] for entry in listed()] == ["UPRIGHT"], 20, "the upright line"
    )
    yield 0.5
    turned = camera.matrix_world.to_quaternion().rotation_difference(was.to_quaternion()).angle
    report["upright_from_the_side_deg"] = round(math.degrees(turned), 2)
    assert abs(math.degrees(turned) - math.degrees(math.atan2(20, 300))) < 0.3, report
    yield from undone(before)
    use(bpy.ops.scope.side_view)
    yield 1.0


def tools() -> int:
    """Return how often the tool runs."""
    return [each.bl_idname for each in viewport()["window"].modal_operators].count(
        "SCOPE_OT_pin_limb"
    )


def disabled() -> Iterator[float]:
    """Disable the extension while the handles are shown."""
    invoke(bpy.ops.scope.pin_limb, "INVOKE_DEFAULT")
    x, y = on_screen("head")
    xdotool(*move(x - 60, y), *move(x - 64, y))
    yield from until(lambda: drawn("left_hip"), 30, "the handles")
    name = next(a.module for a in bpy.context.preferences.addons if a.module.endswith(".scope"))
    bpy.ops.preferences.addon_disable(module=name)
    xdotool(*move(x - 60, y), *move(x - 64, y))
    yield from until(lambda: not drawn("left_hip"), 30, "the handles to go with the extension")


def drawn(joint: str, area: bpy.types.Area | None = None) -> bool:
    """Return whether a white handle is drawn on a joint; the suit under it is dark."""
    return min(pixels(joint, area)) > 180


def is_orange(joint: str) -> bool:
    """Return whether the handle on a joint is that of a pin that was missed."""
    red, green, blue = pixels(joint)[12:15]
    return red > 200 and 80 < green < 180 and blue < 100


def pixels(joint: str, area: bpy.types.Area | None = None) -> bytes:
    """Return the colors of the 3 x 3 pixels on a joint."""
    x, y = on_screen(joint, area)
    place = f"3x3+{round(x) - 1}+{round(y) - 1}"
    command = ["import", "-window", "root", "-crop", place, "-depth", "8", "rgb:-"]
    return subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout


def hidden_by_its_button() -> Iterator[float]:
    """Press the tool's button again, which hides the handles, and once more, which shows them."""
    for expected in (0, 1):
        invoke(bpy.ops.scope.pin_limb, "INVOKE_DEFAULT")
        x, y = on_screen("head")
        xdotool(*move(x - 60, y), *move(x - 64, y))  # a tool ends at its next event
        yield from until(
            lambda wanted=expected: tools() == wanted and drawn("left_hip") == bool(wanted),
            30,
            f"{expected} tools",
        )


def dragged_in_side_view(joint: str, by: tuple[int, int]) -> Iterator[float]:
    """Drag a handle in the view from the side, which pins the joint in space."""
    use(bpy.ops.scope.side_view)
    yield 1.0
    area = next(
        a
        for a in viewport()["window"].screen.areas
        if a.type == "VIEW_3D" and a.spaces.active.lock_object
    )
    # an arm can cover one
    legs = [f"{side}_{name}" for name in ("hip", "knee", "ankle") for side in ("left", "right")]
    yield from until(
        lambda: drawn("left_hip") and any(drawn(each, area) for each in legs),
        30,
        "the handles in both views",
    )
    before = len(listed())
    (x, y) = on_screen(joint, area)
    xdotool(
        *move(x - 3, y),
        *move(x, y),
        "mousedown",
        1,
        "sleep",
        "0.3",
        *move(x + by[0] / 2, y + by[1] / 2),
    )
    yield 2.0
    picture("pins_6_side_view")
    xdotool(*move(x + by[0], y + by[1]), "mouseup", 1)
    yield from until(lambda: len(listed()) > before, 30, "the correction in the side view")
    yield 1.0
    assert [e["joint"] for e in listed()[before:]] == [joint], listed()
    report["dragged_in_side_view_px"] = off(joint, (x + by[0], y + by[1]), area)
    invoke(bpy.ops.ed.undo)
    yield 1.0
    use(bpy.ops.scope.side_view)
    yield 1.0


def dragged(was: tuple[float, float], by: tuple[int, int]) -> Iterator[float]:
    """Drag two handles, the first by some pixels; undo, redo, cancel and smooth."""
    target = was[0] + by[0], was[1] + by[1]
    yield from drag("left_wrist", by, "pins_2_dragged")
    assert len(listed()) == 1, listed()
    report["missed_px"] = off("left_wrist", target)
    picture("pins_3_dropped")
    yield from drag("right_ankle", (-30, -20))
    assert [e["joint"] for e in listed()] == ["left_wrist", "right_ankle"], listed()
    report["first_after_second_px"] = off("left_wrist", target)

    invoke(bpy.ops.ed.undo)
    invoke(bpy.ops.ed.undo)
    yield 1.0
    assert listed() == [], listed()
    report["undone_px"] = off("left_wrist", was)
    invoke(bpy.ops.ed.redo)
    yield 1.0
    assert len(listed()) == 1, listed()
    report["redone_px"] = off("left_wrist", target)
    x, y = on_screen("left_wrist")  # Escape during a drag changes nothing
    xdotool(
        *move(x, y),
        "mousedown",
        1,
        "sleep",
        "0.3",
        *move(x + 40, y),
        "key",
        "Escape",
        "sleep",
        "0.3",
        "mouseup",
        1,
    )
    yield 3.0
    yield from until(lambda: off("left_wrist", target) < 2.5, 30, "the wrist to go back")
    assert len(listed()) == 1
    report["escaped_px"] = off("left_wrist", target)
    for strength in (0.0, 2.5, 1.0):
        use(bpy.ops.scope.smooth, strength=strength)
        yield 0.5
        report[f"smoothed_{strength}_px"] = off("left_wrist", target)
    yield from dragged_while_busy("left_ankle", (24, -20))
    yield from dragged_out_of_reach()
    yield from dragged_in_side_view("right_wrist", (-20, -15))
    key("Escape")
    yield 1.0


def dragged_while_busy(joint: str, by: tuple[int, int]) -> Iterator[float]:
    """Drag a handle while Blender does not react: the drag is over before Blender handles the
    press.
    """
    before = len(listed())
    (x, y) = on_screen(joint)
    xdotool(*move(x - 3, y), *move(x, y), "mousedown", 1, *move(x + by[0], y + by[1]), "mouseup", 1)
    time.sleep(3.0)
    yield from until(lambda: len(listed()) > before, 30, "the correction of a drag that was over")
    yield 1.0
    assert [e["joint"] for e in listed()[before:]] == [joint], listed()
    report["dragged_while_busy_px"] = off(joint, (x + by[0], y + by[1]))
    invoke(bpy.ops.ed.undo)
    yield 1.0


def dragged_out_of_reach() -> Iterator[float]:
    """Drag a wrist farther away than the arm is long: its handle is orange, as long as the pin is
    there.
    """
    before = len(listed())
    wrist = on_screen("right_wrist")
    shoulder = on_screen("right_shoulder")
    yield from drag("right_wrist", (round(wrist[0] - shoulder[0]), round(wrist[1] - shoulder[1])))
    assert [bool(e["missed"]) for e in listed()[before:]] == [True], listed()
    yield from until(lambda: is_orange("right_wrist"), 20, "the orange handle")
    picture("pins_10_missed")
    invoke(bpy.ops.ed.undo)
    yield 1.0


def corrected(first: int, frame: int) -> Iterator[float]:
    """Correct in space and over spans, and remove everything."""
    use(bpy.ops.scope.look_through)
    yield 1.5
    began = time.monotonic()
    use(bpy.ops.scope.add_pin, joint="head", location=place("head") + Vector((0.0, 0.05, 0.0)))
    report["pin_s"] = round(time.monotonic() - began, 2)
    use(bpy.ops.scope.foot_stands, start=frame + 20, end=frame + 30, foot="left")
    use(bpy.ops.scope.exchange_sides, start=first + 5, end=first + 12)
    sidebar = next(r for r in viewport()["area"].regions if r.type == "UI")
    sidebar.tag_redraw()
    yield 1.0
    picture("pins_4_panel")
    scroll(sidebar)
    yield 1.5
    picture("pins_5_list")
    use(bpy.ops.scope.remove_correction, index=-1)
    yield 1.0
    assert listed() == []
    out_of_reach()
    upright_line()
    yield from floor_here(frame)
    yield from kept_edits(first, frame)


def upright_line() -> None:
    """Turn the world by a line near the image's middle; without it, the keys are the same to the
    bit.
    """
    before = keys()
    (width, height) = bpy.context.scene.scope.result.resolution
    use(
        bpy.ops.scope.set_upright,
        start=(0.5 * width, 0.2 * height),
        end=(0.52 * width, 0.8 * height),
    )
    assert [entry["kind"] for entry in listed()] == ["UPRIGHT"]
    assert keys() != before
    use(bpy.ops.scope.remove_correction, index=0)
    assert keys() == before
    assert listed() == []


def floor_here(frame: int) -> Iterator[float]:
    """Say that the lower foot rests on the floor: it does, whatever the smoothing, until the
    correction is removed.
    """
    use(bpy.ops.scope.smooth, strength=1.0)  # writes keys as below
    scene = bpy.context.scene
    before = keys()
    scene.frame_set(frame)
    camera = scene.camera.matrix_world.translation.z
    use(bpy.ops.scope.floor_here)
    assert [entry["kind"] for entry in listed()] == ["FLOOR"]
    moved = scene.camera.matrix_world.translation.z - camera
    yield 1.0
    picture("pins_7_floor")
    report["lowest_on_the_floor_cm"] = round(100 * lowest_skin(), 2)
    assert abs(report["lowest_on_the_floor_cm"]) < 0.3, report
    use(bpy.ops.scope.smooth, strength=2.5)
    use(bpy.ops.scope.smooth, strength=1.0)
    assert abs(100 * lowest_skin()) < 0.3, lowest_skin()
    assert abs(scene.camera.matrix_world.translation.z - camera - moved) < 1e-5
    use(bpy.ops.scope.remove_correction, index=0)
    assert listed() == []
    assert abs(scene.camera.matrix_world.translation.z - camera) < 1e-6
    assert keys() == before


def kept_edits(first: int, frame: int) -> Iterator[float]:
    """Interpolate frames, swap sides and put feet on the floor, which smoothing keeps, until they
    are taken back.
    """
    before = keys()
    frames = (first + 8, frame - 2, frame, frame + 2, frame + 10)
    captured_there = places(frames)
    use(bpy.ops.scope.interpolate_span, start=frame - 4, end=frame + 4)
    use(bpy.ops.scope.exchange_sides, start=first + 5, end=first + 12, limbs="legs")
    began = time.monotonic()
    use(bpy.ops.scope.refloor)
    report["feet_to_floor_s"] = round(time.monotonic() - began, 2)
    kinds = ["EXCHANGE", "INTERPOLATION", "FEET"]
    assert [entry["kind"] for entry in listed()] == kinds, listed()
    edited_there = places(frames)
    assert apart(edited_there, captured_there) > 0.02
    yield 1.0
    picture("pins_8_edits")
    for strength in (2.5, 1.0):
        use(bpy.ops.scope.smooth, strength=strength)
        yield 0.5
    report["edits_after_smoothing_mm"] = round(1000 * apart(places(frames), edited_there), 3)
    assert report["edits_after_smoothing_mm"] < 0.1, report
    for _ in range(3):  # both smoothings and the feet
        invoke(bpy.ops.ed.undo)
    yield 1.0
    assert [entry["kind"] for entry in listed()] == kinds[:2], listed()
    invoke(bpy.ops.ed.redo)
    yield 1.0
    assert [entry["kind"] for entry in listed()] == kinds, listed()
    assert apart(places(frames), edited_there) < 1e-5
    for _ in kinds:
        use(bpy.ops.scope.remove_correction, index=0)
    assert listed() == []
    assert keys() == before


def places(frames: tuple[int, ...]) -> list[Vector]:
    """Return where the wrists, knees and the pelvis are in some frames."""
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        found += [
            place(joint)
            for joint in ("left_wrist", "right_wrist", "left_knee", "right_knee", "pelvis")
        ]
    return found


def apart(these: list[Vector], those: list[Vector]) -> float:
    """Return the largest distance between two lists of places, metres."""
    return max((a - b).length for a, b in zip(these, those, strict=True))


def lowest_skin() -> float:
    """Return the height of the body's lowest vertex in the current frame, metres."""
    viewport()["window"].view_layer.update()
    body = next(
        o
        for o in rig().users_collection[0].objects
        if o.type == "MESH" and o.find_armature() == rig()
    )
    posed = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = posed.to_mesh()
    lowest = min((posed.matrix_world @ vertex.co).z for vertex in mesh.vertices)
    posed.to_mesh_clear()
    return lowest


def out_of_reach() -> None:
    """Pin a wrist a metre away: the body stays, and without the pin the keys are the same to the
    bit.
    """
    before = keys()
    shoulder = place("left_shoulder")
    pelvis = place("pelvis")
    use(
        bpy.ops.scope.add_pin,
        joint="left_wrist",
        location=shoulder + Vector((1.1, 0.0, 0.0)),
        in_image=False,
    )
    report["out_of_reach"] = listed()[0]["missed"]
    report["pelvis_moved_cm"] = round(100 * (place("pelvis") - pelvis).length, 2)
    assert report["pelvis_moved_cm"] < 3.5, report
    assert 40 < float(listed()[0]["missed"].removesuffix(" cm")) < 70, listed()
    use(bpy.ops.scope.remove_correction, index=0)
    assert keys() == before


def place(joint: str) -> Vector:
    """Return where a joint is in the scene."""
    viewport()["window"].view_layer.update()
    return rig().matrix_world @ rig().pose.bones[joint].head


def keys() -> list[list[float]]:
    """Return the keys of all curves of the captured armature."""
    found = []
    for curve in curves_of(rig().animation_data.action):
        values = [0.0] * (2 * len(curve.keyframe_points))
        curve.keyframe_points.foreach_get("co", values)
        found.append(values)
    return found


def scroll(sidebar: bpy.types.Region) -> None:
    """Scroll the sidebar down with the wheel."""
    x = sidebar.x + sidebar.width // 2
    xdotool("mousemove", x, 500, "click", "--repeat", 14, "--delay", 40, 5)


run(steps())
