# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion of the clip, written by hand: talk with an open hand, fingers that bend one by one,
surprise, a smile.

Angles are degrees in the model frame (x to the person's left, y up, z ahead), times are seconds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.axes import R_WORLD_MODEL
from ...scope_addon.kinematics.face import EXPRESSIONS
from ...solver.body import Body
from ...solver.rotations import exp
from ..render_faces.sequences import GRIMACES, INDEX, VISEMES, add_pose, with_gaze
from ..render_sample.choreography import Key, arm_keys, arm_pose, on_side, rotation_at, turns

DURATION = 4.0
FINGERS = ("index", "middle", "ring", "pinky")
# of an open hand, about the model's y axis
_SPREAD = {"index": -9.0, "middle": -2.0, "ring": 5.0, "pinky": 13.0}
_SPEECH = (
    (0.15, 0),
    (0.33, 3),
    (0.5, 1),
    (0.66, 5),
    (0.82, 0),
    (1.0, 4),
    (1.2, 2),
    (1.4, 6),
    (1.55, 0),
    (1.75, 3),
)
_SURPRISE = GRIMACES[3]
_SMILE = GRIMACES[0]
# seconds; weights frame by frame
_BLINKS = (0.55, 1.5, 3.15)
_BLINK = (0.35, 0.9, 1.0, 0.75, 0.4, 0.15)


def body_motion(
    body: Body, times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rotations (T, K+1, 3, 3), row 0 the root in the world, and trans (T, 3): the person
    stands, facing −y.
    """
    index = {name: i for i, name in enumerate(body.joint_names)}
    rotations = np.tile(np.eye(3), (len(times), body.K + 1, 1, 1))
    keys = _upper_body() | _fingers()
    for f, t in enumerate(times):
        for name, values in keys.items():
            rotations[f, index[name]] = rotation_at(values, t)
        rotations[f, 0] = R_WORLD_MODEL
    height = body.J_template[0, 1] - body.v_template[:, 1].min()
    return rotations, np.tile([0.0, 0.0, height] - body.J_template[0], (len(times), 1))


def face_motion(times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weights (T, 52) of the expressions."""
    weights = np.zeros((len(times), len(EXPRESSIONS)))
    fps = 1.0 / (times[1] - times[0])
    for start, sound in _SPEECH:
        add_pose(weights, VISEMES[sound], round(start * fps), round(0.24 * fps), 1.1)
    add_pose(weights, _SURPRISE, round(2.1 * fps), round(0.95 * fps), 0.9)
    add_pose(weights, _SMILE, round(3.05 * fps), round(0.95 * fps), 0.9)
    # looks at the raised right hand
    left = 0.5 * np.sin(np.pi * np.clip((times - 1.0) / 0.9, 0, 1))
    weights = np.array([with_gaze(w, -a, 0.0) for w, a in zip(weights, left, strict=True)])
    for start in _BLINKS:
        rows = round(start * fps) + np.arange(len(_BLINK))
        eyes = [INDEX["eyeBlinkLeft"], INDEX["eyeBlinkRight"]]
        weights[np.ix_(rows, eyes)] = np.maximum(
            weights[np.ix_(rows, eyes)], np.array(_BLINK)[:, None]
        )
    return np.clip(weights, 0.0, 1.0)


def _upper_body() -> dict[str, list[Key]]:
    ready = arm_pose(-76, ahead=12, twist=-68, elbow=139)
    raised = arm_pose(-66, ahead=20, twist=-80, elbow=142)
    shrug = arm_pose(-74, ahead=14, twist=-78, elbow=124)
    right = [
        (0.0, ready),
        (0.5, raised),
        (0.8, ready),
        (1.1, raised),
        (1.95, raised),
        (2.35, shrug),
        (3.0, shrug),
    ]
    left = [
        (0.0, ready),
        (0.9, ready),
        (1.4, arm_pose(-78, ahead=6, twist=-62, elbow=134)),
        (1.9, ready),
    ]
    left += [(2.35, shrug), (3.0, shrug), (3.5, raised), (DURATION, ready)]
    right += [(3.5, raised), (DURATION, ready)]
    keys = arm_keys(left, right)
    nods: list[tuple[float, float, float]] = [
        (0.0, 0, 4),
        (0.9, 2, -4),
        (1.9, 3, -7),
        (2.4, -5, 0),
        (3.1, 0, 3),
    ]
    nods += [(DURATION, 2, 4)]
    keys["neck"] = keys["head"] = turns(nods)
    keys["spine2"] = turns([(0.0, 0, 2), (1.2, 2, -4), (2.4, -3, 0), (4.0, 0, 2)])
    return keys


def _fingers() -> dict[str, list[Key]]:
    """Return hands that are open, the right one's fingers bent one by one from 1.1 s on and opened
    again.
    """
    keys: dict[str, list[Key]] = {}
    for number, finger in enumerate(reversed(FINGERS)):
        begin = 1.1 + 0.12 * number
        bends = [
            (0.0, 0.0),
            (begin, 0.0),
            (begin + 0.18, 75.0),
            (1.75, 75.0),
            (2.1, 0.0),
            (DURATION, 0.0),
        ]
        for part in (1, 2, 3):
            spread = _SPREAD[finger] if part == 1 else 0.0
            bent = [
                (t, exp(np.radians([0, spread * (1 - bend / 75.0), 0])) @ _bend(bend))
                for t, bend in bends
            ]
            keys[f"right_{finger}{part}"] = on_side("right", bent)
            keys[f"left_{finger}{part}"] = [(0.0, bent[0][1]), (DURATION, bent[0][1])]
    return keys


def _bend(degrees: float) -> NDArray[np.float64]:
    """Bend a finger of the left hand, which points along x, towards the palm, which faces −y."""
    return np.asarray(exp(np.radians([0.0, 0.0, -degrees])), float)
