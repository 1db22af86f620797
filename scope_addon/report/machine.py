# SPDX-License-Identifier: GPL-3.0-or-later
"""The computer and the versions of Scope and of the packages that it runs with."""

from __future__ import annotations

import os
import platform
import tomllib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]
_PACKAGES = ("numpy", "numba", "onnxruntime", "opencv-contrib-python-headless", "av", "bpy")


def machine() -> str:
    """Describe the computer in one line: processor, cores, system."""
    cores = os.cpu_count() or 1
    name = _processor() or platform.machine()
    return (
        f"{name}, {cores} {'core' if cores == 1 else 'cores'}, {platform.system()} "
        f"{platform.release()}"
    )


def versions() -> str:
    """List the versions of Scope, Python and the installed packages in one line."""
    listed = [f"Scope {scope_version()}", f"Python {platform.python_version()}"]
    for package in _PACKAGES:
        try:
            listed.append(f"{package} {version(package)}")
        # an extension's packages may have no metadata, and bpy is optional
        except PackageNotFoundError:
            continue
    return ", ".join(listed)


def scope_version() -> str:
    """Return the version of Scope, from the extension's manifest or the installed package."""
    manifest = _ROOT / "blender_manifest.toml"
    if manifest.is_file():
        return str(tomllib.loads(manifest.read_text(encoding="utf-8"))["version"])
    try:
        return version("scope-mocap")
    except PackageNotFoundError:
        return "of an unknown version"


def _processor() -> str:
    """Return the processor's model; empty if the system does not say."""
    try:
        for line in (
            Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        ):
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor()
