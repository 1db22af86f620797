# SPDX-License-Identifier: GPL-3.0-or-later
"""Networks that loop, grow or crash end with one sentence, and leave no process behind.

The messages between Scope and the process of a network; what is no message is refused before it
takes memory.
"""

from __future__ import annotations

import gc
import io
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.perception.adapters import graph, network_server
from scope.scope_addon.capture.perception.adapters.description import Description
from scope.scope_addon.capture.perception.adapters.graph import (
    SERVER,
    Graph,
    NetworkProcess,
    Normalization,
)
from scope.scope_addon.capture.perception.adapters.keypoint_network import KeypointNetwork
from scope.scope_addon.capture.perception.adapters.network_server import (
    OUT_OF_MEMORY,
    Server,
    receive,
    send,
)
from scope.solver.errors import ModelFileError

from ....job.processes import runs, wait_for
from ...small_graphs import simcc
from .made_networks import greedy, looping


def grey(network: NetworkProcess) -> list[np.ndarray]:
    return network.run(None, {"images": np.zeros((1, 3, 32, 32), np.float32)})


def test_a_loop_that_only_some_images_start_ends_as_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(graph, "RUN_S", 0.5)
    network = NetworkProcess("cpu", looping(tmp_path / "m.onnx", while_bright=True), 1)
    grey(network)
    with pytest.raises(ModelFileError, match=r"no result within 0\.5 s"):
        network.run(None, {"images": np.full((1, 3, 32, 32), 2000, np.float32)})
    with pytest.raises(RuntimeError, match="its process has ended"):
        grey(network)


def test_a_network_that_takes_more_memory_than_it_may_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    network = NetworkProcess("cpu", greedy(tmp_path / "m.onnx"), 1)
    assert grey(network)[0].shape == (1, 3, 32, 32)
    monkeypatch.setattr(graph, "BASE_BYTES", 300_000_000)
    network = NetworkProcess("cpu", greedy(tmp_path / "m.onnx"), 1)
    with pytest.raises((ModelFileError, RuntimeError), match="memory"):
        grey(network)


def test_watched_memory_ends_the_process() -> None:
    code = (
        f"import sys, threading; sys.path.insert(0, {str(SERVER.parent)!r}); import network_server "
        "as n\n"
        "now = n.used_bytes(); assert 5e6 < now < 1e9, now\n"
        "threading.Thread(target=n.watch_memory, args=(100_000_000,), daemon=True).start()\n"
        "threading.Event().wait(0.2); print('small', flush=True)\n"
        "block = bytearray(b'1') * 200_000_000; threading.Event().wait(300)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-I", "-c", code], capture_output=True, text=True, timeout=600
    )
    assert (ended.returncode, ended.stdout) == (OUT_OF_MEMORY, "small\n"), ended.stderr


# until the answer has been read: who ends sooner may break the question's pipe
LISTEN = "; sys.stdin.buffer.read()"


def _answering(text: str) -> str:
    return (
        f"import os, sys; os.write(1, {len(text).to_bytes(4, 'little') + text.encode()!r})" + LISTEN
    )


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (
            "import os, sys; os._exit(77)",
            r"m\.onnx was stopped because it took more than 4\.\d GB of memory",
        ),
        (
            "import os; os.kill(os.getpid(), 9)",
            r"cannot load this network \(onnxruntime crashed in its process",
        ),
        (
            "import os, sys; os.write(1, b'ORT_ERROR: no answer')" + LISTEN,
            "sent no valid answer: a message is too long",
        ),
        (_answering("[" * 50_000), "sent no valid answer: maximum recursion"),
    ],
)
def test_a_process_that_ends_or_answers_nonsense(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, says: str
) -> None:
    script = tmp_path / "server.py"
    script.write_text(code)
    monkeypatch.setattr(graph, "SERVER", script)
    with pytest.raises(ModelFileError, match=says) as caught:
        KeypointNetwork(simcc(tmp_path / "m.onnx", 17, 32, 32), threads=1)
    assert "\n" not in str(caught.value)


def test_results_are_those_of_this_process_and_the_process_ends_with_the_network(
    tmp_path: Path,
) -> None:
    import onnxruntime

    path = simcc(tmp_path / "m.onnx", 17, 32, 32)
    network = Graph(path, Description(), threads=1)
    picture = np.random.default_rng(0).integers(0, 255, (32, 32, 3), np.uint8)
    here = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"]).run(
        None, {"images": picture.transpose(2, 0, 1)[None].astype(np.float32)}
    )
    for ours, truth in zip(network.run(picture, Normalization()), here, strict=True):
        np.testing.assert_array_equal(ours, truth)
    process = network._session._process
    del network
    gc.collect()
    assert process.returncode is not None


