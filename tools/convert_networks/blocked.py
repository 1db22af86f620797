# SPDX-License-Identifier: GPL-3.0-or-later
"""Rewrite PReLU as convolutions, with which a network stays in onnxruntime's blocked layout.

That layout has no PRelu: with a change of layout before and after it, PRelu takes longer than all
convolutions of a network. With slopes a per channel, and depthwise convolutions of size 1 as
products per channel,

    prelu(x) = x + (1 − a) max(−x, 0)

A convolution W with few channels, followed by PReLU, a depthwise convolution D and one of size 1,
P, takes twice the channels instead, where prelu(x) = max(x, 0) − a max(−x, 0) is a change of D's
weights:

    P D prelu(W x) = [P P] [D, −a D] max([W, −W] x, 0)
"""

from collections import defaultdict
from typing import Any

import numpy as np
from numpy.typing import NDArray
from onnx import NodeProto, helper, numpy_helper

from .graph import Graph

MAX_DOUBLED = 8  # channels; of more, twice as many take longer than the products


def replace_prelu(graph: Graph) -> None:
    """Replace every PRelu of a graph without branches, and remove the constants that are then
    unused.
    """
    before = _Nodes(graph)
    after: list[NodeProto] = []
    replaced: set[str] = set()
    for node in graph.nodes:
        if node.name in replaced:
            continue
        if chain := before.chain_from(node):
            after += before.doubled(*chain)
            replaced |= {each.name for each in chain}
        else:
            after += before.product(node) if node.op_type == "PRelu" else [node]
    used = {name for node in after for name in node.input if node.op_type != "Cast"}
    graph.nodes[:] = [node for node in after if node.op_type != "Cast" or node.output[0] in used]
    used |= {name for node in graph.nodes for name in node.input}
    graph.initializers[:] = [each for each in graph.initializers if each.name in used]


class _Nodes:
    """The nodes of a graph: who uses a value, and the values of constants."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._users: dict[str, list[NodeProto]] = defaultdict(list)
        self._arrays = {each.name: numpy_helper.to_array(each) for each in graph.initializers}
        for node in graph.nodes:
            for name in node.input:
                self._users[name].append(node)
            if node.op_type == "Cast" and node.input[0] in self._arrays:
                self._arrays[node.output[0]] = self._arrays[node.input[0]]

    def chain_from(
        self, first: NodeProto
    ) -> tuple[NodeProto, NodeProto, NodeProto, NodeProto] | None:
        """Return a convolution, PRelu, depthwise convolution and convolution of size 1 that follow
        only each other.
        """
        chain = [first]
        for kind in ("Conv", "PRelu", "Conv", "Conv"):
            if chain[-1].op_type != kind:
                return None
            if len(chain) == 4:
                break
            users = self._users[chain[-1].output[0]]
            if len(users) != 1:
                return None
            chain.append(users[0])
        one, prelu, depthwise, last = chain
        count = len(self._weights(one))
        groups = [_attributes(each)["group"] for each in (depthwise, last)]
        if count > MAX_DOUBLED or groups != [count, 1] or len(self._weights(depthwise)) != count:
            return None
        return one, prelu, depthwise, last

    def doubled(
        self, one: NodeProto, prelu: NodeProto, depthwise: NodeProto, last: NodeProto
    ) -> list[NodeProto]:
        """Return the nodes that compute what a chain computes, see the module."""
        slopes = self._arrays[prelu.input[1]].astype(np.float32).reshape(-1, 1, 1, 1)
        weights = self._weights(one)
        bias = self._bias(one)
        both = self._conv(
            one, one.input[0], np.concatenate([weights, -weights]), np.concatenate([bias, -bias])
        )
        above = helper.make_node("Relu", [both.output[0]], [prelu.output[0]], name=prelu.name)
        weights = self._weights(depthwise)
        bias = self._bias(depthwise)
        each = self._conv(
            depthwise,
            above.output[0],
            np.concatenate([weights, -slopes * weights]),
            np.concatenate([bias, 0 * bias]),
            group=2 * len(weights),
        )
        weights = self._weights(last)
        total = self._conv(
            last, each.output[0], np.concatenate([weights, weights], axis=1), self._bias(last)
        )
        return [both, above, each, total]

    def product(self, prelu: NodeProto) -> list[NodeProto]:
        """Return the nodes that compute what a PRelu computes, see the module."""
        source = prelu.input[0]
        out = prelu.output[0]
        slopes = self._arrays[prelu.input[1]].astype(np.float32).reshape(-1, 1, 1, 1)
        names = [f"{out}_{part}" for part in ("negative", "below", "product")]
        factors = [self._graph.initializer(f) for f in (np.full_like(slopes, -1.0), 1.0 - slopes)]
        size: dict[str, Any] = {"kernel_shape": [1, 1], "group": len(slopes)}
        return [
            helper.make_node("Conv", [source, factors[0]], names[:1], name=names[0], **size),
            helper.make_node("Relu", names[:1], names[1:2], name=names[1]),
            helper.make_node("Conv", [names[1], factors[1]], names[2:], name=names[2], **size),
            helper.make_node("Add", [source, names[2]], [out], name=prelu.name),
        ]

    def _conv(
        self,
        node: NodeProto,
        source: str,
        weights: NDArray[np.float32],
        bias: NDArray[np.float32],
        **changed: int,
    ) -> NodeProto:
        """Return a convolution like ``node`` with another input, other weights, and other
        attributes.
        """
        inputs = [source, self._graph.initializer(weights), self._graph.initializer(bias)]
        return helper.make_node(
            "Conv", inputs, list(node.output), name=node.name, **(_attributes(node) | changed)
        )

    def _weights(self, node: NodeProto) -> NDArray[np.float32]:
        return self._arrays[node.input[1]].astype(np.float32)

    def _bias(self, node: NodeProto) -> NDArray[np.float32]:
        if len(node.input) < 3:
            return np.zeros(len(self._weights(node)), np.float32)
        return self._arrays[node.input[2]].astype(np.float32)


def _attributes(node: NodeProto) -> dict[str, Any]:
    return {each.name: helper.get_attribute_value(each) for each in node.attribute}
