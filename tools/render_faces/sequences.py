# SPDX-License-Identifier: GPL-3.0-or-later
"""What the rendered faces do: single poses drawn at random, and talk and grimaces at 30 frames a
second.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.face import EXPRESSIONS
from ...solver.rotations import exp

FPS = 30
# degrees, largest
YAW = 45.0
PITCH = 20.0
ROLL = 15.0
INDEX = {name: k for k, name in enumerate(EXPRESSIONS)}
_OPPOSITE = (("jawLeft", "jawRight"), ("mouthLeft", "mouthRight"), ("mouthFunnel", "mouthPucker"))
_GAZE = [name for name in EXPRESSIONS if name.startswith("eyeLook")]
_OTHERS = [
    name
    for name in EXPRESSIONS
    if not name.startswith(("eyeLook", "eyeBlink", "tongue", "mouthClose"))
]

# What the mouth does in speech, by sound.
VISEMES: tuple[dict[str, float], ...] = (
    {"jawOpen": 0.55, "mouthLowerDownLeft": 0.3, "mouthLowerDownRight": 0.3},  # a
    {
        "jawOpen": 0.25,
        "mouthStretchLeft": 0.3,
        "mouthStretchRight": 0.3,
        "mouthSmileLeft": 0.2,
        "mouthSmileRight": 0.2,
    },
    {"jawOpen": 0.12, "mouthSmileLeft": 0.35, "mouthSmileRight": 0.35},  # i
    {"jawOpen": 0.3, "mouthFunnel": 0.6},  # o
    {"jawOpen": 0.12, "mouthPucker": 0.7},  # u
    # m, p
    {"mouthPressLeft": 0.5, "mouthPressRight": 0.5, "mouthRollLower": 0.3, "mouthRollUpper": 0.2},
    # f
    {"mouthRollLower": 0.6, "mouthUpperUpLeft": 0.2, "mouthUpperUpRight": 0.2, "jawOpen": 0.06},
    {"jawOpen": 0.3, "mouthClose": 0.28},  # n, lips closed over an open jaw
    {},
)
GRIMACES: tuple[dict[str, float], ...] = (
    {
        "mouthSmileLeft": 0.9,
        "mouthSmileRight": 0.9,
        "cheekSquintLeft": 0.6,
        "cheekSquintRight": 0.6,
    },
    {"mouthFrownLeft": 0.8, "mouthFrownRight": 0.8, "browInnerUp": 0.8, "mouthShrugLower": 0.5},
    {
        "noseSneerLeft": 0.9,
        "noseSneerRight": 0.9,
        "browDownLeft": 0.8,
        "browDownRight": 0.8,
        "eyeSquintLeft": 0.5,
        "eyeSquintRight": 0.5,
    },
    {
        "jawOpen": 0.9,
        "eyeWideLeft": 0.9,
        "eyeWideRight": 0.9,
        "browOuterUpLeft": 0.8,
        "browOuterUpRight": 0.8,
        "browInnerUp": 0.7,
    },
    {"cheekPuff": 0.9, "mouthPucker": 0.3},
    {"mouthLeft": 0.8, "mouthDimpleLeft": 0.5},
    {"mouthRight": 0.7, "eyeBlinkRight": 0.9, "mouthSmileRight": 0.5},
    {"jawLeft": 0.7, "jawOpen": 0.3},
    {"jawForward": 0.8, "mouthShrugUpper": 0.5},
    {"mouthPucker": 0.95},
)


@dataclass(frozen=True)
class FaceClip:
    """T frames of N people: weights, head pose in the camera frame, and the camera's focal
    length.
    """

    weights: NDArray[np.float64]  # (T, 52)
    # (T, 3, 3); the head's axes are the model's: x to the person's left, y up
    R_camera_head: NDArray[np.float64]
    distance: NDArray[np.float64]  # (T,) metres of the point between the eyes
    person: NDArray[np.intp]  # (T,)
    seconds: NDArray[np.float64]  # (T,)
    # (T, 3) metres by which the head is beside that distance along the camera's axis
    shift: NDArray[np.float64]

    @property
    def middle(self) -> NDArray[np.float64]:
        """(T, 3) the point between the eyes in the camera frame, metres."""
        return self.shift + self.distance[:, None] * [0.0, 0.0, 1.0]


def random_poses(rng: np.random.Generator, people: int, each: int) -> FaceClip:
    """Draw unrelated poses: ``each`` of every person, the first of them neutral and frontal."""
    T = people * each
    weights = np.zeros((T, len(EXPRESSIONS)))
    angles = rng.uniform(-1, 1, (T, 3)) * [PITCH, YAW, ROLL]
    for t in range(T):
        if t % each == 0:
            angles[t] *= 0.1
        elif rng.uniform() > 0.1:
            _draw_weights(weights[t], rng)
    distance = rng.uniform(0.45, 1.6, T)
    person = np.repeat(np.arange(people), each)
    return FaceClip(
        weights, _rotations(angles), distance, person, np.arange(T) / FPS, np.zeros((T, 3))
    )


def _draw_weights(w: NDArray[np.float64], rng: np.random.Generator) -> None:
    for name in rng.choice(_OTHERS, rng.integers(1, 6), replace=False):
        w[INDEX[name]] = rng.uniform(0.1, 1.0)
        if name.endswith(("Left", "Right")) and rng.uniform() < 0.7:
            other = name.replace("Left", "?").replace("Right", "Left").replace("?", "Right")
            if (name, other) not in _OPPOSITE and (other, name) not in _OPPOSITE:
                w[INDEX[other]] = w[INDEX[name]]
    if rng.uniform() < 0.35:
        w[INDEX["jawOpen"]] = rng.uniform(0, 1)
    if rng.uniform() < 0.15:
        w[INDEX["jawOpen"]] = rng.uniform(0.1, 0.6)
        w[INDEX["mouthClose"]] = w[INDEX["jawOpen"]] * rng.uniform(0.5, 1.0)
    for a, b in _OPPOSITE:
        w[INDEX[a if rng.uniform() < 0.5 else b]] = 0.0
    if rng.uniform() < 0.35:
        w[INDEX["eyeBlinkLeft"]] = w[INDEX["eyeBlinkRight"]] = rng.uniform(0, 1)
        if rng.uniform() < 0.25:
            w[INDEX[f"eyeBlink{rng.choice(['Left', 'Right'])}"]] = rng.uniform(0, 1)
    if rng.uniform() < 0.6:
        w[:] = with_gaze(w, rng.uniform(-1, 1), rng.uniform(-1, 1))


def with_gaze(w: NDArray[np.float64], left: float, up: float) -> NDArray[np.float64]:
    """Return weights (52,) with both eyes turned to the person's left and up, each from -1 to 1."""
    out = w.copy()
    values = {
        "OutLeft": left, "InRight": left, "InLeft": -left, "OutRight": -left,
        "UpLeft": up, "UpRight": up, "DownLeft": -up, "DownRight": -up,
    }  # fmt: skip
    for name, value in values.items():
        out[INDEX[f"eyeLook{name}"]] = max(value, 0.0)
    return out


