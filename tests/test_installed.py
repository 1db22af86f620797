# SPDX-License-Identifier: GPL-3.0-or-later
"""A shell's limit on addresses: too low a one is refused before anything is loaded, with what to
do.
"""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from scope.scope_addon import installed
from scope.scope_addon.errors import SetupError

CODE = "from scope.scope_addon.installed import address_space_limit as limit; print(limit())"


@pytest.mark.parametrize(
    ("limit", "with_scene", "message"),
    [
        (None, True, ""),
        (4_000_000_000, True, ""),
        (2_600_000_000, False, ""),
        (
            2_600_000_000,
            True,
            "2.60 GB of address space, but a capture needs 3.20 GB: run ulimit -v unlimited first",
        ),
        (1_000_000_000, False, "1.00 GB of address space, but a capture needs 2.50 GB"),
    ],
)
def test_a_limit_below_what_is_needed_is_refused(monkeypatch, limit, with_scene, message) -> None:
    monkeypatch.setattr(installed, "address_space_limit", lambda: limit)
    if message:
        with pytest.raises(SetupError, match=message):
            installed.check_memory_limit(with_scene=with_scene)
    else:
        installed.check_memory_limit(with_scene=with_scene)


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
