# SPDX-License-Identifier: Apache-2.0
"""What cameras see of one frame. Each camera is linearized in its own axes, and its blocks are
turned to the world's.

With R, t the world in camera axes, part i is at (R R_i, R t_i + t) there. A twist about the pelvis
has the components R w, R nu in camera axes and a joint's rotation R u, so that M = Rᵀ M' R by 3 x 3
blocks and likewise the rest. Nothing else in the solver knows of several cameras.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import ArrayLike

from ..arrays import as_array, described
from ..errors import InvalidValueError, ShapeError
from ..gauss_newton.terms import Layout, PackedPriors, Terms, fill_terms, usable
from ..kernel import kernel
from ..matrices import add3, entries, product, rotated, write_entries
from ..measurements import Measurements
from ..part import Array
from ..points import frames_of, numbered
from ..residuals.external import External
from ..residuals.registry import RESIDUALS, empty_tables
from ..rotations import nearest_rotation
from ..tree import Tree
from ..validation import as_finite, check_list, check_rotations, check_type


@dataclass
class View:
    """What one camera measured of one frame, and where it was: a point p of the world is at R p + t
    in its axes.

    All measurements are in the camera's axes, and pixels with its intrinsics, as everywhere.
    R_camera_world (3, 3), t_camera_world (3,) in metres.
    """

    measurements: Measurements
    R_camera_world: ArrayLike = field(default_factory=lambda: np.eye(3))
    t_camera_world: ArrayLike = field(default_factory=lambda: np.zeros(3))


class PackedViews(NamedTuple):
    """The terms of all views of T frames, laid out for the kernels: those of one view are
    `terms_of`. V views.
    """

    of_frame: Array  # (T+1,): the views of frame f are of_frame[f]:of_frame[f+1]
    starts: Array  # (V, K+2), as in `Terms`
    # (V, 2): a view's first slot in the next four, and in `rest` and `V`, which views share
    slots: Array
    flags: Array  # (N,)
    image: Array  # (N, 3)
    point: Array  # (N, 4)
    direction: Array  # (N, 4)
    rest: Array  # (M, 3)
    V: Array  # (M, 3, W)
    rows: Array  # (residuals, V, 2): a view's rows of the tables are rows[k, v, 0]:rows[k, v, 1]
    ints: tuple[Array, ...]
    floats: tuple[Array, ...]
    calls: Array  # (V+1,): the same of external.calls
    external: External
    shape_mean: Array  # (W,)
    shape_information: Array  # (W, W)
    R: Array  # (V, 3, 3) R_camera_world
    t: Array  # (V, 3)
    own_axes: Array  # (V,) whether the camera's axes are the world's


@register_jitable
def _first_table(tables, rows, v):  # type: ignore[no-untyped-def]
    return (tables[0][rows[0, v, 0] : rows[0, v, 1]],)


def _and_table(before: Callable[..., Any], k: int) -> Callable[..., Any]:
    """Return the function that gives what `before` does and a view's rows of table k."""

    def some_tables(tables, rows, v):  # type: ignore[no-untyped-def]
        return before(tables, rows, v) + (tables[k][rows[k, v, 0] : rows[k, v, 1]],)

    return register_jitable(some_tables)


_tables_of: Callable[..., Any] = _first_table
for _k in range(1, len(RESIDUALS)):
    _tables_of = _and_table(_tables_of, _k)
_rows_of = _tables_of  # all tables' rows of a view, as a tuple


@register_jitable
def terms_of(views: PackedViews, v: int) -> Terms:
    """Return the terms of view v; for kernels as well."""
    n = views.starts[v, -1]
    a = views.slots[v, 0]
    b = views.slots[v, 1]
    external = External(
        views.external.calls[views.calls[v] : views.calls[v + 1]],
        views.external.ints,
        views.external.floats,
    )
    return Terms(
        views.starts[v],
        views.flags[a : a + n],
        views.rest[b : b + n],
        views.V[b : b + n],
        views.image[a : a + n],
        views.point[a : a + n],
        views.direction[a : a + n],
        _rows_of(views.ints, views.rows, v),
        _rows_of(views.floats, views.rows, v),
        views.shape_mean,
        views.shape_information,
        external,
    )


