# SPDX-License-Identifier: GPL-3.0-or-later
"""What rigid keypoints miss of SMPL's surface, where that is known."""

from pathlib import Path

import numpy as np
from scope.benchmarks.solver.rigid_keypoints import measure, posed, smpl_layout
from scope.solver import rotations
from scope.solver.smpl_family import smpl_body

FILE = Path("smpl.npz")
POSES = 3


def test_without_blending_of_parts_and_blend_shapes_nothing_is_missed(body):
    arrays = smpl_layout(body, np.random.default_rng(0))
    rigid = np.zeros_like(arrays["weights"])
    strongest = arrays["weights"].argmax(axis=1)
    # The feet's and the head's keypoints belong to the strongest part of their vertices, but for
    # heels, which the ankle moves.
    rigid[np.arange(len(rigid)), strongest] = 1.0
    arrays |= {"weights": rigid, "posedirs": np.zeros_like(arrays["posedirs"])}
    errors = measure(arrays, FILE, POSES)
    assert errors["nose, eyes, ears"].max() < 1e-9


def test_a_blend_shape_moves_a_vertex_by_its_feature():
    tables = _one_bone()
    model = smpl_body(tables, FILE)
    turns = np.stack([np.eye(3), rotations.exp([0.0, 0.0, np.pi / 2])])
    R, t = model.forward_kinematics(turns, np.zeros(3))
    surface = posed(model, R, t, np.zeros(0), tables["posedirs"], turns)
    # entry (0, 1) of R - I is -1; the vertex is turned with its part, after it was moved by -0.02
    np.testing.assert_allclose(surface[3], [0.5, 0.2 - 0.02, 0.0], atol=1e-12)


def _one_bone():
    posedirs = np.zeros((4, 3, 9))
    posedirs[3, 0, 1] = 0.02
    v_template = np.array([[0.0, 0, 0], [0.5, 0, 0], [0.6, 0, 0], [0.7, 0.0, 0]])
    return {
        "v_template": v_template,
        "posedirs": posedirs,
        "J_regressor": np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0]]),
        "weights": np.array([[1.0, 0], [0, 1.0], [0, 1.0], [0, 1.0]]),
        "kintree_table": np.array([[-1, 0], [0, 1]]),
        "f": np.array([[0, 1, 2]]),
    }
