# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers with their noun, for messages in English."""

from __future__ import annotations


def counted(count: int, noun: str, nouns: str = "") -> str:
    """Return a number with its noun: ``1 frame``, ``2 frames``, ``0 people``.

    :param noun: for 1.
    :param nouns: for every other number; if empty, ``noun`` and an s.
    """
    return f"{count} {noun}" if count == 1 else f"{count} {nouns or noun + 's'}"
