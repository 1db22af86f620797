# SPDX-License-Identifier: GPL-3.0-or-later
"""A synthetic walk of sinusoids, as a clip and as a captured motion."""

import numpy as np
from scope.scope_addon.edit.clip import Clip
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.solver import load_body
from scope.solver.rotations import exp, log

from ..made_motion import level_camera, made_motion

BODY = load_body("scope")
NAMES = list(BODY.joint_names)
BETAS = np.zeros(BODY.P)
RATE = 30.0
ARMS_DOWN = {"left_shoulder": [0, 0, -1.2], "right_shoulder": [0, 0, 1.2]}


def angle(a, b):
    """Angles of the rotations from a (..., 3, 3) to b, in radians."""
    return np.linalg.norm(log(np.swapaxes(a, -1, -2) @ b), axis=-1)


def walk(seconds=4.0, period=1.0, speed=1.2, rate=RATE, bent=0.0):
    """Return a walk along −y: hips swing, knees bend, the pelvis moves up and down.

    :param bent: radians by which a knee is bent at least; without, legs are straight for a moment.
    """
    t = np.arange(int(seconds * rate) + 1) / rate
    w = np.zeros((len(t), len(NAMES), 3))
    for name, value in ARMS_DOWN.items():
        w[:, NAMES.index(name)] = value
    phase = 2 * np.pi * t / period
    for side, sign in (("left", 1.0), ("right", -1.0)):
        w[:, NAMES.index(f"{side}_hip"), 0] = -0.4 * sign * np.sin(phase)
        w[:, NAMES.index(f"{side}_knee"), 0] = bent + 0.4 * (1 + sign * np.cos(phase))
    rotations = exp(w)
    rotations[:, 0] = R_WORLD_MODEL
    root = np.stack([np.zeros_like(t), -speed * t, 0.95 + 0.02 * np.cos(2 * phase)], axis=1)
    return Clip(t, rotations, root)


def motion_of(clip, noise=0.0, seed=0, body=BODY):
    """Return a capture of the clip by a level camera 4 m away; its raw motion has ``noise`` in
    radians.
    """
    rng = np.random.default_rng(seed)
    T, K1 = clip.rotations.shape[:2]
    shaken = clip.rotations @ exp(noise * rng.standard_normal((T, K1, 3)))
    camera = level_camera(T)
    J0 = body.rest_joints(np.zeros(body.P))[0]
    joints = clip.joints(body, np.zeros(body.P))
    return made_motion(
        body,
        log(clip.rotations),
        clip.root - J0,
        RATE,
        poses_raw=log(shaken).reshape(T, -1),
        trans_raw=clip.root - J0 + 0.1 * noise * rng.standard_normal((T, 3)),
        timestamps=clip.times,
        joints_cam=(joints - camera[0, :3, 3]) @ camera[0, :3, :3],
    )
