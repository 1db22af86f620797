# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests lie in ``tests/FOLDER/test_MODULE.py`` or ``test_MODULE_TOPIC.py``; FOLDER mirrors the
module's folder.

Tests of a package as a whole have the folder's own name:
``tests/solver/residuals/test_residuals.py``.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from ..conftest import FIRST

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests"
PRODUCT = "scope_addon"  # left out of the path: tests/job/ holds the tests of scope_addon/job/
OTHERS = ("solver", "tools", "benchmarks", "scripts")
# modules that no test file is named after, many tested through others; this number may only fall
WITHOUT_TESTS = 150

# Tests that belong to no single module, by path below tests/, and what they test.
CROSS_CUTTING = {
    "repository/test_ci.py": "what the hosted CI runs, against .ci/run",
    "repository/test_code_size.py": "lines and parameters of functions, lines of files",
    "repository/test_docs.py": "the documentation against the program",
    "repository/test_docstrings.py": "docstrings of all public functions",
    "repository/test_imports.py": "packages that a module may not import",
    "repository/test_layout.py": "names and places of test files",
    "repository/test_rooms.py": "which folder may import which",
    "repository/test_wheel.py": "the wheel, installed",
    "solver/test_arguments.py": "every public function of the solver, given arguments of the wrong "
    "kind",
    "scene/test_made_rigs.py": "captures that tests append, against built ones",
    "ui/test_changed_properties.py": "custom properties that were changed by hand, in operators "
    "and panels",
    "fuzz/test_faults.py": "what writes files, on failing system calls",
    "fuzz/test_faults_outputs.py": "exports, outputs of captures and batches, on failing system "
    "calls",
    "fuzz/test_findings.py": "what once broke under attack, from outside",
    "fuzz/test_kills.py": "commands, killed or refused a system call from outside",
    "fuzz/test_fuzz.py": "every reader of files and messages of others, on damaged ones",
    "scripts/test_flamenco.py": "the job type for Flamenco, a JavaScript file",
    "scripts/test_usage.py": "what shell scripts say about their use",
    "test_read_only.py": "arguments of solving, editing and retargeting, which nothing may change",
    "test_required.py": "a helper of the tests",
}


def source_folder(test: Path) -> Path:
    """Return the folder of the modules that the tests in a file's folder test."""
    below = test.parent.relative_to(TESTS)
    return ROOT / below if below.parts and below.parts[0] in OTHERS else ROOT / PRODUCT / below


def module_of(test: Path) -> Path | None:
    """Return the module or package that a test file is named after, the longest name first; None
    without one.
    """
    folder = source_folder(test)
    words = test.stem.removeprefix("test_").split("_")
    for count in range(len(words), 0, -1):
        name = "_".join(words[:count])
        candidates = [folder / f"{name}.py", folder / name / "__init__.py"]
        if name == folder.name:
            candidates.append(folder / "__init__.py")
        for candidate in candidates:
            if candidate.is_file():
                return candidate
    return None


def files_of_tests() -> list[Path]:
    return sorted(TESTS.rglob("test_*.py"))


def modules() -> list[Path]:
    """Return every module of the product and of its tools, without the packages'
    ``__init__.py``.
    """
    folders = [ROOT / name for name in (PRODUCT, *OTHERS)]
    return sorted(
        path for folder in folders for path in folder.rglob("*.py") if path.name != "__init__.py"
    )


def test_every_test_file_is_named_after_a_module():
    files = files_of_tests()
    assert len(files) > 50
    lost = [path.relative_to(TESTS).as_posix() for path in files if module_of(path) is None]
    assert sorted(set(lost) - set(CROSS_CUTTING)) == [], (
        "rename them after a module, or list them in CROSS_CUTTING"
    )


def test_the_files_to_begin_with_exist():
    assert [name for name in FIRST if not (TESTS / name).is_file()] == []


def test_no_listed_exception_is_stale():
    for name in CROSS_CUTTING:
        assert (TESTS / name).is_file(), f"{name} is not there any more: take it off the list"
        assert module_of(TESTS / name) is None, (
            f"{name} is named after a module: take it off the list"
        )


def test_a_new_module_has_tests_of_its_own():
    tested = {module_of(path) for path in files_of_tests()}
    packages = {path.parent for path in tested if path is not None and path.name == "__init__.py"}
    without = [path for path in modules() if path not in tested and path.parent not in packages]
    names = "\n".join(str(path.relative_to(ROOT)) for path in without)
    assert len(without) <= WITHOUT_TESTS, (
        f"write tests for the new module among these, do not raise the number:\n{names}"
    )
    assert len(without) > WITHOUT_TESTS - 10, (
        f"more modules have tests: set WITHOUT_TESTS to {len(without)}"
    )


@pytest.mark.parametrize(
    ("test", "module"),
    [
        ("solver/test_fit.py", "solver/fit.py"),
        ("test_cli.py", "scope_addon/cli.py"),
        ("job/test_cache.py", "scope_addon/job/cache.py"),
        ("job/test_cache_on_a_full_disk.py", "scope_addon/job/cache.py"),
        ("job/test_cache_key_of_a_link.py", "scope_addon/job/cache_key.py"),
        ("tools/test_build_body.py", "tools/build_body/__init__.py"),
        ("tools/build_body/test_build_body_again.py", "tools/build_body/__init__.py"),
        ("job/test_cached.py", None),
        ("solver/test_cache.py", None),
    ],
)
def test_names_are_matched(tmp_path, monkeypatch, test, module):
    for name in (
        "solver/fit",
        "scope_addon/cli",
        "scope_addon/job/cache",
        "scope_addon/job/cache_key",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / f"{name}.py").touch()
    (tmp_path / "tools" / "build_body").mkdir(parents=True)
    (tmp_path / "tools" / "build_body" / "__init__.py").touch()
    monkeypatch.setitem(globals(), "ROOT", tmp_path)
    monkeypatch.setitem(globals(), "TESTS", tmp_path / "tests")
    assert module_of(tmp_path / "tests" / test) == (tmp_path / module if module else None)
