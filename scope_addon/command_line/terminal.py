# SPDX-License-Identifier: GPL-3.0-or-later
"""The terminal: messages, the progress bar, and a stdout that carries nothing but the report."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Self, TextIO

from ..footage import display_text
from . import signals

_USUAL_COLUMNS = 80  # of a terminal that does not say how many it has
_CLEAR_LINE = "\r\x1b[K"


def print_message(text: str) -> None:
    """Print a message on a separate line, even if a progress bar is shown."""
    clear = _CLEAR_LINE if sys.stderr.isatty() else ""
    print(f"{clear}scope: {display_text(text)}", file=sys.stderr, flush=True)


def open_standard_streams() -> None:
    """Open those of the three standard streams that the caller has closed.

    Otherwise the next files to be opened would take their numbers, and messages be written into
    results. What is written to a closed standard output fails; messages are lost.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # takes the lowest number that is free
            os.open(os.devnull, os.O_RDWR if number == 2 else os.O_RDONLY)
    sys.stdin = sys.stdin or os.fdopen(0, "r", encoding="utf-8", closefd=False)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8", closefd=False)


def _columns(stream: TextIO) -> int:
    """Return how many characters a terminal's line has."""
    with suppress(OSError, ValueError):
        if columns := os.get_terminal_size(stream.fileno()).columns:
            return columns
    return _USUAL_COLUMNS


class ProgressLine:
    """One line on a terminal, each text of which replaces the one before; silent elsewhere. Stops
    after a signal.
    """

    def __init__(self, stream: TextIO, *, show: bool) -> None:
        self._stream = stream
        self._show = show and stream.isatty()

    def write(self, text: str) -> None:
        """Show a text.

        :raises KeyboardInterrupt: a signal arrived, but its own KeyboardInterrupt was lost.
        """
        if signals.received:
            raise KeyboardInterrupt
        if self._show:
            # A line that wraps would stay above the next one.
            self._stream.write(f"{_CLEAR_LINE}{display_text(text)[: _columns(self._stream) - 1]}")
            self._stream.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._show:
            self._stream.write(_CLEAR_LINE)


class ProgressBar(ProgressLine):
    """A one-line progress bar on a terminal; silent elsewhere. Stops work that continues after a
    signal.
    """

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show the progress of a stage: ``done`` of ``total``, which is 0 if unknown.

        :raises KeyboardInterrupt: a signal arrived, but its own KeyboardInterrupt was lost.
        """
        if total:
            filled = min(30, 30 * done // total)
            self.write(f"{stage:<20} [{'#' * filled}{'.' * (30 - filled)}] {done}/{total}")
        else:
            self.write(f"{stage:<20} {done or ''}")


@contextmanager
def stdout_for_report() -> Iterator[TextIO]:
    """Redirect everything that libraries print to stdout, including from C, to stderr.

    :return: context manager that gives the real stdout, for the report.
    """
    sys.stdout.flush()
    try:
        real = os.dup(1)
    except OSError:  # stdout is closed
        yield sys.stdout
        return
    os.dup2(2, 1)
    # output buffered before, such as Blender's version, is not part of the report either
    _flush_c()
    try:
        with os.fdopen(os.dup(real), "w", encoding="utf-8") as stream:
            yield stream
    finally:
        sys.stdout.flush()
        _flush_c()
        os.dup2(real, 1)
        os.close(real)


def _flush_c() -> None:
    """Write out what C libraries have buffered for stdout."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL("ucrtbase" if os.name == "nt" else None).fflush(None)
