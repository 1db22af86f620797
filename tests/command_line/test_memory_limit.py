# SPDX-License-Identifier: GPL-3.0-or-later
"""A shell's limit on addresses: too low a one is refused before anything is loaded, with what to
do.
"""

from __future__ import annotations

import pytest
from scope.scope_addon.command_line import memory_limit
from scope.scope_addon.errors import SetupError


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
    monkeypatch.setattr(memory_limit, "address_space_limit", lambda: limit)
    if message:
        with pytest.raises(SetupError, match=message):
            memory_limit.check_memory_limit(with_scene=with_scene)
    else:
        memory_limit.check_memory_limit(with_scene=with_scene)
