# SPDX-License-Identifier: GPL-3.0-or-later
"""Stored tensors as numpy arrays, and the two operators that only unpack weights: DEQUANTIZE and
DENSIFY.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.errors import ModelFileError
from .tflite import MAX_ELEMENTS, Model, Sparsity, Tensor


def fold_constants(model: Model) -> dict[int, NDArray[Any]]:
    """Return the arrays (NHWC as stored) of all tensors known without running the network, by
    tensor number.

    Half-precision weights stay float16: the ONNX file keeps them so and onnxruntime widens them
    when loading.
    """
    known = {
        i: _stored(tensor, model.name) for i, tensor in enumerate(model.tensors) if tensor.data
    }
    for operator in model.operators:
        if operator.kind not in ("DEQUANTIZE", "DENSIFY"):
            continue
        source = operator.inputs[0] if operator.inputs else -1
        if source not in known:
            raise ModelFileError(
                f"{model.name}: {operator.kind} of tensor {source}, which is not a constant."
            )
        array = known[source]
        if array.dtype not in (np.float16, np.float32):
            raise ModelFileError(
                f"{model.name}: {operator.kind} of {array.dtype} weights; only "
                "float16 is supported."
            )
        known[operator.outputs[0]] = array
    return known


def _stored(tensor: Tensor, name: str) -> NDArray[Any]:
    dtype = np.dtype(tensor.dtype).newbyteorder("<")
    if len(tensor.data) % dtype.itemsize:
        raise ModelFileError(
            f"{name}: tensor {tensor.name!r} holds {len(tensor.data)} bytes of "
            f"{tensor.dtype} items."
        )
    values = np.frombuffer(tensor.data, dtype)
    if tensor.sparsity is not None:
        return densify(values, tensor.shape, tensor.sparsity, f"{name}: tensor {tensor.name!r}")
    if values.size != int(np.prod(tensor.shape)):
        raise ModelFileError(
            f"{name}: tensor {tensor.name!r} of shape {tensor.shape} holds {values.size} items."
        )
    return values.reshape(tensor.shape)


def densify(
    values: NDArray[Any], shape: tuple[int, ...], sparsity: Sparsity, label: str
) -> NDArray[Any]:
    """Scatter the stored values of a sparse tensor into a dense array of ``shape``.

    Levels are walked in traversal order. A dense level of size n multiplies every position p of the
    level above into p·n … p·n + n − 1; a compressed level into segments[p] … segments[p+1] − 1,
    with coordinates indices[·]. Level number d < rank is original dimension d (counted in blocks),
    level rank + b is the place inside block b, along block_map[b].
    """
    rank = len(shape)
    blocks = len(sparsity.block_map)
    if (
        sorted(sparsity.traversal_order) != list(range(rank + blocks))
        or len(sparsity.levels) != rank + blocks
    ):
        raise ModelFileError(
            f"{label}: sparse traversal order {sparsity.traversal_order} does not "
            f"fit shape {shape}."
        )
    coordinates: dict[int, NDArray[Any]] = {}
    block_size = np.ones(rank, np.int64)
    count = 1
    for dimension, level in zip(sparsity.traversal_order, sparsity.levels, strict=True):
        if level.segments is None or level.indices is None:
            if not 0 < level.size <= MAX_ELEMENTS or count * level.size > MAX_ELEMENTS:
                raise ModelFileError(f"{label}: a dense level of size {level.size}.")
            parent = np.repeat(np.arange(count), level.size)
            index = np.tile(np.arange(level.size), count)
            if dimension >= rank:
                along = sparsity.block_map[dimension - rank]
                if not 0 <= along < rank:
                    raise ModelFileError(
                        f"{label}: block map {sparsity.block_map} does not fit shape {shape}."
                    )
                block_size[along] = level.size
        else:
            parent, index = _compressed(level.segments, level.indices, count, label)
            if dimension >= rank:
                raise ModelFileError(
                    f"{label}: a block dimension is sparse, which TFLite does not define."
                )
        coordinates = {key: value[parent] for key, value in coordinates.items()}
        coordinates[dimension] = index
        count = len(index)
    if count != len(values):
        raise ModelFileError(f"{label}: {len(values)} stored values for {count} sparse places.")
    place = [coordinates[d] * block_size[d] for d in range(rank)]
    for b, along in enumerate(sparsity.block_map):
        place[along] = place[along] + coordinates[rank + b]
    for d in range(rank):
        if count and not (0 <= place[d].min() and place[d].max() < shape[d]):
            raise ModelFileError(f"{label}: a sparse index is outside shape {shape}.")
    dense = np.zeros(shape, values.dtype)
    dense[tuple(place)] = values
    return dense


def _compressed(
    segments: NDArray[Any], indices: NDArray[Any], count: int, label: str
) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """Return the position in the level above, and the coordinate, of each entry of a compressed
    level.
    """
    lengths = np.diff(segments)
    if (
        len(lengths) != count
        or (lengths < 0).any()
        or tuple(segments[[0, -1]]) != (0, len(indices))
    ):
        raise ModelFileError(f"{label}: sparse segments do not match their indices.")
    return np.repeat(np.arange(count), lengths), indices
