# SPDX-License-Identifier: GPL-3.0-or-later
"""What the page says about the computer and the versions."""

import platform
import tomllib
from pathlib import Path

import numpy as np
from scope.scope_addon.report import machine

ROOT = Path(__file__).resolve().parents[2]


def test_versions_are_those_that_run():
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    said = machine.versions().split(", ")
    assert {
        f"Scope {stated}",
        f"Python {platform.python_version()}",
        f"numpy {np.__version__}",
    } <= set(said)


def test_the_version_of_an_unknown_installation_is_said_to_be_unknown(tmp_path, monkeypatch):
    monkeypatch.setattr(machine, "_ROOT", tmp_path)
    monkeypatch.setattr(
        machine, "version", lambda name: (_ for _ in ()).throw(machine.PackageNotFoundError(name))
    )
    assert machine.scope_version() == "of an unknown version"


def test_the_computer_is_described_in_one_line():
    assert platform.system() in machine.machine()
    assert "\n" not in machine.machine()
