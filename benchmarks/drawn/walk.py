# SPDX-License-Identifier: GPL-3.0-or-later
"""A person who walks or runs along a line or a circle, at any moment: the feet stand still exactly.

Places are metres in the world, whose z points up. With a heading of 0 degrees, people walk towards
−y, and turn counter-clockwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...scope_addon.arrays import BoolArray, Float64Array
from ...scope_addon.kinematics.axes import R_WORLD_MODEL
from ...solver import Body
from ...solver.rotations import exp
from ...tools.render_sample.choreography import arm_pose
from ...tools.render_sample.leg import solve_leg

SIDES = ("left", "right")
HALF_STANCE_WIDTH_M = 0.09
TOE_OUT_DEG = 6.0
HEEL_M = 0.05  # behind the ankle
REACH = 0.998  # of a leg that is almost straight
BOB_M = 0.02  # of the pelvis, up and down in each step
SWAY_M = 0.02  # and to the sides
STRIKE_DEG = 14.0  # of the foot as its heel touches the floor
PUSH_DEG = 28.0  # and as its toes leave it
_MIRROR = np.diag([-1.0, 1.0, 1.0])


@dataclass(frozen=True)
class Style:
    """How a gait differs from others."""

    stance: float  # of a foot's period, in which it is on the floor
    lift_m: float  # of a foot as it swings
    crouch_m: float
    bob_shift: float  # of the period
    bob: float  # of `BOB_M`
    lean_deg: float
    arm_deg: float  # by which an arm swings
    elbow_deg: float
    elbow_swing_deg: float


WALKS = Style(0.62, 0.10, 0.035, 0.0, 1.0, 4.0, 24.0, 18.0, 8.0)
RUNS = Style(0.38, 0.20, 0.075, 0.19, 2.0, 10.0, 40.0, 85.0, 0.0)


@dataclass(frozen=True)
class Pose:
    """A body at one moment."""

    rotations: Float64Array  # (K+1, 3, 3); the root's in the world, others relative to parents
    trans: Float64Array  # (3,) as in a motion file
    stands: BoolArray  # (2,) whether the left and the right foot are on the floor


@dataclass(frozen=True)
class Walk:
    """Where and how somebody walks."""

    speed_m_s: float
    period_s: float = 1.05  # of two steps
    heading_deg: float = 0.0
    start: tuple[float, float] = (0.0, 0.0)
    turn: float = 0.0  # radians per metre
    style: Style = WALKS
    gestures: int | None = None  # the seed of what the arms do; None: they swing

    @classmethod
    def around(
        cls, center: tuple[float, float], radius_m: float, heading_deg: float, gestures: int
    ) -> Walk:
        """Return a walk along a circle, with irregular gestures of both arms."""
        heading = np.radians(heading_deg)
        start = np.asarray(center) - radius_m * np.array([np.cos(heading), np.sin(heading)])
        return cls(
            0.7,
            heading_deg=heading_deg,
            start=(float(start[0]), float(start[1])),
            turn=1.0 / radius_m,
            gestures=gestures,
        )

    def place(self, distance_m: float) -> tuple[Float64Array, float]:
        """Return where (2,) the walker is after so many metres, and the yaw in radians."""
        heading = np.radians(self.heading_deg)
        yaw = heading + self.turn * distance_m
        if self.turn == 0.0:
            moved = distance_m * np.array([np.sin(yaw), -np.cos(yaw)])
        else:
            moved = np.array([np.cos(heading) - np.cos(yaw), np.sin(heading) - np.sin(yaw)])
            moved /= self.turn
        return np.asarray(self.start) + moved, float(yaw)


@dataclass(frozen=True)
class Foot:
    """A foot at one moment."""

    along_m: float  # of the walk, where its ankle is above
    lift_m: float
    pitch_deg: float  # toes down
    stands: bool


class Walker:
    """A body of some shape that walks."""

    def __init__(self, body: Body, walk: Walk, betas: Float64Array | None = None) -> None:
        """Measure the body at rest."""
        self.body = body
        self.walk = walk
        self.betas = np.zeros(body.P) if betas is None else betas
        self._joints = body.rest_joints(self.betas)
        self._at = body.joint_names.index
        ankle = self._joints[self._at("left_ankle"), 1]
        self._ankle_m = ankle - body.rest_vertices(self.betas)[:, 1].min()
        self._pelvis_m = self._joints[0, 1] - ankle + self._ankle_m - walk.style.crouch_m
        rng = np.random.default_rng(walk.gestures)
        self._rates = rng.uniform(0.25, 1.1, (2, 3, 3))  # of both arms' angles, in hertz
        self._phases = rng.uniform(0.0, 2 * np.pi, (2, 3, 3))

    def joints(self, pose: Pose) -> Float64Array:
        """Return the joints (K+1, 3) of a pose in the world."""
        _, points = self.body.forward_kinematics(pose.rotations, pose.trans, self.betas)
        return points

    def vertices(self, pose: Pose) -> Float64Array:
        """Return the skin (V, 3) of a pose in the world."""
        R, t = self.body.forward_kinematics(pose.rotations, pose.trans, self.betas)
        vertices: Float64Array = self.body.skin(R, t, self.betas)
        return vertices

    def pose(self, time_s: float) -> Pose:
        """Return the pose at a time."""
        walk = self.walk
        style = walk.style
        phase = time_s / walk.period_s
        place, yaw = walk.place(walk.speed_m_s * time_s)
        left = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        bob = style.bob * BOB_M * np.cos(4 * np.pi * (phase - style.bob_shift))
        pelvis = np.array([*place, self._pelvis_m - bob])
        pelvis += SWAY_M * np.sin(2 * np.pi * phase) * left
        swing_deg = np.sin(2 * np.pi * phase)
        rotations = np.tile(np.eye(3), (self.body.K + 1, 1, 1))
        rotations[0] = _facing(yaw) @ exp(np.radians([style.lean_deg, 5.0 * swing_deg, 0.0]))
        rotations[self._at("spine2")] = exp(np.radians([0.0, -8.0 * swing_deg, 0.0]))
        stands = []
        for number, side in enumerate(SIDES):
            foot = self._foot(time_s, 0.5 * number)
            stands.append(foot.stands)
            self._put_leg(rotations, pelvis, side, foot)
            arm = self._arm(number, time_s, phase + 0.5 * number)
            for joint, R in arm.items():
                R_side = R if side == "left" else _MIRROR @ R @ _MIRROR
                rotations[self._at(f"{side}_{joint}")] = R_side
        return Pose(rotations, pelvis - self._joints[0], np.array(stands))

    def _foot(self, time_s: float, shift: float) -> Foot:
        """Return a foot that touches the floor whenever its phase is a whole number.

        :param shift: of the foot's phase against the first one's.
        """
        walk = self.walk
        style = walk.style
        share = (time_s / walk.period_s + shift) % 1.0
        # The body is above a standing foot in the middle of its stance.
        middle_s = time_s - (share - style.stance / 2) * walk.period_s
        along_m = walk.speed_m_s * middle_s
        if share < style.stance:
            rolled = share / style.stance
            strike = STRIKE_DEG * max(0.0, 1.0 - rolled / 0.15)
            push = PUSH_DEG * max(0.0, (rolled - 0.65) / 0.35) ** 1.5
            return Foot(along_m, 0.0, push - strike, True)
        swung = (share - style.stance) / (1.0 - style.stance)
        along_m += _eased(swung) * walk.speed_m_s * walk.period_s
        lift_m = style.lift_m * float(np.sin(np.pi * swung)) ** 1.2
        push = PUSH_DEG * (1.0 - _eased(min(1.0, swung / 0.6)))
        strike = STRIKE_DEG * _eased(max(0.0, (swung - 0.6) / 0.4))
        return Foot(along_m, lift_m, push - strike, False)

    def _put_leg(
        self, rotations: Float64Array, pelvis: Float64Array, side: str, foot: Foot
    ) -> None:
        """Write the rotations of a leg whose foot is given."""
        sign = 1.0 if side == "left" else -1.0
        place, yaw = self.walk.place(foot.along_m)
        outwards = sign * np.array([np.cos(yaw), np.sin(yaw), 0.0])
        R_flat = _facing(yaw + np.radians(sign * TOE_OUT_DEG))
        R_foot = R_flat @ exp(np.radians([foot.pitch_deg, 0.0, 0.0]))
        J = self._joints
        hip, knee, ankle, toe = (
            self._at(f"{side}_{part}") for part in ("hip", "knee", "ankle", "foot")
        )
        # The foot rolls over its toes or its heel, which stays where it is.
        ahead_m = J[toe, 2] - J[ankle, 2] if foot.pitch_deg > 0 else -HEEL_M
        pivot = np.array([0.0, -self._ankle_m, ahead_m])
        target = np.array([*place, self._ankle_m + foot.lift_m])
        target += HALF_STANCE_WIDTH_M * outwards + R_flat @ pivot - R_foot @ pivot
        thigh = J[knee] - J[hip]
        shank = J[ankle] - J[knee]
        start = pelvis + rotations[0] @ (J[hip] - J[0])
        leg = target - start
        longest = REACH * (np.linalg.norm(thigh) + np.linalg.norm(shank))
        target = start + leg * min(1.0, longest / np.linalg.norm(leg))
        R_hip, R_knee = solve_leg(rotations[0], start, target, thigh, shank)
        rotations[hip] = R_hip
        rotations[knee] = R_knee
        rotations[ankle] = (rotations[0] @ R_hip @ R_knee).T @ R_foot

    def _arm(self, number: int, time_s: float, phase: float) -> dict[str, Float64Array]:
        """Return the rotations of an arm as if it were the left one."""
        style = self.walk.style
        if self.walk.gestures is None:
            swing = np.sin(2 * np.pi * phase)
            elbow = style.elbow_deg - style.elbow_swing_deg * swing
            return arm_pose(-76.0, pitch=-style.arm_deg * swing, elbow=elbow)
        angles = 2 * np.pi * self._rates[number] * time_s + self._phases[number]
        raised, pitch, elbow = np.sin(angles).mean(axis=1)
        return arm_pose(-35.0 + 50.0 * raised, pitch=25.0 + 70.0 * pitch, elbow=55.0 + 70.0 * elbow)


def _eased(share: float) -> float:
    """Return how far a smooth movement from 0 to 1 is, which begins and ends at rest."""
    return share**3 * (10.0 + share * (6.0 * share - 15.0))


def _facing(yaw: float) -> Float64Array:
    """Return the rotation (3, 3) from the model's axes to the world's at some yaw, radians."""
    R: Float64Array = exp(np.array([0.0, 0.0, yaw])) @ R_WORLD_MODEL
    return R
