# SPDX-License-Identifier: GPL-3.0-or-later
"""Locates the ONNX networks, and opens onnxruntime sessions on them: on the CPU, or on a GPU
through one of onnxruntime's execution providers.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ....solver.errors import ModelFileError, ScopeError
from ...errors import SetupError, UsageError, lacks_memory
from ...notices import Notice, notice
from .adapters.network_server import load_runtime, make_session

if TYPE_CHECKING:
    import onnxruntime


AUTO = "auto"
CPU = "cpu"
DIRECTML = "directml"
# Our name: onnxruntime's name and the label in messages.
PROVIDERS = {
    "cuda": ("CUDAExecutionProvider", "CUDA"),
    "tensorrt": ("TensorrtExecutionProvider", "TensorRT"),
    DIRECTML: ("DmlExecutionProvider", "DirectML"),
    "coreml": ("CoreMLExecutionProvider", "CoreML"),
    CPU: ("CPUExecutionProvider", "CPU"),
}
CHOICES = (AUTO, *(name for name in reversed(PROVIDERS)))
# TensorRT compiles every network for minutes first, so it is used only on request.
_AUTOMATIC = ("cuda", DIRECTML, "coreml")


def session_options_of(name: str) -> tuple[list[str], bool]:
    """Return onnxruntime's names of a provider and of the CPU as its fallback, and whether it takes
    memory patterns.
    """
    return [PROVIDERS[each][0] for each in dict.fromkeys((name, CPU))], name != DIRECTML


@dataclass
class Execution:
    """The requested execution provider, and which providers opened sessions or failed to.

    ``provider``: one of `CHOICES`; ``used``, ``failed``: our names of the providers that opened a
    session, in order, or could not.

    :raises UsageError: the provider does not exist.
    """

    provider: str = CPU
    warnings: list[Notice] = field(default_factory=list)
    used: list[str] = field(default_factory=list)
    failed: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Check that the provider exists."""
        if self.provider not in CHOICES:
            raise UsageError(
                f"provider {self.provider!r} does not exist; choose one of {', '.join(CHOICES)}"
            )

    def candidates(self, available: Sequence[str]) -> list[str]:
        """List our names of the providers to try, in order, the CPU last.

        :param available: onnxruntime's names of the providers that it was built with.
        """
        requested = _AUTOMATIC if self.provider == AUTO else (self.provider,)
        usable = [name for name in requested if PROVIDERS[name][0] in available and name != CPU]
        if self.provider not in (AUTO, CPU) and not usable:
            labels = [label for ort_name, label in PROVIDERS.values() if ort_name in available]
            self._warn(
                self.provider,
                notice(
                    "provider_missing",
                    provider=PROVIDERS[self.provider][1],
                    available=", ".join(labels),
                ),
            )
        return [*(name for name in usable if name not in self.failed), CPU]

    def succeeded(self, name: str) -> None:
        """Record that a session was opened on this provider."""
        if name not in self.used:
            self.used.append(name)

    def fell_back(self, name: str, why: object) -> None:
        """Record that no session could be opened on this provider, which is not tried again, and
        warn.
        """
        text = " ".join(str(why).split())
        self._warn(name, notice("provider_failed", provider=PROVIDERS[name][1], reason=text))

    def _warn(self, name: str, warning: Notice) -> None:
        if name not in self.failed:
            self.failed.add(name)
            self.warnings.append(warning)

    def describe(self, threads: int) -> str:
        """Describe the providers that were used, such as "CUDA" or "CPU, 2 threads"."""
        count = "1 thread" if threads == 1 else f"{threads} threads"
        return " and ".join(
            PROVIDERS[n][1] + (f", {count}" if n == CPU else "") for n in self.used or [CPU]
        )


class SerializedSession:
    """A session that runs in one thread at a time, because DirectML sessions are not
    thread-safe.
    """

    def __init__(self, session: Any) -> None:
        self._session = session
        self._lock = threading.Lock()

    def run(self, *arguments: Any) -> list[Any]:
        """Run the network, with the arguments and results of onnxruntime's ``run``."""
        with self._lock:
            outputs: list[Any] = self._session.run(*arguments)
        return outputs

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)


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
            "(a release's wheel contains them, one made of the sources alone does not)"
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
        # The package swallows the reason why its library was not loaded.
        if not hasattr(runtime, "InferenceSession"):
            raise ImportError("its library cannot be loaded")
    except ImportError as error:
        raise SetupError(
            f"onnxruntime cannot be imported ({error}). Run ./scripts/capture, which installs it."
        ) from error
    return runtime
