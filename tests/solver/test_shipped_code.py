# SPDX-License-Identifier: GPL-3.0-or-later
"""Numba's cache of the solver never gives the code of other sources than it is asked for."""

import pytest
from numba.core import config
from scope.solver.shipped_code import KernelCache

KEY = "a signature"


def kernel():
    """Is nothing but a name."""


def code_for(sources):
    return KernelCache(kernel, sources)._cache_file


def test_an_index_without_its_data_is_not_that_of_earlier_data(monkeypatch, tmp_path):
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    code_for("old").save(KEY, "code of old")
    assert code_for("old").load(KEY) == "code of old"

    def killed(*_):
        raise KeyboardInterrupt

    ended = code_for("new")
    monkeypatch.setattr(ended, "_save_data", killed)
    with pytest.raises(KeyboardInterrupt):
        ended.save(KEY, "code of new")
    assert code_for("new").load(KEY) is None
    code_for("new").save(KEY, "code of new")
    code_for("new").save("another", "more")
    assert code_for("new").load(KEY) == "code of new"
    assert len(list(tmp_path.rglob("*.nbc"))) == 2
