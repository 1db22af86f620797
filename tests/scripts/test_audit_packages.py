# SPDX-License-Identifier: GPL-3.0-or-later
"""The audit of known vulnerabilities, on answers made for it; the registry itself is not asked."""

import pytest

from .script_modules import script

BAD = {
    "id": "PYSEC-1",
    "aliases": ["CVE-2026-1"],
    "summary": "Reads\n beyond the end",
    "fixed_in": ["2.0"],
    "withdrawn": None,
}


@pytest.fixture
def auditor():
    return script("audit_packages")


def registry(newest, *, vulnerabilities=(), of_versions=True):
    """A registry in which every package has one newest version, and which may know older ones."""

    def ask(path):
        if "/" in path and not of_versions:
            return None
        return {"info": {"version": newest}, "vulnerabilities": list(vulnerabilities)}

    return ask


def test_known_vulnerabilities_are_printed(auditor, capsys):
    assert auditor.main(registry("99", vulnerabilities=[BAD])) == 1
    line = capsys.readouterr().out.splitlines()[0]
    assert line.startswith("av ")
    assert line.endswith("(newest: 99): PYSEC-1, CVE-2026-1: Reads beyond the end (fixed in 2.0)")
    assert auditor.main(registry("99", vulnerabilities=[dict(BAD, withdrawn="2026-01-01")])) == 0


def test_an_answer_for_another_version_is_no_answer(auditor, capsys):
    assert auditor.main(registry("99", of_versions=False)) == 2
    assert "unknown, the registry does not answer for this version" in capsys.readouterr().out
    assert auditor.audit("numba", "99", registry("99", of_versions=False)) == ([], "99")


def test_a_registry_out_of_reach_is_one_sentence(auditor, capsys):
    def ask(path):
        raise OSError("no network")

    assert auditor.main(ask) == 2
    assert (
        capsys.readouterr().err == "audit: the registry could not be asked about av: no network\n"
    )
