# SPDX-License-Identifier: GPL-3.0-or-later
"""Every error the solver raises on purpose. One tree, so that one ``except ScopeError`` is enough.

    ScopeError
    ├── InputError              the user's file or value cannot be used
    │   └── ModelFileError      a body file is missing or malformed
    └── ShapeError              an array of the wrong shape or type

``scope_addon/errors.py`` adds what can go wrong with footage, files and the command line.
Each message says what was wrong, with which file or value, and what to do about it.
"""


class ScopeError(Exception):
    """Root of the tree."""


class InputError(ScopeError):
    """The user's file or value cannot be used."""


class ModelFileError(InputError):
    """A body or network file is missing, malformed or does not match what is expected of it."""


class ShapeError(ScopeError, ValueError):
    """An array does not have the shape or type that was asked for."""
