# SPDX-License-Identifier: GPL-3.0-or-later
"""What a capture needs beside numpy and numba, and which extra of the distribution installs it."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.util import find_spec

from .errors import SetupError

CAPTURE = ("cv2", "onnxruntime", "av")
EXTRAS = {**dict.fromkeys(CAPTURE, "capture"), "bpy": "bpy"}


def check_installed(modules: Sequence[str]) -> None:
    """Refuse to start what would fail for want of a package.

    :param modules: names of ``EXTRAS``.
    :raises SetupError: one of them is not installed; the message has the command that installs all of them.
    """
    missing = [name for name in modules if name not in sys.modules and find_spec(name) is None]
    if missing:
        extras = ",".join(dict.fromkeys(EXTRAS[name] for name in missing))
        raise SetupError(f"{', '.join(missing)} must be installed for this: pip install 'scope-mocap[{extras}]'")
