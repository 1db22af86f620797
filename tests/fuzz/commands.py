# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands that `kills` kills and refuses system calls, what they need, and how to tell that a
result is whole.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.motion import Motion
from scope.scope_addon.untrusted.body_file import load_body
from scope.solver.errors import ScopeError

from ..machine_code.small_package import make_package
from ..made_motion import made_motion
from .system_calls import CUT, FULL, KILL, KILL_PARENT, NO_MEMORY

ACTIONS = (KILL, FULL, NO_MEMORY, CUT)
# of commands that start processes
PARENTS = (*ACTIONS, KILL_PARENT)
SAMPLE = Path(__file__).resolve().parents[2] / "assets" / "sample" / "sample.mp4"
SCOPE = "scope.scope_addon"
PROGRAM = "scope.tests.fuzz.programs"
SIZES = 0.05  # by which a format may differ that states times
SHORT = 12  # frames of a short video
CACHE = "home/scope-mocap/cache"
KERNELS = """from .kernel import kernel
@kernel
def double(x):
    return 2.0 * x
@kernel
def half(x):
    return 0.5 * x
"""
IsWhole = Callable[[Path, bytes], bool]


class Command(NamedTuple):
    """A command to kill.

    :param module: and its arguments; relative paths are below the folder of the test.
    :param outputs: patterns of what it writes.
    :param needs: names in `INPUTS`.
    :param is_whole: whether a file is as complete as the one that was written without a fault.
    :param replaces: whether it replaces earlier results; otherwise there are none, and it would not
        run with them.
    :param continues: whether it uses what a killed one has left, so that it is run after each kill.
    :param tells: whether a failure is one sentence and status 1.
    """

    name: str
    module: str
    arguments: tuple[str, ...]
    outputs: tuple[str, ...]
    needs: tuple[str, ...]
    is_whole: IsWhole
    actions: tuple[str, ...] = ACTIONS
    replaces: bool = True
    continues: bool = False
    tells: bool = True


def _is_same(path: Path, whole: bytes) -> bool:
    return path.read_bytes() == whole


def _is_as_large(path: Path, whole: bytes) -> bool:
    return abs(path.stat().st_size - len(whole)) < SIZES * len(whole)


def _is_same_or_as_large(path: Path, whole: bytes) -> bool:
    """For commands with several outputs, of which pages state times."""
    return _is_as_large(path, whole) if path.suffix == ".html" else _is_same(path, whole)


def _is_same_or_report(path: Path, whole: bytes) -> bool:
    if path.suffix != ".json":
        return _is_same(path, whole)
    return all(
        entry["status"] in ("done", "skipped", "failed")
        for entry in json.loads(path.read_bytes())["files"]
    )


def _can_be_read(path: Path, _: bytes) -> bool:
    """For live captures, which depend on time."""
    try:
        if path.suffix == ".npz":
            return len(Motion.load(path)) > 0
        if path.suffix == ".json":
            return bool(json.loads(path.read_bytes())["motions"])
        with open_video(path) as video:
            return sum(1 for _ in video) > 0
    except ScopeError:
        return False


def _is_same_or_can_be_read(path: Path, whole: bytes) -> bool:
    """For reports, which state speeds."""
    return _can_be_read(path, whole) if path.suffix == ".json" else _is_same(path, whole)


def _import(suffix: str) -> Command:
    arguments: tuple[str, ...] = ("import", "in/walk.npz", "-o", f"out/walk{suffix}")
    if suffix == ".fbx":
        # a quarter of the bytes, which are written 4 kB at a time
        arguments += ("--shape-keys", "baked")
    is_whole = _is_as_large if suffix == ".blend" else _is_same
    return Command(suffix[1:], SCOPE, arguments, (f"out/walk{suffix}",), ("walk",), is_whole)


