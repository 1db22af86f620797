# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors of the application, in addition to those of the solver, and the exit status of each.

    ScopeError                  (solver)                                          exit 1
    ├── InputError              (solver) the user's file or value cannot be used
    │   ├── ModelFileError      (solver) a body or network file is missing or malformed
    │   ├── VideoError          a video or image cannot be opened or decoded
    │   │   └── OfflineError    a stream, while Blender is not to go online
    │   └── MotionFileError     a motion file is missing or malformed
    ├── ShapeError              (solver) an array of the wrong shape or type
    ├── UsageError              invalid or contradictory arguments                exit 2
    ├── NoPersonError           no person was found in the footage                exit 3
    ├── OutputError             a result cannot be written
    ├── SetupError              something that Scope needs is not installed or built
    ├── ClusterError            a cluster cannot be reached, was lost, or cannot capture
    └── CancelledError          the user cancelled; nothing was written

Each message says what was wrong, with which file or value, and what to do about it.
"""

from __future__ import annotations

import errno
import warnings
from pathlib import Path

from ..solver.errors import InputError, ScopeError, ScopeWarning

# exit statuses
FAILED = 1
BAD_ARGUMENTS = 2
NO_PERSON = 3


class VideoError(InputError):
    """A video or image cannot be opened or decoded."""


class ChangedFootageError(VideoError):
    """The footage, or a file that an option names, was changed while it was read."""


class OfflineError(VideoError):
    """A stream, while Blender is not to go online."""

    def __init__(self) -> None:
        super().__init__(
            "a stream needs the network: switch on Allow Online Access in Blender's "
            "preferences, System"
        )


class MotionFileError(InputError):
    """A motion file is missing or malformed."""


class UsageError(ScopeError):
    """Invalid arguments: they contradict each other or name something that does not exist."""


class NoPersonError(ScopeError):
    """No person was found in the footage."""


class OutputError(ScopeError):
    """A result cannot be written."""


class SetupError(ScopeError):
    """Something that Scope needs is not installed or was not built."""


class ClusterError(ScopeError):
    """A cluster cannot be reached, was lost, or none of its workers can capture."""


class CancelledError(ScopeError):
    """The user cancelled; nothing was written."""


def keep_solver_hints_from_users() -> None:
    """Let this process print no ``ScopeWarning``: these are for programs that call the solver.

    What the application measures may look as mistaken as what they name: people who leap off a roof
    are under the floor. Each process of the application calls this; one that only imports its
    packages keeps the hints. Filters of ``python -W`` and of tests come first.
    """
    warnings.filterwarnings("ignore", category=ScopeWarning, append=True)


def exit_status(error: ScopeError) -> int:
    """Return the exit status of a command that failed with this error."""
    if isinstance(error, UsageError):
        return BAD_ARGUMENTS
    return NO_PERSON if isinstance(error, NoPersonError) else FAILED


def internal_error_message(error: Exception) -> str:
    """Describe an error that Scope should not have, and what to do."""
    cause = " ".join(f"{type(error).__name__}: {error}".split())
    return (
        f"an internal error, {cause}; please report it (the environment variable SCOPE_TRACEBACK=1 "
        f"shows where)"
    )


def unreadable(footage: Path, error: OSError) -> VideoError:
    """Return the error for footage whose disk or server fails while it is read."""
    return VideoError(
        f"{footage} cannot be read any more ({error.strerror}); check its disk or server, and "
        "capture again"
    )


def system_error_message(error: OSError | MemoryError) -> str:
    """Describe an error of the operating system, and what to do."""
    if isinstance(error, PermissionError):
        advice = (
            "check the permissions of that file or folder, and whether another program has it open"
        )
    elif isinstance(error, FileNotFoundError):
        advice = "check that this file or folder, and the current folder, still exist"
    elif isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
        advice = "choose a shorter name"
    else:
        advice = "free disk space or memory and try again"
    return f"the operating system reports an error: {str(error) or 'out of memory'}; {advice}"


_WITHOUT_MEMORY = (
    "bad_alloc",
    "can't start new thread",
    "annot allocate memory",
    "failed to map segment",  # this and the next: of the system, when it loads a library
    "cannot map zero-fill pages",
    "OutOfMemoryError",  # OpenCV's
)


def lacks_memory(error: BaseException) -> bool:
    """Return whether an error means that there is too little memory; libraries have errors of their
    own for that.
    """
    return isinstance(error, MemoryError) or any(text in str(error) for text in _WITHOUT_MEMORY)
