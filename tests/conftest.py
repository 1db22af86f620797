# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures shared by all tests."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from scope.solver.body import Body

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


@pytest.fixture(scope="session")
def body() -> Body:
    """The built-in body without fingers."""
    from scope.solver.loaders.body_file import load_body

    return load_body("scope")


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """Leave without Blender's exit handlers, which can wait forever for a thread of their own (see ``cli.run``)."""
    if "bpy" in sys.modules:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(int(config.stash.get(EXIT_STATUS, 1)))


EXIT_STATUS = pytest.StashKey[int]()


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Remember the status for ``pytest_unconfigure``, which is not told."""
    session.config.stash[EXIT_STATUS] = int(exitstatus)
