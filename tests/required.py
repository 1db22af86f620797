# SPDX-License-Identifier: GPL-3.0-or-later
"""Handle missing requirements of tests: skip on a developer's machine, fail in CI."""

from __future__ import annotations

import importlib
import os
from types import ModuleType
from typing import NoReturn

import pytest


def missing(reason: str, allowed_by: str | None = None) -> NoReturn:
    """Skip the running test because of a missing requirement, or fail it if ``CI`` is set.

    :param reason: what is missing, and what to do.
    :param allowed_by: environment variable that, if set, allows the test to be skipped in CI too.
    """
    if os.environ.get("CI") and not (allowed_by and os.environ.get(allowed_by)):
        pytest.fail(f"{reason}; this may not be skipped in CI", pytrace=False)
    pytest.skip(reason, allow_module_level=True)


def package(name: str) -> ModuleType:
    """Import a package of the development environment; if it is not installed, call ``missing``."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        missing(f"{name} cannot be imported ({error}); ./scripts/setup installs it")


def need_encoder(codec: str) -> None:
    """Call ``missing`` if PyAV has been built without an encoder."""
    av = package("av")
    try:
        av.Codec(codec, "w")
    except av.codec.codec.UnknownCodecError:
        missing(
            f"this build of PyAV has no encoder {codec}; ./scripts/setup installs one that does"
        )
