# SPDX-License-Identifier: GPL-3.0-or-later
"""The packages that a capture needs in addition to numpy and numba, and the extras that install them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.util import find_spec

from .errors import SetupError

CAPTURE = ("cv2", "onnxruntime", "av")
EXTRAS = {**dict.fromkeys(CAPTURE, "capture"), "bpy": "bpy", "pythonosc": "live"}


def check_live() -> None:
    """Check that this installation has the command for live captures.

    :raises SetupError: it is Blender's extension, which contains nothing that sends to the network.
    """
    if find_spec(f"{__package__}.live.outputs.json_lines") is None:
        raise SetupError(
            "Blender's extension captures live in its panel alone; use ./scripts/live in the repository, or install "
            "the package: pip install 'scope-mocap[capture,live]'"
        )


def check_installed(modules: Sequence[str]) -> None:
    """Check that packages are installed, before work starts that would fail without them.

    :param modules: keys of ``EXTRAS``.
    :raises SetupError: at least one is not installed; the message gives the command that installs them.
    """
    missing = [name for name in modules if name not in sys.modules and find_spec(name) is None]
    if missing:
        extras = ",".join(dict.fromkeys(EXTRAS[name] for name in missing))
        raise SetupError(f"{', '.join(missing)} must be installed for this: pip install 'scope-mocap[{extras}]'")
