# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages between Scope and the process of a network; what is no message is refused before it
takes memory.
"""

from __future__ import annotations

import io
import json
import mmap

import numpy as np
import pytest
from scope.scope_addon.capture.perception.adapters import network_server
from scope.scope_addon.capture.perception.adapters.network_server import (
    Server,
    receive,
    send,
    used_bytes,
)


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
        (message({"arrays": [{"dtype": "<f8", "shape": [-1]}]}), "too large"),
        (message({"arrays": [{"dtype": "<f8", "shape": [1 << 40, 1 << 40]}]}), "too large"),
        (
            message(
                {"arrays": [{"dtype": "<f8", "shape": [100]}, {"dtype": "<f8", "shape": [26]}]}
            ),
            "too large",
        ),
        (message({"arrays": [{"dtype": "x(", "shape": [1]}]}), "x|type"),
        (message({"arrays": [{"dtype": "<f8", "shape": None}]}), "None"),
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
        (
            [np.array(["text"], object)],
            "it has outputs that are not arrays of numbers; export it without these",
        ),
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


def test_memory_that_is_taken_is_seen():
    before = used_bytes()
    # 64 MB that the C library has not kept from earlier tests
    with mmap.mmap(-1, 1 << 26) as taken:
        taken.write(b"1" * len(taken))
        assert used_bytes() - before > 0.9 * len(taken)
