# SPDX-License-Identifier: GPL-3.0-or-later
"""A missing requirement skips a test, fails it in CI, and skips it there too if that is
requested.
"""

from __future__ import annotations

import pytest

from .required import missing


@pytest.fixture(autouse=True)
def no_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("CI", "WITHOUT"):
        monkeypatch.delenv(name, raising=False)


def test_fails_in_ci(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CI", "1")
    with pytest.raises(pytest.fail.Exception, match="the data; this may not be skipped in CI"):
        missing("the data", allowed_by="WITHOUT")


def test_skips_in_ci_where_that_was_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CI", "1")
    monkeypatch.setenv("WITHOUT", "1")
    with pytest.raises(pytest.skip.Exception):
        missing("the data", allowed_by="WITHOUT")
