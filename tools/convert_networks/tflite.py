# SPDX-License-Identifier: GPL-3.0-or-later
"""TFLite files as checked plain dataclasses, read by the package ``tflite``: readers generated from
the schema.
"""

import re
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
import tflite
from numpy.typing import NDArray

from ...solver.errors import ModelFileError

TENSOR_DTYPES = {0: "float32", 1: "float16", 2: "int32", 3: "uint8", 4: "int64", 9: "int8"}
ACTIVATIONS = {0: "NONE", 1: "RELU", 2: "RELU_N1_TO_1", 3: "RELU6"}
PADDINGS = {0: "SAME", 1: "VALID"}
_OPTIONS: dict[str, Any] = {
    "ADD": tflite.AddOptions,
    "CONCATENATION": tflite.ConcatenationOptions,
    "CONV_2D": tflite.Conv2DOptions,
    "DEPTHWISE_CONV_2D": tflite.DepthwiseConv2DOptions,
    "DEPTH_TO_SPACE": tflite.DepthToSpaceOptions,
    "DIV": tflite.DivOptions,
    "FULLY_CONNECTED": tflite.FullyConnectedOptions,
    "MAX_POOL_2D": tflite.Pool2DOptions,
    "MEAN": tflite.ReducerOptions,
    "MUL": tflite.MulOptions,
    "RESIZE_BILINEAR": tflite.ResizeBilinearOptions,
    "STRIDED_SLICE": tflite.StridedSliceOptions,
    "SUB": tflite.SubOptions,
    "SUM": tflite.ReducerOptions,
}
_INDEX_VECTORS = {1: tflite.Int32Vector, 2: tflite.Uint16Vector, 3: tflite.Uint8Vector}
# a table at 4 whose vtable, at 0, lists no field: all have their defaults
_NO_FIELDS = struct.pack("<HHi", 4, 4, 4)

MAX_ELEMENTS = 1 << 26  # of one tensor: a broken shape must not fill the memory


@dataclass(frozen=True)
class DimensionMetadata:
    """One level of a sparse tensor: dense with ``size``, or compressed with ``segments`` and
    ``indices``.
    """

    size: int
    segments: NDArray[Any] | None = None
    indices: NDArray[Any] | None = None


@dataclass(frozen=True)
class Sparsity:
    """How the stored values of a sparse tensor are laid out: levels in traversal order; block
    dimensions come last.
    """

    traversal_order: tuple[int, ...]
    block_map: tuple[int, ...]
    levels: tuple[DimensionMetadata, ...]


@dataclass(frozen=True)
class Tensor:
    """A tensor's name, NHWC shape, dtype name, stored bytes (empty: an activation) and sparse
    layout if any.
    """

    name: str
    shape: tuple[int, ...]
    dtype: str
    data: bytes
    sparsity: Sparsity | None


@dataclass(frozen=True)
class Operator:
    """One operator: tensor numbers in and out (-1: left out) and its options, named as in the
    schema.
    """

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
    """Parse a TFLite file.

    :raises ModelFileError: when the file is broken or has unsupported content.
    """
    try:
        if not tflite.Model.ModelBufferHasIdentifier(data, 0):
            raise ModelFileError(f"{name}: not a TFL3 FlatBuffer; fetch the file again.")
        return _model(tflite.Model.GetRootAs(data), name)
    # raised by the readers for damaged files
    except (struct.error, ValueError, TypeError, OverflowError) as error:
        raise ModelFileError(
            f"{name}: broken FlatBuffer ({error}); fetch the file again."
        ) from error


def _model(root: Any, name: str) -> Model:
    found = root.Version(), root.SubgraphsLength()
    if found != (3, 1):
        raise ModelFileError(
            f"{name}: schema version and number of subgraphs are {found}, only (3, 1) is supported."
        )
    graph = root.Subgraphs(0)
    codes = [root.OperatorCodes(i) for i in range(root.OperatorCodesLength())]
    kinds = [
        tflite.opcode2name(max(code.DeprecatedBuiltinCode(), code.BuiltinCode())) for code in codes
    ]
    tensors = tuple(_tensor(graph.Tensors(i), root, name) for i in range(graph.TensorsLength()))
    operators = tuple(
        _operator(graph.Operators(i), kinds, len(tensors), name)
        for i in range(graph.OperatorsLength())
    )
    inputs = _integers(graph.InputsAsNumpy())
    outputs = _integers(graph.OutputsAsNumpy())
    for index in inputs + outputs:
        if not 0 <= index < len(tensors):
            raise ModelFileError(
                f"{name}: the graph names tensor {index}, there are {len(tensors)}."
            )
    return Model(name, tensors, operators, inputs, outputs)


