# SPDX-License-Identifier: Apache-2.0
"""The kinematic tree as flat arrays for the kernels. Any number of joints, any shape basis, any
tree par(i) < i.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrays import as_array, as_integers
from .errors import InvalidValueError, ShapeError
from .part import Array
from .validation import as_indices, check_finite, check_list, check_switch, warn_of_units


class BodyArrays(Protocol):
    """What the solver reads of a body; `scope.solver.Body` has it, and so may any other object.

    Properties, because reading is all the solver does: (K+1,) parents, -1 for part 0; (K+1, 3, P)
    S, joint offsets by shape; (K+1, 3) l, joint offsets at beta = 0, metres; (M,) keypoint_part;
    (M, 3) v_bar, keypoints relative to their part's origin at beta = 0, metres; (M, 3, P) V.
    """

    @property
    def parents(self) -> NDArray[np.integer[Any]]: ...  # noqa: D102
    @property
    def S(self) -> NDArray[np.floating[Any]]: ...  # noqa: D102
    @property
    def l(self) -> NDArray[np.floating[Any]]: ...  # noqa: D102, E743
    @property
    def keypoint_part(self) -> NDArray[np.integer[Any]]: ...  # noqa: D102
    @property
    def v_bar(self) -> NDArray[np.floating[Any]]: ...  # noqa: D102
    @property
    def V(self) -> NDArray[np.floating[Any]]: ...  # noqa: D102


WIDTH = 4  # numbers to which rows of shape columns are padded: whole vectors of most processors


def padded(n: int) -> int:
    """Return `n` rounded up to a multiple of `WIDTH`."""
    return -(-n // WIDTH) * WIDTH


class Tree(NamedTuple):
    """A body for the kernels. W is P, plus one if the focal length is unknown, padded to whole
    vectors.

    Part i has the pose (R_i, t_i) in the camera; its relative pose is (Omega_i, S_i beta + l_i). A
    keypoint j of part i is at v_j = R_i (V_j beta + v_bar_j) + t_i. `points` below are the
    keypoints, then the K+1 part origins.
    """

    parents: Array  # (K+1,)
    S: Array  # (K+1, 3, W)
    l: Array  # (K+1, 3)
    point_part: Array  # (M+K+1,)
    v_bar: Array  # (M+K+1, 3)
    V: Array  # (M+K+1, 3, W)
    keypoints: int  # M
    shape_count: int  # P
    global_count: int  # P, or P + 1 with an unknown focal length, which is then column P


def make_tree(body: BodyArrays, focal: bool = False) -> Tree:
    """Check a body's arrays and lay them out for the kernels; `focal` adds a column for an unknown
    focal length.

    :raises ShapeError: an array is missing, does not fit the others, or a parent does not come
        before its child.
    :raises InvalidValueError: an array holds NaN or infinity, names are not one for each joint or
        keypoint, or `focal` is neither True nor False.
    """
    check_switch(focal, "focal")
    missing = [name for name in _ARRAYS if not hasattr(body, name)]
    if missing:
        raise ShapeError(
            f"A body needs the arrays {', '.join(_ARRAYS)}, but {type(body).__name__} "
            f"lacks {missing[0]}."
        )
    # a copy, also because numba compiles anew for an array that cannot be written to
    parents = as_integers(body.parents, "The body's parents").copy()
    n = parents.shape[0]
    if n == 0 or parents[0] != -1 or any(not 0 <= parents[i] < i for i in range(1, n)):
        raise ShapeError(
            "Parents must be -1 for part 0 and come before their children, but got "
            f"{parents.tolist()}."
        )
    s = _check(body.S, (n, 3, None), "S")
    p = s.shape[2]
    offsets = _check(body.l, (n, 3), "l")
    part = as_indices(body.keypoint_part, n, "The body's keypoint parts")
    m = part.shape[0]
    v_bar = _check(body.v_bar, (m, 3), "v_bar")
    v = _check(body.V, (m, 3, p), "V")
    _check_names(body, "joint_names", n)
    _check_names(body, "keypoint_names", m)
    warn_of_units(np.cumsum(offsets, axis=0), "The body's joint offsets l")
    width = padded(p + focal)
    s_padded = np.zeros((n, 3, width))
    v_padded = np.zeros((m + n, 3, width))
    s_padded[1:, :, :p] = s[1:]  # row 0 is not used: the root's pose is free
    v_padded[:m, :, :p] = v
    return Tree(
        parents,
        s_padded,
        offsets,
        np.concatenate([part, np.arange(n)]),
        np.concatenate([v_bar, np.zeros((n, 3))]),
        v_padded,
        m,
        p,
        p + int(focal),
    )


def with_fixed_shape(tree: Tree, beta: ArrayLike) -> Tree:
    """Return the tree at shape beta (P,), with no shape columns left: poses alone, at a fraction of
    the cost.

    :raises ShapeError: beta has another shape.
    :raises InvalidValueError: beta is not finite.
    """
    beta = _check(beta, (tree.shape_count,), "beta")
    n = len(tree.parents)
    m = len(tree.v_bar)
    return Tree(
        tree.parents,
        np.zeros((n, 3, 0)),
        tree.l + tree.S[:, :, : tree.shape_count] @ beta,
        tree.point_part,
        tree.v_bar + tree.V[:, :, : tree.shape_count] @ beta,
        np.zeros((m, 3, 0)),
        tree.keypoints,
        0,
        0,
    )


def _check_names(body: BodyArrays, field: str, count: int) -> None:
    """Check that a body that has names has one for each of its joints, the root included, or
    keypoints.

    :raises InvalidValueError: they are no list, more or fewer, or two are the same.
    """
    names = getattr(body, field, ())
    check_list(names, f"{field} of the body", "part" if field == "joint_names" else "keypoint")
    if len(names) and not len(set(names)) == len(names) == count:
        raise InvalidValueError(
            f"{field} of the body must be {count} different names, but are {len(names)}, of which "
            f"{len(set(names))} differ; the first joint is the root."
        )


_ARRAYS = ("parents", "S", "l", "keypoint_part", "v_bar", "V")


def _check(value: ArrayLike, shape: tuple[int | None, ...], name: str) -> Array:
    """Return a copy of an array of the body."""
    array = as_array(value, shape, f"To fit the rest of the body, {name}")
    check_finite(array, f"The body's {name}")
    return np.array(array, order="C")
