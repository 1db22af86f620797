# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings as results in a .blend file store them. Loaded while Blender starts."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import bpy

from ...notices import Notice, notice_from
from ...scene.animation_data.stored_values import FrameSpan, spans_text
from ..reporting import warning_text


def add_warning(
    shown: bpy.types.PropertyGroup, warning: Notice, spans: Sequence[FrameSpan] = ()
) -> None:
    """Store a warning with a result: its English text, and the record from which it is shown in the
    user's language.
    """
    import json

    stored = shown.warnings.add()
    stored.text = warning_text(warning, str)
    stored.record = json.dumps(warning.as_json())
    stored.spans = spans_text(spans)


def stored_warning(stored: bpy.types.PropertyGroup) -> Notice:
    """Return a warning of a result. Of one whose record is damaged or missing, the text is left."""
    import json

    record = None
    with suppress(ValueError, RecursionError):
        record = json.loads(stored.record)
    return notice_from(record, stored.text, lambda found: warning_text(found, str))
