# SPDX-License-Identifier: GPL-3.0-or-later
"""Locates the ONNX networks and opens onnxruntime sessions on them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ....solver.errors import ModelFileError, ScopeError
from ...errors import SetupError, UsageError, lacks_memory
from .adapters.network_server import load_runtime, make_session
from .execution import CPU, DIRECTML, PROVIDERS, Execution, SerializedSession, session_options_of

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
        raise UsageError(
            f"Quality {quality!r} does not exist; choose one of "
            f"{', '.join(LANDMARK_NETWORK_OF_QUALITY)}."
        )
    return LANDMARK_NETWORK_OF_QUALITY[quality]


def network_path(name: str) -> Path:
    """Locate the file of a network.

    :raises SetupError: it has not been built.
    """
    path = NETWORKS_FOLDER / f"{name}.onnx"
    if not path.is_file():
        raise SetupError(
            f"{path} is missing. Build the networks in the repository with: python -m "
            "scope.tools.convert_networks "
            "(a wheel contains none: capture with the scripts of the repository)"
        )
    return path


def open_session(
    path: Path,
    threads: int,
    execution: Execution | None = None,
    open_on: Callable[[str, Path, int], Any] | None = None,
) -> onnxruntime.InferenceSession:
    """Open an onnxruntime session with ``threads`` threads, on the requested provider if it is
    available.

    :param open_on: opens the session on a provider, given by our name; None: in this process.
    :raises ModelFileError: the file is damaged, or uses operators that onnxruntime does not have.
    :raises SetupError: onnxruntime cannot be imported.
    :raises UsageError: there are fewer than 1 thread.
    :raises MemoryError: there is too little memory.
    """
    if threads < 1:
        raise UsageError(f"{threads} threads were requested; at least 1 is needed.")
    runtime = _runtime()
    execution = execution or Execution()
    for name in execution.candidates(runtime.get_available_providers()):
        try:
            session = (open_on or _open_on)(name, path, threads)
        except ScopeError:  # it takes too much time or memory, on any provider
            raise
        except Exception as error:  # onnxruntime's exceptions have no common base
            if name == CPU and open_on is None and lacks_memory(error):
                raise MemoryError from error
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
    session = make_session(_runtime(), str(path), threads, *session_options_of(name))
    return SerializedSession(session) if name == DIRECTML else session


def _cannot_load(path: Path, error: Exception) -> str:
    text = f"{path}: onnxruntime cannot load this network ({' '.join(str(error).split())})."
    if path.parent == NETWORKS_FOLDER:
        return f"{text} Build it again with: python -m scope.tools.convert_networks --force"
    return (
        f"{text} Export it again, with standard operators alone, an opset that is not newer, and "
        f"all its weights."
    )


@cache
def _runtime() -> ModuleType:
    try:
        runtime = load_runtime()
        # it swallows the reason why its library was not loaded
        if not hasattr(runtime, "InferenceSession"):
            raise ImportError("its library cannot be loaded")
    except ImportError as error:
        raise SetupError(
            f"onnxruntime cannot be imported ({error}). Run ./scripts/capture, which installs it."
        ) from error
    return runtime
