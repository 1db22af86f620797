# SPDX-License-Identifier: GPL-3.0-or-later
"""The built-in body that other options ask for: with fingers for hands, of all ages for the height
of a child.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...solver.body_file import CHILD_BELOW_M, body_with_children, body_with_hands
from .capture import OFF


def chosen_body(values: Mapping[str, Any]) -> str:
    """Return the name or file of the body for the values of a capture's options.

    :param values: by the option's name: ``body``, ``heights_m`` and, where fingers can be captured,
        ``hands``.
    """
    which: str = values["body"]
    if values.get("hands", OFF) != OFF:
        which = body_with_hands(which)
    return (
        body_with_children(which)
        if any(height < CHILD_BELOW_M for height in values["heights_m"])
        else which
    )
