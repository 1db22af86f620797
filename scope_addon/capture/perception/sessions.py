# SPDX-License-Identifier: GPL-3.0-or-later
"""Locates the ONNX networks and opens onnxruntime sessions on them."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from ....solver.errors import ModelFileError
from ...errors import SetupError, UsageError
from .execution import CPU, DIRECTML, PROVIDERS, Execution, SerializedSession

if TYPE_CHECKING:
    import onnxruntime

NETWORKS_FOLDER = Path(__file__).resolve().parents[3] / "assets" / "networks"
LANDMARK_NETWORK_OF_QUALITY = {
    "fast": "pose_landmark_lite",
    "balanced": "pose_landmark_full",
    "best": "pose_landmark_heavy",
}


def landmark_network_name(quality: str) -> str:
    """Look up the landmark network of a quality preset.

    :raises UsageError: there is no such preset.
    """
    if quality not in LANDMARK_NETWORK_OF_QUALITY:
        raise UsageError(f"Quality {quality!r} does not exist; choose one of {', '.join(LANDMARK_NETWORK_OF_QUALITY)}.")
    return LANDMARK_NETWORK_OF_QUALITY[quality]


def network_path(name: str, folder: Path | None = None) -> Path:
    """Locate the file of a network.

    :raises SetupError: it has not been built.
    """
    path = (folder or NETWORKS_FOLDER) / f"{name}.onnx"
    if not path.is_file():
        raise SetupError(
            f"{path} is missing. Build the networks in the repository with: python -m scope.tools.convert_networks"
        )
    return path


def open_session(path: Path, threads: int, execution: Execution | None = None) -> onnxruntime.InferenceSession:
    """Open an onnxruntime session with ``threads`` threads, on the requested provider if it is available.

    :raises ModelFileError: the file is damaged, or uses operators that onnxruntime does not have.
    :raises SetupError: onnxruntime cannot be imported.
    :raises UsageError: there are fewer than 1 thread.
    """
    if threads < 1:
        raise UsageError(f"{threads} threads were requested; at least 1 is needed.")
    runtime, execution = _runtime(), execution or Execution()
    for name in execution.candidates(runtime.get_available_providers()):
        try:
            session = _open_on(name, path, threads)
        except Exception as error:  # onnxruntime's exceptions have no common base
            if name == CPU:
                raise ModelFileError(_cannot_load(path, error)) from error
            execution.fell_back(name, error)
            continue
        if session.get_providers()[0] != PROVIDERS[name][0]:  # onnxruntime fell back silently
            execution.fell_back(name, "its libraries or its device are missing")
            if name != CPU:
                continue
        execution.succeeded(name)
        return session
    raise AssertionError("the CPU is always tried")


def _open_on(name: str, path: Path, threads: int) -> onnxruntime.InferenceSession:
    runtime = _runtime()
    options = runtime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # Threads of one network that spin while waiting would take the cores from the next one.
    options.add_session_config_entry("session.force_spinning_stop", "1")
    options.log_severity_level = 4  # errors are raised as exceptions, with our messages
    options.enable_mem_pattern = name != DIRECTML  # which does not support it
    providers = [PROVIDERS[n][0] for n in dict.fromkeys((name, CPU))]
    session = runtime.InferenceSession(str(path), options, providers=providers)
    return SerializedSession(session) if name == DIRECTML else session


def _cannot_load(path: Path, error: Exception) -> str:
    text = f"{path}: onnxruntime cannot load this network ({' '.join(str(error).split())})."
    if path.parent == NETWORKS_FOLDER:
        return f"{text} Build it again with: python -m scope.tools.convert_networks --force"
    return f"{text} Export it again, with standard operators alone, an opset that is not newer, and all its weights."


@cache
def _runtime() -> ModuleType:
    try:
        import onnxruntime
    except ImportError as error:
        raise SetupError(
            f"onnxruntime cannot be imported ({error}). Run ./scripts/capture, which installs it."
        ) from error
    module: ModuleType = onnxruntime
    return module
