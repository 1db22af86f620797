# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m scope.tools.mutation_sample FOLDER``: change the code at random and see whether its
tests fail.

A sample of the mutants that cosmic-ray's operators make of the modules in FOLDER, in proportion to
their number in each file, is tried one at a time in a copy of the repository: with the test files
named after the module, then with those in their folder. A mutant that no test kills is equivalent
to the original, or a test is missing.

Not sampled are what only matters to compilation, decorators, annotations, and bitwise operators in
place of arithmetic, which no float survives. ``pip install cosmic-ray==8.7.0`` first.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cosmic_ray.commands.init import _all_work_items
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator

ROOT = Path(__file__).resolve().parents[1]
LEFT_OUT = ("solver/kernel.py", "solver/fast/vectors.py")
_NO_ARITHMETIC = ("BitOr", "BitAnd", "BitXor", "LShift", "RShift")
# It compiles a second copy of the solver, for minutes.
_TOO_SLOW = (
    "tests/solver/residuals/test_registry.py::test_one_file_its_import_and_one_line_add_a_residual"
)

Position = tuple[int, int]


def not_executed(text: str) -> list[tuple[Position, Position]]:
    """Return where a module's decorators and annotations begin and end, as (line, column)."""
    nodes: list[ast.expr | None] = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            nodes += node.decorator_list
        if isinstance(node, ast.FunctionDef):
            nodes.append(node.returns)
        if isinstance(node, ast.arg | ast.AnnAssign):
            nodes.append(node.annotation)
    return [
        ((n.lineno, n.col_offset), (n.end_lineno or 0, n.end_col_offset or 0))
        for n in nodes
        if n is not None
    ]


def mutations_of(path: Path) -> list[Any]:
    """Return cosmic-ray's descriptions of the mutants of a module that can be sampled."""
    ranges = not_executed(path.read_text(encoding="utf-8"))
    found = []
    for item in _all_work_items([path], {}):
        mutation = item.mutations[0]
        name = mutation.operator_name
        if name.endswith(_NO_ARITHMETIC) or "RemoveDecorator" in name:
            continue
        if not any(start <= tuple(mutation.start_pos) < end for start, end in ranges):
            found.append(mutation)
    return found


def sample(folder: str, count: int, seed: int) -> list[tuple[str, Any]]:
    """Draw about ``count`` (file, mutation), at least one from each file in proportion, in random
    order.
    """
    files = [path.relative_to(ROOT).as_posix() for path in sorted((ROOT / folder).rglob("*.py"))]
    found = {file: mutations_of(ROOT / file) for file in files if not file.startswith(LEFT_OUT)}
    total = sum(map(len, found.values()))
    rng = random.Random(seed)
    drawn = []
    for file, mutations in sorted(found.items()):
        share = min(len(mutations), max(1, round(count * len(mutations) / total)))
        drawn += [(file, mutation) for mutation in rng.sample(mutations, share)]
    random.Random(seed).shuffle(drawn)  # so that the first ones are a sample as well
    print(f"{len(drawn)} of {total} mutants", flush=True)
    return drawn


def tests_for(copy: Path, file: str) -> Iterator[list[str]]:
    """Yield the tests of a module: those named after it, then those of its folder."""
    module = Path(file)
    below = (
        module.parent if module.parts[0] == "solver" else module.parent.relative_to("scope_addon")
    )
    folder = copy / "tests" / below
    own = sorted({*folder.glob(f"test_{module.stem}.py"), *folder.glob(f"test_{module.stem}_*.py")})
    yield from (
        [str(path) for path in paths] for paths in (own, sorted(folder.glob("test_*.py"))) if paths
    )


def outcome_of(copy: Path, file: str, limit_s: float) -> str:
    """Return "killed", "timeout" or "survived" for the mutant that is in the copy."""
    environment = dict(os.environ, PYTHONPATH=str(copy.parent), PYTHONDONTWRITEBYTECODE="1")
    for tests in tests_for(copy, file):
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-x",
            "-q",
            "-p",
            "no:cacheprovider",
            f"--deselect={_TOO_SLOW}",
            *tests,
        ]
        try:
            done = subprocess.run(
                command,
                cwd=copy,
                env=environment,
                capture_output=True,
                timeout=limit_s,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return "timeout"
        if done.returncode:
            return "killed"
    return "survived"


def main() -> None:
    """Try the mutants and write one line of JSON about each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", help="such as scope_addon/kinematics or solver")
    parser.add_argument("--count", type=int, default=150, help="mutants to try (default: 150)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default: 1)")
    parser.add_argument(
        "--limit", type=float, default=300.0, metavar="S", help="seconds for the tests of a mutant"
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("mutants.jsonl"))
    args = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as scratch,
        args.output.open("w", encoding="utf-8") as output,
    ):
        copy = Path(scratch) / "scope"  # the name that the tests import
        shutil.copytree(
            ROOT, copy, ignore=shutil.ignore_patterns(".venv", ".git", "build", "__pycache__")
        )
        for file, mutation in sample(args.folder, args.count, args.seed):
            original = (copy / file).read_text(encoding="utf-8")
            mutant = mutate_code(
                original, get_operator(mutation.operator_name)(), mutation.occurrence
            )
            (copy / file).write_text(mutant, encoding="utf-8")
            outcome = outcome_of(copy, file, args.limit)
            line = mutation.start_pos[0]
            (copy / file).write_text(original, encoding="utf-8")
            record = {
                "file": file,
                "line": line,
                "outcome": outcome,
                "mutant": mutant.splitlines()[line - 1].strip(),
            }
            output.write(json.dumps(record, ensure_ascii=False) + "\n")
            output.flush()
            print(f"{outcome:9}{file}:{line}  {record['mutant']}", flush=True)


if __name__ == "__main__":
    main()
