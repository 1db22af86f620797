# SPDX-License-Identifier: GPL-3.0-or-later
"""In a process in which the extension has Blender's name for it, corrections use the package that
has machine code.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CODE = """
import importlib, importlib.util, sys, types
from pathlib import Path

import numpy as np

for name in ("bl_ext", "bl_ext.user_default"):
    sys.modules[name] = types.ModuleType(name)
    sys.modules[name].__path__ = []
NAME = "bl_ext.user_default.scope"
spec = importlib.util.spec_from_file_location(NAME, {init!r}, submodule_search_locations=[{root!r}])
sys.modules[NAME] = module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)

compiled_solver = importlib.import_module(f"{{NAME}}.scope_addon.ui.compiled_solver")
pose_refit = importlib.import_module(f"{{NAME}}.scope_addon.edit.pins.pose_refit")
assert pose_refit.compiled_solver().__name__ == f"{{NAME}}.solver"
compiled_solver.cache = lambda: types.SimpleNamespace(kernels=Path({kernels!r}))
compiled_solver.load()
assert pose_refit.compiled_solver().__name__ == "scope.solver"
for package in ("scope", NAME):
    folders = importlib.import_module(f"{{package}}.scope_addon.machine_code.code_folders")
    assert folders.places() == [Path({kernels!r})], folders.places()

body = importlib.import_module(f"{{NAME}}.solver.body_file").load_body("scope")
# Takes a body of the package of the other name.
refit = pose_refit.PoseRefit(body, np.zeros(body.P))
assert type(refit._tree).__module__.startswith("scope.solver."), type(refit._tree)

compiled_solver.detach()
assert not [name for name in sys.modules if name == "scope" or name.startswith("scope.")]
"""


def test_corrections_use_the_package_that_has_machine_code(tmp_path):
    code = CODE.format(init=str(ROOT / "__init__.py"), root=str(ROOT), kernels=str(tmp_path))
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd="/"
    )
    assert done.returncode == 0, done.stderr[-2000:]


def test_a_package_of_the_same_name_that_was_there_before_stays(monkeypatch):
    from scope.scope_addon.ui import compiled_solver

    assert compiled_solver.is_ours()
    monkeypatch.setattr(compiled_solver, "OWN_NAME", "bl_ext.user_default.scope")
    compiled_solver.detach()
    assert "scope" in sys.modules
    monkeypatch.setattr(compiled_solver, "NAME", "json")
    assert not compiled_solver.is_ours()
