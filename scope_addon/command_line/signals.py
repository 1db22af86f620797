# SPDX-License-Identifier: GPL-3.0-or-later
"""Convert SIGINT, SIGTERM and SIGHUP to a KeyboardInterrupt whose message says what has been
written.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

received: list[int] = []  # signals that arrived since `stopped_by_signals` began


@contextmanager
def interrupted(message: str) -> Iterator[None]:
    """Give a KeyboardInterrupt that is raised in this block a message about what has been written.

    :raises KeyboardInterrupt: the block was interrupted.
    """
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(message) from None


def _interrupt(number: int, _: FrameType | None) -> None:
    """Record the signal and raise: an exception raised within a callback of the interpreter is
    lost.
    """
    received.append(number)
    raise KeyboardInterrupt


def stopping_signals() -> list[signal.Signals]:
    """Return the signals that end a command: Ctrl-C, a request, and a closed terminal, unless that
    is to be ignored.
    """
    found = [signal.SIGINT, signal.SIGTERM]
    # as nohup sets it
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
        found.append(signal.SIGHUP)
    return found


@contextmanager
def stopped_by_signals() -> Iterator[None]:
    """Raise KeyboardInterrupt on SIGINT, SIGTERM and SIGHUP, so that no partial file and no process
    is left behind.

    Blender's own handler of Ctrl-C only sets a flag, with which a batch would run to its end.

    :raises KeyboardInterrupt: a signal arrived.
    """
    received.clear()
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, _interrupt) for number in stopping_signals()}
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:  # None: it was not installed by Python and cannot be restored
                signal.signal(number, handler)
