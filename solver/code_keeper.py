# SPDX-License-Identifier: Apache-2.0
"""Who keeps the machine code of the kernels: numba's own cache, unless a program brings another.

This file needs no numba, so that a program can choose before numba is loaded.
"""

from collections.abc import Callable
from typing import Any, Protocol


class CodeKeeper(Protocol):
    """What keeps the machine code of kernels; a kernel is an object that `numba.njit` returns."""

    def prepare(self, kernel: Any) -> None:
        """Set up how a kernel of the solver is compiled, before its first call."""

    def keep(self, kernel: Any) -> None:
        """Keep a kernel's machine code from its first call on, and use what was kept before."""

    def has_code(self, kernel: Any) -> bool:
        """Whether there seems to be machine code of a kernel that was given to `keep`."""


_makers: list[Callable[[], CodeKeeper]] = []  # at most one
_users: list[Callable[[CodeKeeper], None]] = []


def keep_code_with(make: Callable[[], CodeKeeper]) -> None:
    """Let another keeper take care of all kernels, of those that exist and of those to come.

    :param make: makes the keeper. It is called when the first kernel is defined, or at once if
        there are kernels already.
    """
    _makers[:] = [make]
    for use in _users:
        use(make())


def use_keeper(use: Callable[[CodeKeeper], None]) -> None:
    """Call `use` with the keeper that was chosen, if one was, and with every later choice."""
    _users.append(use)
    for make in _makers:
        use(make())
