# SPDX-License-Identifier: GPL-3.0-or-later
"""A residual of one's own: the height of some joints is known, say of hands on a rail, and nothing
else of them.

    r = sqrt(w) (t_y - height),   metres, camera frame (y down)
Once as a kernel, as fast as the solver's own, and once as a plain function of the part's pose, to
try an idea.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scope.solver import (
    Keypoints3D,
    Measurements,
    Options,
    Stage,
    Weights,
    fit,
    load_body,
    register_residual,
)
from scope.solver.kernels import add_to_point
from scope.solver.part import Part

from . import person


def accumulate(  # type: ignore[no-untyped-def]
    tree, ints, floats, weight, pose, blocks
):
    """Add every row's JᵀJ and Jᵀr to the blocks and return the cost. ints (n, 1): part; floats (n,
    2): height, w.
    """
    cost = 0.0
    for k in range(ints.shape[0]):
        i = ints[k, 0]
        w = weight * floats[k, 1]
        r = pose.t[i, 1] - floats[k, 0]
        cost += 0.5 * w * r * r
        origin = tree.keypoints + i  # a joint is a point too
        add_to_point(
            tree, pose, blocks, origin, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, w, 0.0, 0.0, 0.0, w * r, 0.0
        )
    return cost


def height(part: Part, ints: NDArray[np.int64], floats: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return r (1,) of one row: ints (1,), floats (2,)."""
    r: NDArray[np.float64] = np.sqrt(floats[1]) * (part.t[1:2] - floats[0])
    return r


def register() -> None:
    """Add both to the solver, as "height" and "slow_height"."""
    register_residual("height", kernel=accumulate, ints=1, floats=2, indexes="parts")
    register_residual("slow_height", function=height, ints=1, floats=2, indexes="parts")


def main() -> tuple[float, float]:
    """Fit without the heights and with them, print, and return the error of the hands' heights in
    millimetres.
    """
    register()
    body = load_body("scope")
    truth = person.pose(body)
    joints = person.place(body, truth)[1]
    hands = np.array([body.joint_names.index(name) for name in ("left_hand", "right_hand")])
    seen = np.setdiff1d(np.arange(body.K + 1), [*hands, *(hands - 2)])  # neither hands nor wrists
    points = Keypoints3D(len(body.keypoint_names) + seen, joints[seen], np.ones(len(seen)))
    rows = hands[:, None], np.column_stack([joints[hands, 1], np.ones(2)])

    without = Measurements(keypoints3d=points)
    options = Options(stages=[Stage(Weights(tables={"height": 4e4}))], report=True)
    errors = []
    for m in (without, replace(without, tables={"height": rows})):
        found = fit(body, m, options=options)
        errors.append(float(np.abs(found.t_camera_part[hands, 1] - joints[hands, 1]).mean() * 1e3))
    share = found.cost_by_term["height"] / found.cost
    print(
        f"hands off their height by {errors[0]:.1f} mm, and {errors[1]:.1f} mm with it known "
        f"({share:.0%} of the cost)"
    )
    return errors[0], errors[1]


if __name__ == "__main__":
    main()
