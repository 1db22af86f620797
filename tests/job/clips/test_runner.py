# SPDX-License-Identifier: GPL-3.0-or-later
"""Outcomes of clips: those that have ended together come in the clips' order."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from scope.scope_addon.job.clip_runner import LocalRunner

from ..processes import wait_for


def test_clips_that_have_ended_while_nobody_looked_come_in_their_order(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One at a time ends after the other; the last one of them may not be noted yet when the others
    are taken.
    """
    ended = list[str]()

    def capture(_: LocalRunner, task: Any) -> dict[str, str]:
        ended.append(task.name)
        return {"name": task.name}

    monkeypatch.setattr(LocalRunner, "_capture", capture)
    names = [f"clip {number}" for number in range(40)]
    tasks: Any = [SimpleNamespace(name=name) for name in names]
    outcomes = LocalRunner([], 1).outcomes(tasks)
    assert next(outcomes) == {}
    wait_for(lambda: len(ended) == len(names))
    assert [name for found in outcomes for name in found] == names
