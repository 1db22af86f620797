# SPDX-License-Identifier: GPL-3.0-or-later
"""ONNX files, before onnxruntime opens them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ...solver.errors import ModelFileError
from .files import check_regular

# Of each kind of message, the fields that lead to tensors: {field number: kind of its message}.
_FIELDS = {
    "model": {7: "graph", 25: "function"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "function": {7: "node"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "sparse": {1: "tensor", 2: "tensor"},
    "tensor": {13: "entry"},
}
_GRAPH = 7
_DEEPEST = 64
_LARGEST_BYTES = 2 << 30  # of a protocol buffer


def check_onnx_file(path: Path) -> None:
    """Check, before onnxruntime opens it, that a file is an ONNX model and has no weights outside
    its folder.

    An ONNX file is a protocol buffer; only the few fields that lead to tensors are followed
    (onnx.proto3 of the ONNX project). https://protobuf.dev/programming-guides/encoding/ describes
    the wire format.

    :raises ModelFileError: it is not, it has, or the file cannot be read.
    """
    check_regular(path, ModelFileError, "network in one ONNX file", _LARGEST_BYTES)
    try:
        data = memoryview(path.read_bytes())
    except OSError as error:
        raise ModelFileError(
            f"{path} cannot be read ({error.strerror}); choose an ONNX file"
        ) from error
    try:
        if not any(number == _GRAPH for number, _ in _fields(data)):
            raise ValueError("it has no graph")
        locations = list(_locations(data, "model", 0))
    except (ValueError, UnicodeDecodeError) as error:
        raise ModelFileError(
            f"{path} is not an ONNX model ({error}); export the network to ONNX"
        ) from error
    folder = path.resolve().parent
    for location in locations:
        target = (folder / location).resolve()
        if not target.is_relative_to(folder):
            raise ModelFileError(
                f"{path} refers to weights in {location!r}, outside its own folder; "
                "export it as one file, or with its data in the same folder"
            )
        if not target.is_file():
            raise ModelFileError(
                f"{path} needs its weights in {target}, which is missing; put that file there"
            )


def _locations(data: memoryview, kind: str, depth: int) -> Iterator[str]:
    """Iterate over the locations of external data in the tensors of a message."""
    if depth > _DEEPEST:
        raise ValueError("it is nested too deeply")
    for number, value in _fields(data):
        inner = _FIELDS[kind].get(number)
        if inner is None:
            continue
        if not isinstance(value, memoryview):
            raise ValueError("a field has the wrong type")
        if inner == "entry":
            entry = {n: v for n, v in _fields(value) if isinstance(v, memoryview)}
            if bytes(entry.get(1, b"")) == b"location":
                yield bytes(entry.get(2, b"")).decode()
        else:
            yield from _locations(value, inner, depth + 1)


def _fields(data: memoryview) -> Iterator[tuple[int, memoryview | int]]:
    """Iterate over the fields of a message; yield number and value. Fixed-size numbers, which are
    unused, become 0.
    """
    at = 0
    while at < len(data):
        tag, at = _varint(data, at)
        number = tag >> 3
        wire = tag & 7
        if number == 0:
            raise ValueError("a field has no number")
        if wire == 2:
            length, at = _varint(data, at)
            if length > len(data) - at:
                raise ValueError("it is cut short")
            yield number, data[at : at + length]
            at += length
        elif wire == 0:
            value, at = _varint(data, at)
            yield number, value
        elif wire in (1, 5):
            at += 8 if wire == 1 else 4
            if at > len(data):
                raise ValueError("it is cut short")
            yield number, 0
        else:
            raise ValueError("it holds an unknown kind of field")


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    """Decode the varint at ``at`` (seven bits per byte, least significant first); return it and the
    offset after it.
    """
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(data):
            raise ValueError("it is cut short")
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
    raise ValueError("a number in it is too long")
