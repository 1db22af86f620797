# SPDX-License-Identifier: GPL-3.0-or-later
"""What scripts say about their use, before they set anything up."""

import re
import subprocess
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
PARTS = set(
    re.findall(
        r"^    ([a-z "
        r"|]+)\) ",
        (SCRIPTS / "real_blender" / "run.sh").read_text("utf-8"),
        re.M,
    )
)


def run(name, *arguments):
    """Run a script of the folder, or one at a relative path."""
    script = name if name.startswith(".") else str(SCRIPTS / name)
    return subprocess.run(
        ["bash", script, *arguments], capture_output=True, text=True, check=False, timeout=300
    )


def parts():
    """The parts that can be run inside Blender."""
    return {part for line in PARTS for part in line.split(" | ")} - {"install"}


@pytest.mark.parametrize("name", ["blender", "browser", "debian"])
@pytest.mark.parametrize("option", ["--help", "-h"])
def test_a_script_prints_its_own_usage_in_any_folder(name, option, monkeypatch):
    monkeypatch.chdir(SCRIPTS / "requirements")
    done = run(f"../{name}", option)
    assert done.returncode == 0
    assert done.stdout.startswith(f"./scripts/{name} [")
    assert done.stderr == ""
    assert len(done.stdout.splitlines()) < 15


def test_an_unknown_part_is_refused_with_those_that_exist():
    done = run("blender", "--part", "panel", "--part", "nonsense")
    assert done.returncode != 0
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("blender: there is no part 'nonsense'; there are panel ")
    assert [part for part in parts() if not re.search(rf"\b{part}\b", line)] == []
