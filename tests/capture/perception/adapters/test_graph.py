# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user's graph is given: pixels of each layout, type, order and normalization; and graphs
that are refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper
from scope.scope_addon.capture.perception.adapters.description import Description
from scope.scope_addon.capture.perception.adapters.graph import (
    IMAGENET,
    UNIT,
    Graph,
    Normalization,
    finite,
)
from scope.solver.errors import ModelFileError

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


@pytest.mark.parametrize("kind", [TensorProto.FLOAT, TensorProto.FLOAT16, TensorProto.UINT8])
@pytest.mark.parametrize("channels_last", [False, True])
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


def test_the_usual_normalization_is_turned_to_the_order_of_the_json() -> None:
    turned = IMAGENET.with_description(Description(channel_order="bgr"))
    assert (turned.mean, turned.std) == (IMAGENET.mean[::-1], IMAGENET.std[::-1])
    assert UNIT.with_description(Description(mean=(1.0,))) == Normalization((1.0,), (255.0,), "rgb")


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


def test_a_graph_of_any_size_takes_that_of_the_json(tmp_path: Path) -> None:
    path = identity(tmp_path / "m.onnx", [1, 3, "h", "w"])
    graph = opened(path, Description(input_size=(WIDTH, HEIGHT)))
    np.testing.assert_array_equal(
        graph.run(PICTURE, Normalization())[0][0].transpose(1, 2, 0), PICTURE
    )


def test_what_is_not_finite_becomes_zero() -> None:
    values = np.array([1.5, np.nan, np.inf, -np.inf], np.float16)
    np.testing.assert_array_equal(finite(values), [1.5, 0.0, 0.0, 0.0])
    assert finite(values).dtype == np.float64
