# SPDX-License-Identifier: GPL-3.0-or-later
"""A small body, and 3D keypoints of it in some pose, for tests of arguments."""

import numpy as np
from scope.solver import Keypoints3D, Measurements, State

from .synthetic import forward, random_body, random_state

K = 4
P = 3
M = 12
BODY = random_body(np.random.default_rng(1), K, P, M)
TRUTH = State(*random_state(np.random.default_rng(2), K, P))
_, JOINTS, POINTS = forward(BODY, *vars(TRUTH).values())
KEYPOINTS = Keypoints3D(np.arange(M), POINTS, np.ones(M))
SEEN = Measurements(keypoints3d=KEYPOINTS)
