# SPDX-License-Identifier: GPL-3.0-or-later
"""Other optimizers on the same residuals, data and Jacobian, one thread: each in an environment of its own.

Environments are made once in build/bench. What cannot be installed is left out, with the reason. Not for CI.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from .frames import CACHE, ROOT

PACKAGES = {"scipy": "scipy==1.17.1", "ceres": "pyceres==2.6"}
COMMON = ("numpy==1.26.4", "numba==0.68.1")


def run_all() -> dict[str, float | str]:
    """Return the microseconds of one iteration by peer, or why there is no figure."""
    found: dict[str, float | str] = {}
    for name, package in PACKAGES.items():
        try:
            found[name] = _run(name, package)
        except (OSError, subprocess.CalledProcessError, ValueError) as error:
            reason = (getattr(error, "stderr", "") or str(error)).strip().splitlines()
            found[name] = "skipped: " + (reason[-1] if reason else type(error).__name__)
    found["momentum"] = "skipped: its residuals (skeleton states, error functions) are not set up to equal these"
    return found


def _run(name: str, package: str) -> float:
    python = make_environment(name, *COMMON, package)
    path = CACHE / "path"  # the root folder under the name of the package
    path.mkdir(parents=True, exist_ok=True)
    link = path / "scope"
    if not link.exists():
        link.symlink_to(ROOT)
    environment = {**os.environ, "PYTHONPATH": str(path)}
    command = [str(python), "-m", "scope.benchmarks.peer_run", name]
    done = subprocess.run(command, env=environment, cwd=path, capture_output=True, text=True, check=True)
    return float(done.stdout.strip().splitlines()[-1])


def make_environment(name: str, *packages: str) -> Path:
    """Return the interpreter of an environment with these packages, made on first use."""
    folder = CACHE / name
    python, stamp = folder / "bin" / "python", folder / "installed"
    if not stamp.exists():
        print(f"installing {packages[-1]} in {folder}, once", file=sys.stderr)
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True, capture_output=True, text=True)
        command = [str(python), "-m", "pip", "install", "--quiet", "--only-binary", ":all:", *packages]
        subprocess.run(command, check=True, capture_output=True, text=True)
        stamp.touch()
    return python
