# SPDX-License-Identifier: GPL-3.0-or-later
"""The cluster of a batch as users see it before any clip: a sentence, and no output folder."""

import pytest
from scope.scope_addon import installed
from scope.scope_addon.cli import main


def batch(tmp_path, scheduler):
    return main(["batch", str(tmp_path), "--out", str(tmp_path / "out"), "--scheduler", scheduler])


@pytest.mark.usefixtures("blender_module")
@pytest.mark.parametrize(
    ("hidden", "says"),
    [
        (
            "distributed",
            "distributed must be installed for this: pip install 'distributed>=",
        ),
        (
            ".cluster",
            "Blender's extension cannot use a cluster; use ./scripts/batch in the repository\n",
        ),
    ],
)
def test_a_cluster_needs_the_package_and_the_room(tmp_path, capsys, monkeypatch, hidden, says):
    find = installed.find_spec
    monkeypatch.setattr(
        installed, "find_spec", lambda name: None if name.endswith(hidden) else find(name)
    )
    monkeypatch.delitem(installed.sys.modules, "distributed", raising=False)
    assert batch(tmp_path, "tcp://127.0.0.1:1") == 1
    assert says in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("blender_module")
def test_an_address_that_is_none_is_a_bad_argument(tmp_path, capsys):
    assert batch(tmp_path, "8786") == 2
    assert "--scheduler must be an address" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("blender_module")
def test_a_url_without_a_cluster_is_a_bad_argument(tmp_path, capsys):
    assert main(["batch", "s3://bucket/clips", "--out", str(tmp_path / "out")]) == 2
    assert "footage and results at a URL need a cluster" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
