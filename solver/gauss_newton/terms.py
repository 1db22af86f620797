# SPDX-License-Identifier: Apache-2.0
"""Measurements of one frame as flat arrays: one slot a point, with all that was measured of it, by
body part.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..arrays import as_table
from ..errors import ShapeError
from ..kernel import kernel
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


def _places(tree: Tree, point: int) -> list[tuple[int, int]]:
    """Return the parts that a point is fixed to, and its row among all points, which the joints
    follow once more as points of their parents.

    A joint belongs to its own part, as its origin, and to its parent, where it sits at S beta + l.
    """
    places = [(int(tree.point_part[point]), point)]
    joint = point - tree.keypoints
    if joint > 0:
        places.append((int(tree.parents[joint]), len(tree.point_part) + joint))
    return places


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
        """Lay out the slots. Points with several kinds of measurement share one slot, unless one
        kind repeats.

        :param indices: four arrays (n,): indices of 2D and of 3D keypoints, starts and ends of
            directions.
        :raises ShapeError: the two ends of a direction are not fixed to one part.
        """
        self.indices = tuple(index.copy() for index in indices)
        i2, i3, i_start, i_end = self.indices
        # Of each measurement its part, and the rows of its point and of the point it starts from,
        # -1 for the part's origin.
        points = [(*_places(tree, k)[0], -1) for k in [*i2.tolist(), *i3.tolist()]]
        for k in range(len(i_end)):
            points.append(_direction(tree, k, int(i_start[k]), int(i_end[k])))
        kinds = [HAS_2D] * len(i2) + [HAS_3D] * len(i3) + [HAS_DIRECTION] * len(i_end)
        rows: list[tuple[int, int, int]] = []  # of each slot
        has: list[int] = []
        slot_of: dict[tuple[int, int, int], int] = {}
        slots = np.zeros(len(points), np.int64)
        for k, (row, kind) in enumerate(zip(points, kinds, strict=True)):
            slot = slot_of.get(row, -1) if row[2] < 0 else -1
            if slot < 0 or has[slot] & kind:
                slot = len(rows)
                rows.append(row)
                has.append(0)
                slot_of[row] = slot
            has[slot] |= kind
            slots[k] = slot
        part, point, start = np.array(rows, np.int64).reshape(-1, 3).T
        order = np.argsort(part, kind="stable")
        n = len(order)
        place = np.empty(n, np.int64)
        place[order] = np.arange(n)
        self.slots = np.split(place[slots], np.cumsum([len(i2), len(i3)]))
        self.starts = np.searchsorted(part[order], np.arange(len(tree.parents) + 1))
        self.rest = _rows(tree.v_bar, tree.l, point[order])
        self.V = _rows(tree.V, tree.S, point[order])
        differ = start[order] >= 0
        self.rest[differ] -= _rows(tree.v_bar, tree.l, start[order][differ])
        self.V[differ] -= _rows(tree.V, tree.S, start[order][differ])
        self.shaped = HAS_SHAPE * self.V.any(axis=(1, 2)).astype(np.int64)
        self.values = np.zeros(n, np.int64), np.zeros((n, 3)), np.zeros((n, 4)), np.zeros((n, 4))

    def fits(self, indices: tuple[Array, ...]) -> bool:
        """Whether it is the layout of these indices, four arrays (n,) as of `__init__`."""
        return all(_same(a, b) for a, b in zip(self.indices, indices, strict=True))


def _rows(of_points: Array, of_joints: Array, rows: Array) -> Array:
    """Return the rows (n, ...) of all points, which the joints follow once more."""
    n = len(of_points)
    found: Array = of_points[np.minimum(rows, n - 1)]
    found[rows >= n] = of_joints[rows[rows >= n] - n]
    return found


def _direction(tree: Tree, number: int, start: int, end: int) -> tuple[int, int, int]:
    """Return a part that both ends of a direction are fixed to, the row of its end, and that of its
    start, or -1 for the part's origin.

    :raises ShapeError: there is none.
    """
    for part, first in _places(tree, start):
        for other, last in _places(tree, end):
            if part == other:
                return part, last, -1 if first == tree.keypoints + part else first
    raise ShapeError(
        f"Orientation {number} goes from point {start} to point {end}, which no body part has in "
        "common; both ends must be fixed to one part."
    )


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
        ints, floats = _checked_table(tree, name, table)
        # copies, as the priors' own arrays may change or, what needs other machine code, be
        # read-only
        tables[name] = ints.copy(), floats.copy()
    W = tree.S.shape[2]
    mean, information = priors.packed_shape(tree.shape_count)
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
    says where a body is: contacts, floor, outline and further residuals. Priors do not count.

    :param slots: of points and directions in use, if it is known.
    """
    if slots is None:
        slots = int(np.count_nonzero(terms.flags & ~HAS_SHAPE))
    rows = {
        name: _count_measured(RESIDUALS[name], floats)
        for name, floats in zip(RESIDUALS, terms.floats, strict=True)
    }
    everything = slots + int(terms.external.calls[:, 1].sum()) + sum(rows.values())
    return slots + rows["pose_prior"], everything


def _count_measured(residual: Any, floats: Array) -> int:
    """Return how many rows (n, FLOATS) of a residual count as measured."""
    if not len(floats) or not hasattr(residual, "WEIGHTS"):
        return len(floats)
    return int(np.count_nonzero((floats[:, residual.WEIGHTS] > 0.0).any(axis=1)))
