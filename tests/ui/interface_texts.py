# SPDX-License-Identifier: GPL-3.0-or-later
"""Every text of the interface that Blender or Scope translates, found in the registered classes and
in the source.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import scope
from scope.scope_addon import ui
from scope.scope_addon.clock import PLACING
from scope.scope_addon.job.job_progress import BUILDING, FIRST_ONLY, STAGES
from scope.scope_addon.notices import PARTS, PHRASES, SENTENCES
from scope.scope_addon.ui.pin_tool import HANDLES
from scope.scope_addon.ui.translations import CONTEXT

ROOT = Path(scope.__file__).resolve().parent / "scope_addon"
# Blender's contexts
OPERATOR = "Operator"
DEFAULT = "*"
# The same in every language: names of products, formats and axes.
UNTRANSLATED = {
    "Scope",
    "FBX",
    "glTF",
    "BVH",
    "USD",
    "NPZ",
    "TRC",
    "MOT",
    "C3D",
    "VRMA",
    "CPU",
    "CUDA",
    "TensorRT",
    "DirectML",
    "Core ML",
    "Y",
    "Z",
}
# Texts that are composed, in .blend files as well: joints under the mouse, corrections, stages of
# the progress.
_JOINTS = {name.replace("_", " ").title() for name in HANDLES}
CORRECTIONS = {
    *(
        "Left Foot Stands",
        "Right Foot Stands",
        "Upright Line",
        "Floor",
        "Feet on the Floor",
        "Interpolated",
        "Turned Around",
    ),
    *(f"{side} {part}" for side in ("Left", "Right") for part in ("Arm", "Leg", "Forearm", "Shin")),
    *(f"{side} {part}" for side in ("Left", "Right") for part in ("Hand", "Elbow", "Knee")),
    "Seat",
    "Back",
    *(f"{what} Exchanged" for what in ("Sides", "Arms", "Legs")),
}
_STAGES = {stage.capitalize() for stage in (*STAGES, *FIRST_ONLY, PLACING, BUILDING)}
# Texts of warnings; of some, a sentence consists of values alone.
_NOTICES = {
    text
    for text in (*SENTENCES.values(), *PHRASES.values(), *PARTS)
    if any(map(str.isalpha, re.sub(r"\{[^}]*\}", "", text)))
}
# Functions that look a text up, and the place of the text among their arguments.
_LOOKUPS = {"iface_": 0, "rpt_": 0, "tip_": 0, "translate": 0, "refuse": 1}
_LAYOUT_TEXTS = {"text", "placeholder", "title", "message", "confirm_text"}

Message = tuple[str, str]  # context and text


def stage_texts() -> set[str]:
    """Return what the progress of a capture says."""
    source = (ROOT / "job" / "job_progress.py").read_text(encoding="utf-8")
    return _STAGES | {
        text for _, text in _of_source(ast.parse(source)) if any(map(str.isalpha, text))
    }


def interface_texts() -> set[Message]:
    """Return the context and text of everything to translate."""
    found = {(DEFAULT, text) for text in _JOINTS | CORRECTIONS | _NOTICES | stage_texts()}
    for module in ui._MODULES:
        for cls in module.CLASSES:
            found |= set(_of_class(cls))
    for path in (ROOT / "ui").rglob("*.py"):
        found |= set(_of_source(ast.parse(path.read_text(encoding="utf-8"))))
    return {
        (context, text)
        for context, text in found
        if any(map(str.isalpha, text)) and text not in UNTRANSLATED
    }


def texts_without_lookup(path: Path) -> list[str]:
    """Return the composed texts and messages of a file that are shown to the user without having
    been looked up.
    """
    shown: list[ast.expr] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") in (
            "poll_message_set",
            "status_text_set",
        ):
            shown += node.args
        elif isinstance(node, ast.Call):
            reported = node.args[1:] if getattr(node.func, "attr", "") == "report" else []
            texts = [keyword.value for keyword in node.keywords if keyword.arg in _LAYOUT_TEXTS]
            shown += [text for text in (*reported, *texts) if isinstance(text, ast.JoinedStr)]
        elif isinstance(node, ast.FunctionDef) and node.name in ("work", "edit"):
            shown += [
                each.value for each in ast.walk(node) if isinstance(each, ast.Return) and each.value
            ]
    parts = [
        part
        for text in shown
        if isinstance(text, ast.Constant | ast.JoinedStr)
        for part in _literals(text)
    ]
    return [part for part in parts if any(map(str.isalpha, part))]


def _literals(text: ast.Constant | ast.JoinedStr) -> list[str]:
    values = text.values if isinstance(text, ast.JoinedStr) else [text]
    return [
        value.value
        for value in values
        if isinstance(value, ast.Constant) and isinstance(value.value, str)
    ]


def _of_class(cls: Any) -> Iterator[Message]:
    is_operator = issubclass(cls, bpy.types.Operator)
    if label := getattr(cls, "bl_label", ""):
        yield (OPERATOR if is_operator else DEFAULT), label
    if issubclass(cls, bpy.types.Menu):
        yield DEFAULT, cls.__doc__ or ""
    if is_operator:
        group, name = cls.bl_idname.split(".")
        rna = getattr(getattr(bpy.ops, group), name).get_rna_type()
        yield DEFAULT, rna.description
    else:
        rna = cls.bl_rna
    declared = {name for each in cls.__mro__ for name in getattr(each, "__annotations__", {})}
    for prop in rna.properties:
        if prop.identifier in declared and prop.is_hidden and prop.type == "ENUM":
            yield from ((DEFAULT, item.description) for item in prop.enum_items)
        elif prop.identifier in declared and prop.name and not prop.is_hidden:
            yield from _of_property(prop)


def _of_property(prop: Any) -> Iterator[Message]:
    if prop.name != prop.identifier and not prop.name.islower():  # otherwise it is never drawn
        yield prop.translation_context, prop.name
    yield DEFAULT, prop.description
    if prop.type == "ENUM":
        for item in prop.enum_items:
            yield prop.translation_context, item.name
            yield DEFAULT, item.description


def _of_source(tree: ast.Module) -> Iterator[Message]:
    """Texts of the calls in one file: lookups, reports, and the texts that layouts draw."""
    for scope_node in ast.walk(tree):
        if not isinstance(scope_node, ast.FunctionDef):
            continue
        for call in (node for node in ast.walk(scope_node) if isinstance(node, ast.Call)):
            name = (
                call.func.attr
                if isinstance(call.func, ast.Attribute)
                else getattr(call.func, "id", "")
            )
            if name in _LOOKUPS and call.args:
                looked_up = call.args[_LOOKUPS[name]]
                yield from ((CONTEXT, text) for text in _constants(looked_up, tree))
            elif name == "report" and len(call.args) == 2:
                yield from ((DEFAULT, text) for text in _constants(call.args[1], scope_node))
            for keyword in call.keywords:
                if keyword.arg in _LAYOUT_TEXTS:
                    context = OPERATOR if name == "operator" else DEFAULT
                    yield from ((context, text) for text in _constants(keyword.value, scope_node))


def _constants(node: ast.expr, inside: ast.AST) -> Iterator[str]:
    """Texts that an expression may have; a name has those that ``inside`` assigns to it."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _constants(node.body, inside)
        yield from _constants(node.orelse, inside)
    elif isinstance(node, ast.Name):
        for other in ast.walk(inside):
            if isinstance(other, ast.Assign) and any(
                isinstance(t, ast.Name) and t.id == node.id for t in other.targets
            ):
                if not (isinstance(other.value, ast.Name) and other.value.id == node.id):
                    yield from _constants(other.value, inside)
            elif isinstance(other, ast.For) and isinstance(other.target, ast.Tuple):
                yield from _loop_texts(node.id, other, inside)


def _loop_texts(name: str, loop: ast.For, inside: ast.AST) -> Iterator[str]:
    """Texts of one variable of ``for text, mode in (("In Place", 1), ...)``."""
    assert isinstance(loop.target, ast.Tuple)
    names = [getattr(target, "id", "") for target in loop.target.elts]
    if name in names and isinstance(loop.iter, ast.Tuple):
        for row in loop.iter.elts:
            if isinstance(row, ast.Tuple):
                yield from _constants(row.elts[names.index(name)], inside)
