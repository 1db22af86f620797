# SPDX-License-Identifier: GPL-3.0-or-later
"""The hosted CI runs what `.ci/run` runs."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PREPARES = {"./scripts/setup", "./scripts/debian"}  # which the others call where they need it


def scripts(text: str) -> set[str]:
    return set(re.findall(r"^(?:\s*command: )?(\./scripts/\w+)", text, re.MULTILINE))


def test_every_script_of_the_local_run_is_in_the_hosted_one() -> None:
    local = scripts((ROOT / ".ci" / "run").read_text())
    assert {"./scripts/check", "./scripts/test", "./scripts/gate", "./scripts/fuzz"} <= local
    assert local - PREPARES == scripts((ROOT / ".github" / "workflows" / "ci.yml").read_text())


def test_all_that_is_run_exists() -> None:
    assert [name for name in scripts((ROOT / ".ci" / "run").read_text()) if not (ROOT / name).is_file()] == []
