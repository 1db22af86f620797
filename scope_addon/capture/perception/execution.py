# SPDX-License-Identifier: GPL-3.0-or-later
"""Where networks run: on the CPU, or on a GPU through one of onnxruntime's execution providers."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ...errors import UsageError
from ...notices import Notice, notice

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
