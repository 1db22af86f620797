# SPDX-License-Identifier: GPL-3.0-or-later
"""Docstrings of public functions say what a caller cannot see: shapes of arrays, and errors.

The source is parsed, not imported. A function's errors are those that it raises itself and those of
the functions of its module, of private methods and, in the solver, of the checks in validation.py
that it calls, unless it catches them. What a constructor takes and raises may be said by the
docstring of its class.
"""

import ast
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOLVER = ROOT / "solver"
CHECKS = SOLVER / "validation.py"
PACKAGES = (SOLVER, ROOT / "scope_addon")
# (n,), (..., 3), (K+1, 3, P), (M', 3), (), ...: extents are numbers, n, m, capitals and what is
# added to them.
EXTENT = (
    r"(?:\.\.\.|\d*\s?(?:[A-Z][A-Z_]*'?|[nmT]|count|None)(?:\s?[+-]\s?\w)*|\d+(?:\s?\+\s?[A-Z])*)"
)
SHAPE = re.compile(rf"\((?:|\.\.\.|{EXTENT},|{EXTENT}(?:, {EXTENT})+)\)")
ARRAY = re.compile(r"\b(\w*Array|ArrayLike)\b")
CONSTRUCTORS = ("__init__", "__post_init__")
INTERNAL = {"AssertionError"}  # a mistake in the program, which no caller handles
KERNELS = {
    "kernel",
    "allocating_kernel",
    "inlined_kernel",
    "expanded_kernel",
    "formula",
    "intrinsic",
    "compiled",
}


@dataclass(frozen=True)
class Function:
    """A function or method: where it is, what it says and what it does."""

    name: str
    node: ast.FunctionDef
    module: Path
    owner: ast.ClassDef | None = None

    @property
    def doc(self) -> str:
        own = ast.get_docstring(self.node) or ""
        of_class = (
            self.owner is not None
            and self.node.name in CONSTRUCTORS
            and ast.get_docstring(self.owner)
        )
        return f"{own}\n{of_class or ''}"

    @property
    def array_parameters(self) -> list[str]:
        arguments = self.node.args
        everything = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
        return [
            a.arg for a in everything if a.annotation and ARRAY.search(ast.unparse(a.annotation))
        ]

    @property
    def is_compiled(self) -> bool:
        return any(isinstance(d, ast.Name) and d.id in KERNELS for d in self.node.decorator_list)


def parse(tree: ast.Module, path: Path) -> list[Function]:
    """The module's functions and the methods of its classes, private ones included; no nested
    functions.
    """
    found = []
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            found.append(Function(node.name, node, path))
        elif isinstance(node, ast.ClassDef):
            methods = [n for n in node.body if isinstance(n, ast.FunctionDef)]
            found += [Function(f"{node.name}.{n.name}", n, path, node) for n in methods]
    return found


def is_public(name: str) -> bool:
    return all(not part.startswith("_") or part in CONSTRUCTORS for part in name.split("."))


@cache  # not while collecting, which every process does
def trees() -> dict[Path, ast.Module]:
    files = [path for package in PACKAGES for path in sorted(package.rglob("*.py"))]
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in files}


@cache
def modules() -> dict[Path, list[Function]]:
    return {path: parse(tree, path) for path, tree in trees().items()}


@cache
def public_functions() -> dict[str, Function]:
    return {
        f"{path.relative_to(ROOT).with_suffix('').as_posix()}:{f.name}": f
        for path, functions in modules().items()
        for f in functions
        if is_public(f.name) and not f.is_compiled
    }


@cache
def base_classes() -> dict[str, set[str]]:
    """The direct base classes of every error of ours, by name; all are at the top of their
    modules.
    """
    classes = [
        node
        for tree in trees().values()
        for node in tree.body
        if isinstance(node, ast.ClassDef) and node.name.endswith("Error")
    ]
    return {node.name: {ast.unparse(base) for base in node.bases} for node in classes}


def with_bases(error: str) -> set[str]:
    """An error's name and those of all its base classes that are ours, with Python's directly above
    them.
    """
    return {error}.union(*(with_bases(base) for base in base_classes().get(error, ())))


def last_name(node: ast.expr) -> str:
    """The name of a class or function, without the module or object before it."""
    return (
        node.id
        if isinstance(node, ast.Name)
        else node.attr
        if isinstance(node, ast.Attribute)
        else ""
    )


@cache
def groups_of_errors() -> dict[str, set[str]]:
    """What modules catch by the name of a tuple of errors at their top, such as ``_DAMAGED``."""
    assigned = [
        node for tree in trees().values() for node in tree.body if isinstance(node, ast.Assign)
    ]
    tuples = [
        (node.targets[0], node.value.elts) for node in assigned if isinstance(node.value, ast.Tuple)
    ]
    return {
        name.id: set(map(last_name, kinds)) for name, kinds in tuples if isinstance(name, ast.Name)
    }


