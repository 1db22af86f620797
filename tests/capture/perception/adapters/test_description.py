# SPDX-License-Identifier: GPL-3.0-or-later
"""The JSON beside a network: every entry with values it may have, and those that are refused by
their names.

What a user's graph is given: pixels of each layout, type, order and normalization; and graphs
that are refused.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper
from scope.scope_addon.capture.perception.adapters.description import (
    Description,
    read_description,
)
from scope.scope_addon.capture.perception.adapters.graph import (
    Graph,
    Normalization,
)
from scope.solver.errors import ModelFileError

TYPES = ("yolox", "simcc")


pytestmark = pytest.mark.usefixtures("in_this_process")


def read(folder: Path, text: str) -> Description:
    (folder / "m.json").write_text(text, "utf-8")
    return read_description(folder / "m.onnx", TYPES)


def test_entries_are_read(tmp_path: Path) -> None:
    numbers = {"input_size": [192, 256], "mean": [1, 2.5, -3], "std": 58.4}
    others = {
        "type": "simcc",
        "channel_order": "bgr",
        "score_threshold": 0.25,
        "decoded": False,
        "person_class": 3,
        "keypoints": "halpe26",
        "decode": "quarter",
        "udp": True,
    }
    found = read(tmp_path, json.dumps(others | numbers))
    as_tuples = {"input_size": (192, 256), "mean": (1, 2.5, -3), "std": (58.4,)}
    assert vars(found) == others | as_tuples
    assert read(tmp_path, "{}") == Description()


@pytest.mark.parametrize(
    ("key", "given", "expected"),
    [
        ("type", "yolov99", "one of yolox, simcc"),
        ("input_size", 256, "width, height"),
        ("input_size", [8, 256], "16 to 4096"),
        ("mean", [1, 2], "one number or three"),
        ("mean", [True], "one number or three"),
        ("std", 0, "above 0"),
        ("channel_order", "grb", "one of rgb, bgr"),
        ("score_threshold", 1, "between 0 and 1"),
        ("decoded", 1, "true or false"),
        ("person_class", -1, "at least 0"),
        ("person_class", True, "whole number"),
        ("keypoints", "coco", "one of coco17"),
        ("decode", "exact", "one of dark, quarter"),
        ("udp", "yes", "true or false"),
        ("colour", "rgb", "unknown entry 'colour'"),
    ],
)
def test_a_value_that_means_nothing_is_refused(
    tmp_path: Path, key: str, given: object, expected: str
) -> None:
    with pytest.raises(ModelFileError, match=r"m\.json") as caught:
        read(tmp_path, json.dumps({key: given}))
    assert key in str(caught.value)
    assert expected in str(caught.value)


@pytest.mark.parametrize(
    "text", ['{"std": NaN}', '{"mean": 1e400}', '{"mean": 1e31}', "[]", "{", "", "[" * 100_000]
)
def test_what_is_no_object_of_finite_numbers_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ModelFileError, match=r"m\.json"):
        read(tmp_path, text)


WIDTH = 32


HEIGHT = 16


PICTURE = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)


def identity(
    path: Path, shape: Sequence[str | int], kind: int = TensorProto.FLOAT, inputs: int = 1
) -> Path:
    """Write a graph that returns what it is given."""
    names = [f"x{k}" for k in range(inputs)]
    given = [helper.make_tensor_value_info(name, kind, shape) for name in names]
    returned = [helper.make_tensor_value_info("y", kind, shape)]
    graph = helper.make_graph([helper.make_node("Identity", ["x0"], ["y"])], "g", given, returned)
    onnx.save(
        helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8),
        str(path),
    )
    return path


def opened(path: Path, description: Description | None = None) -> Graph:
    return Graph(path, description or Description(), threads=1)


@pytest.mark.parametrize(
    ("kind", "channels_last"),
    [(TensorProto.FLOAT, False), (TensorProto.FLOAT16, False), (TensorProto.UINT8, True)],
)
def test_the_graph_gets_the_image_in_its_own_layout_and_type(
    tmp_path: Path, kind: int, channels_last: bool
) -> None:
    shape = [1, HEIGHT, WIDTH, 3] if channels_last else [1, 3, HEIGHT, WIDTH]
    graph = opened(identity(tmp_path / "m.onnx", shape, kind))
    assert (graph.width, graph.height, graph.shapes) == (WIDTH, HEIGHT, [tuple(shape)])
    (given,) = graph.run(PICTURE, Normalization())
    np.testing.assert_array_equal(
        given[0] if channels_last else given[0].transpose(1, 2, 0), PICTURE
    )


def test_pixels_are_normalized_in_the_order_of_the_channels(tmp_path: Path) -> None:
    graph = opened(identity(tmp_path / "m.onnx", [1, 3, HEIGHT, WIDTH]))
    normalization = Normalization((10.0, 20.0, 30.0), (2.0, 4.0, 5.0), "bgr")
    (given,) = graph.run(PICTURE, normalization)
    for channel, of_picture in enumerate((2, 1, 0)):
        expected = (PICTURE[..., of_picture] - (10.0, 20.0, 30.0)[channel]) / (2.0, 4.0, 5.0)[
            channel
        ]
        np.testing.assert_allclose(given[0, channel], expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("shape", "description", "message"),
    [
        ([1, 1, HEIGHT, WIDTH], None, "choose a network for colour images"),
        ([2, 3, HEIGHT, WIDTH], None, "export it with batch size 1"),
        ([3, HEIGHT, WIDTH], None, "must take one colour image"),
        ([1, 3, "h", "w"], None, r"images of any size.*m\.json"),
        (
            [1, 3, HEIGHT, WIDTH],
            Description(input_size=(64, 64)),
            "takes images of 32 x 16; correct it",
        ),
        ([1, 3, 8, WIDTH], None, "16 to 4096 pixels"),
    ],
)
def test_graphs_that_take_no_image_are_refused(tmp_path: Path, shape, description, message) -> None:
    with pytest.raises(ModelFileError, match=message):
        opened(identity(tmp_path / "m.onnx", shape), description)


def test_several_inputs_and_other_types_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match=r"takes 2 inputs \(x0, x1\)"):
        opened(identity(tmp_path / "two.onnx", [1, 3, HEIGHT, WIDTH], inputs=2))
    with pytest.raises(ModelFileError, match=r"takes tensor\(int64\)"):
        opened(identity(tmp_path / "whole.onnx", [1, 3, HEIGHT, WIDTH], TensorProto.INT64))
