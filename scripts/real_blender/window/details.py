# SPDX-License-Identifier: GPL-3.0-or-later
"""What an animator meets around captures, in a Blender with a window: two captures compared, rates,
rigs, files.

Usage: ``blender --python details.py -- VIDEO OUT_FOLDER``
"""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
import sys
from collections.abc import Generator, Iterator
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from shared.file_state import curves_of
from shared.session import (
    FOOTAGE,
    OUT,
    captured,
    invoke,
    key,
    picture,
    press,
    run,
    show_tab,
    strips,
    until,
    use,
    viewport,
)

# On a screen of 1600 x 1000, of which a laptop of 1366 x 768 shows the first 768 pixels, with two
# captures in the list.
FBX_BUTTON = (1078, 453)
RAW_BUTTON = (1085, 622)
FOLD = 768
FOLDER_BUTTON = (1231, 128)  # beside the footage, before that which adds a camera
# Names of files, and by operator which of them the file browser shows at first.
FOOTAGE_FILES = ("a.mp4", "b.MTS", "c.ts", "d.webm", "e.flv", "f.heic", "g_0001.png")
FILES = (*FOOTAGE_FILES, "net.onnx", "notes.txt", "odd.xyz", "pose.npz", "x.json")
BROWSERS = (
    ("import_video", {}, FOOTAGE_FILES),
    ("import_motion", {}, ("pose.npz",)),
    ("load_bone_map", {}, ("x.json",)),
    ("choose_file", {"owner": "scope", "setting": "body_file"}, ("pose.npz",)),
    ("choose_file", {"owner": "scope", "setting": "calibration_file"}, ("x.json",)),
    ("choose_file", {"owner": "scope_live", "setting": "file"}, FOOTAGE_FILES[:5]),
    ("choose_file", {"owner": "preferences", "setting": "detector_file"}, ("net.onnx",)),
)
WIDTH, HEIGHT = 640, 480  # of the footage
STILL = OUT / "still.npz"
LOW = OUT / "low.npz"
FRAMES = 120
RATE = 60.0
# By its code: for the name, xdotool holds Alt where the keyboard's layout has F3 on several levels.
F3 = "69"
# words, how many of Blender's own entries they find first, the operator after these, and its format
SEARCHED = (
    ("motion capture", 2, "import_video", ""),
    ("mocap", 0, "import_video", ""),
    ("video", 1, "import_video", ""),
    ("smpl motion", 0, "import_motion", ""),
    ("captured motion as bvh", 0, "export", "BVH"),
)
report: dict[str, object] = {}


def space() -> bpy.types.SpaceView3D:
    """Return the first viewport's settings."""
    return viewport()["area"].spaces.active


def select(take: str) -> None:
    """Select a capture in the list."""
    bpy.context.scene.scope.capture_index = bpy.data.collections.find(take)


def warnings() -> list[str]:
    """Return the warnings that the panel shows."""
    return [warning.text for warning in bpy.context.scene.scope.result.warnings]


def two_captures() -> Iterator[float]:
    """Capture a clip twice, the second time from the cache, in a scene with another frame rate than
    the clip.
    """
    scene = bpy.context.scene
    scene.render.fps = 20
    scene.scope.quality = "FAST"
    scene.scope.frame_rate = "KEEP"
    bpy.ops.scope.choose_footage(filepath=FOOTAGE)
    for take in ("first", "second"):
        scene.scope.take = take
        yield from captured()
        assert scene.scope.result.collection.name == take
        assert any("keeps its 20 frames/s, the footage has" in text for text in warnings()), (
            warnings()
        )


def picked() -> Iterator[float]:
    """Click the person to capture in the first frame of the footage; Escape keeps the choice."""
    settings = bpy.context.scene.scope
    here = viewport()
    region = here["region"]
    middle = region.x + region.width // 2, here["window"].height - region.y - region.height // 2
    invoke(bpy.ops.scope.pick_person, "INVOKE_DEFAULT")
    yield from press(middle, lambda: bool(settings.person))
    report["picked"] = settings.person
    place, _, time_s = settings.person.partition("@")
    x, y = map(int, place.split(","))
    assert 0 < x < WIDTH, settings.person
    assert 0 < y < HEIGHT, settings.person
    assert float(time_s) == 0.0, settings.person
    invoke(bpy.ops.scope.pick_person, "INVOKE_DEFAULT")
    yield 5.0
    picture("33_pick_person")
    key("Escape")
    yield 1.0
    assert settings.person == report["picked"]
    settings.person = ""


