# SPDX-License-Identifier: GPL-3.0-or-later
"""What the networks are computed on: the processor, or a graphics card through one of onnxruntime's providers."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ...errors import UsageError

AUTO, CPU, DIRECTML = "auto", "cpu", "directml"
# Our name: onnxruntime's, and how people write it.
PROVIDERS = {
    "cuda": ("CUDAExecutionProvider", "CUDA"),
    "tensorrt": ("TensorrtExecutionProvider", "TensorRT"),
    DIRECTML: ("DmlExecutionProvider", "DirectML"),
    "coreml": ("CoreMLExecutionProvider", "CoreML"),
    CPU: ("CPUExecutionProvider", "CPU"),
}
CHOICES = (AUTO, *(name for name in reversed(PROVIDERS)))
# TensorRT compiles every network for minutes before it is fast, so nobody gets it who did not ask for it.
_BY_ITSELF = ("cuda", DIRECTML, "coreml")


@dataclass
class Execution:
    """The provider that was asked for, and what became of it while sessions were opened.

    ``failed`` are providers that could not make a session, ``used`` our names of those that did, in order.
    """

    provider: str = CPU
    warnings: list[str] = field(default_factory=list)
    used: list[str] = field(default_factory=list)
    failed: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Refuse a provider that does not exist."""
        if self.provider not in CHOICES:
            raise UsageError(f"provider {self.provider!r} does not exist; choose one of {', '.join(CHOICES)}")

    def candidates(self, available: Sequence[str]) -> list[str]:
        """Our names of the providers to try in order, the processor last.

        :param available: what onnxruntime says is there, by its own names.
        """
        wanted = _BY_ITSELF if self.provider == AUTO else (self.provider,)
        there = [name for name in wanted if PROVIDERS[name][0] in available and name != CPU]
        if self.provider not in (AUTO, CPU) and not there:
            named = [label for ort_name, label in PROVIDERS.values() if ort_name in available]
            self._warn(
                self.provider,
                f"{PROVIDERS[self.provider][1]} was asked for, but this onnxruntime has only {', '.join(named)}; "
                "the networks run on the CPU",
            )
        return [*(name for name in there if name not in self.failed), CPU]

    def succeeded(self, name: str) -> None:
        """A session was made."""
        if name not in self.used:
            self.used.append(name)

    def fell_back(self, name: str, why: object) -> None:
        """No session could be made; this provider is not tried again."""
        text = " ".join(str(why).split())
        self._warn(name, f"{PROVIDERS[name][1]} cannot run the networks ({text}); they run on the CPU instead")

    def _warn(self, name: str, text: str) -> None:
        if name not in self.failed:
            self.failed.add(name)
            self.warnings.append(text)

    def describe(self, threads: int) -> str:
        """What was used, in words: "CUDA", or "CPU, 2 threads"."""
        count = "1 thread" if threads == 1 else f"{threads} threads"
        return " and ".join(PROVIDERS[n][1] + (f", {count}" if n == CPU else "") for n in self.used or [CPU])


class OneAtATime:
    """A session whose runs wait for each other: DirectML cannot run one session in two threads at once."""

    def __init__(self, session: Any) -> None:
        self._session, self._lock = session, threading.Lock()

    def run(self, *arguments: Any) -> list:
        """As onnxruntime's."""
        with self._lock:
            return self._session.run(*arguments)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)
