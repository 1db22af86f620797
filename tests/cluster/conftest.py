# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of Dask for the processes that the tests start, and of the waits for them."""

import importlib
import importlib.util
import os

import pytest

# Otherwise every process looks at its own stacks a hundred times a second, in a fifth of these
# tests' processor time.
os.environ.setdefault("DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED", "False")


@pytest.fixture(autouse=True)
def polls_often(monkeypatch):
    """Look at the workers ten times a second, rather than once."""
    if importlib.util.find_spec("distributed") is not None:
        runner = importlib.import_module("scope.scope_addon.cluster.runner")
        monkeypatch.setattr(runner, "_POLLING_INTERVAL_S", 0.1)
