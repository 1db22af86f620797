# SPDX-License-Identifier: GPL-3.0-or-later
"""End a process when its parent ends, on every operating system and even if the parent crashes.

The parent keeps the other end of the child's standard input open, and writes nothing to it, or
commands. The operating system closes that end when the parent ends, killed or crashed parents
included; the child waits for this in a thread.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import NoReturn

GRACE_S = 5.0  # time for the main thread to clean up, after which the process ends in any case
_POLLING_INTERVAL_S = 0.2  # of the pipe, on Windows


def when_parent_ends(
    end: Callable[[], object], receive: Callable[[bytes], object] = lambda _: None
) -> None:
    """Call ``end`` in a new thread when standard input, a pipe, is closed; immediately if it is
    closed already.

    :param receive: gets what the parent writes before, in any pieces.
    """

    def wait() -> None:
        try:
            _wait_for_end_of_stdin(receive)
        except BrokenPipeError:  # Windows reports the end of the pipe this way
            pass
        except OSError:
            return  # not a pipe, so there is no parent to wait for
        end()

    threading.Thread(target=wait, name="scope-parent", daemon=True).start()


def stop_with_parent() -> None:
    """Interrupt the main thread, as Ctrl-C does, when the parent ends; end the process ``GRACE_S``
    later.
    """

    def stop() -> NoReturn:
        from ..atomic_write import remove_temporary_files

        _thread.interrupt_main(signal.SIGINT)
        time.sleep(GRACE_S)
        remove_temporary_files()
        os._exit(130)

    when_parent_ends(stop)


def _wait_for_end_of_stdin(receive: Callable[[bytes], object]) -> None:
    if sys.platform == "win32":
        # A blocking read would lock the pipe, and numpy's libraries, which query its state while
        # they are loaded, would wait for the read to end:
        # https://github.com/numpy/numpy/issues/24290
        import _winapi
        import msvcrt

        handle = msvcrt.get_osfhandle(0)
        while True:
            available, _ = _winapi.PeekNamedPipe(handle, 0)
            if available:
                receive(os.read(0, available))
            else:
                time.sleep(_POLLING_INTERVAL_S)
    # Not sys.stdin, whose lock would block the exit of the interpreter.
    while piece := os.read(0, 4096):
        receive(piece)
