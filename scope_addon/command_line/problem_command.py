# SPDX-License-Identifier: GPL-3.0-or-later
"""The command that writes what a problem report needs: versions, the computer, and the figures of a
capture, without any name of a file, folder, person or address.

Nothing is removed from texts, which could miss something: numbers are kept, and of the texts only
those that Scope itself has chosen from a list.
"""

from __future__ import annotations

import math
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from ...solver.body_file import BUILT_IN
from ...solver.errors import InputError
from ..atomic_write import write_result
from ..capture_report import Report
from ..confinement import limits_files
from ..footage import display_text, json_text
from ..installed import machine, versions
from ..json_file import read_json_object
from ..notices import PHRASES, SENTENCES
from ..options import option
from ..output_paths import check_output
from .arguments import path_argument
from .outputs import refuse_inputs

PROBLEM_FILE = Path("scope-problem.json")
LEFT_OUT = "left out"
_PROVIDERS = ("CUDA", "TensorRT", "DirectML", "CoreML", "CPU")
# The texts that a report may contain and that say nothing about the user.
_KNOWN_TEXTS = frozenset(
    {
        *("built-in", "lines", "bodies", "x", "y", "z", "-x", "-y", "-z"),
        *("given", "assumed", "estimated", "the file's metadata"),
        *BUILT_IN,
        *PHRASES,
        *option("quality").values,
        *_PROVIDERS,
    }
)


def add_problem_report(parser: ArgumentParser) -> None:
    """Add the arguments of ``scope report-a-problem``."""
    parser.add_argument(
        "report",
        nargs="?",
        type=path_argument,
        metavar="REPORT",
        help="what the capture printed with --json, saved to a file (default: none)",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=path_argument,
        default=PROBLEM_FILE,
        metavar="OUT",
        help=f"the .json file to write (default: {PROBLEM_FILE} in the current folder)",
    )
    parser.set_defaults(run=run_problem_report, json=False)


def run_problem_report(args: Namespace) -> dict[str, Any]:
    """Run ``scope report-a-problem``: write the file, and return what it says.

    :raises InputError: the report of the capture cannot be read, or is something else.
    :raises OutputError: the file cannot be written.
    """
    check_output(args.output, (".json",))
    content: dict[str, Any] = {"versions": versions(), "computer": machine()}
    content["limits_files"] = limits_files()
    if args.report:
        refuse_inputs([args.output], [args.report] if args.report.is_file() else [])
        content["capture"] = figures_without_names(_read_report(args.report))
    write_result(args.output, json_text(content, indent=1) + "\n")
    print(
        display_text(
            f"wrote {args.output}, which names no file, folder, person or address; read it, then "
            "attach it to your problem report"
        ),
        file=sys.stderr,
    )
    return content


def _read_report(path: Path) -> dict[str, Any]:
    advice = "give the file into which the output of scope capture --json was saved"
    report = read_json_object(path, InputError, "report of a capture", advice)
    if not {"frames", "people", "warnings"} <= set(report):
        raise InputError(f"{path} is not the report of a capture; {advice}")
    return report


def figures_without_names(report: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of a capture's report that a problem report needs.

    Warnings are kept as their records: the sentence of each follows from its code.

    :param report: as of ``Report.as_json``; it may have been edited, and contain anything.
    """
    kept: dict[str, Any] = {}
    for name in (each.name for each in fields(Report)):
        value = report.get(name)
        if name == "warnings" or value is None:
            continue
        if name == "per_person" and isinstance(value, list):
            kept[name] = [_named_figures(person) for person in value]
        elif name == "fps":
            kept[name] = _named_figures(value)
        elif name == "camera":
            # The figures that follow the comma are other entries.
            kept[name] = _figure(str(value).partition(",")[0])
        elif name == "execution":
            # Scope says how many threads each of them has.
            kept[name] = [each for each in _PROVIDERS if each in str(value)]
        else:
            kept[name] = _figure(value)
    notices = report.get("notices")
    kept["notices"] = [_notice(each) for each in notices] if isinstance(notices, list) else LEFT_OUT
    return kept


def _notice(record: Any) -> Any:
    """Return the code of a warning and those of its values that name nothing."""
    code = record.get("code") if isinstance(record, Mapping) else None
    if not isinstance(code, str) or code not in SENTENCES:
        return LEFT_OUT
    return {"code": code, "values": _named_figures(record.get("values"))}


def _named_figures(values: Any) -> Any:
    """Return figures by their names, of which Scope's own are made of small letters."""
    if not isinstance(values, Mapping):
        return LEFT_OUT
    return {
        name: _figure(value)
        for name, value in values.items()
        if name.isascii() and name.replace("_", "").isalnum() and name.islower()
    }


def _figure(value: Any) -> Any:
    """Return a number, a list of numbers or a text that Scope has chosen; nothing of any other."""
    if isinstance(value, list):
        return [_figure(each) if _is_number(each) else LEFT_OUT for each in value]
    if value is None or _is_number(value) or (isinstance(value, str) and value in _KNOWN_TEXTS):
        return value
    return LEFT_OUT


def _is_number(value: Any) -> bool:
    return isinstance(value, int) or (isinstance(value, float) and math.isfinite(value))
