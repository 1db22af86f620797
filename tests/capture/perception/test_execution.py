# SPDX-License-Identifier: GPL-3.0-or-later
"""The provider of a session: availability, the request, and the CPU as fallback."""

from __future__ import annotations

import threading
from pathlib import Path
from types import SimpleNamespace

import pytest
from scope.scope_addon.capture.perception import sessions
from scope.scope_addon.capture.perception.sessions import (
    CPU,
    PROVIDERS,
    Execution,
    SerializedSession,
    open_session,
)
from scope.scope_addon.errors import UsageError

CPU_NAME = "CPUExecutionProvider"


class FakeRuntime:
    """Fake of onnxruntime with these providers; those in ``broken`` raise, those in ``silent`` are
    left out.
    """

    def __init__(
        self, available: list[str], broken: tuple[str, ...] = (), silent: tuple[str, ...] = ()
    ) -> None:
        self.available = available
        self.broken = broken
        self.silent = silent
        self.asked: list[list[str]] = []
        self.threads: list[int] = []

    def get_available_providers(self) -> list[str]:
        return [*self.available, CPU_NAME]

    def SessionOptions(self) -> SimpleNamespace:
        return SimpleNamespace(add_session_config_entry=lambda *_: None)

    def InferenceSession(
        self, path: str, options: SimpleNamespace, providers: list[str]
    ) -> SimpleNamespace:
        self.asked.append(providers)
        self.threads.append(options.intra_op_num_threads)
        if providers[0] in self.broken:
            raise RuntimeError("no device\nwas found")
        got = [p for p in providers if p not in self.silent]
        return SimpleNamespace(get_providers=lambda: got, options=options)


@pytest.fixture
def runtime(monkeypatch: pytest.MonkeyPatch):
    def make(*available: str, **more) -> FakeRuntime:
        fake = FakeRuntime([PROVIDERS[name][0] for name in available], **more)
        monkeypatch.setattr(sessions, "_runtime", lambda: fake)
        return fake

    return make


@pytest.mark.parametrize(
    ("available", "asked", "used"),
    [
        (("tensorrt", "cuda"), "auto", "cuda"),
        (("tensorrt",), "auto", "cpu"),
        (("coreml",), "auto", "coreml"),
        (("tensorrt", "cuda"), "tensorrt", "tensorrt"),
    ],
)
def test_the_best_available_provider_is_used(
    runtime, available: tuple[str, ...], asked: str, used: str
) -> None:
    fake = runtime(*available)
    execution = Execution(asked)
    open_session(Path("m.onnx"), 3, execution)
    assert execution.used == [used]
    assert execution.warnings == []
    assert fake.asked[-1][-1] == CPU_NAME  # for operators that the other does not have
    assert fake.threads == [3]


def test_an_unavailable_provider_gives_one_warning(runtime) -> None:
    fake = runtime("coreml")
    execution = Execution("cuda")
    open_session(Path("m.onnx"), 1, execution)
    open_session(Path("m.onnx"), 1, execution)
    assert fake.asked == [[CPU_NAME]] * 2
    (warning,) = map(str, execution.warnings)
    assert "CUDA was requested, but this onnxruntime has only CoreML, CPU" in warning


@pytest.mark.parametrize("how", ["broken", "silent"])
def test_a_failing_provider_is_not_tried_again(runtime, how: str) -> None:
    fake = runtime("cuda", **{how: (PROVIDERS["cuda"][0],)})
    execution = Execution("auto")
    for _ in range(3):
        open_session(Path("m.onnx"), 1, execution)
    assert len([a for a in fake.asked if a[0] != CPU_NAME]) == 1
    assert execution.used == [CPU]
    (warning,) = map(str, execution.warnings)
    assert "CUDA cannot run the networks" in warning
    assert "\n" not in warning


def test_directml_sessions_run_in_one_thread_at_a_time(runtime) -> None:
    runtime("directml")
    session = open_session(Path("m.onnx"), 1, Execution("auto"))
    assert isinstance(session, SerializedSession)
    assert session.options.enable_mem_pattern is False
    inside = threading.Semaphore()

    def run(*_: object) -> list:
        assert inside.acquire(blocking=False)
        threading.Event().wait(0.005)
        inside.release()
        return [1]

    session._session.run = run
    results: list = []
    threads = [
        threading.Thread(target=lambda: results.extend(session.run(None, {}))) for _ in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [1] * 6


def test_description_of_the_providers() -> None:
    assert Execution("auto", used=["cuda"]).describe(2) == "CUDA"
    assert Execution("auto", used=["cpu"]).describe(2) == "CPU, 2 threads"
    assert Execution("auto", used=["cpu"]).describe(1) == "CPU, 1 thread"
    with pytest.raises(UsageError, match="auto, cpu"):
        Execution("gpu")