def test_the_process_ends_when_the_capture_is_killed(tmp_path: Path) -> None:
    path = simcc(tmp_path / "m.onnx", 17, 32, 32)
    code = (
        "import os, pathlib, sys\n"
        "from scope.scope_addon.capture.perception.adapters.graph import NetworkProcess\n"
        f"network = NetworkProcess('cpu', pathlib.Path({str(path)!r}), 1)\n"
        "print(network._process.pid, flush=True)\n"
        "os._exit(9)\n"
    )
    killed = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=600
    )
    assert killed.returncode == 9, killed.stderr
    pid = int(killed.stdout)
    wait_for(lambda: not runs(pid))


def message(content: object, *, data: bytes = b"", claimed: int | None = None) -> io.BytesIO:
    text = json.dumps(content).encode()
    return io.BytesIO(
        (len(text) if claimed is None else claimed).to_bytes(4, "little") + text + data
    )


def test_messages_arrive_as_they_were_sent():
    stream = io.BytesIO()
    arrays = [
        np.arange(6, dtype=np.float32).reshape(2, 3),
        np.zeros((0, 4)),
        np.array(7, np.int64),
        np.array([True]),
    ]
    send(stream, {"name": "größe", "limit_s": 2.5}, arrays)
    send(stream, {"next": None})
    stream.seek(0)
    found = receive(stream, 1000)
    assert (found["name"], found["limit_s"]) == ("größe", 2.5)
    for got, sent in zip(found["arrays"], arrays, strict=True):
        assert (got.dtype, got.shape, got.tolist()) == (sent.dtype, sent.shape, sent.tolist())
    assert receive(stream, 0) == {"next": None, "arrays": []}
    with pytest.raises(EOFError):
        receive(stream, 0)


@pytest.mark.parametrize(
    ("stream", "words"),
    [
        (message({}, claimed=network_server.LARGEST_MESSAGE + 1), "too long"),
        (message([1]), "no object"),
        (message({}), "arrays"),
        (message({"arrays": [{"dtype": "|O", "shape": [1]}]}), "not of numbers"),
        (message({"arrays": [{"dtype": "f4", "shape": [float("inf")]}]}), "cannot convert float"),
        (message({"arrays": [{"dtype": "<f8", "shape": [-1]}]}), "too large"),
        (message({"arrays": [{"dtype": "<f8", "shape": [1 << 40, 1 << 40]}]}), "too large"),
        (
            message(
                {"arrays": [{"dtype": "<f8", "shape": [100]}, {"dtype": "<f8", "shape": [26]}]}
            ),
            "too large",
        ),
        (message({"arrays": [{"dtype": "x(", "shape": [1]}]}), "x|type"),
        (message({"arrays": [{"dtype": "f4,(", "shape": [1]}]}), "."),
    ],
)
def test_what_is_no_message_is_refused(stream, words):
    stream = io.BytesIO(stream.getvalue() + bytes(800))
    with pytest.raises(ValueError, match=words):
        receive(stream, 1000)


def test_a_message_that_breaks_off_is_the_end():
    with pytest.raises(EOFError):
        receive(message({"arrays": [{"dtype": "<f8", "shape": [3]}]}, data=bytes(23)), 1000)


class Session:
    """Stands for a session of onnxruntime."""

    def __init__(self, outputs):
        self.outputs = outputs

    def run(self, names, inputs):
        if isinstance(self.outputs, BaseException):
            raise self.outputs
        return self.outputs


@pytest.mark.parametrize(
    ("outputs", "error"),
    [
        ([np.zeros(2)], None),
        ([[1, 2]], "it has outputs that are not arrays of numbers; export it without these"),
        ([np.broadcast_to(np.float32(0), (1 << 26, 2))], "its outputs are larger than 256 MB"),
        (MemoryError(), "out of memory"),
        (RuntimeError("x" * 5000), "x" * 2000),
        (KeyError(), "KeyError"),
    ],
)
def test_a_request_is_answered_whatever_the_network_does(outputs, error):
    server = Server()
    server._session = Session(outputs)
    answer, arrays = server.answer(
        {"limit_s": 60.0, "input": "image", "arrays": [np.zeros((1, 3))]}
    )
    assert answer == ({} if error is None else {"error": error})
    assert len(arrays) == (error is None)
