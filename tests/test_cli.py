# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line as users see it: exit status, one sentence on stderr, no partial files."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon import cli
from scope.scope_addon.cli import SAMPLE, main
from scope.scope_addon.footage import display_text
from scope.scope_addon.motion import Motion
from scope.solver.body_file import BUILT_IN

# several would wait for each other in busy loops
BRIEF = ["--quality", "fast", "--end", "0.1", "--threads", "1"]


def run(capsys, *argv):
    status = main([str(a) for a in argv])
    out, err = capsys.readouterr()
    return status, out, err


def files_below(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*"))


BROKEN = {"missing.mp4": None, "text.mp4": b"this is not a video\n" * 50}


@pytest.mark.usefixtures("blender_module")
@pytest.mark.parametrize("name", BROKEN)
def test_unreadable_footage_gives_one_sentence_status_1_and_no_file(tmp_path, capsys, name):
    content = BROKEN[name]
    if content is not None:
        (tmp_path / name).write_bytes(content)
    before = files_below(tmp_path)
    status, out, err = run(
        capsys, "capture", tmp_path / name, "-o", tmp_path / "out.npz", "-o", tmp_path / "out.glb"
    )
    assert status == 1
    assert out == ""
    assert name in err
    assert err.count("\n") == 1
    assert "Traceback" not in err
    assert files_below(tmp_path) == before


@pytest.mark.usefixtures("blender_module")
@pytest.mark.parametrize(
    ("argv", "status", "says"),
    [
        (["capture", "-o", "{tmp}/a.xyz"], 2, ".xyz"),
        (["capture", "--overlay", "{tmp}/a.avi"], 2, ".avi"),
        (["capture", "--report", "{tmp}/a.pdf"], 2, ".pdf"),
        (["capture", "-o", "{tmp}/none/a.npz"], 1, "none"),
        (["capture", "", "-o", "{tmp}/a.npz"], 2, "VIDEO: the path is empty"),
        (["capture", "-o", ""], 2, "--output: the path is empty"),
        (["capture", "https://a.b/c.mp4"], 2, "https://a.b/c.mp4 is an address"),
        (["capture", "--retarget", "", "-o", "{tmp}/a.glb"], 2, "--retarget: the path is empty"),
        (["batch", "", "--out", "{tmp}"], 2, "FOLDER: the path is empty"),
        (["capture", "--quality", "superb"], 2, "superb"),
        (["capture", "--fov", "60", "--focal-mm", "26", "-o", "{tmp}/a.npz"], 2, "contradict"),
        (
            ["capture", "--height", "1,82", "-o", "{tmp}/a.npz"],
            2,
            "a height of 1 cm is not plausible",
        ),
        (["capture", "--body", "nobody", "-o", "{tmp}/a.npz"], 1, "nobody"),
        (
            ["capture", "--hands", "--body", str(BUILT_IN["scope"]), "-o", "{tmp}/a.npz"],
            2,
            "no finger joints, which capturing hands needs: use scope_h",
        ),
        (["capture", "--retarget", "{tmp}/rig.glb", "-o", "{tmp}/a.glb"], 1, "rig.glb"),
        (["capture", "--retarget", "{tmp}/rig.obj", "-o", "{tmp}/a.glb"], 2, ".obj"),
        (["capture", "--bone-map", "{tmp}/map.json", "-o", "{tmp}/a.glb"], 2, "--retarget"),
        (
            [
                *("capture", "--retarget", "{tmp}/rig.glb", "--expression-map", "{tmp}/face.json"),
                *("-o", "{tmp}/a.glb"),
            ],
            2,
            "only --face captures",
        ),
        (["capture", "--bvh-unit", "m", "-o", "{tmp}/a.glb"], 2, "-o OUT.bvh"),
        (["capture", "--shape-keys", "baked", "-o", "{tmp}/a.bvh"], 2, "-o OUT.glb"),
        (["capture", "--deform-bones", "-o", "{tmp}/a.glb"], 2, "give --retarget RIG"),
        (
            ["capture", "--deform-bones", "--retarget", "{tmp}/rig.glb", "-o", "{tmp}/a.usdc"],
            2,
            "-o OUT.fbx",
        ),
        (
            [
                *("capture", "--shape-keys", "baked", "--retarget", "{tmp}/rig.glb"),
                *("-o", "{tmp}/a.glb"),
            ],
            2,
            "either --shape-keys or --retarget",
        ),
        (
            ["capture", str(SAMPLE), "second.mp4", "-o", "{tmp}/a.npz"],
            1,
            "second.mp4",
        ),
        (["capture", "--offset", "1.5", "-o", "{tmp}/a.npz"], 2, "one video was given"),
        (
            ["capture", "a.mp4", "b.mp4", "--offset", "x", "-o", "{tmp}/a.npz"],
            2,
            "seconds, or auto",
        ),
        (["capture", "--save-calibration", "{tmp}/a.toml"], 2, "is for several videos"),
        (["capture", "a.mp4", "b.mp4", "--save-calibration", "{tmp}/a.json"], 2, "a.json"),
        (["capture", "--frobnicate"], 2, "--frobnicate (see scope capture --help)"),
        (["capture", "--threads", "-2", "-o", "{tmp}/a.npz"], 2, "--threads"),
        (["capture", "--fps", "", "-o", "{tmp}/a.npz"], 2, "'' is not a frame rate"),
        (
            ["capture", "--start", "00:00:00:99", "-o", "{tmp}/a.npz"],
            2,
            "00:00:00:99 does not exist",
        ),
        (["frobnicate"], 2, "frobnicate"),
        (["capture", "a.mp4", "--unknown=" + 300 * "x"], 2, "unknown arguments: --unknown=xxx"),
        ([], 2, "COMMAND"),
    ],
)
def test_bad_arguments(tmp_path, capsys, argv, status, says):
    got, out, err = run(capsys, *[a.format(tmp=tmp_path) for a in argv])
    assert got == status
    assert says in err
    assert err.count("\n") == 1
    assert out == ""
    assert files_below(tmp_path) == []


def test_a_file_whose_name_begins_with_a_dash_is_given_with_its_folder(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("-walk.mp4").touch()
    status, _, err = run(capsys, "capture", "-walk.mp4")
    assert status == 2
    assert (
        "unknown arguments: -walk.mp4 (see scope capture --help; to capture the file of that name, "
        "write ./-walk.mp4)" in err
    )
    status, _, err = run(capsys, "capture", "./-walk.mp4", "-o", "out.npz")
    assert status == 1
    assert "-walk.mp4 is empty" in err


def test_a_picture_without_a_person_ends_with_status_3(tmp_path, capsys):
    import cv2

    cv2.imwrite(str(tmp_path / "wall.png"), np.full((240, 320, 3), 128, np.uint8))
    status, _, err = run(capsys, "capture", tmp_path / "wall.png", "-o", tmp_path / "out.npz")
    assert status == 3
    assert "no person" in err
    assert files_below(tmp_path) == ["wall.png"]


def test_a_failed_write_keeps_the_earlier_result(tmp_path, capsys, monkeypatch):
    import cv2

    picture = tmp_path / "person.png"
    ok, frame = cv2.VideoCapture(str(SAMPLE)).read()
    assert ok
    cv2.imwrite(str(picture), frame)
    (tmp_path / "out.npz").write_bytes(b"earlier")

    def full_disk(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np.lib.format, "write_array", full_disk)
    status, _, err = run(capsys, "capture", picture, "-o", tmp_path / "out.npz")
    assert status == 1
    assert "No space left" in err
    assert (tmp_path / "out.npz").read_bytes() == b"earlier"
    assert files_below(tmp_path) == ["out.npz", "person.png"]


def test_an_interrupt_during_the_overlay_leaves_complete_files(tmp_path, capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("scope.scope_addon.capture.overlay_video.write_overlay", interrupted)
    motion = tmp_path / "a.npz"
    options = [*BRIEF, "-o", motion, "--overlay", tmp_path / "a.mp4"]
    status, _, err = run(capsys, "capture", SAMPLE, *options)
    assert status == 130
    assert (
        err == "scope: stopped; some results may have been written already, each of them complete\n"
    )
    assert files_below(tmp_path) == ["a.npz"]


@pytest.mark.slow
@pytest.mark.usefixtures("blender_module")
def test_no_command_writes_into_scopes_own_folders(tmp_path, capfd, monkeypatch):
    def state():
        files = [
            p
            for name in ("assets", "scope_addon", "solver")
            for p in (SAMPLE.parents[2] / name).rglob("*")
        ]
        kept = [p for p in files if p.is_file() and "__pycache__" not in p.parts]  # Python's own
        return {str(p): (p.stat().st_size, p.stat().st_mtime_ns) for p in kept}

    monkeypatch.chdir(tmp_path)
    before = state()
    for argv in (
        ["capture", SAMPLE, *BRIEF, "--overlay", "check.mp4"],
        ["batch", SAMPLE.parent, "--out", "motions", "--formats", "npz", *BRIEF],
    ):
        status, _, err = run(capfd, *argv)
        assert status == 0, err
        assert state() == before
    made = [
        "check.mp4",
        "motions",
        "motions/sample.npz",
        "motions/scope-batch.json",
        "sample.glb",
        "sample.npz",
    ]
    assert files_below(tmp_path) == made


# elsewhere, names are Unicode
ANY_NAME = os.fsdecode(b"person \xe9") if sys.platform == "linux" else "person"


@pytest.mark.usefixtures("blender_module")
def test_a_picture_gives_a_motion_of_one_frame_and_only_json_on_stdout(tmp_path, capfdbinary):
    import cv2

    name = ANY_NAME
    picture = tmp_path / f"{name}.png"
    capture = cv2.VideoCapture(str(SAMPLE))
    ok, frame = capture.read()
    assert ok
    picture.write_bytes(cv2.imencode(".png", frame)[1].tobytes())
    outputs = [tmp_path / f"{name}.npz", tmp_path / f"{name}.glb"]
    argv = [
        "capture",
        picture,
        "--json",
        "--threads",
        "1",
        "--overlay",
        tmp_path / f"{name}.o.png",
        "--report",
        tmp_path / f"{name}.html",
    ]
    for path in outputs:
        argv += ["-o", path]
    status = main([str(each) for each in argv])
    out, err = capfdbinary.readouterr()
    assert status == 0, err
    report = json.loads(out.decode())
    json.dumps(report, ensure_ascii=False).encode()  # no half characters
    assert report["frames"] == 1
    assert report["people"] == 1
    assert set(report["outputs"]) == {
        display_text(p) for p in [*outputs, tmp_path / f"{name}.o.png", tmp_path / f"{name}.html"]
    }
    assert f"<h1>{display_text(f'{name}.png')}</h1>" in (tmp_path / f"{name}.html").read_text(
        "utf-8"
    )
    assert {"fps", "reprojection_px", "warnings"} <= set(report)
    motion = Motion.load(outputs[0])
    assert len(motion) == 1
    assert motion.valid.all()
    overlay = np.frombuffer((tmp_path / f"{name}.o.png").read_bytes(), np.uint8)
    assert cv2.imdecode(overlay, cv2.IMREAD_COLOR).shape == frame.shape


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        RuntimeError("can't start new thread"),
        ImportError("libx.so: failed to map segment from shared object"),
        RuntimeError("[ONNXRuntimeError] : 6 : std::bad_alloc"),
    ],
)
def test_too_little_memory_is_no_bug(tmp_path, capsys, monkeypatch, error):
    def fail(args):
        raise error

    monkeypatch.setattr(cli, "run_capture", fail)
    status, _, err = run(capsys, "capture", str(SAMPLE), "-o", str(tmp_path / "out.npz"))
    assert (status, err.count("\n")) == (1, 1)
    assert "out of memory; free disk space or memory and try again" in err


def test_the_start_loads_no_library_that_only_a_capture_needs():
    heavy = {"numba", "cv2", "onnxruntime", "bpy"}
    code = (
        f"import sys; from scope.scope_addon import cli; print(sorted({heavy} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_names_and_addresses_reach_a_terminal_without_what_could_forge_or_betray(tmp_path, capsys):
    """Whatever the command, and whether it is a message, a warning or an error."""
    hostile = "\x1b[2K\nscope: wrote all.npz\u202e"
    commands = [
        ["capture", str(tmp_path / f"{hostile}.mp4")],
        ["capture", "rtsp://me:SECRET@camera/x"],
        ["import", str(tmp_path / f"{hostile}.npz")],
        ["import", str(tmp_path / "none.npz"), "-o", str(tmp_path / f"{hostile}.glb")],
        ["batch", str(tmp_path / hostile), "--out", str(tmp_path / "out")],
        ["live", str(tmp_path / f"{hostile}.mp4")],
        ["live", "rtsp://me:SECRET@127.0.0.1:1/x?token=SECRET", "--reconnect", "0"],
    ]
    for command in commands:
        assert main(command) != 0
        said = capsys.readouterr().err
        assert said.count("\n") == 1, command
        assert said.rstrip("\n").isprintable()
        assert "SECRET" not in said
