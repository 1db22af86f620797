# SPDX-License-Identifier: GPL-3.0-or-later
"""Every error and warning Scope raises on purpose. One tree, so that one ``except ScopeError`` is enough.

    ScopeError
    ├── InputError              the user's file or value cannot be used           exit 1
    │   ├── VideoError          a video or picture cannot be opened or decoded
    │   ├── ModelFileError      a body or network file is missing or malformed
    │   ├── MotionFileError     a motion file is missing or malformed
    │   ├── ShapeError          an array of the wrong shape or type
    │   └── InvalidValueError   an array or option of the right shape with a value that cannot be used
    ├── UsageError              arguments that contradict or do not exist         exit 2
    ├── NoPersonError           nobody was found in the footage                   exit 3
    ├── OutputError             a result cannot be written                        exit 1
    ├── SetupError              something Scope needs is not installed or built   exit 1
    └── CancelledError          the user asked to stop; nothing was written       exit 1

    ScopeWarning                what is probably a mistake, but can be used (a UserWarning)
    └── UnitsWarning            lengths that are probably not in metres

Each message says what was wrong, with which file or value, and what to do about it.
"""


class ScopeError(Exception):
    """Root of the tree; ``exit_status`` is what the command line ends with."""

    exit_status = 1


class InputError(ScopeError):
    """The user's file or value cannot be used."""


class VideoError(InputError):
    """A video or picture cannot be opened or decoded."""


class ModelFileError(InputError):
    """A body or network file is missing, malformed or does not match what is expected of it."""


class MotionFileError(InputError):
    """A motion file is missing or malformed."""


class ShapeError(InputError, ValueError):
    """An array does not have the shape or type that was asked for."""


class InvalidValueError(InputError, ValueError):
    """An array, option or name has the right shape and type, but a value that cannot be used."""


class UsageError(ScopeError):
    """Arguments that contradict each other or name something that does not exist."""

    exit_status = 2


class NoPersonError(ScopeError):
    """Nobody was found in the footage."""

    exit_status = 3


class OutputError(ScopeError):
    """A result cannot be written."""


class SetupError(ScopeError):
    """Something Scope needs is not installed or was not built."""


class CancelledError(ScopeError):
    """The user asked to stop; nothing was written."""


class ScopeWarning(UserWarning):
    """Root of the warnings: what was given is probably a mistake, but can be used."""


class UnitsWarning(ScopeWarning):
    """Lengths are probably not in metres."""
