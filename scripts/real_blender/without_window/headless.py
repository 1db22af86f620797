# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender --background --command scope``: one clip, and a folder with failing clips, interrupted
and resumed.

Runs in the Debian with its own Python, in /scope; ``compare.py`` compares its files with the
shell's.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

COMMAND = ("blender", "--background", "--command", "scope")
OUT = Path("out")
FAST = ("--quality", "fast")


def command(*arguments: str, status: int) -> dict | None:
    """Run it; returns the report, which must be all of stdout, where ``--json`` asks for one."""
    print("scope", *arguments, flush=True)
    done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, check=False)
    print(done.stderr, flush=True)
    assert done.returncode == status, f"status {done.returncode}, not {status}: {done.stdout}"
    return json.loads(done.stdout) if "--json" in arguments else None


def statuses(report: dict) -> dict[str, str]:
    """Return the outcome of each file of a batch."""
    return {entry["file"]: entry["status"] for entry in report["files"]}


def one_clip() -> None:
    """Try a capture and the ways in which it can fail."""
    report = command(
        "capture",
        "clips/walk.mp4",
        *FAST,
        "-o",
        "out/command.npz",
        "-o",
        "out/command.glb",
        "--json",
        status=0,
    )
    assert report is not None
    assert report["people"] == 1
    assert report["outputs"] == ["out/command.npz", "out/command.glb"]
    command("capture", "clips/broken.mp4", "-o", "out/broken.npz", status=1)
    command("capture", "clips/walk.mp4", "--quality", "superb", status=2)
    command("capture", "clips/wall.png", *FAST, "-o", "out/wall.npz", status=3)
    assert not list(OUT.glob("broken*")) + list(OUT.glob("wall*"))


def without_a_video() -> None:
    """Capture the sample clip, whose results are not for the folder of the clip, and import a
    motion.
    """
    command("capture", *FAST, status=0)
    assert {path.name for path in Path().glob("sample.*")} - {"sample.mp4"} == {
        "sample.npz",
        "sample.glb",
    }
    command("import", "sample.npz", "-o", "out/imported.glb", status=0)
    assert (OUT / "imported.glb").stat().st_size > 1000


def name_that_is_not_utf8() -> None:
    """Capture a video and an image with a name in Latin-1, at which OpenCV's functions crash."""
    shutil.copy("clips/walk.mp4", OUT / os.fsdecode(b"caf\xe9.mp4"))
    subprocess.run(["convert", "pictures/0030.jpg", "out/person.png"], check=True)
    (OUT / "person.png").rename(OUT / os.fsdecode(b"caf\xe9.png"))
    for suffix in ("mp4", "png"):
        clip = OUT / os.fsdecode(b"caf\xe9." + suffix.encode())
        motion = OUT / f"latin_{suffix}.npz"
        command("capture", str(clip), *FAST, "-o", str(motion), status=0)
        assert motion.stat().st_size > 1000


def damaged_code() -> None:
    """Damage some of the compiled code that comes with the extension or, where none comes with it,
    that captures have compiled: a capture compiles it again.
    """
    extensions = Path("home/.config/blender")
    files = [*extensions.glob("*/extensions/user_default/scope/assets/kernels/*/*.code")]
    files = files or [
        *extensions.glob("*/extensions/.user/user_default/scope/cache/kernels/*/*.code")
    ]
    empty, cut, flipped = sorted(files, key=lambda path: path.stat().st_size)[:3]
    whole = {path: path.read_bytes() for path in (empty, cut, flipped)}
    replace(empty, b"")
    replace(cut, whole[cut][:500])
    replace(flipped, whole[flipped][:-100] + bytes(byte ^ 255 for byte in whole[flipped][-100:]))
    command("capture", "clips/walk.mp4", *FAST, "-o", "out/mended.npz", status=0)
    assert (OUT / "mended.npz").stat().st_size > 1000
    for path, content in whole.items():
        replace(path, content)


def replace(path: Path, content: bytes) -> None:
    """Write a new file, because the old one is also that of the other parts' homes."""
    path.unlink(missing_ok=True)
    path.write_bytes(content)


def running(what: bytes) -> list[str]:
    """Return the ids of this command line's processes with these arguments."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            found += [path.parent.name] if b"--command\0scope\0" + what in path.read_bytes() else []
        except OSError:
            continue  # it has just ended
    return found


def stopped(name: str) -> None:
    """Interrupt, terminate or kill a batch: its captures end with it, and no file is left
    incomplete.
    """
    out = OUT / f"stopped_{name}"
    arguments = (
        "batch",
        "clips",
        "--out",
        str(out),
        "--jobs",
        "2",
        "--formats",
        "npz",
        "--quality",
        "best",
    )
    print("scope", *arguments, name, flush=True)
    process = subprocess.Popen([*COMMAND, *arguments], stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 120.0
    while not running(b"capture"):  # earlier, Blender itself would receive the signals
        assert process.poll() is None, process.returncode
        assert time.monotonic() < end, "the batch began no clip"
        time.sleep(0.1)
    process.send_signal(getattr(signal, name))
    began = time.monotonic()
    _, stderr = process.communicate(timeout=60)
    print(stderr, flush=True)
    assert process.returncode == (-signal.SIGKILL if name == "SIGKILL" else 130), process.returncode
    while running(b"") and time.monotonic() - began < 40:
        time.sleep(0.1)
    # The next batch takes the lock of one that was killed.
    may_be_left = {"scope-batch.json", ".scope-batch.lock"}
    if name != "SIGKILL":
        may_be_left.remove(".scope-batch.lock")
    assert {p.name for p in out.iterdir()} <= may_be_left, list(out.iterdir())
    assert not running(b""), running(b"")


def folder() -> None:
    """Capture a folder with a clip that fails and one without people; a second run repeats only the
    failed one.
    """
    arguments = ("batch", "clips", "--out", "out/batch", "--jobs", "2", *FAST, "--json")
    first = command(*arguments, status=1)
    assert first is not None
    assert statuses(first) == {
        "broken.mp4": "failed",
        "walk.mp4": "done",
        "wall.png": "no_person",
    }, statuses(first)
    assert first["exit_status"] == 1
    made = {p.name: p.stat().st_mtime_ns for p in (OUT / "batch").iterdir() if p.suffix != ".json"}
    assert set(made) == {"walk.npz", "walk.glb"}, made
    second = command(*arguments, status=1)
    assert second is not None
    assert statuses(second) == {
        "broken.mp4": "failed",
        "walk.mp4": "skipped",
        "wall.png": "no_person",
    }
    assert {name: (OUT / "batch" / name).stat().st_mtime_ns for name in made} == made
    (OUT / "batch.json").write_text(json.dumps(first))


def languages() -> None:
    """Show texts of the interface in each of its languages."""
    script = "parts/without_window/languages.py"
    subprocess.run(
        ["blender", "--background", "--python-exit-code", "1", "--python", script], check=True
    )


if __name__ == "__main__":
    subprocess.run(["convert", "-size", "320x240", "xc:gray", "clips/wall.png"], check=True)
    os.environ.pop("DISPLAY", None)
    one_clip()
    without_a_video()
    name_that_is_not_utf8()
    damaged_code()
    folder()
    stopped("SIGINT")
    stopped("SIGTERM")
    stopped("SIGKILL")
    languages()
