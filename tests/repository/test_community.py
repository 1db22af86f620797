# SPDX-License-Identifier: GPL-3.0-or-later
"""The citation and the licence of every source."""

from __future__ import annotations

import tomllib
from pathlib import Path

from ..required import package

ROOT = Path(__file__).resolve().parents[2]


def load(path: Path):
    return package("yaml").safe_load(path.read_text("utf-8"))


def test_the_citation_names_the_paper_and_the_version():
    citation = load(ROOT / "CITATION.cff")
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    version = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))["version"]
    assert citation["version"] == version
    paper = citation["preferred-citation"]
    assert len(paper["authors"]) == 6
    bibtex = (ROOT / "docs" / "for_researchers.md").read_text("utf-8")
    assert f"version = {{{version}}}" in bibtex
    assert f"year = {{{paper['year']}}}" in bibtex
    assert paper["title"] in bibtex
    for author in paper["authors"]:
        assert f"{author['family-names']}, {author['given-names']}" in bibtex
    manifest = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert manifest["project"]["license"].startswith(citation["license"] + " AND ")


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