def talk_and_grimaces(rng: np.random.Generator, people: int, seconds: float) -> FaceClip:
    """Draw a clip for each person: the first half of the time he talks, in the other he makes
    faces; he blinks.
    """
    T = round(seconds * FPS)
    clips = [_one_person(rng, T) for _ in range(people)]
    weights, angles, distance = (np.concatenate(parts) for parts in zip(*clips, strict=True))
    times = np.tile(np.arange(T) / FPS, people)
    person = np.repeat(np.arange(people), T)
    return FaceClip(weights, _rotations(angles), distance, person, times, np.zeros((len(times), 3)))


def turned_away(clip: FaceClip) -> FaceClip:
    """Return the clip with heads turned by 45° to 60°, every second person's to the other side."""
    phase = 2 * np.pi * clip.seconds
    side = np.where(clip.person % 2, 1.0, -1.0)
    yaw = side * (52.5 + 7.5 * np.sin(0.4 * phase))
    angles = np.stack([6.0 * np.sin(0.3 * phase), yaw, 5.0 * np.sin(0.2 * phase)], axis=1)
    return replace(clip, R_camera_head=_rotations(angles))


def in_motion(clip: FaceClip) -> FaceClip:
    """Return the clip with heads that shake by 20° and nod by 8°, 3 and 2 cm to and fro, more than
    once a second.
    """
    phase = 2 * np.pi * (clip.seconds + 0.3 * clip.person)
    shaking = np.sin(1.1 * phase)
    nodding = np.sin(1.7 * phase)
    turn = exp(np.radians(np.stack([8.0 * nodding, 20.0 * shaking, 0 * phase], axis=1)))
    shift = np.stack([0.03 * shaking, 0.02 * nodding, 0 * phase], axis=1)
    return replace(clip, R_camera_head=np.asarray(clip.R_camera_head @ turn, float), shift=shift)


