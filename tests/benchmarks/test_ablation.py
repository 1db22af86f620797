# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of the ablation leave out parts of the product that there are."""

from __future__ import annotations

from scope.benchmarks.ablation import ROWS, replaced


def test_every_row_replaces_something_that_there_is_and_puts_it_back() -> None:
    for row in ROWS.values():
        replacements = row.get("replacements", ())
        before = [getattr(owner, name) for owner, name, _ in replacements]
        with replaced(replacements):
            assert all(getattr(owner, name) is value for owner, name, value in replacements)
        assert [getattr(owner, name) for owner, name, _ in replacements] == before
