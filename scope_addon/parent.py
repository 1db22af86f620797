# SPDX-License-Identifier: GPL-3.0-or-later
"""End a process when its parent ends, on every operating system and however the parent ends.

The parent keeps the other end of the child's standard input open, and writes nothing to it, or
commands. A thread of the child waits until the operating system closes that end, which it also does
when the parent is killed or crashes, and asks from time to time whether the parent is still there:
another process may have inherited the end by mistake.

A thread of Python stands still while a library keeps the interpreter's lock, and for good while the
interpreter ends. Two timers of the system need no lock, and end the process then.

The module needs the standard library alone, and is also loaded by scripts without the package.
"""

from __future__ import annotations

import _thread
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable

# Time for the main thread to clean up, and then for this module. The child of a parent that was
# killed ends after twice `_LIMIT_S` at the latest.
GRACE_S = 4.0
_LIMIT_S = 5
_INTERVAL_S = 0.5  # between two looks at the parent
STOPPED = 130  # exit status of a process that was stopped, as when its parent has ended


def end_with_parent(
    clean: Callable[[], object] = lambda: None,
    receive: Callable[[bytes], object] | None = lambda _: None,
    *,
    interrupts: bool = False,
    parent: int | None = None,
) -> None:
    """End this process when its parent ends or closes this process's standard input, a pipe.

    :param clean: called, in a thread, before the process ends; removes what must not be left.
    :param receive: gets what the parent writes to the pipe, in any pieces; None: somebody else
        reads it.
    :param interrupts: whether to interrupt the main thread first, as Ctrl-C does, and to give it
        ``GRACE_S`` to clean up.
    :param parent: process id; None: the parent is running now.
    """
    parent = os.getppid() if parent is None else parent
    _end_without_interpreter()

    def wait() -> None:
        try:
            _wait_for_end(parent, receive)
        except BrokenPipeError:  # Windows reports the end of the pipe this way
            pass
        except OSError:
            return  # not a pipe, so there is no parent to wait for
        if hasattr(signal, "alarm"):
            signal.alarm(_LIMIT_S)  # the interpreter may be about to end, or stand still
        try:
            if interrupts:
                _thread.interrupt_main(signal.SIGINT)
                time.sleep(GRACE_S)
            clean()
        finally:
            os._exit(STOPPED)

    threading.Thread(target=wait, name="scope-parent", daemon=True).start()


def _wait_for_end(parent: int, receive: Callable[[bytes], object] | None) -> None:
    """Return when a process has ended, or when standard input is closed, if that is read.

    :raises OSError: standard input cannot be read.
    """
    if sys.platform == "win32":
        import _winapi
        import msvcrt

        if receive is None:
            process = _winapi.OpenProcess(_winapi.SYNCHRONIZE, False, parent)
            _winapi.WaitForSingleObject(process, _winapi.INFINITE)
            return
        # A blocking read would lock the pipe, and numpy's libraries, which query its state while
        # they are loaded, would wait for the read to end:
        # https://github.com/numpy/numpy/issues/24290
        handle = msvcrt.get_osfhandle(0)
        while True:
            available, _ = _winapi.PeekNamedPipe(handle, 0)
            if available:
                receive(os.read(0, available))
            else:
                time.sleep(_INTERVAL_S)
    while os.getppid() == parent:
        signal.alarm(0)  # which was set by the end of a thread of the parent's
        if receive is None:
            time.sleep(_INTERVAL_S)
        elif select.select([0], [], [], _INTERVAL_S)[0]:
            # Not sys.stdin, whose lock would block the exit of the interpreter.
            piece = os.read(0, 4096)
            if not piece:
                return
            receive(piece)


def _end_without_interpreter() -> None:
    """Have Linux end this process some seconds after its parent, whatever the interpreter does.

    At the parent's end, the system sends the signal 5, and its handler is the C library's
    ``alarm``, which takes the signal's number as seconds, after which another signal ends the
    process. Before that, `_wait_for_end` usually notices the parent's end. The system also sends
    the signal when only the parent's thread ends that has started this process; the alarm is then
    called off.
    """
    if sys.platform != "linux":
        return
    import ctypes

    set_signal_at_parents_end = 1  # PR_SET_PDEATHSIG
    library = ctypes.CDLL(None)
    library.signal.argtypes = [ctypes.c_int, ctypes.c_void_p]
    library.signal.restype = ctypes.c_void_p
    library.signal(_LIMIT_S, ctypes.cast(library.alarm, ctypes.c_void_p))
    library.prctl(set_signal_at_parents_end, _LIMIT_S, 0, 0, 0)
