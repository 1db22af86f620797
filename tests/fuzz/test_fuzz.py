# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged inputs of every reader give one sentence or none: past findings and new ones; more by ./scripts/fuzz."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import pytest
from scope.solver.errors import ScopeError

from .fuzz import CORPUS, check, inputs, random_inputs
from .targets import TARGETS

COUNT = {"picture": 60, "video": 100, "body": 20, "motion": 100}  # of inputs, in some 10 s of CPU
WHOLE = sorted(TARGETS.keys() - {"pickle"})  # whose body has too few vertices


@pytest.mark.parametrize("name", TARGETS)
def test_damaged_inputs_raise_nothing_but_ours(tmp_path: Path, name: str) -> None:
    for path in islice(inputs(name, tmp_path, seed=1), COUNT.get(name, 250)):
        check(name, path)


@pytest.mark.parametrize("name", TARGETS)
def test_random_bytes_raise_nothing_but_ours(tmp_path: Path, name: str) -> None:
    for path in random_inputs(name, tmp_path, seed=1, count=30_000):
        check(name, path)


@pytest.mark.parametrize("path", sorted(CORPUS.iterdir()), ids=lambda path: path.name)
def test_past_findings_are_refused(path: Path) -> None:
    """Each once crashed, hung, took all memory or ran code."""
    with pytest.raises(ScopeError):
        TARGETS[path.name.partition("-")[0]].read(path)


@pytest.mark.parametrize("name", WHOLE)
def test_what_is_damaged_was_whole(tmp_path: Path, name: str) -> None:
    """Otherwise all would be refused at the door."""
    target = TARGETS[name]
    for data in target.seeds(tmp_path):
        accepted = []
        for suffix in target.suffixes:
            path = tmp_path / f"input{suffix}"
            path.write_bytes(data)
            try:
                target.read(path)
            except ScopeError as error:
                accepted.append(str(error))
            else:
                break
        else:
            pytest.fail(f"{data[:40]!r}: {accepted}")
