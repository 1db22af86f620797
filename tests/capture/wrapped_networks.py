# SPDX-License-Identifier: GPL-3.0-or-later
"""Our own networks with the outputs of other types, such as a user's RTMPose and YOLO.

Appended nodes convert BlazePose's landmarks to SimCC rows of COCO-17, and its detections to rows of
boxes.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from scope.scope_addon.capture.perception.adapters.description import COCO_17
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.person_detector import make_anchors
from scope.scope_addon.capture.perception.sessions import network_path

_SIDE = 256
_RATIO = 2


def _extend(
    source: str, path: Path, nodes: list, constants: dict[str, np.ndarray], outputs: list
) -> Path:
    model = onnx.load(str(network_path(source)))
    model.graph.node.extend(nodes)
    model.graph.initializer.extend(
        numpy_helper.from_array(value, name) for name, value in constants.items()
    )
    del model.graph.output[:]
    model.graph.output.extend(outputs)
    onnx.save(model, str(path))
    return path


def coco_simcc(path: Path, source: str = "pose_landmark_lite") -> Path:
    """Write a SimCC network: the score is visibility times presence, and falls by a quarter per
    bin.
    """
    constants: dict[str, np.ndarray] = {
        "table": np.array([39, 5], np.int64),
        "coco": np.array([KEYPOINT_NAMES.index(name) for name in COCO_17], np.int64),
        "bins": np.arange(_SIDE * _RATIO, dtype=np.float32)[None],
        "ratio": np.array(_RATIO, np.float32),
        "slope": np.array(0.25, np.float32),
        "one": np.array(1, np.float32),
        "visible": np.array([3], np.int64),
        "column_x": np.array([0], np.int64),
        "column_y": np.array([1], np.int64),
        "batch": np.array([0], np.int64),
    }
    make = helper.make_node
    nodes = [
        make("Reshape", ["landmarks", "table"], ["rows"]),
        make("Gather", ["rows", "coco"], ["kept"], axis=0),
        make("Gather", ["kept", "visible"], ["visible_logit"], axis=1),
        make("Sigmoid", ["visible_logit"], ["visibility"]),
        make("Mul", ["visibility", "presence"], ["score"]),
    ]
    for axis in "xy":
        nodes += [
            make("Gather", ["kept", f"column_{axis}"], [f"at_{axis}"], axis=1),
            make("Mul", [f"at_{axis}", "ratio"], [f"bin_{axis}"]),
            make("Sub", ["bins", f"bin_{axis}"], [f"off_{axis}"]),
            make("Abs", [f"off_{axis}"], [f"far_{axis}"]),
            make("Mul", [f"far_{axis}", "slope"], [f"fall_{axis}"]),
            make("Sub", ["one", f"fall_{axis}"], [f"hill_{axis}"]),
            make("Relu", [f"hill_{axis}"], [f"peak_{axis}"]),
            make("Mul", [f"peak_{axis}", "score"], [f"scored_{axis}"]),
            make("Unsqueeze", [f"scored_{axis}", "batch"], [f"simcc_{axis}"]),
        ]
    outputs = [
        helper.make_tensor_value_info(f"simcc_{axis}", TensorProto.FLOAT, [1, 17, _SIDE * _RATIO])
        for axis in "xy"
    ]
    path.with_suffix(".json").write_text(json.dumps({"mean": 0, "std": 255}))
    return _extend(source, path, nodes, constants, outputs)


def box_rows(path: Path) -> Path:
    """Write a box detector: the square around each body circle, its score, and class 0."""
    constants: dict[str, np.ndarray] = {
        "anchors": make_anchors().astype(np.float32)[None],
        "hips": np.array([4, 5], np.int64),
        "circle": np.array([6, 7], np.int64),
        "shrink": np.array(0.8, np.float32),
    }
    make = helper.make_node
    nodes = [
        make("Gather", ["boxes", "hips"], ["from_anchor"], axis=2),
        make("Gather", ["boxes", "circle"], ["circle_from_anchor"], axis=2),
        make("Add", ["from_anchor", "anchors"], ["center"]),
        make("Sub", ["circle_from_anchor", "from_anchor"], ["spoke"]),
        make("ReduceL2", ["spoke"], ["full_radius"], axes=[2], keepdims=1),
        make("Mul", ["full_radius", "shrink"], ["radius"]),
        make("Sub", ["center", "radius"], ["low"]),
        make("Add", ["center", "radius"], ["high"]),
        make("Sigmoid", ["scores"], ["score"]),
        make("Sub", ["score", "score"], ["class"]),
        make("Concat", ["low", "high", "score", "class"], ["rows"], axis=2),
    ]
    output = helper.make_tensor_value_info("rows", TensorProto.FLOAT, [1, 2254, 6])
    path.with_suffix(".json").write_text(
        json.dumps({"mean": 127.5, "std": 127.5, "score_threshold": 0.5})
    )
    return _extend("pose_detection", path, nodes, constants, [output])
