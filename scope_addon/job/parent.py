# SPDX-License-Identifier: GPL-3.0-or-later
"""A process that ends with the one that started it, on every system, however that one ends.

The parent keeps the other end of the child's standard input and writes nothing more into it. The system closes it when
the parent is gone, also one that was killed or crashed; the child waits for that in a thread.
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

GRACE_S = 5.0  # that the main thread has to clean up; then the process ends without
_PEEK_S = 0.2  # between two looks at the pipe, on Windows


def when_parent_ends(end: Callable[[], object]) -> None:
    """Call ``end`` in a thread of its own when standard input, a pipe, closes; at once where it is closed already."""

    def wait() -> None:
        try:
            _wait_for_end_of_stdin()
        except BrokenPipeError:  # the end, in Windows' words
            pass
        except OSError:
            return  # no pipe, and so no parent to wait for
        end()

    threading.Thread(target=wait, name="scope-parent", daemon=True).start()


def stop_with_parent() -> None:
    """Have the main thread stop as by Ctrl-C when the parent is gone, and the process end soon after in any case."""

    def stop() -> NoReturn:
        from ..atomic_write import remove_temporary_files

        _thread.interrupt_main(signal.SIGINT)
        time.sleep(GRACE_S)
        remove_temporary_files()
        os._exit(130)

    when_parent_ends(stop)


def _wait_for_end_of_stdin() -> None:
    if sys.platform == "win32":
        # A read would hold the pipe for itself, and numpy's libraries, which ask for its state while they are loaded,
        # would wait for the read to end: https://github.com/numpy/numpy/issues/24290
        import _winapi
        import msvcrt

        handle = msvcrt.get_osfhandle(0)
        while True:
            _winapi.PeekNamedPipe(handle, 0)
            time.sleep(_PEEK_S)
    # Not sys.stdin, whose lock would hold up the exit of the interpreter.
    while os.read(0, 4096):
        pass
