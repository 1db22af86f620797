# SPDX-License-Identifier: GPL-3.0-or-later
"""Docstrings of the solver's public functions say what a caller cannot see: shapes of arrays, and errors.

The source is parsed, not imported. A function's errors are those that it raises itself, and those of the functions of
its module, of private methods and of the checks in validation.py that it calls.
"""

import ast
import re
from dataclasses import dataclass
from pathlib import Path

import pytest
from scope import solver

ROOT = Path(solver.__file__).parent
CHECKS = ROOT / "validation.py"
# (n,), (..., 3), (K+1, 3, P), (M', 3), (), ...: extents are numbers, n, m, capitals and what is added to them.
EXTENT = r"(?:\.\.\.|\d*\s?(?:[A-Z][A-Z_]*'?|[nmT]|count|None)(?:\s?[+-]\s?\w)*|\d+(?:\s?\+\s?[A-Z])*)"
SHAPE = re.compile(rf"\((?:|\.\.\.|{EXTENT},|{EXTENT}(?:, {EXTENT})+)\)")
ARRAY = re.compile(r"\b(NDArray|ArrayLike|Array)\b")
KERNELS = {"kernel", "allocating_kernel", "inlined_kernel", "expanded_kernel", "intrinsic", "compiled"}


@dataclass(frozen=True)
class Function:
    """A function or method of the solver: where it is, what it says and what it does."""

    name: str
    node: ast.FunctionDef
    module: Path

    @property
    def doc(self) -> str:
        return ast.get_docstring(self.node) or ""

    @property
    def array_parameters(self) -> list[str]:
        arguments = self.node.args
        everything = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
        return [a.arg for a in everything if a.annotation and ARRAY.search(ast.unparse(a.annotation))]

    @property
    def is_compiled(self) -> bool:
        return any(isinstance(d, ast.Name) and d.id in KERNELS for d in self.node.decorator_list)


def parse(path: Path) -> list[Function]:
    """The module's functions and the methods of its classes, private ones included; no nested functions."""
    found = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            found.append(Function(node.name, node, path))
        elif isinstance(node, ast.ClassDef):
            methods = [n for n in node.body if isinstance(n, ast.FunctionDef)]
            found += [Function(f"{node.name}.{n.name}", n, path) for n in methods]
    return found


def is_public(name: str) -> bool:
    return all(not part.startswith("_") or part in ("__init__", "__post_init__") for part in name.split("."))


MODULES = {path: parse(path) for path in sorted(ROOT.rglob("*.py"))}
PUBLIC = {
    f"{path.relative_to(ROOT).with_suffix('')}:{f.name}": f
    for path, functions in MODULES.items()
    for f in functions
    if is_public(f.name) and not f.is_compiled
}


def raised(function: Function, seen: frozenset[str] = frozenset()) -> set[str]:
    """The names of the errors that a function raises, by itself or through the functions described above."""
    errors = set()
    for node in ast.walk(function.node):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and isinstance(node.exc.func, ast.Name):
            errors |= {node.exc.func.id} if node.exc.func.id[0].isupper() else set()
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute):
            called = node.func.id if isinstance(node.func, ast.Name) else node.func.attr
            if called in seen:
                continue
            if isinstance(node.func, ast.Name):
                others = [f for f in MODULES[function.module] + MODULES[CHECKS] if f.name == called]
            else:
                others = [f for f in MODULES[function.module] if called[0] == "_" and f.name.endswith(f".{called}")]
            for other in others:
                errors |= raised(other, seen | {called})
    return errors


def test_the_parser_finds_shapes_and_errors() -> None:
    for text in ("(n,)", "(..., 3, 3)", "(K+1, 3, P)", "(M', 3)", "(...)", "(n, 8 + W)", "(count, 3, 3)", "(None, 3)"):
        assert SHAPE.search(text), text
    for text in ("exp(phi)", "(see below)", "(x, y, z)", "f(a, b)"):
        assert not SHAPE.search(text), text
    assert raised(PUBLIC["rotations:exp"]) == {"ShapeError"}
    assert raised(PUBLIC["validation:check_weight"]) == {"InvalidValueError"}
    assert len(PUBLIC) > 100


@pytest.mark.parametrize("name", [name for name, f in PUBLIC.items() if f.array_parameters])
def test_docstrings_give_the_shapes_of_arrays(name: str) -> None:
    function = PUBLIC[name]
    shapes = len(SHAPE.findall(function.doc))
    assert shapes >= len(function.array_parameters), (function.array_parameters, function.doc)


@pytest.mark.parametrize("name", [name for name, f in PUBLIC.items() if raised(f)])
def test_docstrings_name_the_errors(name: str) -> None:
    documented = set(re.findall(r":raises (\w+):", PUBLIC[name].doc))
    assert raised(PUBLIC[name]) <= documented
