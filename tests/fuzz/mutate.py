# SPDX-License-Identifier: GPL-3.0-or-later
"""Damage inputs: bytes anywhere, and values where the format is known, behind checksums and
brackets.
"""

from __future__ import annotations

import copy
import io
import json
import random
from typing import Any

import numpy as np

from .targets import npz

_BYTES = (
    b"\0",
    b"\xff",
    b"\x7f",
    b"\x80",
    b"\xff\xff\xff\xff",
    b"\0\0\0\0",
    b"\x7f\xff\xff\xff",
    b"-1",
    b"1e999",
    b"[",
)
_VALUES: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 2**31, 2**63, 10**400, 0.5, 1e308, float("nan"), float("inf")),
    *("", "x" * 300, "\ud800", "\0", "../../etc/passwd", [], [[]], {}, {"": None}, [1, "2", None]),
)
_TYPES = ("f4", "f8", "i4", "u1", "i8", "?", "U3", "S2", "c8", "M8[s]", "f2")
_SHAPES = (
    (),
    (0,),
    (1,),
    (3,),
    (0, 3),
    (3, 0),
    (10, 3),
    (3, 3, 3),
    (2, 72),
    (1, 1, 1, 1),
    (100, 24),
)


def mutate(data: bytes, chance: random.Random) -> bytes:
    """Return damaged data."""
    kind = chance.random()
    if kind < 0.5 and data[:2] == b"PK":
        return _arrays(data, chance)
    if kind < 0.5 and data[:1] == b"{":
        return _json(data, chance)
    changed = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        at = chance.randrange(len(changed) + 1)
        way = chance.randrange(6)
        if way == 0 and changed:
            changed[at % len(changed)] ^= 1 << chance.randrange(8)
        elif way == 1:
            piece = chance.choice(_BYTES)
            changed[at : at + len(piece)] = piece
        elif way == 2:
            changed[at:at] = chance.choice(_BYTES)
        elif way == 3:
            del changed[at : at + chance.choice((1, 4, 64))]
        elif way == 4:
            other = chance.randrange(len(changed) + 1)
            changed[at:at] = changed[other : other + chance.choice((1, 8, 64))]
        elif chance.random() < 0.3:
            del changed[at:]
    return bytes(changed)


def _json(data: bytes, chance: random.Random) -> bytes:
    """Replace values in a JSON object."""
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        return data[: chance.randrange(len(data) + 1)]
    for _ in range(chance.randint(1, 3)):
        holder = document
        key = None
        while isinstance(holder, dict | list) and holder:
            key = chance.choice(list(holder) if isinstance(holder, dict) else range(len(holder)))
            inside = holder[key]
            if not isinstance(inside, dict | list) or not inside or chance.random() < 0.3:
                break
            holder = inside
        if key is not None:
            holder[key] = copy.deepcopy(chance.choice(_VALUES))
    if chance.random() < 0.02:
        return b'{"a":' * 100_000
    return json.dumps(document).encode()


def _arrays(data: bytes, chance: random.Random) -> bytes:
    """Replace arrays in a .npz file."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
    except Exception:  # damaged before
        return data[: chance.randrange(len(data) + 1)]
    if not arrays:
        return data
    for _ in range(chance.randint(1, 2)):
        key = chance.choice(list(arrays))
        value = np.array(arrays[key])
        way = chance.randrange(5)
        if way == 0:
            value = np.zeros(chance.choice(_SHAPES), chance.choice(_TYPES))
        elif way == 1 and value.dtype.kind == "f" and value.size:
            value.reshape(-1)[chance.randrange(value.size)] = chance.choice(
                (np.nan, np.inf, 1e30, -1e30, 0.0)
            )
        elif way == 2 and value.ndim:
            value = value[: chance.randrange(len(value) + 1)]
        elif way == 3 and value.dtype.kind in "iu" and value.size:
            number = np.int64(chance.choice((0, 1, 99, 2**31 - 1)))
            value.reshape(-1)[chance.randrange(value.size)] = number.astype(value.dtype)
        else:
            value = value[None]
        arrays[key] = value
    if chance.random() < 0.1:
        del arrays[chance.choice(list(arrays))]
    return npz(arrays)
