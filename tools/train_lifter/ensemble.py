# SPDX-License-Identifier: GPL-3.0-or-later
"""Several lifting networks as one: ``python -m scope.tools.train_lifter.ensemble A.onnx B.onnx -o lifter.onnx``.

With members' points P_i and deviations σ_i, the one network returns the moments of the members' even mixture,

    P = mean_i P_i,   σ² = mean_i σ_i² + mean_i (P_i − P)²,

the second term averaged over both coordinates across the line of sight: where members disagree, the deviation grows.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, compose, helper, numpy_helper

from ...scope_addon.capture.lifter import INPUT_SIZE, KEYPOINT_COUNT


def merge(members: list[Path], path: Path) -> None:
    """Write the mixture of ``members``, files that ``export`` wrote, to ``path``."""
    nodes: list[onnx.NodeProto] = []
    weights = [
        numpy_helper.from_array(np.array([2, 1], np.int64), "split"),
        numpy_helper.from_array(np.array(0.5, np.float32), "half"),
    ]
    names = [f"member{k}_" for k in range(len(members))]
    for name, file in zip(names, members, strict=True):
        model = onnx.load(str(file))
        graph = compose.add_prefix_graph(model.graph, name)
        nodes += [helper.make_node("Identity", ["input"], [f"{name}input"]), *graph.node]
        weights += graph.initializer

    def add(kind: str, inputs: list[str], output: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    points = add("Mean", [f"{name}points" for name in names], "points")
    spread = []
    for name in names:
        off = add("Sub", [f"{name}points", points], f"from_{name}off")
        squared = add("Mul", [off, off], f"from_{name}squared")
        nodes.append(helper.make_node("Split", [squared, "split"], [f"from_{name}xy", f"from_{name}z"], axis=2))
        across = add("ReduceMean", [f"from_{name}xy"], f"from_{name}across", axes=[2], keepdims=1)
        both = add("Concat", [across, f"from_{name}z"], f"from_{name}spread", axis=2)
        double = add("Add", [f"{name}log_sigma", f"{name}log_sigma"], f"from_{name}log_variance")
        spread.append(add("Add", [both, add("Exp", [double], f"from_{name}variance")], f"from_{name}total"))
    variance = add("Mean", spread, "variance")
    add("Mul", [add("Log", [variance], "log_variance"), "half"], "log_sigma")
    graph = helper.make_graph(
        nodes,
        "lifter",
        [helper.make_tensor_value_info("input", TensorProto.FLOAT, ["n", INPUT_SIZE])],
        [
            helper.make_tensor_value_info("points", TensorProto.FLOAT, ["n", KEYPOINT_COUNT, 3]),
            helper.make_tensor_value_info("log_sigma", TensorProto.FLOAT, ["n", KEYPOINT_COUNT, 2]),
        ],
        weights,
    )
    opset = [helper.make_opsetid("", model.opset_import[0].version)]
    merged = helper.make_model(graph, producer_name="scope", opset_imports=opset, ir_version=model.ir_version)
    onnx.checker.check_model(merged, full_check=True)
    temporary = path.with_suffix(".part")
    onnx.save(merged, str(temporary))
    os.replace(temporary, path)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Merge lifting networks into one.")
    parser.add_argument("members", type=Path, nargs="+", help="networks written by scope.tools.train_lifter.train")
    parser.add_argument("-o", "--output", type=Path, required=True)
    a = parser.parse_args()
    merge(a.members, a.output)


if __name__ == "__main__":
    main()
