# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl-C and requests to end, as a KeyboardInterrupt that states what was left behind."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

received: list[int] = []  # the signals that asked to stop


@contextmanager
def interrupted(what: str) -> Iterator[None]:
    """Make an interrupt in this block state what it left behind."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(what) from None


def _interrupt(number: int, _: FrameType | None) -> None:
    """Record it as well: an exception raised within a callback of the interpreter is lost."""
    received.append(number)
    raise KeyboardInterrupt


@contextmanager
def stopped_by_signals() -> Iterator[None]:
    """Raise KeyboardInterrupt on SIGINT and SIGTERM, so that no partial file and no process stays behind.

    Blender's own handler of Ctrl-C only sets a flag: a batch would run to its end.
    """
    received.clear()
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, _interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:  # None: not installed by Python, which cannot restore it
                signal.signal(number, handler)
