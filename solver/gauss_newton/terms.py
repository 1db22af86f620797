# SPDX-License-Identifier: Apache-2.0
"""Measurements of one frame as flat arrays: one slot a point, with all that was measured of it, by
body part.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..arrays import as_table
from ..errors import ShapeError
from ..kernel import allocating_kernel, kernel
from ..measurements import LARGEST, Measurements
from ..part import Array
from ..residuals.external import NONE, External, pack_external
from ..residuals.registry import FIRST_EXTERNAL, RESIDUALS, empty_tables, registered
from ..tree import Tree
from ..validation import all_within

if TYPE_CHECKING:
    from ..options import Priors

HAS_SHAPE = 1
HAS_2D = 2
HAS_3D = 4
HAS_DIRECTION = 8
# The least that a residual's whole numbers may be, by its INDEXES, and the array of `Tree` that has
# one row for each.
_RANGES = {
    "points": (0, "point_part"),
    "parts": (0, "parents"),
    "joints": (1, "parents"),
    "indices": (0, None),
}
_UNLIMITED = np.iinfo(np.int64).max
_POSE_PRIOR = [k for k, name in enumerate(RESIDUALS) if name == "pose_prior"]
# Of the tables that say where a body is, the first column of a row's weights.
_WEIGHED = {
    k: {"foot_contact": 3, "floor": 4, "outline": 7}[name]
    for k, name in enumerate(RESIDUALS)
    if name in ("foot_contact", "floor", "outline")
}


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
    external: External  # rows of residuals that were registered from outside


@kernel
def _common_part(tree: Tree, a: int, b: int) -> tuple[int, int, int]:
    """Return (part, start joint or -1, end joint or -1): a part that two points are both fixed to.

    A joint belongs to its own part, as its origin, and to its parent, where it sits at S beta + l.
    -1 if none.
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
def _lay_out(tree: Tree, i2, i3, i_start, i_end) -> tuple[Any, ...]:  # type: ignore[no-untyped-def]
    """Return (starts, shaped, rest, V, slots of 2D, of 3D, of directions, first direction without a
    common part or -1).

    Points with several kinds of measurement share one slot, unless one kind repeats. `shaped` is
    HAS_SHAPE where V is not zero.
    """
    n_points = tree.V.shape[0]
    W = tree.S.shape[2]
    n_parts = tree.parents.shape[0]
    counts = (i2.shape[0], i3.shape[0], i_end.shape[0])
    most = counts[0] + counts[1] + counts[2]
    # after the points: joints as points of their parents
    of_point = np.full(n_points + n_parts, -1, np.int64)
    part = np.empty(most, np.int64)
    listed = np.zeros(most, np.int64)
    # numbered as of_point
    point = np.empty(most, np.int64)
    minus = np.full(most, -1, np.int64)
    slots = np.empty(most, np.int64)
    n = 0
    term = 0
    bad = -1
    for kind in range(3):
        for k in range(counts[kind]):
            first = -1
            last = -1
            if kind < 2:
                end = i2[k] if kind == 0 else i3[k]
                i = tree.point_part[end]
            else:
                end = i_end[k]
                i, first, last = _common_part(tree, i_start[k], end)
                if i < 0:
                    i = 0
                    if bad < 0:
                        bad = k
            key = end if last < 0 else n_points + last
            from_origin = kind < 2 or (first < 0 and i_start[k] == tree.keypoints + i)
            slot = of_point[key] if from_origin else -1
            bit = HAS_2D if kind == 0 else (HAS_3D if kind == 1 else HAS_DIRECTION)
            if slot < 0 or listed[slot] & bit:
                slot = n
                n += 1
                part[slot] = i
                point[slot] = key
                if from_origin:
                    of_point[key] = slot
                else:
                    minus[slot] = i_start[k] if first < 0 else n_points + first
            listed[slot] |= bit
            slots[term] = slot
            term += 1
    starts = np.zeros(n_parts + 1, np.int64)
    for k in range(n):
        starts[part[k] + 1] += 1
    for i in range(n_parts):
        starts[i + 1] += starts[i]
    shaped = np.zeros(n, np.int64)
    rest = np.zeros((n, 3))
    V = np.zeros((n, 3, W))
    place = np.empty(n, np.int64)
    free = starts[:-1].copy()
    for k in range(n):
        at = free[part[k]]
        free[part[k]] += 1
        place[k] = at
        for sign, key in ((1.0, point[k]), (-1.0, minus[k])):
            if key < 0:
                continue
            for r in range(3):
                rest[at, r] += sign * (
                    tree.v_bar[key, r] if key < n_points else tree.l[key - n_points, r]
                )
                for c in range(W):
                    V[at, r, c] += sign * (
                        tree.V[key, r, c] if key < n_points else tree.S[key - n_points, r, c]
                    )
        for r in range(3):
            for c in range(W):
                if V[at, r, c] != 0.0:
                    shaped[at] = HAS_SHAPE
    for k in range(most):
        slots[k] = place[slots[k]]
    a = counts[0]
    b = counts[0] + counts[1]
    return starts, shaped, rest, V, slots[:a], slots[a:b], slots[b:], bad


