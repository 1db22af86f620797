# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion of the sample clip, written by hand: stand, raise both arms and wave, squat, turn and
walk four steps.

Angles are degrees in the model frame (x to the person's left, y up, z ahead), times are seconds,
places are metres on the floor of the world (z up). At zero yaw the person faces world −y, where the
camera stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.axes import R_WORLD_MODEL
from ...solver.body import Body
from ...solver.rotations import exp, log
from .leg import solve_leg

DURATION = 5.0
START = np.array([-0.50, 0.0])
TURN = 68.0  # yaw of the walk: to the right of the image and slightly towards the camera
FOOT_APART = 0.115
TOE_OUT = 8.0
SQUAT = (2.2, 2.72, 2.86, 3.28)  # begins, is lowest from .. to, ends

Key = tuple[float, NDArray[np.float64]]  # time, value


def choreograph(
    body: Body, betas: NDArray[np.float64], fps: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pose of every frame: rotations (T, K+1, 3, 3), row 0 the root in the world; and
    trans (T, 3).
    """
    times = np.arange(round(DURATION * fps)) / fps
    J = body.rest_joints(betas)
    index = {name: i for i, name in enumerate(body.joint_names)}
    ankle_height = J[index["left_ankle"], 1] - body.rest_vertices(betas)[:, 1].min()
    stand = J[0, 1] - J[index["left_ankle"], 1] + ankle_height
    rotations = np.tile(np.eye(3), (len(times), body.K + 1, 1, 1))
    trans = np.empty((len(times), 3))
    upper = _upper_body()
    for f, t in enumerate(times):
        for name, keys in upper.items():
            rotations[f, index[name]] = rotation_at(keys, t)
        pelvis = np.array([*_curve(_PELVIS_XY, t), stand + _curve(_PELVIS_DROP, t)[0]])
        R_root = (
            exp(np.radians([0, 0, _eased(_YAW, t)]))
            @ R_WORLD_MODEL
            @ exp(np.radians([_eased(_LEAN, t), 0, 0]))
        )
        rotations[f, 0] = R_root
        trans[f] = pelvis - J[0]
        for side in ("left", "right"):
            hip, knee, ankle = (index[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
            place, R_foot = _foot_at(side, t)
            place[2] += ankle_height
            R_hip, R_knee = solve_leg(
                R_root,
                pelvis + R_root @ (J[hip] - J[0]),
                place,
                J[knee] - J[hip],
                J[ankle] - J[knee],
            )
            rotations[f, hip] = R_hip
            rotations[f, knee] = R_knee
            rotations[f, ankle] = (R_root @ R_hip @ R_knee).T @ R_foot
    return rotations, trans


def standing_feet(times: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return (T, 2) bool: whether the left and the right foot are flat and at rest at these
    times.
    """
    return np.array(
        [
            [not any(t0 < t < t1 for t0, t1, *_ in _STEPS[s]) for s in ("left", "right")]
            for t in times
        ]
    )


# Legs


def _beside(along: float, side: str, yaw: float) -> NDArray[np.float64]:
    """Return a place on the floor, ``along`` metres into the walk, half the width of the stance to
    one side.
    """
    walk = np.radians(TURN)
    facing = np.radians(yaw)
    ahead = np.array([np.sin(walk), -np.cos(walk)])
    left = np.array([np.cos(facing), np.sin(facing)])
    return START + along * ahead + (FOOT_APART if side == "left" else -FOOT_APART) * left


_WALK = (3.25, 3.66, 4.08, 4.50, 4.92)  # each step begins where the last one ends
# Per foot: begin, end, place and yaw at the end.
_STEPS: dict[str, list[tuple[float, float, NDArray[np.float64], float]]] = {
    "left": [
        (_WALK[0], _WALK[1], _beside(0.22, "left", TURN), TURN),
        (_WALK[2], _WALK[3], _beside(1.12, "left", TURN), TURN),
    ],
    "right": [
        (_WALK[1], _WALK[2], _beside(0.68, "right", TURN), TURN),
        (_WALK[3], _WALK[4], _beside(1.14, "right", TURN), TURN),
    ],
}


def _foot_at(side: str, t: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the ankle above its height on the floor (3,), and the foot's rotation in the world."""
    place = _beside(0.0, side, 0.0)
    yaw = 0.0
    lift = 0.0
    pitch = 0.0
    for begin, end, to, to_yaw in _STEPS[side]:
        if t >= end:
            place = to
            yaw = to_yaw
        elif t > begin:
            s = (t - begin) / (end - begin)
            place = place + _ease(s) * (to - place)
            yaw = yaw + _ease(s) * (to_yaw - yaw)
            # toe down first, then heel
            lift = 0.10 * np.sin(np.pi * s)
            pitch = 18 * np.sin(2 * np.pi * s)
            break
    outward = TOE_OUT if side == "left" else -TOE_OUT
    R_foot = exp(np.radians([0, 0, yaw + outward])) @ R_WORLD_MODEL @ exp(np.radians([pitch, 0, 0]))
    return np.array([*place, lift]), R_foot


def _on_path(along: float, back: float = 0.0) -> NDArray[np.float64]:
    return _beside(along, "left", 90.0) - [0.0, FOOT_APART] + [0.0, back]


_PELVIS_XY: list[Key] = [
    (0.0, _on_path(0)),
    (SQUAT[0], _on_path(0)),
    (SQUAT[1], _on_path(0, 0.16)),
    (SQUAT[2], _on_path(0, 0.16)),
    (SQUAT[3], _on_path(0.0)),
    (_WALK[1], _on_path(0.12)),
    (_WALK[2], _on_path(0.47)),
    (_WALK[3], _on_path(0.91)),
    (_WALK[4], _on_path(1.13)),
    (DURATION, _on_path(1.13)),
]
_PELVIS_DROP: list[Key] = [
    (0.0, np.array([-0.020])),
    (SQUAT[0], np.array([-0.022])),
    (SQUAT[1], np.array([-0.40])),
    (SQUAT[2], np.array([-0.40])),
    (SQUAT[3], np.array([-0.055])),
    *((t, np.array([-0.060])) for t in _WALK[1:4]),
    (DURATION, np.array([-0.022])),
]
_YAW = [(0.0, 0.0), (SQUAT[3] - 0.1, 0.0), (_WALK[2], TURN), (DURATION, TURN)]
_LEAN = [
    (0.0, 0.0),
    (SQUAT[0], 0.0),
    (SQUAT[1], 32.0),
    (SQUAT[2], 32.0),
    (SQUAT[3], 2.0),
    (_WALK[2], 4.0),
    (5.0, 0.0),
]


# Above the hips


def arm_pose(
    raised: float, ahead: float = 0.0, pitch: float = 0.0, twist: float = 0.0, elbow: float = 10.0
) -> dict[str, NDArray[np.float64]]:
    """Return rotations of left collar, shoulder and elbow; ``raised``: −90 hangs, 0 T-pose;
    ``pitch`` > 0: ahead.
    """
    collar = max(raised, 0) * 0.3
    axes = np.radians([[-pitch, 0, 0], [0, -ahead, 0], [0, 0, raised - collar], [twist, 0, 0]])
    shoulder = exp(axes[0]) @ exp(axes[1]) @ exp(axes[2]) @ exp(axes[3])
    return {
        "collar": exp(np.radians([0, 0, collar])),
        "shoulder": shoulder,
        "elbow": exp(np.radians([0, -elbow, 0])),
        "wrist": np.eye(3),
    }


_MIRROR = np.diag([-1.0, 1.0, 1.0])
Arm = list[tuple[float, dict[str, NDArray[np.float64]]]]  # times, and poses of the left arm


def arm_keys(left: Arm, right: Arm) -> dict[str, list[Key]]:
    """Return the keys of both arms' joints."""
    keys = {}
    for side, arm in (("left", left), ("right", right)):
        for joint in ("collar", "shoulder", "elbow", "wrist"):
            keys[f"{side}_{joint}"] = on_side(side, [(t, pose[joint]) for t, pose in arm])
    return keys


def on_side(side: str, keys: list[Key]) -> list[Key]:
    """Return the keys of a joint of the left side, mirrored for the right one."""
    return [(t, _MIRROR @ R @ _MIRROR) for t, R in keys] if side == "right" else keys


def _upper_body() -> dict[str, list[Key]]:
    hanging = arm_pose(-74, ahead=10, elbow=14)
    reaching = arm_pose(-8, ahead=78, pitch=42, elbow=12)
    high_open = arm_pose(38, twist=-70, elbow=28)
    high_bent = arm_pose(38, twist=-78, elbow=72)
    left = [(0.0, hanging), (0.35, hanging)]
    left += [(0.95, arm_pose(34, twist=-72, elbow=45)), (1.65, arm_pose(40, twist=-72, elbow=38))]
    right = [(0.0, hanging), (0.35, hanging), (0.90, high_open)]
    right += [(0.90 + 0.2 * (i + 1), high_bent if i % 2 == 0 else high_open) for i in range(4)]
    for arm in (left, right):
        arm += [(SQUAT[0] + 0.1, arm_pose(-50, ahead=40)), (SQUAT[1], reaching)]
        arm += [(SQUAT[2], reaching), (SQUAT[3], hanging)]
    forward = arm_pose(-76, pitch=26, elbow=32)
    backward = arm_pose(-76, pitch=-24, elbow=12)
    left += [(_WALK[1], backward), (_WALK[2], forward), (_WALK[3], backward), (_WALK[4], hanging)]
    right += [(_WALK[1], forward), (_WALK[2], backward), (_WALK[3], forward), (_WALK[4], hanging)]
    keys = arm_keys(left, right)
    lean = turns(
        [(SQUAT[0], 0, 0), (SQUAT[1], 7, 0), (SQUAT[2], 7, 0), (SQUAT[3], 0, 0), (_WALK[1], 0, -4)]
    )
    keys["spine1"] = keys["spine2"] = lean + turns(
        [(_WALK[2], 0, 4), (_WALK[3], 0, -4), (_WALK[4], 0, 0)]
    )
    keys["spine3"] = turns([(0.4, 0, 0), (1.2, -4, 0), (1.7, -4, 0), (SQUAT[0], 0, 0)])
    look = [
        (0.2, 0, 0),
        (0.8, -6, 8),
        (1.7, -6, 8),
        (SQUAT[0], 0, 0),
        (SQUAT[1], -12, 0),
        (SQUAT[3], 0, 0),
    ]
    keys["neck"] = keys["head"] = turns(
        [*look, (_WALK[1], 2, 12), (_WALK[3], 2, 0), (DURATION, 0, -10)]
    )
    return keys


def turns(keys: list[tuple[float, float, float]]) -> list[Key]:
    """Convert (time, degrees forward, degrees to the left) to rotations."""
    return [
        (t, np.matmul(exp(np.radians([0, turn, 0])), exp(np.radians([nod, 0, 0]))))
        for t, nod, turn in keys
    ]


# Between keys


def _ease(s: float) -> float:
    """Ease from 0 to 1 without velocity or acceleration at either end."""
    return s * s * s * (10 + s * (6 * s - 15))


def _span(keys: Sequence[tuple[float, Any]], t: float) -> tuple[int, float]:
    """Return the indices of the two keys around ``t``, and the fraction 0..1 between them."""
    times = [key[0] for key in keys]
    i = int(np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(keys) - 2))
    return i, float(np.clip((t - times[i]) / (times[i + 1] - times[i]), 0, 1))


def _eased(keys: list[tuple[float, float]], t: float) -> float:
    i, s = _span(keys, t)
    return keys[i][1] + _ease(s) * (keys[i + 1][1] - keys[i][1])


def rotation_at(keys: list[Key], t: float) -> NDArray[np.float64]:
    """Interpolate rotations from key to key about one axis."""
    i, s = _span(keys, t)
    return keys[i][1] @ exp(_ease(s) * log(keys[i][1].T @ keys[i + 1][1]))


def _curve(keys: list[Key], t: float) -> NDArray[np.float64]:
    """Evaluate the monotone cubic through the keys."""
    i, s = _span(keys, t)
    (t0, p0) = keys[i]
    (t1, p1) = keys[i + 1]
    d = t1 - t0
    v0 = _velocity(keys, i)
    v1 = _velocity(keys, i + 1)
    from_start = (1 + 2 * s) * (1 - s) ** 2 * p0 + s * (1 - s) ** 2 * d * v0
    return from_start + s * s * (3 - 2 * s) * p1 + s * s * (s - 1) * d * v1


def _velocity(keys: list[Key], i: int) -> NDArray[np.float64]:
    """Return the harmonic mean of the slopes on both sides; zero at ends and turning points. Never
    overshoots.
    """
    if i in (0, len(keys) - 1):
        return np.zeros_like(keys[i][1])
    before, after = (
        (keys[j + 1][1] - keys[j][1]) / (keys[j + 1][0] - keys[j][0]) for j in (i - 1, i)
    )
    same = before * after > 0
    return np.where(same, 2 * before * after / np.where(same, before + after, 1.0), 0.0)