def compared() -> Iterator[float]:
    """Compare one capture, then the other, without leaving the first: its own camera, no bones, its
    own side view.
    """
    assert space().overlay.show_bones
    for take in ("first", "second"):
        select(take)
        use(bpy.ops.scope.look_through)
        yield 1.0
        seen_by = space().camera
        assert seen_by.name in bpy.data.collections[take].all_objects, (take, seen_by.name)
        assert bpy.context.scene.camera == seen_by
        assert not space().overlay.show_bones
    picture("30_second_compared")
    use(bpy.ops.scope.side_view)
    yield 1.0
    followed = [
        area.spaces.active.lock_object
        for area in bpy.context.window_manager.windows[0].screen.areas
        if area.type == "VIEW_3D" and area.spaces.active.lock_object
    ]
    assert [person.name in bpy.data.collections["second"].all_objects for person in followed] == [
        True
    ], followed
    use(bpy.ops.scope.look_through)
    yield 1.0
    assert space().overlay.show_bones, "the bones are still hidden after two comparisons"
    assert space().local_view is None
    assert (
        sum(area.type == "VIEW_3D" for area in bpy.context.window_manager.windows[0].screen.areas)
        == 1
    )
    report["compared"] = "each through its own camera"


def above_the_fold() -> Iterator[float]:
    """Press an export and a refinement where a laptop's screen shows them."""
    assert max(FBX_BUTTON[1], RAW_BUTTON[1]) < FOLD
    windows = bpy.context.window_manager.windows
    select("second")
    yield 1.0
    picture("31_fold")
    keys = curve()
    yield from press(RAW_BUTTON, lambda: curve() != keys)
    invoke(bpy.ops.ed.undo)
    yield 0.5
    yield from press(FBX_BUTTON, lambda: len(windows) > 1)
    yield 1.0
    for window in list(windows)[1:]:
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.window_close()
    yield 0.5
    report["above_the_fold"] = "export and refine"


def curve() -> list[float]:
    """Return the keys of one curve of the second capture."""
    action = bpy.data.objects["second"].animation_data.action
    found = next(each for each in curves_of(action) if "left_elbow" in each.data_path)
    return [point.co[1] for point in found.keyframe_points]


def shortcut() -> Iterator[float]:
    """Press Shift Alt V over the viewport: compare with the footage, and back."""
    for perspective in ("CAMERA", "PERSP"):
        key("shift+alt+v")
        yield from until(
            lambda wanted=perspective: space().region_3d.view_perspective == wanted, 10, perspective
        )
        yield 0.5
    report["shortcut"] = "there and back"


def searched() -> Iterator[float]:
    """Find the entries of File > Import and Export with Blender's search, and open the window of
    each.
    """
    windows = bpy.context.window_manager.windows
    for number, (words, others, operator, form) in enumerate(SEARCHED):
        before = popup()
        key(F3)
        yield from until(lambda empty=before: popup() != empty, 20, "the search")
        before = popup()
        subprocess.Popen(["xdotool", "type", "--delay", "60", words])
        yield from until(lambda empty=before: popup() != empty, 20, "what is found")
        while popup() != before:  # until all of the words are in it
            before = popup()
            yield 1.5
        if number < 3:
            picture(f"33_search_{words.replace(' ', '_')}")
        for _ in range(others):
            key("Down")
            yield 0.3
        key("Return")
        yield from until(
            lambda: len(windows) > 1, 10, f"the window of what is found with {words!r}"
        )
        yield 0.5
        opened = windows[-1].screen.areas[0].spaces.active.active_operator
        assert opened.bl_idname == f"SCOPE_OT_{operator}", (words, opened.bl_idname)
        assert not form or opened.format == form, (words, opened.format)
        with bpy.context.temp_override(window=windows[-1]):
            bpy.ops.wm.window_close()
        yield 0.5
    for kind in ("import", "export"):
        invoke(bpy.ops.wm.call_menu, name=f"TOPBAR_MT_file_{kind}")
        yield 1.0
        picture(f"34_file_{kind}")
        key("Escape")
        yield 0.5
    report["searched"] = [words for words, *_ in SEARCHED]


