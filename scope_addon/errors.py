# SPDX-License-Identifier: GPL-3.0-or-later
"""Every error of the application, beside the solver's own, and the exit status that each one leads to.

    ScopeError                  (solver)                                          exit 1
    ├── InputError              (solver) the user's file or value cannot be used
    │   ├── ModelFileError      (solver) a body or network file is missing or malformed
    │   ├── VideoError          a video or picture cannot be opened or decoded
    │   └── MotionFileError     a motion file is missing or malformed
    ├── ShapeError              (solver) an array of the wrong shape or type
    ├── UsageError              arguments that contradict or do not exist         exit 2
    ├── NoPersonError           nobody was found in the footage                   exit 3
    ├── OutputError             a result cannot be written
    ├── SetupError              something Scope needs is not installed or built
    └── CancelledError          the user asked to stop; nothing was written

Each message says what was wrong, with which file or value, and what to do about it.
"""

from __future__ import annotations

from ..solver.errors import InputError, ScopeError

FAILED, BAD_ARGUMENTS, NO_PERSON = 1, 2, 3  # exit statuses


class VideoError(InputError):
    """A video or picture cannot be opened or decoded."""


class MotionFileError(InputError):
    """A motion file is missing or malformed."""


class UsageError(ScopeError):
    """Arguments that contradict each other or name something that does not exist."""


class NoPersonError(ScopeError):
    """Nobody was found in the footage."""


class OutputError(ScopeError):
    """A result cannot be written."""


class SetupError(ScopeError):
    """Something Scope needs is not installed or was not built."""


class CancelledError(ScopeError):
    """The user asked to stop; nothing was written."""


def exit_status(error: ScopeError) -> int:
    """Return the status that a command line ends with after this error."""
    if isinstance(error, UsageError):
        return BAD_ARGUMENTS
    return NO_PERSON if isinstance(error, NoPersonError) else FAILED
