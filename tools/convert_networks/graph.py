# SPDX-License-Identifier: GPL-3.0-or-later
"""The ONNX graph under construction: the ONNX value of each TFLite tensor, and its layout.

Rank-4 activations are NHWC in TFLite and NCHW here; everything of lower rank keeps its order. The
batch dimension is free, so that the regions of two people can go through a network together.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from onnx import NodeProto, TensorProto, helper, numpy_helper

from ...solver.errors import ModelFileError
from .tflite import ACTIVATIONS, Model, Operator

NCHW_AXIS = (0, 2, 3, 1)  # TFLite axis -> ONNX axis of a rank-4 activation


@dataclass(frozen=True)
class SpatialPad:
    """A zero padding of rows and columns that is not written yet, because a convolution may include
    it.
    """

    source: int
    top: int
    left: int
    bottom: int
    right: int


@dataclass
class Graph:
    """Nodes and initializers so far. ``constants``: folded TFLite tensors; ``names``: the ONNX
    value of each tensor.
    """

    model: Model
    constants: dict[int, NDArray[Any]]
    nodes: list[NodeProto] = field(default_factory=list)
    initializers: list[TensorProto] = field(default_factory=list)
    names: dict[int, str] = field(default_factory=dict)
    pads: dict[int, SpatialPad] = field(default_factory=dict)
    blocked: bool = False  # see `convert_model`
    _shared: dict[tuple[str, bytes, tuple[int, ...]], str] = field(default_factory=dict)

    def known(self) -> tuple[dict[Any, Any], ...]:
        """Return a copy of what is known of the values so far, for `forget_since`."""
        return dict(self.names), dict(self.pads), dict(self._shared)

    def forget_since(self, known: tuple[dict[Any, Any], ...]) -> None:
        """Forget the values added since `known`; nodes and initializers stay."""
        self.names, self.pads, self._shared = known

    def shape(self, tensor: int) -> tuple[int, ...]:
        """Return the TFLite (NHWC) shape of a tensor."""
        return self.model.tensors[tensor].shape

    def axis(self, operator: Operator, tensor: int, axis: int) -> int:
        """Return the ONNX number of the axis ``axis`` of a tensor, which may count from the end.

        :raises ModelFileError: when the tensor has no such axis.
        """
        rank = len(self.shape(tensor))
        if not -rank <= axis < rank:
            raise self.fail(operator, f"axis {axis} of a rank-{rank} tensor")
        return NCHW_AXIS[axis % rank] if rank == 4 else axis % rank

    def fail(self, operator: Operator, why: str) -> ModelFileError:
        """Return the error for an operator that cannot be converted."""
        return ModelFileError(
            f"{self.model.name}: {operator.kind} writing tensor {operator.outputs[0]}: {why}."
        )

    def constant(self, operator: Operator, position: int) -> NDArray[Any]:
        """Return input ``position`` of the operator as an array.

        :raises ModelFileError: when it is not a constant.
        """
        tensor = operator.inputs[position] if position < len(operator.inputs) else -1
        if tensor not in self.constants:
            raise self.fail(operator, f"input {position} must be a constant")
        return self.constants[tensor]

    def node(self, kind: str, inputs: list[str], **attributes: Any) -> str:
        """Append one node; return the name of its only output."""
        name = f"{kind.lower()}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, inputs, [name], name=name, **attributes))
        return name

    def initializer(self, array: NDArray[Any]) -> str:
        """Store a constant once; float16 weights are widened by a Cast that onnxruntime folds on
        loading.
        """
        array = np.ascontiguousarray(array, array.dtype.newbyteorder("="))
        key = (array.dtype.str, array.tobytes(), array.shape)
        if key not in self._shared:
            name = f"constant_{len(self.initializers)}"
            self.initializers.append(numpy_helper.from_array(array, name))
            self._shared[key] = (
                self.node("Cast", [name], to=TensorProto.FLOAT)
                if array.dtype == np.float16
                else name
            )
        return self._shared[key]

    def value(self, tensor: int) -> str:
        """Return the ONNX value of a tensor, NCHW if its rank is 4; write a pending padding or
        constant.
        """
        if tensor in self.names:
            return self.names[tensor]
        if tensor in self.pads:
            pad = self.pads[tensor]
            amounts = np.array([0, 0, pad.top, pad.left, 0, 0, pad.bottom, pad.right], np.int64)
            self.names[tensor] = self.node(
                "Pad", [self.value(pad.source), self.initializer(amounts)]
            )
        elif tensor in self.constants:
            array = self.constants[tensor]
            self.names[tensor] = self.initializer(
                array.transpose(0, 3, 1, 2) if array.ndim == 4 else array
            )
        else:
            raise ModelFileError(
                f"{self.model.name}: tensor {tensor} is used before it is computed."
            )
        return self.names[tensor]

    def operand(self, tensor: int, rank: int) -> str:
        """Return the value of a tensor for elementwise use; a constant gets leading axes of 1 up to
        ``rank``.
        """
        constant = self.constants.get(tensor)
        if constant is None or constant.ndim >= rank:
            return self.value(tensor)
        padded = constant.reshape((1,) * (rank - constant.ndim) + constant.shape)
        return self.initializer(padded.transpose(0, 3, 1, 2) if rank == 4 else padded)

    def channels_last(self, tensor: int) -> str:
        """Return the value with its elements in TFLite order, without a transpose where both orders
        agree.
        """
        shape = self.shape(tensor)
        name = self.value(tensor)
        if len(shape) != 4 or shape[1] * shape[2] == 1 or shape[3] == 1:
            return name
        return self.node("Transpose", [name], perm=[0, 2, 3, 1])

    def finish(self, operator: Operator, name: str) -> None:
        """Apply the operator's fused activation to ``name`` and make it the operator's output."""
        code = operator.options.get("fused_activation_function", 0)
        activation = ACTIVATIONS.get(code)
        if activation is None:
            raise self.fail(operator, f"fused activation {code} is not supported")
        if activation == "RELU":
            name = self.node("Relu", [name])
        elif activation != "NONE":
            low, high = (0.0, 6.0) if activation == "RELU6" else (-1.0, 1.0)
            name = self.node(
                "Clip",
                [name, *(self.initializer(np.array(limit, np.float32)) for limit in (low, high))],
            )
        self.names[operator.outputs[0]] = name
