# SPDX-License-Identifier: GPL-3.0-or-later
"""What the 3D view reads back from the page's quantized arrays, against the motion and the body
themselves.
"""

from __future__ import annotations

import base64
import json

import numpy as np
from scope.scope_addon.report.viewer_data import shown_rows, viewer_data
from scope.solver.rotations import exp

from ..made_motion import made_motion


def decoded(text: str, kind: str, *shape: int) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), kind).reshape(shape)


def rotation_matrices(q: np.ndarray) -> np.ndarray:
    """(..., 4) quaternions (w, x, y, z) to (..., 3, 3), as R = I + 2 w [v]× + 2 [v]×²."""
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    w = q[..., 0, None, None]
    (x, y, z) = np.moveaxis(q[..., 1:], -1, 0)
    zero = np.zeros_like(x)
    V = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*x.shape, 3, 3)
    return np.eye(3) + 2 * w * V + 2 * V @ V


def test_joints_and_skin_of_the_page_are_those_of_the_body(body):
    rng = np.random.default_rng(3)
    T = 6
    K1 = body.K + 1
    poses = rng.normal(0, 0.7, (T, K1, 3))
    poses[0] = 0
    poses[1, 5] = [np.pi, 0, 0]
    poses[2, 0] = [0, 0, -3.3]  # more than half a turn
    motion = made_motion(body, poses, rng.normal(0, 2, (T, 3)), betas=rng.normal(0, 1, body.P))
    data = viewer_data([motion], body, np.arange(T), ["red"])
    person = data["people"][0]
    q = decoded(person["rotations"], "<i2", T, K1, 4)
    assert (q[..., 0] >= 0).all()
    R = rotation_matrices(q.astype(float))
    t = decoded(person["trans"], "<f4", T, 3)
    betas = motion.betas.astype(float)
    wanted = body.forward_kinematics(
        exp(motion.poses.reshape(T, K1, 3).astype(float)), motion.trans.astype(float), betas
    )
    found = body.forward_kinematics(R, t, betas)
    assert np.abs(found[1] - wanted[1]).max() < 5e-4
    V = len(body.v_template)
    positions = np.array(person["low"]) + decoded(person["positions"], "<u2", V, 3) * np.array(
        person["step"]
    )
    assert np.abs(positions - body.rest_vertices(betas)).max() < 3e-5
    assert np.abs(np.array(person["rest"]) - body.rest_joints(betas)).max() < 1e-6
    weights = decoded(data["skinWeights"], "u1", V, 4)
    assert (weights.sum(axis=1) == 255).all()
    assert np.abs(weights / 255 - body.skin_weights).max() < 0.01
    assert (decoded(data["skinJoints"], "u1", V, 4) == body.skin_joints).all()
    assert (decoded(data["triangles"], "<u2", len(body.triangles()), 3) == body.triangles()).all()
    assert len(decoded(data["camera"], "<f4", -1, 3, 4)) == 1  # it does not move


def test_a_very_long_clip_is_thinned(body):
    T = 30_000
    motion = made_motion(
        body, np.zeros((T, 3 * (body.K + 1)), np.float32), np.zeros((T, 3), np.float32)
    )
    rows = shown_rows([motion])
    assert rows[:3].tolist() == [0, 2, 4]
    assert shown_rows([motion, motion])[:3].tolist() == [0, 4, 8]
    assert len(json.dumps(viewer_data([motion], body, rows, ["red"]))) < 7_000_000
    short = made_motion(body, np.zeros((3, 3 * (body.K + 1))), np.zeros((3, 3)))
    assert shown_rows([short]).tolist() == [0, 1, 2]
