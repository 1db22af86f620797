# SPDX-License-Identifier: Apache-2.0
"""Every error and warning the solver raises on purpose. One tree, so that one ``except ScopeError``
is enough.

    ScopeError
    └── InputError                  the user's file or value cannot be used
        ├── ModelFileError          a body file is missing or malformed
        ├── ShapeError              an array of the wrong shape or type
        └── InvalidValueError       an array or option of the right shape with a value that cannot
                                    be used

    ScopeWarning                    what is probably a mistake, but can be used (a UserWarning)
    └── UnitsWarning                lengths that are probably not in metres, or times not in seconds

``scope_addon/errors.py`` adds what can go wrong with footage, files and the command line.
Each message says what was wrong, with which file or value, and what to do about it.
"""

from __future__ import annotations

import sys
import warnings


class ScopeError(Exception):
    """Root of the tree."""


class InputError(ScopeError):
    """The user's file or value cannot be used."""


class ModelFileError(InputError):
    """A body or network file is missing, malformed or does not match what is expected of it."""


class ShapeError(InputError, ValueError):
    """An array does not have the shape or type that was asked for."""


class InvalidValueError(InputError, ValueError):
    """An array, option or name has the right shape and type, but a value that cannot be used."""


class ScopeWarning(UserWarning):
    """Root of the warnings: what was given is probably a mistake, but can be used."""


class UnitsWarning(ScopeWarning):
    """Lengths are probably not in metres, or times not in seconds."""


def warn_caller(message: str, kind: type[ScopeWarning] = ScopeWarning) -> None:
    """Warn of what a caller of the solver gave, at the line outside this package that gave it."""
    package = f"{__package__}."
    level = 1
    frame = sys._getframe()
    while frame.f_back is not None and f"{frame.f_globals.get('__name__')}.".startswith(package):
        frame = frame.f_back
        level += 1
    warnings.warn(message, kind, stacklevel=level)
