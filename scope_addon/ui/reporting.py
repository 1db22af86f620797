# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts in the user's language, and operators that report their result or error as a message."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.app.translations import pgettext_iface, pgettext_rpt, pgettext_tip

from ...solver.errors import ScopeError
from ..footage import display_text
from ..notices import Notice, Translate
from .libraries import restore_libraries
from .translations import CONTEXT


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


class ReportingOperator(bpy.types.Operator):
    """An operator that runs ``work`` and reports the result, or the error's message. Not
    registered.
    """

    bl_options = {"REGISTER", "UNDO"}

    if TYPE_CHECKING:  # implemented by each operator

        def work(self, context: bpy.types.Context) -> str:
            """Do the work and return a message for the user, which may be empty."""

    def execute(self, context: bpy.types.Context) -> set[str]:
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
