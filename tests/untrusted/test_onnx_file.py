# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged and malicious network files: each gives one message."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper
from scope.scope_addon.capture.perception.adapters.keypoint_network import KeypointNetwork
from scope.scope_addon.untrusted.onnx_file import check_onnx_file
from scope.solver.errors import ModelFileError

from ..capture.small_graphs import picture_input, save


def refused(path: Path, says: str | None = None) -> None:
    with pytest.raises(ModelFileError, match=says) as caught:
        KeypointNetwork(path, threads=1)
    text = str(caught.value)
    assert "\n" not in text
    assert path.stem in text


@pytest.mark.parametrize(
    "content", [b"", b"PK\x03\x04 torch", b"\x80\x04 pickle", b"text\n" * 99, b"\xff" * 99]
)
def test_files_that_are_not_onnx(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "m.onnx").write_bytes(content)
    refused(tmp_path / "m.onnx", "not an ONNX model")


def test_missing_and_folder(tmp_path: Path) -> None:
    refused(tmp_path / "m.onnx", "cannot be read")
    (tmp_path / "m.onnx").mkdir()
    refused(tmp_path / "m.onnx", "cannot be read")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no named pipes in folders")
def test_a_pipe_is_refused_without_waiting(tmp_path: Path) -> None:
    pipe = tmp_path / "m.onnx"
    os.mkfifo(pipe)
    keeps_open = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    os.write(keeps_open, b"text")
    try:
        refused(pipe, "m.onnx is a pipe or a device")
    finally:
        os.close(keeps_open)


def test_a_file_larger_than_a_protocol_buffer_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.onnx"
    with path.open("wb") as file:
        file.truncate((2 << 30) + 1)
    refused(path, "too large for a network in one ONNX file")


def with_external_data(path: Path, location: str, inside: str = "initializer") -> Path:
    weight = numpy_helper.from_array(np.zeros((1, 17, 64), np.float32), "w")
    weight.ClearField("raw_data")
    weight.data_location = TensorProto.EXTERNAL
    for key, value in {"location": location, "offset": "0", "length": "4352"}.items():
        entry = weight.external_data.add()
        entry.key = key
        entry.value = value
    if inside == "initializer":
        node = helper.make_node("Identity", ["w"], ["simcc_x"])
        weights = [weight]
    else:
        node = helper.make_node("Constant", [], ["simcc_x"], value=weight)
        weights = []
    info = helper.make_tensor_value_info("simcc_x", TensorProto.FLOAT, [1, 17, 64])
    graph = helper.make_graph([node], "ours", [picture_input(32, 32)], [info], weights)
    path.write_bytes(
        helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)]).SerializeToString()
    )
    return path


@pytest.mark.parametrize("inside", ["initializer", "constant"])
@pytest.mark.parametrize(
    "location", ["../secret.bin", "{tmp}/secret.bin", "a/../../secret.bin", "link"]
)
def test_weights_outside_of_the_folder(tmp_path: Path, location: str, inside: str) -> None:
    (tmp_path / "secret.bin").write_bytes(bytes(4352))
    folder = tmp_path / "models"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path / "secret.bin")
    path = with_external_data(folder / "m.onnx", location.format(tmp=tmp_path), inside)
    refused(path, "outside its own folder")


def test_weights_in_the_same_folder_are_read(tmp_path: Path) -> None:
    path = with_external_data(tmp_path / "m.onnx", "m.onnx.data")
    refused(path, "missing; put that file there")
    (tmp_path / "m.onnx.data").write_bytes(bytes(4352))
    check_onnx_file(path)


def test_unknown_operators_are_refused(tmp_path: Path) -> None:
    node = helper.make_node("Magic", ["images"], ["out"], domain="com.example")
    info = helper.make_tensor_value_info("out", TensorProto.FLOAT, [1, 17, 64])
    graph = helper.make_graph([node], "ours", [picture_input(32, 32)], [info])
    opsets = [helper.make_opsetid("", 17), helper.make_opsetid("com.example", 1)]
    path = tmp_path / "m.onnx"
    path.write_bytes(
        helper.make_model(graph, opset_imports=opsets, ir_version=8).SerializeToString()
    )
    refused(path, "onnxruntime cannot load.*standard operators")


@pytest.mark.parametrize(
    ("shape", "kind", "says"),
    [
        ([1, 1, 32, 32], TensorProto.FLOAT, "colour"),
        ([1, 3, 32], TensorProto.FLOAT, "batch size 1"),
        ([1, 3, 2, 2], TensorProto.FLOAT, "16 to 4096"),
        ([1, 3, 32, 32], TensorProto.INT64, "int64"),
        ([1, 3, "h", "w"], TensorProto.FLOAT, "input_size"),
    ],
)
def test_inputs_that_are_not_an_image_are_refused(
    tmp_path: Path, shape: list, kind: int, says: str
) -> None:
    info = helper.make_tensor_value_info("images", kind, shape)
    out = helper.make_tensor_value_info("out", kind, shape)
    path = save(
        tmp_path / "m.onnx", [helper.make_node("Identity", ["images"], ["out"])], [info], [out]
    )
    refused(path, says)


def test_a_graph_that_fails_at_run_time_is_refused(tmp_path: Path) -> None:
    nodes = [helper.make_node("Reshape", ["images", "wanted"], ["out"])]
    out = helper.make_tensor_value_info("out", TensorProto.FLOAT, [7, 11])
    shape = {"wanted": np.array([7, 11], np.int64)}
    path = save(tmp_path / "m.onnx", nodes, [picture_input("w", "h")], [out], shape)
    path.with_suffix(".json").write_text('{"input_size": [32, 32]}')
    refused(path, "cannot be run on an image of 32 x 32")