def file_browsers() -> Iterator[float]:
    """Open the file browsers: at first they show what fits, and with the filter off, all that there
    is.
    """
    windows = bpy.context.window_manager.windows
    settings = bpy.context.scene.scope
    folder = OUT / "files"
    folder.mkdir()
    for name in FILES:
        shutil.copy(FOOTAGE, folder / name)
    settings.footage = str(folder / "a.mp4")
    yield from press(FOLDER_BUTTON, lambda: len(windows) > 1)
    assert (yield from listed(folder)) == list(FOOTAGE_FILES)
    browser = windows[-1].screen.areas[0].spaces.active
    browser.params.use_filter = False
    assert (yield from listed(folder)) == list(FILES)
    browser.params.filename = "odd.xyz"
    yield 0.5
    with bpy.context.temp_override(window=windows[-1], area=windows[-1].screen.areas[0]):
        bpy.ops.file.execute()
    yield from until(lambda: settings.footage == str(folder / "odd.xyz"), 10, "the chosen file")
    for operator, chosen, expected in BROWSERS:
        invoke(getattr(bpy.ops.scope, operator), "INVOKE_DEFAULT", **chosen)
        yield from until(lambda: len(windows) > 1, 10, f"the file browser of {operator}")
        found = yield from listed(folder)
        assert found == list(expected), (operator, chosen, found)
        with bpy.context.temp_override(window=windows[-1]):
            bpy.ops.wm.window_close()
        yield 0.5
    settings.footage = FOOTAGE
    report["file_browsers"] = "filtered"


def listed(folder: Path) -> Generator[float, None, list[str]]:
    """Return which files the open file browser shows of a folder: those that can be selected."""
    window = bpy.context.window_manager.windows[-1]
    area = window.screen.areas[0]
    area.spaces.active.params.directory = str(folder).encode()
    found: list[str] = []
    # the browser reads the folder in the background, and lists it when it is drawn
    for _ in range(40):
        yield 0.25
        region = next(each for each in area.regions if each.type == "WINDOW")
        with bpy.context.temp_override(window=window, area=area, region=region):
            bpy.ops.file.select_all(action="SELECT")
            before = found
            found = sorted(each.name for each in bpy.context.selected_files)
            bpy.ops.file.select_all(action="DESELECT")
        area.tag_redraw()
        if found and found == before:
            break
    return found


def popup() -> bytes:
    """Return the pixels where Blender's search is, with the mouse in the middle of the viewport."""
    command = ["import", "-window", "root", "-crop", "500x230+510+390", "-depth", "8", "rgb:-"]
    return subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout


def rigs() -> None:
    """Choose one rig after another: the list of bones is always that of the chosen rig."""
    settings = bpy.context.scene.scope_retarget
    found = []
    for prefix in ("mixamorig:", "DEF-"):
        data = bpy.data.objects["first"].data.copy()
        for bone in data.bones:
            bone.name = prefix + bone.name
        settings.rig = bpy.data.objects.new(prefix, data)
        bpy.context.scene.collection.objects.link(settings.rig)
        if not found:
            use(bpy.ops.scope.guess_bones)
        found.append([pair.bone for pair in settings.pairs])
        assert found[-1], prefix
        assert all(bone in data.bones for bone in found[-1]), found[-1]
    use(bpy.ops.scope.retarget)
    report["rigs"] = [len(each) for each in found]


