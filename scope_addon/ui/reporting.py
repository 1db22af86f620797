# SPDX-License-Identifier: GPL-3.0-or-later
"""How an operator tells what it did, and what went wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy


def sentence(error: Exception | str) -> str:
    """An error's message as the panel shows it."""
    text = str(error).strip() or type(error).__name__
    return text[:1].upper() + text[1:]


class ReportingOperator(bpy.types.Operator):
    """An operator whose work is one method, ``work``; what goes wrong there is told as a sentence. Not registered."""

    bl_options = {"REGISTER", "UNDO"}

    if TYPE_CHECKING:  # each operator has its own

        def work(self, context: bpy.types.Context) -> str:
            """Do it; returns what to tell, or nothing."""

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do it and tell."""
        from ...solver.errors import ScopeError

        try:
            said = self.work(context)
        except (ScopeError, OSError) as error:
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        if said:
            self.report({"INFO"}, said)
        return {"FINISHED"}