def pack_frames(
    tree: Tree, frames: Sequence[Sequence[View]], priors: PackedPriors
) -> tuple[PackedViews, Array]:
    """Return the terms of frames, and how many measurements of each are usable. Each frame's first
    view has the priors.

    :raises ShapeError: an array does not fit the body.
    :raises InvalidValueError: a value that no fit can use.
    """
    without = PackedPriors(empty_tables(), priors.shape_mean, priors.shape_information)
    layout: Layout | None = None
    of_frame = [0]
    counts = np.zeros(len(frames), np.int64)
    seen: list[Terms] = []
    cameras = []
    for f, frame in enumerate(frames):
        for k, view in enumerate(frame or [View(Measurements())]):
            terms, slots, layout = fill_terms(
                tree, view.measurements, without if k else priors, layout
            )
            counts[f] += usable(terms, slots)[1]
            # The next view with this layout overwrites them.
            kept = {name: getattr(terms, name).copy() for name in _VALUES}
            seen.append(terms._replace(**kept))
            cameras.append(_placed(view))
        of_frame.append(len(seen))
    return _packed(seen, cameras, np.array(of_frame)), counts


_VALUES = ("flags", "image", "point", "direction")


def _packed(
    views: Sequence[Terms], cameras: Sequence[tuple[Array, Array, bool]], of_frame: Array
) -> PackedViews:
    """Lay out the terms of all views one after the other."""
    layouts = _Shared()
    tables = [_Shared() for _ in RESIDUALS]
    places = [layouts.add(terms.rest, terms.V)[0] for terms in views]
    firsts = np.cumsum([0, *(len(terms.flags) for terms in views[:-1])])
    rows = [
        [table.add(terms.ints[k], terms.floats[k]) for terms in views]
        for k, table in enumerate(tables)
    ]
    flags, image, point, direction = (
        np.concatenate([getattr(terms, name) for terms in views]) for name in _VALUES
    )
    R, t, own_axes = (np.array(some) for some in zip(*cameras, strict=True))
    rest, V = layouts.joined()
    ints, floats = zip(*(table.joined() for table in tables), strict=True)
    calls, external = _joined([terms.external for terms in views])
    return PackedViews(
        of_frame,
        np.array([terms.starts for terms in views]),
        np.array(list(zip(firsts, places, strict=True))),
        flags,
        image,
        point,
        direction,
        rest,
        V,
        np.array(rows),
        ints,
        floats,
        calls,
        external,
        views[0].shape_mean,
        views[0].shape_information,
        R,
        t,
        own_axes,
    )


def _views_of(frame: Any, name: str) -> Sequence[View]:
    """Return what cameras measured of a frame, checked: measurements alone are the view of a camera
    at the origin.

    :param name: of the frame, for messages.
    :raises ShapeError: a camera's rotation or position has another shape.
    :raises InvalidValueError: the frame is neither measurements nor views, or a camera's rotation
        is none.
    """
    if isinstance(frame, Measurements):
        return [View(frame)]
    if not isinstance(frame, Sequence) or isinstance(frame, str):
        raise InvalidValueError(
            f"{name} must be Measurements or a list of View, but is {described(frame)}."
        )
    for k, view in enumerate(frame):
        check_type(view, View, f"{name}[{k}]")
        check_type(view.measurements, Measurements, f"measurements of {name}[{k}]")
        R = as_array(view.R_camera_world, (3, 3), f"R_camera_world of {name}[{k}]")
        check_rotations(R[None], f"R_camera_world of {name}[{k}]")
        as_finite(view.t_camera_world, (3,), f"t_camera_world of {name}[{k}]")
    return frame


