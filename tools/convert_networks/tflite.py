# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of the TFLite schema that these networks use, as plain dataclasses.

Field and operator numbers: tensorflow/lite/schema/schema.fbs (public schema, version 3).
"""

from dataclasses import dataclass

import numpy as np

from ...solver.errors import ModelFileError
from .flatbuffer import Buffer, Table

OPERATOR_NAMES = {
    0: "ADD", 2: "CONCATENATION", 3: "CONV_2D", 4: "DEPTHWISE_CONV_2D", 5: "DEPTH_TO_SPACE", 6: "DEQUANTIZE",
    9: "FULLY_CONNECTED", 14: "LOGISTIC", 17: "MAX_POOL_2D", 22: "RESHAPE", 23: "RESIZE_BILINEAR", 34: "PAD",
    40: "MEAN", 54: "PRELU", 124: "DENSIFY",
}  # fmt: skip
TENSOR_DTYPES = {0: "float32", 1: "float16", 2: "int32", 3: "uint8", 4: "int64", 9: "int8"}
ACTIVATIONS = {0: "NONE", 1: "RELU", 2: "RELU_N1_TO_1", 3: "RELU6"}
PADDINGS = {0: "SAME", 1: "VALID"}

# operator -> option -> (field number, struct format, default)
_OPTIONS: dict[str, dict[str, tuple[int, str, int]]] = {
    "ADD": {"activation": (0, "b", 0)},
    "CONCATENATION": {"axis": (0, "i", 0), "activation": (1, "b", 0)},
    "CONV_2D": {
        "padding": (0, "b", 0), "stride_w": (1, "i", 0), "stride_h": (2, "i", 0), "activation": (3, "b", 0),
        "dilation_w": (4, "i", 1), "dilation_h": (5, "i", 1),
    },
    "DEPTHWISE_CONV_2D": {
        "padding": (0, "b", 0), "stride_w": (1, "i", 0), "stride_h": (2, "i", 0), "activation": (4, "b", 0),
        "dilation_w": (5, "i", 1), "dilation_h": (6, "i", 1),
    },
    "DEPTH_TO_SPACE": {"block_size": (0, "i", 0)},
    "FULLY_CONNECTED": {"activation": (0, "b", 0), "weights_format": (1, "b", 0), "keep_num_dims": (2, "b", 0)},
    "MAX_POOL_2D": {
        "padding": (0, "b", 0), "stride_w": (1, "i", 0), "stride_h": (2, "i", 0), "filter_w": (3, "i", 0),
        "filter_h": (4, "i", 0), "activation": (5, "b", 0),
    },
    "MEAN": {"keep_dims": (0, "b", 0)},
    "RESIZE_BILINEAR": {"align_corners": (2, "b", 0), "half_pixel_centers": (3, "b", 0)},
}  # fmt: skip

MAX_ELEMENTS = 1 << 26  # of one tensor: a broken shape must not fill the memory


@dataclass(frozen=True)
class DimensionMetadata:
    """One level of a sparse tensor: dense with ``size``, or compressed with ``segments`` and ``indices``."""

    size: int
    segments: np.ndarray | None = None
    indices: np.ndarray | None = None


@dataclass(frozen=True)
class Sparsity:
    """How the stored values of a sparse tensor are laid out: levels in traversal order; block dimensions come last."""

    traversal_order: tuple[int, ...]
    block_map: tuple[int, ...]
    levels: tuple[DimensionMetadata, ...]


@dataclass(frozen=True)
class Tensor:
    """A tensor's name, NHWC shape, dtype name, stored bytes (empty: an activation) and sparse layout if any."""

    name: str
    shape: tuple[int, ...]
    dtype: str
    data: bytes
    sparsity: Sparsity | None


@dataclass(frozen=True)
class Operator:
    """One operator: tensor numbers in and out (-1: left out) and its options by name."""

    kind: str
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]
    options: dict[str, int]


@dataclass(frozen=True)
class Model:
    """The single subgraph of a TFLite file; ``name`` is for messages."""

    name: str
    tensors: tuple[Tensor, ...]
    operators: tuple[Operator, ...]
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


