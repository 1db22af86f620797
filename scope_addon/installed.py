# SPDX-License-Identifier: GPL-3.0-or-later
"""The packages that a capture needs in addition to numpy and numba, and the extras that install
them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.util import find_spec

from .errors import SetupError

CAPTURE = ("cv2", "onnxruntime", "av")
EXTRAS = {
    **dict.fromkeys(CAPTURE, "capture"),
    "bpy": "bpy",
    "pythonosc": "live",
    "distributed": "cluster",
}


def check_live() -> None:
    """Check that this installation has the command for live captures.

    :raises SetupError: it is Blender's extension, which contains nothing that sends to the network.
    """
    _check_has("live.outputs.json_lines", "captures live in its panel alone", "live")


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
        extras = ",".join(dict.fromkeys(EXTRAS[name] for name in missing))
        raise SetupError(
            f"{', '.join(missing)} must be installed for this: pip install 'scope-mocap[{extras}]'"
        )
