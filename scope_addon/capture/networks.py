# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the ONNX networks lie, and onnxruntime sessions on them."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from ...solver.errors import ModelFileError, SetupError, UsageError

if TYPE_CHECKING:
    import onnxruntime

NETWORKS_FOLDER = Path(__file__).resolve().parents[2] / "assets" / "networks"
LANDMARK_NETWORK_OF_QUALITY = {
    "fast": "pose_landmark_lite",
    "balanced": "pose_landmark_full",
    "best": "pose_landmark_heavy",
}


def landmark_network_name(quality: str) -> str:
    """The landmark network behind a quality preset; UsageError names the presets there are."""
    if quality not in LANDMARK_NETWORK_OF_QUALITY:
        raise UsageError(f"Quality {quality!r} does not exist; choose one of {', '.join(LANDMARK_NETWORK_OF_QUALITY)}.")
    return LANDMARK_NETWORK_OF_QUALITY[quality]


def network_path(name: str, folder: Path | None = None) -> Path:
    """The file of a network; SetupError when it has not been built."""
    path = (folder or NETWORKS_FOLDER) / f"{name}.onnx"
    if not path.is_file():
        raise SetupError(f"{path} is missing. Build the networks with: python -m scope.tools.convert_networks")
    return path


def open_session(path: Path, threads: int) -> onnxruntime.InferenceSession:
    """An onnxruntime session on the CPU with ``threads`` threads; ModelFileError when the file is not sound."""
    if threads < 1:
        raise UsageError(f"{threads} threads were asked for; at least 1 is needed.")
    onnxruntime = _runtime()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # Threads of one network that wait in a busy loop would take the cores from the next one.
    options.add_session_config_entry("session.force_spinning_stop", "1")
    options.log_severity_level = 4  # errors arrive as exceptions, with our words around them
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's exceptions share no base of their own
        raise ModelFileError(
            f"{path}: onnxruntime cannot load this network ({error}). Build it again with: "
            "python -m scope.tools.convert_networks --force"
        ) from error


@cache
def _runtime() -> ModuleType:
    try:
        import onnxruntime
    except ImportError as error:
        raise SetupError(
            f"onnxruntime cannot be imported ({error}). Run ./scripts/capture, which installs it."
        ) from error
    return onnxruntime
