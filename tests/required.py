# SPDX-License-Identifier: GPL-3.0-or-later
"""What to do where something that a test needs is not there: skip on a developer's machine, fail in CI."""

from __future__ import annotations

import importlib
import os
from types import ModuleType
from typing import NoReturn

import pytest


def missing(reason: str, allowed_by: str | None = None) -> NoReturn:
    """End the running test because of something it needs: skip it, but fail it where ``CI`` is set.

    :param allowed_by: environment variable that, where it is set, allows the test to be skipped in CI too.
    """
    if os.environ.get("CI") and not (allowed_by and os.environ.get(allowed_by)):
        pytest.fail(f"{reason}; this may not be skipped in CI", pytrace=False)
    pytest.skip(reason, allow_module_level=True)


def package(name: str) -> ModuleType:
    """Import a package of the development environment; where it is not installed, see ``missing``."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        missing(f"{name} cannot be imported ({error}); ./scripts/setup installs it")
