# SPDX-License-Identifier: GPL-3.0-or-later
"""Machine code serves a package under whatever name it is loaded: Blender has another for it."""

import os

import pytest

from .small_package import make_package

# A kernel whose argument's class is the package's own, and one that it calls.
KERNELS = """
from typing import NamedTuple

import numpy as np

from .kernel import kernel


class Pair(NamedTuple):
    a: float
    b: np.ndarray


@kernel
def add(pair):
    return pair.a + pair.b[0]


@kernel
def both(pair):
    return pair.b[1] + add(pair)
"""
LOAD = """
import importlib, importlib.util, sys, types

NAME = "bl_ext.user_default.package"
for name in ("bl_ext", "bl_ext.user_default"):
    sys.modules[name] = types.ModuleType(name)
    sys.modules[name].__path__ = []
spec = importlib.util.spec_from_file_location(
    NAME, "package/__init__.py", submodule_search_locations=["package"]
)
sys.modules[NAME] = module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
"""
RUN = """
import importlib
import numpy as np

importlib.import_module(f"{NAME}.scope_addon")
kernels = importlib.import_module(f"{NAME}.solver.kernels")
found = kernels.both(kernels.Pair(1.0, np.array([2.0, 5.0])))
print(found, sum(kernels.both.stats.cache_hits.values()))
"""
UNDER_BLENDERS_NAME = (
    LOAD
    + RUN
    + """
assert not [name for name in sys.modules if name == "package" or name.startswith("package.")]
"""
)
UNDER_ITS_OWN_NAME = "NAME = 'package'\n" + RUN


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["worker first", "Blender first"])
def test_code_that_was_compiled_under_one_name_serves_under_the_other(run_code, tmp_path, order):
    (make_package(tmp_path) / "kernels.py").write_text(KERNELS)
    environment = dict(os.environ, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    texts = (UNDER_ITS_OWN_NAME, UNDER_BLENDERS_NAME)
    results = [run_code(texts[k], tmp_path, environment).stdout.split() for k in order]
    assert results == [["8.0", "0"], ["8.0", "1"]]
