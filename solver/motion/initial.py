# SPDX-License-Identifier: Apache-2.0
"""Where a clip's optimization starts: frames fitted in order, what several cameras see triangulated
first.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from ..errors import warn_caller
from ..fitting.clip import Camera, fit_in_order
from ..fitting.misfit import IMAGE_REMEDIES
from ..measurements import Keypoints3D, Measurements
from ..options import Options, Priors
from ..part import Array
from ..state import State
from ..tree import Tree
from ..validation import far_apart, warn_of_distance, warn_of_units
from .views import View

# of a point's rays: smallest over largest eigenvalue, below which they are too nearly parallel
_MIN_CONDITION = 1e-4
# of cameras that agree, in normalized image coordinates, and of some that do not in whatever axes
_LARGEST_ERROR = 0.01
_CONTRADICTION = 0.03
_LEAST_SHARE = 1 / 3  # of one camera's points that must be triangulated, or that camera says more


def initial_states(
    tree: Tree,
    frames: Sequence[Sequence[View]],
    priors: Priors,
    options: Options,
    cold: Literal["multi"] | None = None,
) -> list[State]:
    """Return each frame's state in the world's axes, of one shape; `cold` as of `fit_in_order`."""
    chosen = [first_view(views, len(tree.point_part)) for views in frames]
    cameras = [_camera_of(view) for view in chosen]
    states = fit_in_order(
        tree, [view.measurements for view in chosen], priors, options, cameras, cold
    )
    return [replace(state, beta=states[-1].beta) for state in states]


def first_view(views: Sequence[View], points: int) -> View:
    """Return what a frame is first fitted to: its triangulated points, or one camera's view where
    that says more.
    """
    if len(views) < 2:
        return views[0] if views else View(Measurements())
    fullest = max(views, key=lambda view: _points_of(view, points))  # of equal ones the first
    found = triangulated(views, points)
    meet = np.asarray(found.points)
    # of cameras that are not placed in metres, the points are none of a person
    is_usable = len(meet) > _LEAST_SHARE * _points_of(fullest, points) and not far_apart(meet)
    return View(Measurements(keypoints3d=found)) if is_usable else fullest


def _points_of(view: View, points: int) -> int:
    """Return how many usable 2D and 3D keypoints a camera has."""
    tables = view.measurements.packed2d(points)[1], view.measurements.packed3d(points)[1]
    return sum(int(_usable(m).sum()) for m in tables)


def _usable(m: Array) -> Array:
    """Return which rows (n,) of measurements are finite and have a positive confidence, the
    last.
    """
    usable: Array = np.isfinite(m).all(axis=1) & (m[:, -1] > 0.0)
    return usable


def _camera_of(view: View) -> Camera:
    return (
        np.asarray(view.R_camera_world, dtype=float),
        np.asarray(view.t_camera_world, dtype=float),
    )


def triangulated(views: Sequence[View], points: int) -> Keypoints3D:
    """Return the points of the world that rays of several cameras or 3D keypoints fix, numbered as
    in measurements.

    A ray (u, v, 1) of a camera with R, t as in `View` says (R_0 - u R_2) p = u t_2 - t_0 and
    likewise for v; rows are divided by the depth of a first solution, so that the second minimizes
    errors in the image. A 3D keypoint weighs as much as one ray from a metre away.
    """
    p = np.full((points, 3), np.nan)
    for _ in range(2):
        A = np.zeros((points, 3, 3))
        b = np.zeros((points, 3))
        for view in views:
            R, t = _camera_of(view)
            indices, m = view.measurements.packed2d(points)
            usable = _usable(m)
            indices = indices[usable]
            m = m[usable]
            depth = np.nan_to_num(p[indices] @ R[2] + t[2], nan=1.0)
            weight = m[:, 2] / np.maximum(depth, 0.1) ** 2
            for axis in range(2):
                row = R[axis] - m[:, axis, None] * R[2]
                _add_rows(A, b, indices, row, m[:, axis] * t[2] - t[axis], weight)
            indices, q = view.measurements.packed3d(points)
            usable = _usable(q)
            for axis in range(3):
                row = np.broadcast_to(R[axis], (usable.sum(), 3))
                _add_rows(A, b, indices[usable], row, q[usable, axis] - t[axis], q[usable, 3])
        values = np.linalg.eigvalsh(A)
        fixed = values[:, 0] > _MIN_CONDITION * np.maximum(values[:, 2], 1e-12)
        p = np.full((points, 3), np.nan)
        p[fixed] = np.linalg.solve(A[fixed], b[fixed][..., None])[..., 0]
    index = np.flatnonzero(fixed)
    return Keypoints3D(index, p[index], np.ones(len(index)))


def _add_rows(A: Array, b: Array, indices: Array, row: Array, value: Array, weight: Array) -> None:
    """Add the normal equations of row (n, 3) times p = value (n,) to those of the points with these
    indices.
    """
    np.add.at(A, indices, weight[:, None, None] * row[:, :, None] * row[:, None, :])
    np.add.at(b, indices, (weight * value)[:, None] * row)


def warn_of_cameras(frames: Sequence[Sequence[View]], points: int) -> bool:
    """Warn of cameras that are not placed in metres, with `UnitsWarning`; or, with `ScopeWarning`,
    of those whose rays of one frame miss each other, and of what makes them meet: each camera's
    R_camera_world transposed, its place replaced by t_camera_world, its whole pose inverted, its
    axes those of OpenGL, or its pixels mirrored or swapped.

    :param points: how many points the body has, joints included.
    :return: whether there was something to tell.
    """
    places = [view.t_camera_world for views in frames for view in views]
    if warn_of_distance(np.array(places).reshape(-1, 3), "t_camera_world of views lies"):
        return True
    views = next((v for v in frames if len(v) > 1), None)
    if views is None or any(view.measurements.keypoints2d is None for view in views):
        return False
    given = _median_error(views, points)
    if not given > _LARGEST_ERROR:
        meet = np.asarray(triangulated(views, points).points)
        return warn_of_units(meet, "Points where rays meet by R_camera_world and t_camera_world")
    others: dict[str, list[View]] = {}
    for view in views:
        for remedy, (R, t) in _other_poses(*_camera_of(view)).items():
            moved = replace(view, R_camera_world=R, t_camera_world=t)
            others.setdefault(remedy, []).append(moved)
    for remedy, change in IMAGE_REMEDIES:
        others[remedy] = [replace(view, measurements=change(view.measurements)) for view in views]
    errors = {remedy: _median_error(changed, points) for remedy, changed in others.items()}
    best = min(errors, key=lambda remedy: np.nan_to_num(errors[remedy], nan=np.inf))
    if errors[best] < min(0.2 * given, 2.0 * _LARGEST_ERROR):
        what = f"meet in other axes; {best}"
    elif given > _CONTRADICTION:
        what = (
            "should meet; check each camera's R_camera_world and t_camera_world, that its "
            "intrinsics belong to pixels of this size, and that all saw the same moment"
        )
    else:
        return False
    warn_caller(f"The cameras' rays to a point miss each other, but {what}.")
    return True


def _other_poses(R: Array, t: Array) -> dict[str, Camera]:
    """Return what a camera's R_camera_world (3, 3) and t_camera_world (3,) should be where R and t
    are something else, by what to do.
    """
    from_opengl = np.diag([1.0, -1.0, -1.0])
    inverse = from_opengl @ R.T
    return {
        "transpose R_camera_world": (R.T, t),
        "give t_camera_world = -R_camera_world c of the camera's place c in the world": (R, -R @ t),
        "give R^T and -R^T t of the poses R_world_camera and t_world_camera": (R.T, -R.T @ t),
        "give F R and F t, F = diag(1, -1, -1), since y is down and z forward, unlike in OpenGL": (
            from_opengl @ R,
            from_opengl @ t,
        ),
        "give F R^T and -F R^T t, F = diag(1, -1, -1), of poses R, t of cameras in OpenGL's axes, "
        "as Blender's are": (inverse, -inverse @ t),
    }


def _median_error(views: Sequence[View], points: int) -> float:
    """Return the median distance of 2D keypoints from their triangulated points in normalized
    image coordinates; infinite where these are behind a camera, NaN where there are none.
    """
    found = triangulated(views, points)
    at = np.full((points, 3), np.nan)
    at[np.asarray(found.indices)] = found.points
    errors = []
    for view in views:
        indices, m = view.measurements.packed2d(points)
        R, t = _camera_of(view)
        p = at[indices] @ R.T + t
        usable = _usable(m) & np.isfinite(p).all(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            off = np.linalg.norm(p[:, :2] / p[:, 2:] - m[:, :2], axis=1)
        errors.append(np.where(p[:, 2] > 0.0, off, np.inf)[usable])
    together = np.concatenate(errors)
    return float(np.median(together)) if len(together) else np.nan
