# SPDX-License-Identifier: GPL-3.0-or-later
"""Wheels that are not the pinned ones are refused, and one that is there is not downloaded
again.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
from scope.scope_addon.errors import SetupError
from scope.tools.pinned_wheel import PinnedWheel

CONTENT = b"a wheel"
WHEEL = PinnedWheel(
    "made-up==1.0", "made_up-1.0-py3-none-any.whl", hashlib.sha256(CONTENT).hexdigest()
)


def test_a_wheel_with_another_checksum_is_set_aside(tmp_path: Path) -> None:
    (tmp_path / WHEEL.file_name).write_bytes(b"not the wheel")
    with pytest.raises(SetupError, match="SHA-256"):
        WHEEL.fetch(tmp_path)
    assert not (tmp_path / WHEEL.file_name).exists()
