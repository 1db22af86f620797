# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions stay short enough to be read at once, and take few enough parameters to be called
without looking up.
"""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LINES, PARAMETERS, FILE_LINES = 60, 7, 500

# Modules of compiled kernels: they take their arrays one by one, and a call between kernels may
# cost speed.
KERNELS = {"scope_addon/capture/overlay/rasterizer.py"}
# Called by Blender, which passes as many arguments.
CALLED_BY_BLENDER = {"draw_item"}


def functions(path: Path) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Every function of a file, methods and inner functions included."""
    tree = ast.parse(path.read_text("utf-8"))
    return [
        node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """How many a caller passes: all but ``self`` and ``cls``."""
    names = [
        a.arg for a in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)
    ]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def test_functions_are_short_and_take_few_parameters() -> None:
    files = sorted((ROOT / "scope_addon").rglob("*.py"))
    assert len(files) > 300
    wrong = []
    for path in files:
        here = path.relative_to(ROOT).as_posix()
        for function in functions(path) if here not in KERNELS else []:
            where = f"{here}:{function.lineno} {function.name}"
            lines = (function.end_lineno or function.lineno) - function.lineno + 1
            if lines > LINES:
                wrong.append(f"{where} has {lines} lines")
            if function.name not in CALLED_BY_BLENDER and parameters(function) > PARAMETERS:
                wrong.append(f"{where} takes {parameters(function)} parameters")
    assert wrong == []


def test_the_exceptions_exist() -> None:
    for name in KERNELS:
        assert any(
            "njit" in ast.unparse(d) for f in functions(ROOT / name) for d in f.decorator_list
        ), name


def test_files_stay_readable() -> None:
    for top in ("solver", "scope_addon", "tools", "benchmarks", "tests"):
        for path in (ROOT / top).rglob("*.py"):
            lines = len(path.read_text("utf-8").splitlines())
            assert lines <= FILE_LINES, f"{path.relative_to(ROOT)} has {lines} lines"
