# SPDX-License-Identifier: GPL-3.0-or-later
"""One table says which room may import which, directly or through others; nothing imports in a
circle.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PRODUCT = ("solver", "scope_addon")

# Each room and the rooms that its files may import directly; what these may import in turn, it may
# reach as well. A name stands for a file, or for a folder and everything below it, unless a longer
# name fits better.
SOLVER: dict[str, set[str]] = {"solver": set()}
CAPTURE = {
    "scope_addon/capture/media": {"scope_addon/files", "scope_addon/machine_code"},
    "scope_addon/capture/perception": {"scope_addon/kinematics"},
    "scope_addon/capture/camera": {"scope_addon/capture/perception"},
    "scope_addon/capture/tracking": {"scope_addon/capture/camera"},
    "scope_addon/capture/fitting": {"scope_addon/capture/tracking", "scope_addon/capture/overlay"},
    "scope_addon/capture/world": {"scope_addon/capture/fitting"},
    "scope_addon/capture/overlay": {
        "scope_addon/capture/media",
        "scope_addon/capture/camera",
        "scope_addon/capture/perception",
    },
    "scope_addon/capture/options": {"scope_addon/capture/fitting", "scope_addon/options"},
    "scope_addon/capture/stages": {"scope_addon/capture/world", "scope_addon/capture/options"},
    "scope_addon/capture": {"scope_addon/capture/stages", "scope_addon/capture/overlay"},
    # around the main road, which does not know of it
    "scope_addon/capture/long_clips": {"scope_addon/capture"},
}
ROOMS = {
    **SOLVER,
    # the files directly in scope_addon that every room may use, see SHARED
    "scope_addon/files": {"scope_addon/untrusted"},
    "scope_addon/machine_code": {"scope_addon/files"},
    "scope_addon/kinematics": {"scope_addon/files"},
    "scope_addon/untrusted": {"solver"},
    **CAPTURE,
    "scope_addon/options": {"scope_addon/files"},
    "scope_addon/edit": {"scope_addon/kinematics"},
    "scope_addon/retarget": {"scope_addon/edit"},
    "scope_addon/smpl_import": {"scope_addon/edit"},
    "scope_addon/scene": {"scope_addon/scene/character", "scope_addon/retarget"},
    "scope_addon/scene/animation_data": {"scope_addon/files"},
    "scope_addon/scene/character": {"scope_addon/scene/animation_data", "scope_addon/edit"},
    "scope_addon/job": {
        "scope_addon/capture",
        "scope_addon/capture/long_clips",
        "scope_addon/edit",
        "scope_addon/live",
    },
    "scope_addon/cluster": {"scope_addon/job"},
    "scope_addon/report": {"scope_addon/capture/overlay", "scope_addon/kinematics"},
    "scope_addon/live": {"scope_addon/capture"},
    "scope_addon/ui": {
        "scope_addon/scene",
        "scope_addon/job",
        "scope_addon/smpl_import",
        "scope_addon/cli",
    },
    "scope_addon/command_line": {
        "scope_addon/scene",
        "scope_addon/job",
        "scope_addon/smpl_import",
        "scope_addon/report",
        "scope_addon/live",
        "scope_addon/cluster",
    },
    "scope_addon/cli": {"scope_addon/command_line"},
}
SHARED = (
    "arrays",
    "errors",
    "installed",
    "motion",
    "atomic_write",
    "footage",
    "footage_view",
    "counts",
    "json_file",
    "parent",
    "temporary",
    "review_spans",
    "notices",
    "capture_report",
    "__init__",
)
# in docs/architecture.md, which says so
NOT_DRAWN = {"scope_addon/options", "scope_addon/files", "scope_addon/cli"}
# a part of the box of that name
PIPELINE = {"scope_addon/capture/stages", "scope_addon/capture/options"}


def modules() -> list[str]:
    """Every module of the product, as a path without its suffix; a package is its folder."""
    paths = (
        p.relative_to(ROOT).with_suffix("") for top in PRODUCT for p in (ROOT / top).rglob("*.py")
    )
    return sorted((p.parent if p.name == "__init__" else p).as_posix() for p in paths)


@cache
def room(module: str) -> str:
    """The room of the table that a module lies in."""
    top, _, rest = module.partition("/")
    if top == "scope_addon" and "/" not in rest and not (ROOT / module).is_dir():
        return "scope_addon/files" if rest in SHARED else "scope_addon/cli"
    if module == "scope_addon":
        return "scope_addon/files"
    return max((name for name in ROOMS if f"{module}/".startswith(f"{name}/")), key=len)


@cache
def imported(module: str) -> frozenset[str]:
    """The modules of the product that a module imports, also inside functions and for type
    checking.
    """
    path = ROOT / module
    package = (path / "__init__.py").is_file()
    base = module.split("/") if package else module.split("/")[:-1]
    found = set()
    for node in ast.walk(
        ast.parse((path / "__init__.py" if package else path.with_suffix(".py")).read_text("utf-8"))
    ):
        if isinstance(node, ast.ImportFrom) and node.level:
            target = "/".join(
                [*base[: len(base) - node.level + 1], *filter(None, (node.module or "").split("."))]
            )
            for alias in node.names:
                inner = f"{target}/{alias.name}"
                # A folder alone may be left over from a package that was removed, with compiled
                # modules in it.
                is_module = (ROOT / inner / "__init__.py").is_file() or (ROOT / inner).with_suffix(
                    ".py"
                ).is_file()
                found.add(inner if is_module else target)
    return frozenset(m for m in found if m.startswith(PRODUCT) and m != module)


@cache
def reachable(name: str) -> set[str]:
    """The rooms that a room may reach: itself, those of its row, and theirs."""
    seen = set()
    todo = [name]
    while todo:
        here = todo.pop()
        if here not in seen:
            seen.add(here)
            todo += ROOMS[here]
    return seen


def test_a_module_reaches_only_rooms_of_its_row() -> None:
    """Follow its imports to the end, so that nothing leaks in through another room."""
    leaks = []
    for module in modules():
        allowed = reachable(room(module))
        seen = set()
        todo: list[tuple[str, tuple[str, ...]]] = [(module, (module,))]
        while todo:
            here, chain = todo.pop()
            for target in imported(here):
                if target not in seen:
                    seen.add(target)
                    if room(target) not in allowed:
                        leaks.append(
                            f"{' -> '.join((*chain, target))}: not in the row of {room(module)}"
                        )
                    todo.append((target, (*chain, target)))
    assert leaks == []


def test_the_table_has_no_circle_and_no_room_that_does_not_exist() -> None:
    for name, below in ROOMS.items():
        assert not any(name in reachable(other) for other in below), (
            f"{name} and a room of its row reach each other"
        )
        exists = (ROOT / name).is_dir() or (ROOT / f"{name}.py").is_file()
        assert exists or name in ("scope_addon/files", "scope_addon/cli"), f"{name} does not exist"


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


def room_drawn(name: str) -> str:
    """The room that a box of the drawing stands for; `pipeline` is the folder with the list of
    stages.
    """
    special = {
        "solver": "solver",
        "pipeline": "scope_addon/capture",
        "cli": "scope_addon/command_line",
    }
    folders = (f"{top}/{name}" for top in ("scope_addon", "scope_addon/capture"))
    return special.get(name) or next(folder for folder in folders if folder in ROOMS)


def test_the_drawing_of_the_rooms_is_the_table() -> None:
    """Each row's rooms can be reached along the arrows, and nothing else can."""
    page = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    drawing = page.partition("```mermaid\n")[2].partition("```")[0]
    boxes = re.sub(r'\["[^"]*"\]', "", drawing)
    arrows: dict[str, set[str]] = {}
    for start, end in re.findall(r"^ +(\w+) --> (\w+)$", boxes, re.MULTILINE):
        arrows.setdefault(room_drawn(start), set()).add(room_drawn(end))
    drawn = {*arrows, *(end for ends in arrows.values() for end in ends)}
    rooms = {
        name
        for name in ROOMS
        if name.count("/") == 1 or name.rpartition("/")[0] == "scope_addon/capture"
    } | {"solver"}
    assert drawn == rooms - PIPELINE - NOT_DRAWN

    def along(start: str) -> set[str]:
        return {start}.union(*(along(end) for end in arrows.get(start, ())))

    for name in drawn:
        assert along(name) == reachable(name) & drawn, name
