# SPDX-License-Identifier: GPL-3.0-or-later
"""The limit that a shell sets is the one that is read."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

CODE = (
    "from scope.scope_addon.command_line.address_space import address_space_limit as limit; "
    "print(limit())"
)


def limit_under(command: str) -> str:
    done = subprocess.run(
        ["sh", "-c", f'{command} && exec "$0" -c "$1"', sys.executable, CODE],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


@pytest.mark.skipif(
    sys.platform != "linux", reason="macOS has no such limit, Windows no shell that sets one"
)
def test_the_limit_is_that_of_the_shell() -> None:
    assert limit_under("ulimit -v 3000000") == str(3000000 * 1024)
    assert limit_under("true") == limit_here()


def limit_here() -> str:
    done = subprocess.run(
        [sys.executable, "-c", CODE], capture_output=True, text=True, check=True, env=os.environ
    )
    return done.stdout.strip()