COMMANDS = (
    *map(_import, (".npz", ".bvh", ".glb", ".usdc", ".blend", ".fbx")),
    Command(
        "capture",
        SCOPE,
        (
            "capture",
            "in/still.png",
            "-o",
            "out/still.npz",
            "--overlay",
            "out/still.png",
            "--report",
            "out/still.html",
        ),
        ("out/still.npz", "out/still.png", "out/still.html"),
        ("still",),
        _is_same_or_as_large,
    ),
    Command(
        "batch",
        SCOPE,
        ("batch", "clips", "--out", "out", "--formats", "npz", "--quality", "fast"),
        ("out/a.npz", "out/b.npz", "out/scope-batch.json"),
        ("still", "clips"),
        _is_same_or_report,
        actions=PARENTS,
        tells=False,
    ),
    Command(
        "overlay",
        SCOPE,
        (
            "capture",
            "in/short.mp4",
            "-o",
            "out/short.npz",
            "--overlay",
            "out/short.mp4",
            "--quality",
            "fast",
        ),
        ("out/short.npz", "out/short.mp4"),
        ("short",),
        _is_same,
    ),
    Command(
        "continued",  # a capture that keeps what its networks find at once, rather than every 20 s
        PROGRAM,
        (
            "continued",
            "capture",
            "in/short.mp4",
            "--end",
            "0.1",
            "-o",
            "out/short.npz",
            "--quality",
            "fast",
        ),
        ("out/short.npz",),
        ("short",),
        _is_same,
        continues=True,
    ),
    Command(
        "windows",  # one of a long clip, which keeps its finished windows
        SCOPE,
        (
            "capture",
            "in/short.mp4",
            "--window-seconds",
            "0.2",
            "-o",
            "out/short.npz",
            "--quality",
            "fast",
        ),
        ("out/short.npz",),
        ("short",),
        _is_same,
        continues=True,
    ),
    Command(
        "live",
        SCOPE,
        ("live", "in/short.mp4", "--record", "out/live.npz", "--keep-footage", "out/live.mp4"),
        ("out/live.npz", "out/live.mp4"),
        ("short",),
        _can_be_read,
        tells=False,  # also where the recording is
    ),
    Command(
        "panel",  # the button, with the worker, its messages and the cache
        PROGRAM,
        ("panel", "in/still.png"),
        (f"{CACHE}/captures/*/*",),
        ("still",),
        _is_same_or_can_be_read,
        actions=PARENTS,
        replaces=False,
    ),
    Command(
        "panel-live",  # a recording in the panel
        PROGRAM,
        ("panel-live", "in/short.mp4", "out/recorded.npz"),
        ("out/recorded.npz",),
        ("short",),
        _can_be_read,
        actions=PARENTS,
    ),
    Command(
        # two captures are kept, the older one is removed, since there is no space for both
        "cache",
        PROGRAM,
        ("cache", "in/walk.npz", CACHE),
        (f"{CACHE}/captures/11111111111111111111111111111111/*",),
        ("walk",),
        _is_same,
        replaces=False,
    ),
    Command(
        "compile",
        PROGRAM,
        ("compile", "in", "home/kernels"),
        ("home/kernels/*/*.code",),
        ("kernels",),
        _is_as_large,
        actions=(KILL, FULL),  # LLVM ends the process itself where there is no memory
        replaces=False,
    ),
)


def _walk(folder: Path) -> None:
    body = load_body("scope")
    made_motion(body, np.zeros((2, 3 * (body.K + 1))), np.zeros((2, 3))).save(
        folder / "in" / "walk.npz"
    )


def _still(folder: Path) -> None:
    _, picture = cv2.VideoCapture(str(SAMPLE)).read()
    cv2.imwrite(str(folder / "in" / "still.png"), picture)


def _clips(folder: Path) -> None:
    for name in "ab":
        shutil.copy(folder / "in" / "still.png", folder / "clips" / f"{name}.png")


def _short(folder: Path) -> None:
    source = cv2.VideoCapture(str(SAMPLE))
    size = int(source.get(cv2.CAP_PROP_FRAME_WIDTH)), int(source.get(cv2.CAP_PROP_FRAME_HEIGHT))
    codec = cv2.VideoWriter.fourcc(*"mp4v")
    writer = cv2.VideoWriter(
        str(folder / "in" / "short.mp4"), codec, source.get(cv2.CAP_PROP_FPS), size
    )
    for _ in range(SHORT):
        writer.write(source.read()[1])
    writer.release()


def _kernels(folder: Path) -> None:
    (make_package(folder / "in") / "kernels.py").write_text(KERNELS)


INPUTS: dict[str, Callable[[Path], None]] = {
    "walk": _walk,
    "still": _still,
    "clips": _clips,
    "short": _short,
    "kernels": _kernels,
}
