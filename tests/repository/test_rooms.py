# SPDX-License-Identifier: GPL-3.0-or-later
"""Imports follow the arrows of the drawing in docs/architecture.md, and never lead in a circle."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PRODUCT = ("solver", "scope_addon")
COMMAND_LINE = ("scope_addon/cli", "scope_addon/__main__")
# Options, and the files directly in scope_addon: the page says that the drawing leaves them out.
# All rooms may use them, except those of which they are made.
FOR_ALL = "files"
_IMPORT = re.compile(r"^ *from (\.+)([\w.]*) import (\([^)]*\)|.*)$", re.MULTILINE)
BELOW_ALL = {FOR_ALL: {"untrusted"}, "untrusted": {"solver"}, "solver": set[str]()}


def modules() -> list[str]:
    """Every module of the product, as a path without its suffix; a package is its folder."""
    paths = (
        p.relative_to(ROOT).with_suffix("") for top in PRODUCT for p in (ROOT / top).rglob("*.py")
    )
    return sorted((p.parent if p.name == "__init__" else p).as_posix() for p in paths)


@cache
def arrows() -> dict[str, set[str]]:
    """The boxes of the drawing, and those that arrows lead to from each."""
    page = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    drawing = page.partition("```mermaid\n")[2].partition("```")[0]
    ends = re.findall(r"^ +(\w+) --> (\w+)$", re.sub(r'\["[^"]*"\]', "", drawing), re.MULTILINE)
    found: dict[str, set[str]] = {box: {FOR_ALL} for pair in ends for box in pair}
    for start, end in ends:
        found[start].add(end)
    found["ui"].add("cli")
    return found | BELOW_ALL


@cache
def reachable(box: str) -> set[str]:
    """The boxes that a box may import: itself and those along its arrows."""
    return {box}.union(*(reachable(other) for other in arrows()[box]))


def room(module: str) -> str:
    """The box of the drawing that a module lies in."""
    top, *folders = module.split("/")
    if top == "solver":
        return "solver"
    if module in COMMAND_LINE or folders[:1] == ["command_line"]:
        return "cli"
    if not folders or folders[0] == "options" or (ROOT / f"{top}/{folders[0]}.py").is_file():
        return FOR_ALL
    if folders[0] == "capture":
        return folders[1] if len(folders) > 1 and folders[1] in arrows() else "pipeline"
    return folders[0]


@cache
def imported(module: str) -> frozenset[str]:
    """The modules of the product that a module imports, also inside functions and for type
    checking.
    """
    path = ROOT / module
    is_package = (path / "__init__.py").is_file()
    base = module.split("/") if is_package else module.split("/")[:-1]
    text = (path / "__init__.py" if is_package else path.with_suffix(".py")).read_text("utf-8")
    found = set()
    for dots, name, names in _IMPORT.findall(text):
        target = "/".join([*base[: len(base) - len(dots) + 1], *filter(None, name.split("."))])
        for alias in re.findall(r"(?:^|[,(])\s*(\w+)", names):
            inner = f"{target}/{alias}"
            # A folder alone may be left over from a package that was removed, with compiled
            # modules in it.
            is_module = (ROOT / inner / "__init__.py").is_file() or (ROOT / inner).with_suffix(
                ".py"
            ).is_file()
            found.add(inner if is_module else target)
    return frozenset(m for m in found if m.startswith(PRODUCT) and m != module)


def test_imports_follow_the_arrows_of_the_drawing() -> None:
    assert [
        f"{module} imports {target}: no arrows lead from {room(module)} to {room(target)}"
        for module in modules()
        for target in imported(module)
        if room(target) not in reachable(room(module))
    ] == []


def test_every_box_of_the_drawing_is_a_room_and_no_arrows_lead_in_a_circle() -> None:
    assert {room(module) for module in modules()} == set(arrows())
    for box, ends in arrows().items():
        assert not any(box in reachable(end) for end in ends), box


def test_no_module_imports_itself_through_others() -> None:
    done: set[str] = set()

    def visit(module: str, chain: tuple[str, ...]) -> None:
        assert module not in chain, (
            f"import circle: {' -> '.join((*chain[chain.index(module) :], module))}"
        )
        if module not in done:
            for target in imported(module):
                visit(target, (*chain, module))
            done.add(module)

    for module in modules():
        visit(module, ())
