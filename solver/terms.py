# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements of one frame as flat arrays: one slot a point, with all that was measured of it, by body part."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .errors import ShapeError
from .kernel import allocating_kernel, kernel
from .residuals.part import Array
from .residuals.registry import RESIDUALS, empty_tables
from .tree import Tree

if TYPE_CHECKING:
    from .measurements import Measurements
    from .options import Priors

HAS_SHAPE, HAS_2D, HAS_3D, HAS_DIRECTION = 1, 2, 4, 8


class Terms(NamedTuple):
    """One frame's terms for the kernels. W as in `Tree`."""

    starts: Array  # (K+2,): the slots of part i are starts[i]:starts[i+1]
    flags: Array  # (n,), what a slot has
    rest: Array  # (n, 3), the point, or difference of points, relative to its part at beta = 0
    V: Array  # (n, 3, W)
    image: Array  # (n, 3): u, v in normalized image coordinates, confidence
    point: Array  # (n, 4): metres in the camera frame, confidence
    direction: Array  # (n, 4): unit vector in the camera frame, confidence
    ints: tuple[Array, ...]  # one table for each of RESIDUALS
    floats: tuple[Array, ...]
    shape_mean: Array  # (W,)
    shape_information: Array  # (W, W)


@kernel
def _common_part(tree: Tree, a: int, b: int) -> tuple:
    """Return (part, start joint or -1, end joint or -1): a part that two points are both fixed to.

    A joint belongs to its own part, as its origin, and to its parent, where it sits at S beta + l. -1 if none.
    """
    M = tree.keypoints
    for p in range(2):
        for q in range(2):
            i = tree.point_part[a] if p == 0 else (tree.parents[a - M] if a >= M else -1)
            j = tree.point_part[b] if q == 0 else (tree.parents[b - M] if b >= M else -1)
            if i == j and i >= 0:
                return i, (a - M if p else -1), (b - M if q else -1)
    return -1, -1, -1


@allocating_kernel
def _pack(tree: Tree, i2, m2, i3, m3, i_start, i_end, md) -> tuple:  # type: ignore[no-untyped-def]
    """Return (starts, flags, rest, V, image, point, direction, first direction without a common part or -1).

    Points measured in several ways share one slot, unless one way repeats. Terms without confidence, or with a value
    that is not finite, are left out.
    """
    n_points, W = tree.V.shape[0], tree.S.shape[2]
    n_parts = tree.parents.shape[0]
    most = i2.shape[0] + i3.shape[0] + i_end.shape[0]
    of_point = np.full(n_points + n_parts, -1, np.int64)  # after the points: joints as points of their parents
    part, kind = np.empty(most, np.int64), np.zeros(most, np.int64)
    rest, V = np.zeros((most, 3)), np.zeros((most, 3, W))
    image, point, direction = np.zeros((most, 3)), np.zeros((most, 4)), np.zeros((most, 4))
    n = 0
    bad = -1
    for way in range(3):
        count = i2.shape[0] if way == 0 else (i3.shape[0] if way == 1 else i_end.shape[0])
        for k in range(count):
            values = m2[k] if way == 0 else (m3[k] if way == 1 else md[k])
            finite = True
            for v in values:
                finite = finite and np.isfinite(v)
            if not finite or values[-1] <= 0.0:
                continue
            first, last = -1, -1
            if way < 2:
                end = i2[k] if way == 0 else i3[k]
                i = tree.point_part[end]
            else:
                end = i_end[k]
                i, first, last = _common_part(tree, i_start[k], end)
                if i < 0:
                    bad = k
                    break
                norm = np.sqrt(values[0] ** 2 + values[1] ** 2 + values[2] ** 2)
                if norm < 1e-9:
                    continue
            key = end if last < 0 else n_points + last
            from_origin = way < 2 or (first < 0 and i_start[k] == tree.keypoints + i)
            slot = of_point[key] if from_origin else -1
            bit = HAS_2D if way == 0 else (HAS_3D if way == 1 else HAS_DIRECTION)
            if slot < 0 or kind[slot] & bit:
                slot = n
                n += 1
                if from_origin:
                    of_point[key] = slot
                part[slot] = i
                if last < 0:
                    rest[slot], V[slot] = tree.v_bar[end], tree.V[end]
                else:
                    rest[slot], V[slot] = tree.l[last], tree.S[last]
                if not from_origin:
                    if first < 0:
                        rest[slot] -= tree.v_bar[i_start[k]]
                        V[slot] -= tree.V[i_start[k]]
                    else:
                        rest[slot] -= tree.l[first]
                        V[slot] -= tree.S[first]
                for r in range(3):
                    for a in range(W):
                        if V[slot, r, a] != 0.0:
                            kind[slot] |= HAS_SHAPE
            kind[slot] |= bit
            if way == 0:
                image[slot, 0], image[slot, 1], image[slot, 2] = values[0], values[1], values[2]
            elif way == 1:
                for r in range(4):
                    point[slot, r] = values[r]
            else:
                for r in range(3):
                    direction[slot, r] = values[r] / norm
                direction[slot, 3] = values[3]
    starts = np.zeros(n_parts + 1, np.int64)
    for k in range(n):
        starts[part[k] + 1] += 1
    for i in range(n_parts):
        starts[i + 1] += starts[i]
    order = np.empty(n, np.int64)
    free = starts[:-1].copy()
    for k in range(n):
        order[free[part[k]]] = k
        free[part[k]] += 1
    return starts, kind[order], rest[order], V[order], image[order], point[order], direction[order], bad


