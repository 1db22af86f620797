# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of Dask for the processes that the tests start, and of the waits for them."""

from __future__ import annotations

import importlib
import importlib.util
import os
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest

from ..required import package

# Otherwise every process looks at its own stacks a hundred times a second, in a fifth of these
# tests' processor time.
os.environ.setdefault("DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED", "False")


@pytest.fixture(autouse=True)
def polls_often(monkeypatch):
    """Look at the workers ten times a second, rather than once."""
    if importlib.util.find_spec("distributed") is not None:
        runner = importlib.import_module("scope.scope_addon.cluster.runner")
        monkeypatch.setattr(runner, "_POLLING_INTERVAL_S", 0.1)


def started(**options: Any) -> AbstractContextManager[Any]:
    """A context with a cluster of two workers."""
    defaults = {"threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": 60}
    return package("distributed").LocalCluster(n_workers=2, **defaults | options)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two worker processes; one that a test kills is started again.

    They end with the tests of a file: those of a package end with the whole run, and Dask's threads
    beside Blender's module crashed it, and met the faults of other tests.
    """
    with started() as cluster:
        yield cluster


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder for clips, with a subfolder."""
    clips = tmp_path / "clips"
    (clips / "below").mkdir(parents=True)
    return clips
