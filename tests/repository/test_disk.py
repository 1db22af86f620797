# SPDX-License-Identifier: GPL-3.0-or-later
"""Which modules create, rename or remove files: two lists that are to become shorter, not longer.

Whoever reads these modules has read everything that can lose a user's file.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

REMOVING = {"unlink", "rmdir", "rmtree", "removedirs", "replace", "rename", "renames"}
TEMPORARY = {"TemporaryDirectory", "NamedTemporaryFile", "mkdtemp", "mkstemp", "TemporaryFile"}
WRITING = {"write_text", "write_bytes", "touch", "symlink_to", "hardlink_to", "link"}
WRITING |= {"savez", "savez_compressed", "copyfile", "mkdir", "makedirs", "tofile"}

# Everything else calls `temporary.remove` and `atomic_write.atomic_path`.
REMOVES = {
    "scope_addon/atomic_write.py": "gives a complete file its name",
    "scope_addon/temporary.py": "removes",
    "scope_addon/job/cache.py": "gives a finished capture its name",
    "scope_addon/job/worker.py": "takes a folder's name away, so that nothing is written to it",
    "scope_addon/cluster/remote.py": "in stores",
}
WRITES = {
    # in the folder that Blender removes with its session
    "scope_addon/ui/scene_camera.py",
    # folders
    "scope_addon/temporary.py",
    "scope_addon/machine_code/code_cache.py",
    "scope_addon/private_folder.py",
    "scope_addon/job/cache.py",
    "scope_addon/job/unfinished.py",
    "scope_addon/job/batch.py",
    "scope_addon/job/clip_task.py",
    "scope_addon/capture/long_clips/kept_estimates.py",
    "scope_addon/capture/long_clips/windowed_clip.py",
    "scope_addon/cluster/runner.py",
    "scope_addon/cluster/remote.py",
    "scope_addon/cluster/worker.py",
    "scope_addon/ui/warm_up.py",
    # a recording that grows
    "scope_addon/live/journal.py",
    # the content of temporary files
    "scope_addon/atomic_write.py",
    "scope_addon/capture/media/guards.py",
    "scope_addon/capture/overlay_video.py",
    "scope_addon/capture/media/video_writer.py",
    "scope_addon/job/finished_clip.py",
    "scope_addon/job/footage_picture.py",
    "scope_addon/job/preview.py",
    "scope_addon/motion.py",
    "scope_addon/scene/character/uncorrected_keys.py",
    "scope_addon/scene/export/formats.py",
}


@cache
def called(path: Path) -> set[str]:
    """The names of all functions and methods that a module calls, and how it opens files."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        owner = getattr(getattr(node.func, "value", None), "id", "")
        # Texts and records are replaced too, and objects unlinked from a scene.
        is_others = {
            "replace": owner != "os",
            "rename": owner != "os" and len(node.args) != 1,
            "link": owner != "os",
            "unlink": bool(node.args),
        }
        if is_others.get(name):
            continue
        names.add(name)
    return names


def modules_that_call(functions: set[str]) -> set[str]:
    found = set()
    named = re.compile(rf"\b({'|'.join(functions)})\b")
    for package in ("solver", "scope_addon"):
        for path in (ROOT / package).rglob("*.py"):
            if "examples" in path.parts or not named.search(path.read_text("utf-8")):
                continue
            if functions & called(path):
                found.add(path.relative_to(ROOT).as_posix())
    return found


def test_what_removes_or_renames_is_listed():
    assert modules_that_call(REMOVING) == set(REMOVES)


def test_what_creates_is_listed():
    assert modules_that_call(WRITING) == WRITES


def test_temporary_names_are_made_in_one_module():
    assert modules_that_call(TEMPORARY) == set()
