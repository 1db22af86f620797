# SPDX-License-Identifier: GPL-3.0-or-later
"""A marker set: 41 reflective markers on the skin, each stuck to a vertex of the mesh, one of them
lost.

A marker belongs to the part that moves its vertex most; it becomes a keypoint of that part. The
skin between two parts bends, and no point of the solver does: markers on it cost a few millimetres.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .. import Body, Keypoints3D, Measurements, Options, Stage, Weights, fit, load_body
from . import person

OFFSET_M = 0.0095  # of the marker's centre from the skin


def with_markers(body: Body, vertices: NDArray[np.intp]) -> Body:
    """Return the body with one keypoint for each marker, at vertices (n,), in place of its own."""
    most = body.skin_weights[vertices].argmax(axis=1)
    part = body.skin_joints[vertices, most]
    outwards = body.v_template[vertices] - body.J_template[part]
    outwards *= OFFSET_M / np.linalg.norm(outwards, axis=1, keepdims=True)
    return replace(
        body,
        keypoint_names=tuple(f"marker/{k}" for k in range(len(vertices))),
        keypoint_part=part.astype(np.int32),
        keypoint_template=body.v_template[vertices] + outwards,
        keypoint_shapedirs=body.shapedirs[vertices],
    )


def main() -> float:
    """Fit, print, and return the mean error of the joints in millimetres."""
    body = load_body("scope")
    rng = np.random.default_rng(5)
    rigid = np.flatnonzero(body.skin_weights.max(axis=1) > 0.95)
    chosen = _spread(body.v_template, rigid, 41)
    marked = with_markers(body, chosen)
    truth = person.pose(body, seed=6)
    R, t = person.place(body, truth)
    markers = marked.keypoints(R, t, truth.beta) + 0.001 * rng.standard_normal((41, 3))
    markers[7] = np.nan  # lost: a value that is not finite is left out

    seen = Measurements(keypoints3d=Keypoints3D(np.arange(41), markers, np.ones(41)))
    # one over a variance
    weights = Weights(keypoints3d=1.0 / 0.005**2, shape=1.0, joint_limits=100.0)
    found = fit(marked, seen, options=Options(stages=[Stage(weights)]))

    error = person.joint_error_mm(body, found.t_camera_part, truth)
    print(
        f"{found.status.name}: {found.measurements} of 41 markers, joints off by {error:.1f} mm "
        "on average"
    )
    return error


def _spread(points: NDArray[np.float64], among: NDArray[np.intp], n: int) -> NDArray[np.intp]:
    """Choose n indices far from each other: always the one farthest from those chosen."""
    chosen = [int(among[0])]
    apart = np.full(len(among), np.inf)
    while len(chosen) < n:
        apart = np.minimum(apart, np.linalg.norm(points[among] - points[chosen[-1]], axis=1))
        chosen.append(int(among[apart.argmax()]))
    return np.array(chosen)


if __name__ == "__main__":
    main()