def exported() -> None:
    """Export a rig and then captures: everything starts at 0 s, has the take's name, and is what
    was asked for.
    """
    use(bpy.ops.scope.export, filepath=str(OUT / "rig.bvh"), format="BVH", which="RIG")
    assert "DEF-" in (OUT / "rig.bvh").read_text("utf-8")
    select("first")
    for kind, suffix in (("FBX", "fbx"), ("GLB", "glb"), ("BVH", "bvh"), ("NPZ", "npz")):
        use(bpy.ops.scope.export, filepath=str(OUT / f"first.{suffix}"), format=kind)
    text = (OUT / "first.bvh").read_text("utf-8")
    assert "DEF-" not in text, "the rig was exported again"
    longest = max(
        abs(float(word))
        for line in text.splitlines()
        if "OFFSET" in line
        for word in line.split()[1:]
    )
    assert 20.0 < longest < 100.0, f"a BVH in centimetres has no bone of {longest}"
    content = (OUT / "first.glb").read_bytes()
    glb = json.loads(content[20 : 20 + struct.unpack("<I", content[12:16])[0]])
    assert [animation["name"] for animation in glb["animations"]] == ["first"], glb["animations"]
    starts = {
        glb["accessors"][sampler["input"]]["min"][0] for sampler in glb["animations"][0]["samplers"]
    }
    assert starts == {0.0}, starts
    before = set(bpy.data.actions)
    bpy.context.scene.frame_set(1)
    invoke(bpy.ops.import_scene.fbx, filepath=str(OUT / "first.fbx"), anim_offset=0.0)
    for action in set(bpy.data.actions) - before:
        assert "|first|" in action.name, action.name
        assert abs(action.frame_range[0]) < 0.01, tuple(action.frame_range)
    invoke(bpy.ops.ed.undo)
    report["exported"] = ["FBX", "GLB", "BVH", "NPZ"]


def usd() -> None:
    """Say why USD cannot be exported where this Blender was built without it."""
    if "usd_export" in dir(bpy.ops.wm):
        return
    tooltip = bpy.types.SCOPE_OT_export.description(bpy.context, SimpleNamespace(format="USDC"))
    assert "built without USD" in tooltip, tooltip  # of the grey button
    try:
        use(bpy.ops.scope.export, filepath=str(OUT / "first.usdc"), format="USDC")
    except RuntimeError as error:
        report["usd"] = str(error).strip()
    assert "built without USD" in str(report.get("usd")), report


def sequencer() -> None:
    """Add the footage to the sequencer twice: the second time changes nothing."""
    counts = []
    for _ in range(2):
        use(bpy.ops.scope.footage_to_sequencer)
        counts.append(len(strips()))
    assert counts[0] == counts[1] > 0, counts
    report["strips"] = counts


def imported() -> None:
    """Import a motion without a cycle, of which no loop can be made, and one with two floors, which
    is warned of.
    """
    poses = np.zeros((FRAMES, 24, 3))
    trans = np.zeros((FRAMES, 3))
    poses[:, 0, 0] = np.pi / 2  # AMASS: z is up
    poses[:, 16, 2] = np.linspace(0.0, 0.8, FRAMES)  # an arm that rises once
    np.savez(STILL, poses=poses.reshape(FRAMES, -1), trans=trans, mocap_framerate=np.array(RATE))
    trans[80:, 2] -= 0.3
    np.savez(LOW, poses=poses.reshape(FRAMES, -1), trans=trans, mocap_framerate=np.array(RATE))
    use(bpy.ops.scope.import_motion, filepath=str(STILL))
    assert any("keeps its 20 frames/s, the motion has 60" in text for text in warnings()), (
        warnings()
    )
    try:
        use(bpy.ops.scope.loop, start=1, end=40)
    except RuntimeError as error:
        report["no_cycle"] = str(error).strip()
    assert "no_cycle" in report, "a loop was made of a movement that is not repeated"
    use(bpy.ops.scope.import_motion, filepath=str(LOW))
    assert any("under the floor" in text for text in warnings()), warnings()
    markers = [marker.name for marker in bpy.context.scene.timeline_markers]
    assert any("floor" in name for name in markers), markers
    report["two_floors"] = markers


def steps() -> Iterator[float]:
    """Run the session; yield the seconds to wait before each next step."""
    show_tab()
    yield 1.0
    show_tab()
    yield from two_captures()
    yield from picked()
    yield from compared()
    yield from shortcut()
    yield from above_the_fold()
    yield from searched()
    rigs()
    yield 0.5
    yield from file_browsers()
    exported()
    yield 0.5
    usd()
    sequencer()
    imported()
    yield 1.0
    picture("32_imported")
    (OUT / "details.json").write_text(json.dumps(report))


run(steps())
