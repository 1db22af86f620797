# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that a forge reads: forms, citation, hooks and the updates of actions."""

from __future__ import annotations

import shlex
import tomllib
from pathlib import Path

import pytest

from ..required import package

ROOT = Path(__file__).resolve().parents[2]
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))
KINDS = {"markdown", "textarea", "input"}


def load(path: Path):
    return package("yaml").safe_load(path.read_text("utf-8"))


@pytest.mark.parametrize(
    "path", [path for path in FORMS if path.stem != "config"], ids=lambda p: p.stem
)
def test_a_form_has_what_a_forge_requires(path):
    form = load(path)
    assert form["name"]
    assert form["description"]
    assert {part["type"] for part in form["body"]} <= KINDS
    fields = [part for part in form["body"] if part["type"] != "markdown"]
    names = [field["id"] for field in fields]
    assert len(set(names)) == len(names) > 0
    assert all(field["attributes"]["label"] for field in fields)


def test_the_citation_names_the_paper_and_states_no_version_of_its_own():
    citation = load(ROOT / "CITATION.cff")
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert "version" not in citation
    paper = citation["preferred-citation"]
    assert len(paper["authors"]) == 6
    bibtex = (ROOT / "docs" / "for_researchers.md").read_text("utf-8")
    assert f"year = {{{paper['year']}}}" in bibtex
    assert paper["title"] in bibtex
    for author in paper["authors"]:
        assert f"{author['family-names']}, {author['given-names']}" in bibtex
    manifest = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert manifest["project"]["license"] == f"{citation['license']} AND Apache-2.0"


def test_every_source_states_its_licence():
    """The solver's is Apache-2.0, so that others can use it, and all else the program's."""
    wrong = []
    for top in ("solver", "scope_addon", "tests", "benchmarks", "tools", "scripts"):
        licence = "Apache-2.0" if top == "solver" else "GPL-3.0-or-later"
        for path in sorted((ROOT / top).rglob("*.py")):
            first = path.read_text("utf-8").partition("\n")[0]
            if path.stat().st_size and first != f"# SPDX-License-Identifier: {licence}":
                wrong.append(path.relative_to(ROOT).as_posix())
    assert wrong == []


def test_the_licences_texts_are_complete():
    apache = (ROOT / "solver" / "LICENSE").read_text("utf-8")
    assert apache.split()[:4] == ["Apache", "License", "Version", "2.0,"]
    assert "END OF TERMS AND CONDITIONS" in apache
    assert "GNU GENERAL PUBLIC LICENSE" in (ROOT / "LICENSE").read_text("utf-8")


def test_the_hooks_run_what_the_check_runs():
    hooks = load(ROOT / ".pre-commit-config.yaml")["repos"][0]["hooks"]
    check = (ROOT / "scripts" / "check").read_text("utf-8")
    for hook in hooks:
        tool, *rest = [
            word for word in shlex.split(hook["entry"]) if word.startswith((".venv", "check", "f"))
        ]
        assert " ".join([tool, *rest]) in check


def test_actions_are_the_only_packages_that_are_updated_without_a_person():
    updates = load(ROOT / ".github" / "dependabot.yml")["updates"]
    assert [each["package-ecosystem"] for each in updates] == ["github-actions"]