def _padded(a: Array, shape: tuple[int, ...]) -> Array:
    out = np.zeros(shape)
    out[tuple(slice(0, n) for n in a.shape)] = a
    return out


def _checked_table(name: str, table: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the rows of a registered residual, or raise ShapeError."""
    if name not in RESIDUALS:
        raise ShapeError(f"There is no residual named {name!r}; the registered ones are {', '.join(RESIDUALS)}.")
    ints, floats = np.asarray(table[0], dtype=np.int64), np.asarray(table[1], dtype=np.float64)
    expected = (RESIDUALS[name].INTS, RESIDUALS[name].FLOATS)
    if (ints.shape[1:], floats.shape[1:], len(ints)) != ((expected[0],), (expected[1],), len(floats)):
        raise ShapeError(
            f"Tables of {name!r} must have shapes (n, {expected[0]}) and (n, {expected[1]}), "
            f"but got {ints.shape} and {floats.shape}."
        )
    return ints, floats


def make_terms(tree: Tree, measurements: "Measurements", priors: "Priors") -> Terms:
    """Pack one frame's measurements and priors. Raises ShapeError naming the array that does not fit the body."""
    m = measurements
    n_points = len(tree.point_part)
    i2, m2 = m.packed2d(n_points)
    i3, m3 = m.packed3d(n_points)
    starts, ends, md = m.packed_directions(n_points)
    offsets, flags, rest, V, image, point, direction, bad = _pack(tree, i2, m2, i3, m3, starts, ends, md)
    if bad >= 0:
        raise ShapeError(
            f"Orientation {bad} goes from point {starts[bad]} to point {ends[bad]}, which no body part has in common; "
            f"both ends must be fixed to one part."
        )
    tables = empty_tables()
    K, P, W = len(tree.parents) - 1, tree.shape, tree.S.shape[2]
    tables.update(m.packed_tables(K))
    tables.update(priors.packed_tables(K))
    for name, table in m.tables.items():
        ints, floats = _checked_table(name, table)
        tables[name] = np.concatenate([tables[name][0], ints]), np.concatenate([tables[name][1], floats])
    mean, information = priors.packed_shape(P)
    return Terms(
        offsets,
        flags,
        rest,
        V,
        image,
        point,
        direction,
        tuple(np.ascontiguousarray(tables[name][0], dtype=np.int64) for name in RESIDUALS),
        tuple(np.ascontiguousarray(tables[name][1], dtype=np.float64) for name in RESIDUALS),
        _padded(mean, (W,)),
        _padded(information, (W, W)),
    )