@kernel
def _usable(values, k: int) -> bool:  # type: ignore[no-untyped-def]
    """Whether all of row k are numbers below `LARGEST` and its confidence, the last, is
    positive.
    """
    last = values.shape[1] - 1
    for r in range(last + 1):
        if not abs(values[k, r]) < LARGEST:
            return False
    return bool(values[k, last] > 0.0)


@kernel
def _fill(  # type: ignore[no-untyped-def]
    shaped, slots2, slots3, slots_d, m2, m3, md, flags, image, point, direction
) -> int:
    """Write the values and flags of all that is usable; return how many slots have anything."""
    for k in range(flags.shape[0]):
        flags[k] = shaped[k]
    for k in range(slots2.shape[0]):
        if _usable(m2, k):
            at = slots2[k]
            flags[at] |= HAS_2D
            for r in range(3):
                image[at, r] = m2[k, r]
    for k in range(slots3.shape[0]):
        if _usable(m3, k):
            at = slots3[k]
            flags[at] |= HAS_3D
            for r in range(4):
                point[at, r] = m3[k, r]
    for k in range(slots_d.shape[0]):
        norm = np.sqrt(md[k, 0] ** 2 + md[k, 1] ** 2 + md[k, 2] ** 2)
        if _usable(md, k) and norm >= 1e-9:
            at = slots_d[k]
            flags[at] |= HAS_DIRECTION
            for r in range(3):
                direction[at, r] = md[k, r] / norm
            direction[at, 3] = md[k, 3]
    count = 0
    for k in range(flags.shape[0]):
        if flags[k] & (HAS_2D | HAS_3D | HAS_DIRECTION):
            count += 1
    return count


@kernel
def _same(a, b) -> bool:  # type: ignore[no-untyped-def]
    """Whether two lists of indices are equal."""
    if a.shape[0] != b.shape[0]:
        return False
    for k in range(a.shape[0]):
        if a[k] != b[k]:
            return False
    return True


class Layout:
    """Which slot every measurement goes to: the part of `Terms` that stays while the same points
    are measured.
    """

    def __init__(self, tree: Tree, indices: tuple[Array, ...]) -> None:
        """Lay out the slots.

        :param indices: four arrays (n,): indices of 2D and of 3D keypoints, starts and ends of
            directions.
        :raises ShapeError: the two ends of a direction are not fixed to one part.
        """
        self.indices = tuple(index.copy() for index in indices)
        self.starts, self.shaped, self.rest, self.V, *slots, bad = _lay_out(tree, *self.indices)
        self.slots = tuple(slots)
        if bad >= 0:
            raise ShapeError(
                f"Orientation {bad} goes from point {indices[2][bad]} to point {indices[3][bad]}, "
                "which no body part "
                f"has in common; both ends must be fixed to one part."
            )
        n = len(self.rest)
        self.values = np.zeros(n, np.int64), np.zeros((n, 3)), np.zeros((n, 4)), np.zeros((n, 4))

    def fits(self, indices: tuple[Array, ...]) -> bool:
        """Whether it is the layout of these indices, four arrays (n,) as of `__init__`."""
        return all(_same(a, b) for a, b in zip(self.indices, indices, strict=True))


class PackedPriors(NamedTuple):
    """Priors laid out for the kernels."""

    tables: dict[str, tuple[Array, Array]]
    shape_mean: Array  # (W,)
    shape_information: Array  # (W, W)


