# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts in the user's language, warnings as results in a .blend file store them, and operators that
report their result or error as a message. Loaded while Blender starts.

Before their work, operators put back the libraries that come with the extension. Blender keeps the
wheels of all enabled extensions in one folder, and removes those of the others whenever a process
ends or enables one: so one that was started with factory settings takes them away from all that
run.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence
from contextlib import suppress
from importlib.util import find_spec
from typing import TYPE_CHECKING

import bpy
from bpy.app.translations import pgettext_iface, pgettext_rpt, pgettext_tip
from bpy.types import Context, Operator, PropertyGroup

from ...solver.errors import ScopeError
from ..errors import SetupError
from ..footage import display_text
from ..notices import Notice, Translate, notice_from
from ..scene.stored_values import FrameSpan, spans_text
from .translations import CONTEXT

_PACKAGE = __package__.rpartition(".scope_addon")[0]
_NEEDED = ("numba", "llvmlite", "cv2", "onnxruntime", "av")


def iface_(text: str, **values: object) -> str:
    """Return a label in the user's language, with values for its placeholders."""
    translated: str = pgettext_iface(text, CONTEXT)
    return translated.format(**values) if values else translated


def rpt_(text: str, **values: object) -> str:
    """Return a message to report in the user's language, with values for its placeholders."""
    translated: str = pgettext_rpt(text, CONTEXT)
    return translated.format(**values) if values else translated


def tip_(text: str, **values: object) -> str:
    """Return a tooltip in the user's language, with values for its placeholders."""
    translated: str = pgettext_tip(text, CONTEXT)
    return translated.format(**values) if values else translated


def refuse(operator: type[Operator], reason: str, **values: object) -> bool:
    """Say in the user's language why an operator cannot be used, with values for placeholders;
    return False, as its ``poll`` then does.
    """
    operator.poll_message_set(tip_(reason, **values))
    return False


def sentence(error: Exception | str, name: str = "") -> str:
    """Return an error's message with a capital first letter, as the panel shows it; a file's name
    keeps its own.

    :param name: of a file with which the message may begin; without it, a first word such as
        ``walk.mp4`` is one.
    """
    text = display_text(str(error).strip()) or type(error).__name__
    first = text.split()[0].rstrip(":,")
    if (name and text.startswith(display_text(name))) or "." in first.rstrip("."):
        return text
    return text[:1].upper() + text[1:]


def warning_text(warning: Notice, translate: Translate = iface_) -> str:
    """Return a warning as the panel shows it, in the user's language by default."""
    return sentence(warning.text(translate), str(warning.values.get("footage", "")))


class ReportingOperator(Operator):
    """An operator that runs ``work`` and reports the result, or the error's message. Not
    registered.
    """

    bl_options = {"REGISTER", "UNDO"}

    if TYPE_CHECKING:  # implemented by each operator

        def work(self, context: Context) -> str:
            """Do the work and return a message for the user, which may be empty."""

    def execute(self, context: Context) -> set[str]:
        """Run ``work`` and report."""
        try:
            restore_libraries()
            message = self.work(context)
        except (ScopeError, OSError, ImportError) as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        if message:
            self.report({"INFO"}, display_text(message))
        return {"FINISHED"}

    def report_all(self, message: str, warnings: Sequence[Notice]) -> str:
        """Report a result and then its warnings, because Blender's status bar shows the last report
        alone; return the empty message of ``work``.
        """
        self.report({"INFO"}, display_text(message))
        for warning in warnings:
            self.report({"WARNING"}, warning_text(warning, rpt_))
        return ""


def restore_libraries() -> None:
    """Have Blender unpack the extension's wheels again if some are missing.

    :raises SetupError: some are still missing.
    """
    if _PACKAGE not in bpy.context.preferences.addons or not _missing():
        return
    import addon_utils

    addon_utils.extensions_refresh(ensure_wheels=True)
    importlib.invalidate_caches()
    if missing := _missing():
        raise SetupError(
            f"a part of Scope is missing ({', '.join(missing)}), which another Blender may have "
            "removed: disable Scope in the preferences and enable it again; if that does not help, "
            "reinstall it"
        )


def _missing() -> list[str]:
    """Return the libraries that are not on the disk, where a worker would look for them."""
    specs = {name: find_spec(name) for name in _NEEDED}
    return [
        name
        for name, spec in specs.items()
        if spec is None or not os.path.exists(spec.origin or "")
    ]


def add_warning(shown: PropertyGroup, warning: Notice, spans: Sequence[FrameSpan] = ()) -> None:
    """Store a warning with a result."""
    import json

    stored = shown.warnings.add()
    stored.record = json.dumps(warning.as_json())
    stored.spans = spans_text(spans)


def stored_warning(stored: PropertyGroup) -> Notice:
    """Return a warning of a result."""
    import json

    record = None
    with suppress(ValueError, RecursionError):
        record = json.loads(stored.record)
    return notice_from(record)
