# SPDX-License-Identifier: GPL-3.0-or-later
"""Users' networks without their processes, which `test_network_process` tests."""

from __future__ import annotations

import pytest
from scope.scope_addon.capture.perception import sessions
from scope.scope_addon.capture.perception.adapters import graph


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Open users' networks in the process of the test: another one takes a third of a second."""
    monkeypatch.setattr(graph, "NetworkProcess", sessions._open_on)
