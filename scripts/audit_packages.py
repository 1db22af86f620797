# SPDX-License-Identifier: GPL-3.0-or-later
"""Ask the package registry which vulnerabilities it knows of in the packages of the zips.

PyPI states them for one version, or, where a mirror offers no more, for a project's newest. What
was not answered for the shipped version is said to be unknown, rather than taken to be good.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

REGISTRY = "https://pypi.org/pypi"
LOCKS = Path(__file__).parent / "requirements"
ADVISORIES = Path(__file__).parent / "advisories.toml"
PACKAGES = ("numba", "llvmlite", "onnxruntime", "opencv-contrib-python-headless", "av")
Ask = Callable[[str], Any]


def ask(path: str) -> Any:
    """Return what the registry says at a path; None where it has nothing.

    :raises OSError: it cannot be reached.
    """
    request = urllib.request.Request(
        f"{REGISTRY}/{path}/json", headers={"Accept": "application/json"}
    )
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)
    except urllib.error.HTTPError as error:
        if error.code == 404:
            return None
        raise


def locked_versions() -> set[tuple[str, str]]:
    """Return name and version of every shipped package, in any of the locks."""
    found = set()
    for lock in sorted(LOCKS.glob("3.*.txt")):
        found |= set(re.findall(r"^([a-z0-9-]+)==(\S+)", lock.read_text("utf-8"), flags=re.M))
    return {(name, version) for name, version in found if name in PACKAGES}


def audit(name: str, version: str, ask: Ask = ask) -> tuple[list[str] | None, str]:
    """Look up a package.

    :return: its known vulnerabilities, each as a sentence, None if the registry does not say; and
        the newest version.
    """
    answer = ask(f"{name}/{version}")
    newest = ask(name)
    latest = str(newest["info"]["version"]) if newest else ""
    if answer is None and latest == version:
        answer = newest
    if answer is None or not isinstance(answer.get("vulnerabilities"), list):
        return None, latest
    known = [entry for entry in answer["vulnerabilities"] if not entry.get("withdrawn")]
    return [_sentence(entry) for entry in known], latest


def _sentence(entry: dict[str, Any]) -> str:
    names = ", ".join([entry.get("id", "?"), *entry.get("aliases", [])])
    fixed = ", ".join(entry.get("fixed_in") or []) or "no version"
    return (
        f"{names}: "
        f"{' '.join(str(entry.get('summary') or entry.get('details') or '').split())[:200]} (fixed "
        f"in {fixed})"
    )


def print_advisories() -> None:
    """Print what is known of the libraries inside the packages, and whether it can be reached."""
    table = tomllib.loads(ADVISORIES.read_text("utf-8"))
    print(f"inside the packages, as of {table['as_of']}:")
    for library in table["library"]:
        what = f"{library['project']} {library['found']} in {library['package']}"
        known = "no known vulnerability"
        if library["advisories"]:
            reach = "reachable" if library["reachable"] else "out of reach"
            advisories = ", ".join(library["advisories"])
            known = f"{advisories} (fixed in {library['fixed_in']}); {reach}"
        print(f"  {what}: {known}: {library['because']}")


def main(ask: Ask = ask) -> int:
    """Print what is known; return the exit status, which is about the packages alone."""
    found = False
    unknown = False
    for name, version in sorted(locked_versions()):
        try:
            known, latest = audit(name, version, ask)
        except (OSError, ValueError) as error:
            print(f"audit: the registry could not be asked about {name}: {error}", file=sys.stderr)
            return 2
        newer = f" (newest: {latest})" if latest not in ("", version) else ""
        if known is None:
            unknown = True
            print(
                f"{name} {version}{newer}: unknown, the registry does not answer for this version"
            )
        else:
            found = found or bool(known)
            print(
                f"{name} {version}{newer}: "
                f"{'; '.join(known) if known else 'no known vulnerability'}"
            )
    print_advisories()
    return 1 if found else 2 if unknown else 0


if __name__ == "__main__":
    sys.exit(main())