def _integers(vector: Any) -> tuple[int, ...]:
    """Return a vector of the file; one that is absent is read as 0."""
    return tuple(vector.tolist()) if isinstance(vector, np.ndarray) else ()


def _tensor(table: Any, root: Any, name: str) -> Tensor:
    label = (table.Name() or b"").decode("utf-8", "replace")
    shape = _integers(table.ShapeAsNumpy())
    elements = 1
    for size in shape:
        elements *= size
        if size < 0 or elements > MAX_ELEMENTS:
            raise ModelFileError(f"{name}: tensor {label!r} has the impossible shape {shape}.")
    if table.Type() not in TENSOR_DTYPES or table.Buffer() >= root.BuffersLength():
        raise ModelFileError(
            f"{name}: tensor {label!r}: type {table.Type()}, buffer "
            f"{table.Buffer()}: not supported."
        )
    stored = root.Buffers(table.Buffer()).DataAsNumpy()
    data = stored.tobytes() if isinstance(stored, np.ndarray) else b""
    layout = _sparsity(table.Sparsity(), name) if table.Sparsity() else None
    return Tensor(label, shape, TENSOR_DTYPES[table.Type()], data, layout)


def _sparsity(table: Any, name: str) -> Sparsity:
    levels = tuple(_level(table.DimMetadata(i), name) for i in range(table.DimMetadataLength()))
    return Sparsity(
        _integers(table.TraversalOrderAsNumpy()), _integers(table.BlockMapAsNumpy()), levels
    )


def _level(level: Any, name: str) -> DimensionMetadata:
    if level.Format() == tflite.DimensionType.DENSE:
        return DimensionMetadata(level.DenseSize())
    segments = _index_vector(level.ArraySegmentsType(), level.ArraySegments(), name)
    return DimensionMetadata(
        0, segments, _index_vector(level.ArrayIndicesType(), level.ArrayIndices(), name)
    )


def _index_vector(code: int, table: Any, name: str) -> NDArray[Any]:
    if code not in _INDEX_VECTORS or table is None:
        raise ModelFileError(f"{name}: a sparse dimension without segments or indices.")
    vector = _INDEX_VECTORS[code]()
    vector.Init(table.Bytes, table.Pos)
    return np.array(_integers(vector.ValuesAsNumpy()), np.int64)


def _operator(table: Any, kinds: list[str], tensor_count: int, name: str) -> Operator:
    if table.OpcodeIndex() >= len(kinds):
        raise ModelFileError(
            f"{name}: operator code {table.OpcodeIndex()}, there are {len(kinds)}."
        )
    kind = kinds[table.OpcodeIndex()]
    inputs = _integers(table.InputsAsNumpy())
    outputs = _integers(table.OutputsAsNumpy())
    if (
        not outputs
        or min((*inputs, 0)) < -1
        or min(outputs) < 0
        or max(inputs + outputs) >= tensor_count
    ):
        raise ModelFileError(
            f"{name}: {kind} reads {inputs} and writes {outputs}, there are {tensor_count} tensors."
        )
    return Operator(kind, inputs, outputs, _options(kind, table.BuiltinOptions()))


def _options(kind: str, table: Any) -> dict[str, int]:
    """Return every field of the operator's options, which are all numbers: StrideW becomes
    stride_w.
    """
    if kind not in _OPTIONS:
        return {}
    options = _OPTIONS[kind]()
    options.Init(*((table.Bytes, table.Pos) if table else (_NO_FIELDS, 4)))
    getters = [
        name for name, member in vars(_OPTIONS[kind]).items() if getattr(member, "__code__", None)
    ]
    return {
        re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower(): getattr(options, name)()
        for name in getters
        if name != "Init"
    }
