# SPDX-License-Identifier: GPL-3.0-or-later
"""The packages that a capture needs in addition to numpy and numba, the extras that install them,
the addresses that it needs of the shell, and the versions and the computer that Scope runs with.
"""

from __future__ import annotations

import os
import platform
import shlex
import sys
import tomllib
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from pathlib import Path

from .errors import SetupError

CAPTURE = ("cv2", "onnxruntime", "av")
EXTRAS = {
    **dict.fromkeys(CAPTURE, "capture"),
    "bpy": "bpy",
    "pythonosc": "live",
    "distributed": "cluster",
}
_ROOT = Path(__file__).resolve().parents[1]
_PACKAGES = ("numpy", "numba", "onnxruntime", "opencv-contrib-python-headless", "av", "bpy")
# Of addresses, most of which are never used: 1.6 to 2.1 GB were measured without a scene, 2.8 GB
# with one. With less, libraries crash, or wait for memory without end.
_NEEDED_BYTES = 2_500_000_000
_NEEDED_WITH_SCENE = 3_200_000_000


def check_live() -> None:
    """Check that this installation has the command for live captures.

    :raises SetupError: it is Blender's extension, which contains nothing that sends to the network.
    """
    _check_has("live.json_lines", "captures live in its panel alone", "live")


def check_cluster() -> None:
    """Check that this installation can use a cluster.

    :raises SetupError: it is Blender's extension, which contains nothing that uses the network; or
        Dask is missing.
    """
    _check_has("cluster", "cannot use a cluster", "batch")
    check_installed(["distributed"])


def _check_has(module: str, otherwise: str, script: str) -> None:
    if find_spec(f"{__package__}.{module}") is None:
        raise SetupError(
            f"Blender's extension {otherwise}; use ./scripts/{script} in the repository"
        )


def check_installed(modules: Sequence[str]) -> None:
    """Check that packages are installed, before work starts that would fail without them.

    :param modules: keys of ``EXTRAS``.
    :raises SetupError: at least one is not installed; the message gives the command that installs
        them.
    """
    missing = [name for name in modules if name not in sys.modules and find_spec(name) is None]
    if missing:
        raise SetupError(
            f"{', '.join(missing)} must be installed for this: "
            f"{_installation({EXTRAS[name] for name in missing})}"
        )


def _installation(extras: set[str]) -> str:
    """Return how the packages of extras are installed. Scope itself is in no package index."""
    try:
        stated = [text.partition(";") for text in requires("scope-mocap") or ()]
    except PackageNotFoundError:
        return "install Scope again"
    needed = [
        name.strip()
        for name, _, condition in stated
        if any(f'extra == "{extra}"' in condition for extra in extras)
    ]
    return f"pip install {shlex.join(needed)}"


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


def address_space_limit() -> int | None:
    """Return the limit on this process's addresses (``ulimit -v``) in bytes; None if there is
    none.

    It is asked when other libraries could not be loaded, so that it needs the standard one alone.
    """
    try:
        import resource
    except ImportError:  # on Windows
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def check_memory_limit(*, with_scene: bool) -> None:
    """Check the limit on this process's addresses (``ulimit -v``).

    :param with_scene: whether Blender's module will be loaded.
    :raises SetupError: it is too low.
    """
    limit = address_space_limit()
    needed = _NEEDED_WITH_SCENE if with_scene else _NEEDED_BYTES
    if limit is not None and limit < needed:
        raise SetupError(
            f"this shell limits a process to {limit / 1e9:.2f} GB of address space, but a capture "
            f"needs {needed / 1e9:.2f} GB: run ulimit -v unlimited first"
        )
