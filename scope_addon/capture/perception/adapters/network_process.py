# SPDX-License-Identifier: GPL-3.0-or-later
"""A session on a user's network in a process of its own, which ends where the network takes too
much time or memory.

A file from somewhere may loop without end, ask for any memory, or crash onnxruntime; and it may do
so for one image alone, so that a trial before the capture would prove nothing. Therefore every run
is made in that process. It costs a third of a second at the start, and a few milliseconds an image
to pass arrays through a pipe. The built-in networks are opened in the capture's own process and pay
nothing.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
import weakref
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from .....solver.errors import ModelFileError
from ....errors import SetupError
from ..sessions import session_options_of
from .network_server import LARGEST_ARRAYS, OUT_OF_MEMORY, receive, send

SERVER = Path(__file__).with_name("network_server.py")
OPENING_S = {"tensorrt": 1800.0}  # TensorRT compiles the network
DEFAULT_OPENING_S = 120.0
RUN_S = 60.0
# Memory beside the weights, which onnxruntime copies while it rearranges them.
BASE_BYTES = 4 << 30
WEIGHT_COPIES = 4
_FLAGS = getattr(subprocess, "CREATE_NO_WINDOW", 0)


class NetworkProcess:
    """A session of onnxruntime, with what `Graph` needs of its interface, in another process;
    thread-safe.
    """

    def __init__(self, provider: str, path: Path, threads: int) -> None:
        """Start the process and open the network.

        :param provider: our name of the execution provider.
        :raises ModelFileError: this takes too much time or memory.
        :raises RuntimeError: onnxruntime cannot open it, or its process crashed.
        :raises SetupError: the process cannot be started.
        """
        self._path = path
        self._lock = threading.Lock()
        self._limit_bytes = BASE_BYTES + WEIGHT_COPIES * _bytes_of_weights(path)
        self._limit_s = OPENING_S.get(provider, DEFAULT_OPENING_S)
        self._process = _start(str(path.resolve().parent) if provider == "cpu" else "")
        self._end = weakref.finalize(self, _end, self._process)
        providers, mem_pattern = session_options_of(provider)
        opened = self._ask(
            {
                "path": str(path),
                "threads": threads,
                "providers": providers,
                "mem_pattern": mem_pattern,
                "limit_bytes": self._limit_bytes,
            }
        )
        self._providers: list[str] = opened["providers"]
        self._inputs = [SimpleNamespace(name=n, type=t, shape=s) for n, t, s in opened["inputs"]]
        self._outputs = [SimpleNamespace(name=name) for name in opened["outputs"]]

    def get_providers(self) -> list[str]:
        """Return onnxruntime's names of the providers in use."""
        return self._providers

    def get_inputs(self) -> list[SimpleNamespace]:
        """Return the inputs, each with ``name``, ``type`` and ``shape``."""
        return self._inputs

    def get_outputs(self) -> list[SimpleNamespace]:
        """Return the outputs, each with its ``name``."""
        return self._outputs

    def run(self, _: None, inputs: dict[str, Any]) -> list[Any]:
        """Run the network on its only input.

        :return: arrays of numbers.
        :raises ModelFileError: it takes too much time or memory.
        :raises RuntimeError: it fails, or its process has ended.
        """
        ((name, array),) = inputs.items()
        with self._lock:
            answer = self._ask({"input": name}, [array])
            self._limit_s = RUN_S  # the first run may still compile
        outputs: list[Any] = answer["arrays"]
        return outputs

    def _ask(self, request: dict[str, Any], arrays: list[Any] | None = None) -> dict[str, Any]:
        if not self._end.alive:
            raise RuntimeError("its process has ended")
        began = time.monotonic()
        try:
            assert self._process.stdin is not None
            assert self._process.stdout is not None
            send(self._process.stdin, {**request, "limit_s": self._limit_s}, arrays or [])
            answer = receive(self._process.stdout, LARGEST_ARRAYS)
        except (EOFError, OSError):
            raise self._ended(time.monotonic() - began) from None
        except ValueError as error:
            self._end()
            raise RuntimeError(f"its process sent no valid answer: {error}") from error
        except BaseException:
            self._end()  # an interrupted exchange cannot be resumed
            raise
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return answer

    def _ended(self, elapsed_s: float) -> Exception:
        """Return the error for a process that ended instead of answering."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
        status = self._process.returncode
        self._end()
        if status == OUT_OF_MEMORY:
            return ModelFileError(
                f"{self._path} was stopped because it took more than {self._limit_bytes / 1e9:.1f} "
                "GB of memory; "
                "choose a smaller network"
            )
        if elapsed_s >= self._limit_s:
            return ModelFileError(
                f"{self._path} was stopped because it gave no result within {self._limit_s:g} s; "
                "choose a faster "
                "network, or export this one again"
            )
        return RuntimeError(f"onnxruntime crashed in its process, which ended with status {status}")


def _start(folder: str) -> subprocess.Popen[bytes]:
    # An empty entry means the current folder, which isolated Python omits on purpose.
    parent = str(os.getpid())
    command = [sys.executable, "-I", "-S", str(SERVER), parent, folder, *(p for p in sys.path if p)]
    try:
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            creationflags=_FLAGS,
        )
    except OSError as error:
        raise SetupError(
            f"the process for your network cannot be started ({error}); free some memory"
        ) from error


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    for stream in (process.stdin, process.stdout):
        with suppress(OSError):
            if stream is not None:
                stream.close()
    with suppress(subprocess.TimeoutExpired):
        process.wait(5.0)


def _bytes_of_weights(path: Path) -> int:
    """Return the size of an ONNX file and of what may be its external data: the files whose names
    begin with its own.

    The check of the file has confined external data to its folder.
    """
    with suppress(OSError):
        return sum(
            p.stat().st_size
            for p in path.parent.iterdir()
            if p.name.startswith(path.stem) and p.is_file()
        )
    return 0