def read_model(data: bytes, name: str) -> Model:
    """Parse a TFLite file; ModelFileError names what is broken or not supported."""
    root = Buffer(data, name).root(b"TFL3")
    if root.scalar(0, "I") != 3:
        raise ModelFileError(f"{name}: TFLite schema version {root.scalar(0, 'I')}, only version 3 is supported.")
    codes = [max(code.scalar(0, "b"), code.scalar(3, "i")) for code in root.tables(1)]
    subgraphs = root.tables(2)
    if len(subgraphs) != 1:
        raise ModelFileError(f"{name}: {len(subgraphs)} subgraphs, exactly one is supported.")
    buffers = root.tables(4)
    graph = subgraphs[0]
    tensors = tuple(_tensor(table, buffers, name) for table in graph.tables(0))
    operators = tuple(_operator(table, codes, len(tensors), name) for table in graph.tables(3))
    inputs, outputs = (tuple(graph.array(number, "int32").tolist()) for number in (1, 2))
    for index in inputs + outputs:
        if not 0 <= index < len(tensors):
            raise ModelFileError(f"{name}: the graph names tensor {index}, there are {len(tensors)}.")
    return Model(name, tensors, operators, inputs, outputs)


def _tensor(table: Table, buffers: list[Table], name: str) -> Tensor:
    label = table.raw(3).decode("utf-8", "replace")
    shape = tuple(table.array(0, "int32").tolist())
    elements = 1
    for size in shape:
        elements *= size
        if size < 0 or elements > MAX_ELEMENTS:
            raise ModelFileError(f"{name}: tensor {label!r} has the impossible shape {shape}.")
    code, buffer = table.scalar(1, "b"), table.scalar(2, "I")
    if code not in TENSOR_DTYPES or buffer >= len(buffers):
        raise ModelFileError(f"{name}: tensor {label!r} has type {code} in buffer {buffer}: not supported.")
    sparsity = table.table(6)
    layout = None if sparsity is None else _sparsity(sparsity)
    return Tensor(label, shape, TENSOR_DTYPES[code], buffers[buffer].raw(0), layout)


def _sparsity(table: Table) -> Sparsity:
    order, blocks = (tuple(table.array(number, "int32").tolist()) for number in (0, 1))
    return Sparsity(order, blocks, tuple(_level(level) for level in table.tables(2)))


def _level(table: Table) -> DimensionMetadata:
    if table.scalar(0, "b") == 0:
        return DimensionMetadata(table.scalar(1, "i"))
    segments, indices = (_index_vector(table, number) for number in (2, 4))
    return DimensionMetadata(0, segments, indices)


def _index_vector(table: Table, type_field: int) -> np.ndarray:
    dtype = {1: "int32", 2: "uint16", 3: "uint8"}.get(table.scalar(type_field, "B"))
    vector = table.table(type_field + 1)
    if dtype is None or vector is None:
        raise ModelFileError(f"{table.buffer.name}: a sparse dimension without segments or indices.")
    return vector.array(0, dtype).astype(np.int64)


def _operator(table: Table, codes: list[int], tensor_count: int, name: str) -> Operator:
    index = table.scalar(0, "I")
    kind = OPERATOR_NAMES.get(codes[index]) if index < len(codes) else None
    if kind is None:
        raise ModelFileError(f"{name}: operator code {codes[index] if index < len(codes) else index} is not supported.")
    inputs, outputs = (tuple(table.array(number, "int32").tolist()) for number in (1, 2))
    if not outputs or min((*inputs, 0)) < -1 or min(outputs) < 0 or max(inputs + outputs) >= tensor_count:
        raise ModelFileError(f"{name}: {kind} reads {inputs} and writes {outputs}, there are {tensor_count} tensors.")
    options = table.table(4)
    fields = _OPTIONS.get(kind, {})
    values = {
        key: default if options is None else options.scalar(number, fmt, default)
        for key, (number, fmt, default) in fields.items()
    }
    return Operator(kind, inputs, outputs, values)
