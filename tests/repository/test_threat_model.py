# SPDX-License-Identifier: GPL-3.0-or-later
"""Every promise of the threat model names tests that exist, and modules that exist."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "threat_model.md").read_text("utf-8")
CODE = re.compile(r"`([\w./]+\.(?:py|toml))`")
TEST = re.compile(r"`([\w/]*test_\w+\.py)`")


def rows() -> list[list[str]]:
    """The cells of each row of the table, without its head."""
    lines = [line for line in PAGE.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[1:]]


def promises() -> list[str]:
    """The entries of the list of promises."""
    section = PAGE.partition("## What is promised about data")[2]
    return ["- " + entry for entry in section.split("\n- ")[1:]]


def defines_tests(name: str) -> bool:
    """Whether there is a file of tests of this name, below the folder of tests."""
    path = ROOT / "tests" / name.removeprefix("tests/")
    return path.is_file() and "\ndef test_" in path.read_text("utf-8")


def test_what_is_prevented_names_its_tests() -> None:
    found = rows()
    assert len(found) > 30
    for *_, prevented, tests in found:
        names = TEST.findall(tests)
        assert names or "**not prevented" in prevented, prevented
        assert not [name for name in names if not defines_tests(name)], prevented


def test_what_is_promised_names_its_tests() -> None:
    found = promises()
    assert len(found) > 5
    for promise in found:
        names = TEST.findall(promise)
        assert names, promise
        assert not [name for name in names if not defines_tests(name)], promise


def test_modules_that_are_named_exist() -> None:
    above_the_table = ("solver/", "scripts/", "tests/")
    for *_, prevented, _tests in rows():
        for name in CODE.findall(prevented):
            folder = ROOT if name.startswith(above_the_table) else ROOT / "scope_addon"
            is_there = (folder / name).is_file()
            # A second one is often named without the folder that it shares with the first.
            assert is_there or any((ROOT / "scope_addon").rglob(f"**/{name}")), name
