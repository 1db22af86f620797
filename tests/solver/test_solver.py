# SPDX-License-Identifier: GPL-3.0-or-later
"""The package as a whole: its names, which are imported when they are first used."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from scope import solver

# Runs in a fresh interpreter, in which nothing else has imported the modules.
FIRST_USES = """
import sys
from scope import solver
from scope.solver import ShapeError, load_body

load_body("scope")
assert "numba" not in sys.modules, "errors and bodies need no compiler"
R = solver.rotations.exp([[0.0, 0.0, 0.0]])[0]
assert abs(R - [[1, 0, 0], [0, 1, 0], [0, 0, 1]]).max() == 0.0
names = {}
exec("from scope.solver import *", names)
assert set(solver.__all__) <= set(names), set(solver.__all__) - set(names)
assert set(solver.__all__) <= set(dir(solver))
assert names["ShapeError"] is ShapeError is solver.errors.ShapeError
"""


def test_every_name_is_there_when_it_is_first_used():
    done = subprocess.run(
        [sys.executable, "-c", FIRST_USES], capture_output=True, text=True, check=False, cwd="/"
    )
    assert done.returncode == 0, done.stderr[-2000:]


def test_the_version_is_the_manifests():
    manifest = Path(solver.__file__).parents[1] / "blender_manifest.toml"
    assert solver.__version__ == tomllib.loads(manifest.read_text("utf-8"))["version"]


def test_a_name_that_does_not_exist_is_an_error():
    with pytest.raises(
        AttributeError,
        match=r"module 'scope\.solver' has no attribute "
        r"'fit_video'",
    ):
        _ = solver.fit_video
    with pytest.raises(ImportError, match="fit_video"):
        from scope.solver import fit_video  # noqa: F401