def _one_person(
    rng: np.random.Generator, T: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    half = T // 2
    weights = np.zeros((T, len(EXPRESSIONS)))
    t = rng.integers(8, 14)  # at rest at first
    while t < half:
        length = int(rng.integers(3, 7))
        add_pose(weights, VISEMES[rng.integers(len(VISEMES))], t, length + 3, rng.uniform(0.7, 1.2))
        t += length
    t = half + 4
    while t < T - 12:
        length = int(rng.integers(18, 28))
        add_pose(weights, GRIMACES[rng.integers(len(GRIMACES))], t, length, rng.uniform(0.8, 1.05))
        t += length + int(rng.integers(0, 6))
    gaze = np.zeros((T, 2))
    t = 0
    while t < T:
        length = int(rng.integers(12, 30))
        gaze[t : t + length] = rng.uniform(-0.7, 0.7, 2) * (rng.uniform() < 0.6)
        t += length
    weights = np.array([with_gaze(w, *g) for w, g in zip(weights, gaze, strict=True)])
    t = int(rng.integers(15, 35))
    blinks = [INDEX["eyeBlinkLeft"], INDEX["eyeBlinkRight"]]
    shape = np.array([0.35, 0.9, 1.0, 0.75, 0.4, 0.15])
    while t < T - len(shape):
        weights[t : t + len(shape), blinks] = np.maximum(
            weights[t : t + len(shape), blinks], shape[:, None]
        )
        t += int(rng.integers(40, 75))
    s = np.arange(T)[:, None] / FPS
    phase = rng.uniform(0, 2 * np.pi, 3)
    turn = rng.uniform(-30, 30)
    angles = np.array([6.0, 13.0, 5.0]) * np.sin(
        2 * np.pi * s * rng.uniform(0.15, 0.4, 3) + phase
    ) + [0, turn, 0]
    distance = np.full(T, rng.uniform(0.5, 1.4))
    return np.clip(weights, 0, 1), angles, distance


def add_pose(
    weights: NDArray[np.float64], pose: dict[str, float], start: int, length: int, strength: float
) -> None:
    """Add a pose that comes and goes: in, held in the middle, out."""
    t = np.arange(min(length, len(weights) - start))
    rise = max(2, length // 4)
    share = np.clip(np.minimum(t / rise, (length - t) / rise), 0, 1)
    bump = share * share * (3 - 2 * share)
    for name, value in pose.items():
        weights[start : start + len(t), INDEX[name]] += strength * value * bump


def _rotations(angles_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return R_camera_head (T, 3, 3) from pitch, yaw and roll; all zero looks into the camera."""
    frontal = np.diag([1.0, -1.0, -1.0])
    x, y, z = np.radians(angles_deg).T
    axes = [
        exp(np.stack([a if k == i else np.zeros_like(a) for i in range(3)], axis=1))
        for k, a in enumerate((x, y, z))
    ]
    return np.asarray(frontal @ axes[2] @ axes[1] @ axes[0], float)