def view_frames_of(
    body: object, frames: Sequence[Measurements | Sequence[View]] | Measurements | Sequence[View]
) -> list[list[View]]:
    """Return the views of each frame, checked and with points as numbers, however they were given:
    see `fit_motion`.

    :raises ShapeError: the arrays of a clip, or of its cameras, have different numbers of frames,
        or a camera's rotation or position has another shape.
    :raises InvalidValueError: the body has no point of a name, `frames` is no list, a frame is
        neither measurements nor views, or a camera's rotation is none.
    """
    if isinstance(frames, Measurements):
        return [[View(m)] for m in frames_of(body, frames, "frames")]
    check_list(frames, "frames", "frame")
    by_frame: Sequence[Any] = frames
    if len(frames) and all(isinstance(view, View) for view in frames):
        cameras = [
            [replace(view, measurements=m) for m in frames_of(body, view.measurements, "frames")]
            for view in frames
            if isinstance(view, View)
        ]
        lengths = [len(camera) for camera in cameras]
        if len(set(lengths)) > 1:
            raise ShapeError(f"Cameras must have the same number of frames, but have {lengths}.")
        by_frame = list(zip(*cameras, strict=True))
    return [
        [
            replace(view, measurements=numbered(body, view.measurements))
            for view in _views_of(frame, f"frames[{f}]")
        ]
        for f, frame in enumerate(by_frame)
    ]


class _Shared:
    """Rows of pairs of arrays, one after the other; the same pair again, as of priors or of a
    layout, shares its rows.
    """

    def __init__(self) -> None:
        self._pairs: list[tuple[Array, Array]] = []
        self._known: dict[tuple[int, int], tuple[int, int]] = {}
        self._size = 0

    def add(self, a: Array, b: Array) -> tuple[int, int]:
        """Return where the rows of a pair begin and end."""
        key = id(a), id(b)
        if key not in self._known:
            self._known[key] = self._size, self._size + len(a)
            self._pairs.append((a, b))  # so that no other arrays get these ids
            self._size += len(a)
        return self._known[key]

    def joined(self) -> tuple[Array, Array]:
        """Return all rows."""
        return (
            np.concatenate([a for a, _ in self._pairs]),
            np.concatenate([b for _, b in self._pairs]),
        )


def _placed(view: View) -> tuple[Array, Array, bool]:
    """Return R_camera_world, made orthonormal, t_camera_world, and whether the camera's axes are
    the world's.
    """
    R = nearest_rotation(view.R_camera_world)
    t = np.asarray(view.t_camera_world, dtype=float)
    return R, t, np.array_equal(R, np.eye(3)) and not t.any()


def _joined(views: Sequence[External]) -> tuple[Array, External]:
    """Return where the calls of each view begin and end (V+1,), and the rows of all of them."""
    calls = []
    i = 0
    f = 0
    for external in views:
        calls.append(external.calls + np.array([0, 0, i, f, 0]))
        i = i + len(external.ints)
        f = f + len(external.floats)
    ints, floats = (
        np.concatenate([getattr(each, name) for each in views]) for name in ("ints", "floats")
    )
    return np.cumsum([0, *map(len, calls)]), External(np.concatenate(calls), ints, floats)


@kernel
def place_in_camera(R, t, pose, seen) -> None:  # type: ignore[no-untyped-def]
    """Write the root of `pose` in a camera's axes, and its joints, to `seen`; the other parts are
    left to linearize.

    R (3, 3), t (3,): the world in the camera's axes.
    """
    turn = entries(R)
    write_entries(product(turn, entries(pose.R[0])), seen.R[0])
    root = add3(rotated(turn, pose.t[0]), t)
    for r in range(3):
        seen.t[0, r] = root[r]
    for i in range(1, pose.Omega.shape[0]):
        write_entries(entries(pose.Omega[i]), seen.Omega[i])
    for a in range(pose.beta.shape[0]):
        seen.beta[a] = pose.beta[a]
    seen.log_focal[0] = pose.log_focal[0]