def caught_by(handler: ast.ExceptHandler) -> set[str]:
    kinds = (
        handler.type.elts
        if isinstance(handler.type, ast.Tuple)
        else [handler.type]
        if handler.type
        else []
    )
    names = {last_name(kind) for kind in kinds} or {"BaseException"}
    return names.union(*(groups_of_errors().get(name, ()) for name in names))


def is_caught(error: str, caught: frozenset[str]) -> bool:
    return bool((with_bases(error) | {"Exception", "BaseException"}) & caught)


Places = list[tuple[ast.Raise | ast.Call, frozenset[str]]]


@cache
def raising_places(node: ast.AST, caught: frozenset[str] = frozenset()) -> Places:
    """The statements that raise and the calls below a node, each with the errors that are caught
    around it.
    """
    if isinstance(node, ast.Try):
        inside = caught.union(*map(caught_by, node.handlers))
        rest = [*node.handlers, *node.orelse, *node.finalbody]
        parts = [
            *(raising_places(n, inside) for n in node.body),
            *(raising_places(n, caught) for n in rest),
        ]
    elif isinstance(node, ast.With):
        calls = [
            item.context_expr for item in node.items if isinstance(item.context_expr, ast.Call)
        ]
        inside = caught.union(
            *(map(last_name, call.args) for call in calls if last_name(call.func) == "suppress")
        )
        parts = [
            *(raising_places(n, caught) for n in node.items),
            *(raising_places(n, inside) for n in node.body),
        ]
    else:
        parts = [raising_places(child, caught) for child in ast.iter_child_nodes(node)]
    own: Places = [(node, caught)] if isinstance(node, ast.Raise | ast.Call) else []
    return own + [place for part in parts for place in part]


def raised(function: Function, seen: frozenset[str] = frozenset()) -> set[str]:
    """The names of the errors that a function raises, as described above."""
    errors = set()
    for node, caught in raising_places(function.node):
        found = set()
        if isinstance(node, ast.Raise):
            name = last_name(node.exc.func) if isinstance(node.exc, ast.Call) else ""
            found = {name} if name[:1].isupper() and name not in INTERNAL else set()
        elif (called := last_name(node.func)) and called not in seen:
            found = found.union(
                *(raised(other, seen | {called}) for other in called_functions(function, node))
            )
        errors |= {error for error in found if not is_caught(error, caught)}
    return errors


def called_functions(function: Function, call: ast.Call) -> list[Function]:
    """The functions of the same module, the private methods and the solver's checks that a call may
    mean.
    """
    called = last_name(call.func)
    near = modules()[function.module]
    if isinstance(call.func, ast.Attribute):
        return [f for f in near if called[0] == "_" and f.name.endswith(f".{called}")]
    checks = modules()[CHECKS] if function.module.is_relative_to(SOLVER) else []
    return [f for f in near + checks if f.name == called]


def test_the_parser_finds_shapes_and_errors() -> None:
    for text in (
        "(n,)",
        "(..., 3, 3)",
        "(K+1, 3, P)",
        "(M', 3)",
        "(...)",
        "(n, 8 + W)",
        "(count, 3, 3)",
        "(None, 3)",
    ):
        assert SHAPE.search(text), text
    for text in ("exp(phi)", "(see below)", "(x, y, z)", "f(a, b)"):
        assert not SHAPE.search(text), text
    public = public_functions()
    assert raised(public["solver/arrays:as_arrays"]) == {"ShapeError"}
    assert raised(public["solver/validation:check_weight"]) == {"InvalidValueError"}
    assert raised(public["scope_addon/job/batch:Batch.run"]) == {"UsageError", "OutputError"}
    assert raised(public["scope_addon/cli:main"]) == set()  # it prints what it catches
    assert raised(public["scope_addon/cluster/remote:download"]) == {
        "UsageError"
    }  # of a private function that it calls
    assert sum(name.startswith("solver/") for name in public) > 100
    assert len(public) > 800


def test_docstrings_give_the_shapes_of_arrays() -> None:
    with_arrays = {name: f for name, f in public_functions().items() if f.array_parameters}
    assert len(with_arrays) > 350
    missing = {
        n: f.doc
        for n, f in with_arrays.items()
        if len(SHAPE.findall(f.doc)) < len(f.array_parameters)
    }
    assert missing == {}


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_docstrings_name_the_errors(package: Path) -> None:
    missing = {}
    some = 0
    for name, function in public_functions().items():
        if function.module.is_relative_to(package) and (errors := raised(function)):
            documented = set(re.findall(r":raises (\w+):", function.doc))
            missing[name] = [error for error in errors if not with_bases(error) & documented]
            some += 1
    assert some > 60
    assert {name: errors for name, errors in missing.items() if errors} == {}
