# SPDX-License-Identifier: GPL-3.0-or-later
"""Each package needs only its own libraries, and Scope works under two names; see also
``test_rooms``.
"""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Runs in a fresh interpreter: forbids modules, then imports every module below some packages.
IMPORT_ALL = """
import importlib, pkgutil, sys

class Forbid:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {forbidden!r}:
            raise ImportError(name + " is out of bounds here")

sys.meta_path.insert(0, Forbid())
for package in {packages!r}:
    module = importlib.import_module(package)
    for found in pkgutil.walk_packages(getattr(module, "__path__", []), package + "."):
        importlib.import_module(found.name)
loaded = {{name.split(".")[0] for name in sys.modules}} & {forbidden!r}
assert not loaded, loaded
"""

# The package under the name that Blender gives it: bl_ext.<repository>.scope.
AS_EXTENSION = """
import importlib.util, sys, types

for name in ("bl_ext", "bl_ext.user_default"):
    sys.modules[name] = types.ModuleType(name)
    sys.modules[name].__path__ = []
spec = importlib.util.spec_from_file_location(
    "bl_ext.user_default.scope", {init!r}, submodule_search_locations=[{root!r}]
)
module = importlib.util.module_from_spec(spec)
before = set(sys.modules)
sys.modules[spec.name] = module
spec.loader.exec_module(module)
assert set(sys.modules) - before == {{spec.name}}, "the root package imports something"
importlib.import_module("bl_ext.user_default.scope.solver")
importlib.import_module("bl_ext.user_default.scope.scope_addon.capture.pipeline")
importlib.import_module("bl_ext.user_default.scope.scope_addon.cli")
assert not [name for name in sys.modules if name == "scope" or name.startswith("scope.")]
"""


def run(code: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd="/"
    )
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.parametrize(
    ("packages", "forbidden"),
    [
        (["scope.solver"], {"bpy", "cv2", "onnxruntime", "scipy", "torch"}),
        (["scope.scope_addon.capture", "scope.scope_addon.motion"], {"bpy", "scipy", "torch"}),
    ],
)
def test_rooms_without_blender(packages, forbidden):
    run(IMPORT_ALL.format(packages=packages, forbidden=forbidden))


def test_the_scene_needs_no_networks_and_no_opencv():
    # os._exit, because Blender's module can hang in its exit handlers.
    code = IMPORT_ALL.format(
        packages=["scope.scope_addon.scene"], forbidden={"cv2", "onnxruntime", "torch"}
    )
    run(code + "\nimport os\nos._exit(0)")


def test_the_package_works_under_blenders_name():
    run(AS_EXTENSION.format(init=str(ROOT / "__init__.py"), root=str(ROOT)))


def sources(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


def imported(path: Path) -> list[tuple[int, str]]:
    """(level, module) of every import statement in a file, also inside functions."""
    out = []
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            out += [(0, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            out.append((node.level, node.module or ""))
    return out


def test_imports_are_relative():
    files = sources("solver") + sources("scope_addon")
    assert len(files) > 100
    absolute = [
        f"{path.relative_to(ROOT).as_posix()}: 'import {module}' is not relative"
        for path in files
        # The worker's start script runs by path, in a process where the package has not been loaded
        # yet.
        if path.name != "start_worker.py"
        if re.search(r"\bimport\b.*\bscope\b|\bfrom\s+scope\b", path.read_text("utf-8"))
        for level, module in imported(path)
        if module.split(".")[0] == "scope" and not level
    ]
    assert absolute == []


def test_no_operator_of_the_panel_opens_a_rigs_file():
    """As the threat model says: Blender's importers run under limits in a shell, which its window
    could not have.
    """
    reads_files = {"load_rig", "check_rig", "export_on_rig", "rig_source", "RigSource"}
    for path in sources("scope_addon/ui"):
        text = path.read_text("utf-8")
        if not any(name in text for name in reads_files):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom):
                assert not reads_files & {alias.name for alias in node.names}, path
    importers = ("import_scene", "libraries.load", "wm.append", "wm.link")
    readers = [
        path.stem
        for path in sources("scope_addon")
        if any(name in path.read_text("utf-8") for name in importers)
    ]
    assert readers == ["formats", "rig_file"]  # the first reads what Scope has just written