def pack_priors(tree: Tree, priors: "Priors") -> PackedPriors:
    """Check and lay out the priors.

    :raises ShapeError: a prior does not fit the body.
    """
    tables = empty_tables()
    for name, table in priors.packed_tables(len(tree.parents) - 1).items():
        tables[name] = _checked_table(tree, name, table)
    W = tree.S.shape[2]
    mean, information = priors.packed_shape(tree.shape)
    return PackedPriors(tables, _padded(mean, (W,)), _padded(information, (W, W)))


def _padded(a: Array, shape: tuple[int, ...]) -> Array:
    out = np.zeros(shape)
    out[tuple(slice(0, n) for n in a.shape)] = a
    return out


def _checked_table(tree: Tree, name: str, table: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the rows of a registered residual, or raise ShapeError where kernels would read beyond
    the arrays.
    """
    module = registered(name)
    ints, floats = as_table(table, module.INTS, module.FLOATS, name)
    counted = getattr(module, "INDEXES", "indices")
    least, of_what = _RANGES[counted]
    limit = _UNLIMITED if of_what is None else len(getattr(tree, of_what))
    if not all_within(ints.ravel(), least, limit):
        wanted = "not be negative" if of_what is None else f"lie in {least}..{limit - 1}"
        raise ShapeError(
            f"{counted.capitalize()} of {name!r} must {wanted}, but go from "
            f"{ints.min()} to {ints.max()}."
        )
    return ints, floats


def make_terms(tree: Tree, measurements: Measurements, priors: "Priors") -> Terms:
    """Pack one frame's measurements and priors.

    :raises ShapeError: an array does not fit the body; the message names it.
    :raises InvalidValueError: a measurement has a value that no fit can use.
    """
    return fill_terms(tree, measurements, pack_priors(tree, priors), None)[0]


def fill_terms(
    tree: Tree, measurements: Measurements, priors: PackedPriors, layout: Layout | None
) -> tuple[Terms, int, Layout]:
    """Return the terms, how many slots are in use, and the layout, whose arrays the terms share.

    `layout` is an earlier frame's: it is used again where the same points were measured.

    :raises ShapeError: an array does not fit the body; the message names it.
    :raises InvalidValueError: a measurement has a value that no fit can use.
    """
    m = measurements
    n_points = len(tree.point_part)
    i2, m2 = m.packed2d(n_points)
    i3, m3 = m.packed3d(n_points)
    starts, ends, md = m.packed_directions(n_points)
    indices = i2, i3, starts, ends
    if layout is None or not layout.fits(indices):
        layout = Layout(tree, indices)
    count = _fill(layout.shaped, *layout.slots, m2, m3, md, *layout.values)
    tables = priors.tables
    external = NONE
    own = m.packed_tables(len(tree.parents) - 1, n_points)
    if own or m.tables:
        tables = {**tables, **own}
        outside = []
        for name, table in m.tables.items():
            more = _checked_table(tree, name, table)
            if name in RESIDUALS:
                tables[name] = (
                    np.concatenate([tables[name][0], more[0]]),
                    np.concatenate([tables[name][1], more[1]]),
                )
            else:
                outside.append((registered(name), *more))
        external = pack_external(outside, FIRST_EXTERNAL) if outside else NONE
    ints = tuple([np.ascontiguousarray(tables[name][0], dtype=np.int64) for name in RESIDUALS])
    floats = tuple([np.ascontiguousarray(tables[name][1], dtype=np.float64) for name in RESIDUALS])
    terms = Terms(
        layout.starts, layout.values[0], layout.rest, layout.V, *layout.values[1:], ints, floats,
        priors.shape_mean, priors.shape_information, external,
    )  # fmt: skip
    return terms, count, layout


def usable(terms: Terms, slots: int | None = None) -> tuple[int, int]:
    """Return how many points, directions and poses were measured, and these with all else that
    fixes where a body is: contacts, floor, outline and residuals from outside. Priors do not count.

    :param slots: of points and directions in use, if it is known.
    """
    if slots is None:
        slots = int(np.count_nonzero(terms.flags & ~HAS_SHAPE))
    seen = slots + sum(len(terms.ints[k]) for k in _POSE_PRIOR)
    everything = seen + int(terms.external.calls[:, 1].sum())
    for k, first_weight in _WEIGHED.items():
        if len(terms.floats[k]):
            weights = terms.floats[k][:, first_weight : first_weight + 2]
            everything += int(np.count_nonzero((weights > 0.0).any(axis=1)))
    return seen, everything
