# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real clips and motion data that lies beside the checkout."""
    if not (SHARED / "data").is_dir():
        if os.environ.get("CI"):
            pytest.fail(f"{SHARED}/data must be there in CI: the tests on real clips may not be skipped")
        pytest.skip("../shared/data is not beside this checkout: the tests on real clips need it")
    return SHARED
