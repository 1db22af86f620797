# SPDX-License-Identifier: GPL-3.0-or-later
"""`python -m scope.benchmarks.solver.rigid_keypoints [SMPL.npz]`: what the paper's Assumption 1
costs, in millimetres.

SMPL moves a vertex v with several parts and by pose blend shapes,
    v(theta, beta) = sum_k w_k A_k (v_bar + B_shape beta + B_pose vec(R(theta) - I)),
the solver a keypoint with one part and without B_pose. The difference is taken at the vertices of
face and feet that serve as keypoints, in poses drawn from the joint prior. Joints are the same in
both; those that an evaluation regresses from the posed mesh, J v(theta, beta), are not.

Without a file, the body is the built-in one in SMPL's layout, with blend shapes of the size that
`BLEND_M` and `REACH_M` say: they are made up, and SMPL's own are the user's to measure.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver import Body, load_body, load_joint_prior
from ...solver.smpl_family import smpl_body
from ..report import table

Array = NDArray[np.float64]
POSES = 500
# a vertex at a joint that is turned by a right angle moves by so much, root mean square
BLEND_M = 0.01
REACH_M = 0.08  # one standard deviation of the bell by which blend shapes fade around their joint
REGRESSED = 40  # vertices of which a joint is the mean
GROUPS = {
    "nose, eyes, ears": ("nose", "left_eye", "right_eye", "left_ear", "right_ear"),
    "heels": ("left_heel", "right_heel"),
    "toes": ("left_big_toe", "left_small_toe", "right_big_toe", "right_small_toe"),
}


def main() -> int:
    """Measure, and print a table."""
    if len(sys.argv) > 1:
        path = Path(sys.argv[1])
        with np.load(path, allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
    else:
        path = Path("smpl.npz")
        arrays = smpl_layout(load_body("scope"), np.random.default_rng(0))
    errors = measure(arrays, path, POSES)
    rows = [
        [name, *(f"{1e3 * value:.1f}" for value in (e.mean(), np.quantile(e, 0.95), e.max()))]
        for name, e in errors.items()
    ]
    print(table(("points", "mean mm", "95 %", "largest"), rows))
    return 0


def measure(arrays: Mapping[str, NDArray[Any]], path: Path, poses: int) -> dict[str, Array]:
    """Return errors (n,) in metres of each group of points, and of its two causes.

    :param arrays: of a model file in SMPL's layout.
    """
    body = smpl_body(arrays, path)
    posedirs = arrays["posedirs"].astype(float)
    regressor = arrays["J_regressor"].astype(float)
    prior = load_joint_prior()
    rng = np.random.default_rng(1)
    drawn = np.tile(np.eye(3), (poses, body.K + 1, 1, 1))
    for i, name in enumerate(body.joint_names):
        if i > 0 and name in prior.names:
            drawn[:, i] = prior.sample(name, poses, rng)
    rest = body.keypoints(
        *body.forward_kinematics(np.tile(np.eye(3), (body.K + 1, 1, 1)), np.zeros(3))
    )
    keypoints = {name: body.point(f"coco/{name}") for names in GROUPS.values() for name in names}
    vertices = {
        name: int(np.linalg.norm(body.v_template - rest[k], axis=1).argmin())
        for name, k in keypoints.items()
    }
    found: dict[str, list[float]] = {}
    for turns in drawn:
        betas = rng.standard_normal(body.P)
        R, t = body.forward_kinematics(turns, np.zeros(3), betas)
        blended = posed(body, R, t, betas, posedirs, turns)
        skinned = posed(body, R, t, betas, np.zeros_like(posedirs), turns)
        joints = body.rest_joints(betas)
        shaped = body.rest_vertices(betas)
        for group, names in GROUPS.items():
            for name in names:
                part = body.keypoint_part[keypoints[name]]
                v = vertices[name]
                rigid = R[part] @ (shaped[v] - joints[part]) + t[part]
                for cause, surface in (("", blended), (", without blend shapes", skinned)):
                    off = float(np.linalg.norm(surface[v] - rigid))
                    found.setdefault(group + cause, []).append(off)
        off = np.linalg.norm(regressor @ blended - t, axis=1)
        found.setdefault("joints regressed from the posed mesh", []).extend(off[1:22])
    return {name: np.array(values) for name, values in found.items()}


def posed(body: Body, R: Array, t: Array, betas: Array, posedirs: Array, turns: Array) -> Array:
    """Return SMPL's posed vertices (V, 3); posedirs (V, 3, 9 K)."""
    features = (turns[1:] - np.eye(3)).reshape(-1)
    rest = body.rest_vertices(betas) + posedirs @ features
    local = rest[:, None] - body.rest_joints(betas)[body.skin_joints]
    moved = np.einsum("vsij,vsj->vsi", R[body.skin_joints], local) + t[body.skin_joints]
    surface: Array = np.einsum("vs,vsi->vi", body.skin_weights, moved)
    return surface


def smpl_layout(body: Body, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file in SMPL's layout, of a body of ours with made-up blend shapes."""
    joints = body.rest_joints()
    vertices = body.v_template
    weights = np.zeros((len(vertices), body.K + 1))
    np.put_along_axis(weights, body.skin_joints, body.skin_weights, axis=1)
    far = np.linalg.norm(vertices[:, None] - joints, axis=2)
    regressor = np.zeros((body.K + 1, len(vertices)))
    for i in range(body.K + 1):
        near = np.argsort(far[:, i])[:REGRESSED]
        # the smallest change of equal shares that gives the joint itself
        A = np.vstack([vertices[near].T, np.ones(REGRESSED)])
        wanted = np.append(joints[i], 1.0)
        equal = np.full(REGRESSED, 1.0 / REGRESSED)
        regressor[i, near] = equal + np.linalg.pinv(A) @ (wanted - A @ equal)
    bells = np.exp(-0.5 * (far[:, 1:] / REACH_M) ** 2)
    # A right angle changes four entries of R by 1: each may add a part of the displacement.
    directions = rng.standard_normal((body.K, 9, 3)) * BLEND_M / np.sqrt(4.0 * 3.0)
    posedirs = np.einsum("vk,kfc->vckf", bells, directions).reshape(len(vertices), 3, -1)
    parents = np.array([body.parents, np.arange(body.K + 1)])
    return {
        "v_template": vertices,
        "shapedirs": body.shapedirs,
        "posedirs": posedirs,
        "J_regressor": regressor,
        "weights": weights,
        "kintree_table": parents,
        "f": body.faces,
        "gender": np.array("neutral"),
    }


if __name__ == "__main__":
    sys.exit(main())
