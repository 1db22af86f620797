# SPDX-License-Identifier: GPL-3.0-or-later
"""Feet and palms that stay where they rest, without looking ahead.

Contact is estimated as offline (`standing`), from a window that ends with the newest frame, and
from the speed at which heels and toes move in the image, which no fit can hold back. A point whose
probability exceeds `BEGIN` is held where it is shown then; the hold ends below `END`, or when the
body has moved too far away from it. A foot that stands is often taken for the other one while that
swings past it: meanwhile, it is let go only after `PASSED_S`, or when it rises. The next frame is
fitted to these places and to the floor (`Support`), from which the distance of the body follows.
The legs then bridge what smoothing has left between held feet and their places: they bend, and the
rest of the body stays. Where a hold begins or ends, what it would change abruptly dies away
(`Transition`).

A place can be wrong from the beginning, as after a cut of the footage, or where frames are rare and
smoothing has not yet followed. The fits then stay at that place, too, and bend the body. So a foot
that the image shows elsewhere for `DISPLACED_S` is let go, and not held for a while.

The places drift towards where the fits have the points, because an error in where a hold began
would otherwise tilt the body for as long as it lasts: fast while size and floor are being
estimated, slowly afterwards.

Where a hold begins or ends, the remainder r of an offset is what the change would add: it is taken
over, and dies away. It follows r''' = −3ω r'' − 3ω² r' − ω³ r. At a change, the difference of the
old and the new offset and that of their velocities are added to r and r', so that position,
velocity and acceleration continue; with c₀ = r, c₁ = r' + ω r and c₂ = (r'' + 2ω r' + ω² r) / 2, a
time t later r = (c₀ + c₁ t + c₂ t²) exp(−ω t).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from ...solver import Body
from ..arrays import BoolArray, Float64Array, FloatArray
from ..capture.world.placement import VISIBLE_CONFIDENCE
from ..capture.world.stance import floor_probability
from ..kinematics.contact_points import (
    CONTACT_POINTS,
    FOOT_PARTS,
    SOLES,
    contact_point_positions,
    with_contact_points,
)
from ..kinematics.leg_reach import LEGS, move_ends
from ..kinematics.standing import CONTACT_SPEED_M_S, logistic, resting_probability, speed_across
from .causal_fit import SAME_SHAPE, FittedFrame, Support

WINDOW_S = 0.6
SPEED_FRAMES = 3  # at least in the window, from which speeds can be computed
# probability of contact
BEGIN = 0.5
END = 0.3
LONGEST_STRETCH_M = 0.15  # between a held point and where the body has it
# time constants of the places, while the estimates settle and afterwards
EARLY_DRIFT_S = 0.5
DRIFT_S = 3.0
TRANSITION_HZ = 6.0  # ω / 2π
MOVED_M = 0.06  # in the image since the frame before: more than noise of a foot at rest
SWING_M_S = 0.7  # in the image, of a foot that swings past the other one
# for which, and up to which height, the other one is not let go
PASSED_S = 0.15
RISE_M = 0.03
# of a place from where the image shows the foot, and for how long
DISPLACED_M = 0.12
DISPLACED_S = 0.3
REHOLD_DELAY_S = 0.5  # after that, in which smoothing has come to where the foot really is
SOLE_ROWS = slice(len(SOLES))  # of the contact points
SOFT_M = 0.005  # the floor raises soles from about this height on


@dataclass(frozen=True)
class _Entry:
    """One frame of the window."""

    time_s: float
    points: FloatArray  # (6, 3) camera frame, metres
    visible: FloatArray  # (6,) 0..1
    # (4, 2) where the image shows the soles, normalized image coordinates
    rays: FloatArray


class FootHold:
    """Holds the contact points of one body; frames are given in order."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._betas: FloatArray | None = None
        self._with_points = body
        self._visible_parts = [
            body.joint_names.index(n) for n in (*FOOT_PARTS, "left_wrist", "right_wrist")
        ]
        self.reset()

    def reset(self) -> None:
        """Let everything go, for the person was not seen."""
        n = len(CONTACT_POINTS)
        self._window: deque[_Entry] = deque()
        self._anchors = np.zeros((n, 3))  # world
        self._is_held = np.zeros(n, bool)
        self._moving_s = np.zeros(n)  # since the contact of each point ended
        self._elsewhere_s = np.zeros(n)  # for which the image has shown each point elsewhere
        self._rehold_delay_s = np.zeros(n)  # for which each point is not held yet
        # of the soles in the image, m/s
        self._speed: FloatArray = np.zeros(len(SOLES))
        self._points_world: FloatArray | None = None
        self._shift: Float64Array = np.zeros((2, 3))  # of each foot in the last frame, world
        self._transition = Transition(2)
        self._probability: FloatArray = np.zeros(n)

    @property
    def is_holding(self) -> bool:
        """Whether a foot or palm was held in the last frame."""
        return bool(self._is_held.any())

    def support(self, T_world_camera: Float64Array, soles: FloatArray) -> Support | None:
        """Return what the body stands on in the next frame; None before the first.

        A foot that rested can have taken a step since then, the more so the rarer the frames are.
        Its place in the image then says so, before the frame is fitted.

        :param T_world_camera: (4, 4) the floor at z = 0.
        :param soles: (4, 2) where the image of the next frame shows the soles, normalized image
            coordinates.
        """
        if not self._window:
            return None
        last = self._window[-1]
        moved_m = np.linalg.norm(soles - last.rays, axis=1) * last.points[SOLE_ROWS, 2]
        contact = self._probability.copy()
        contact[SOLE_ROWS] *= logistic(8 * (1 - moved_m / MOVED_M))
        R = T_world_camera[:3, :3]
        t = T_world_camera[:3, 3]
        by_height = floor_probability(last.points @ R[2] + t[2])
        on_floor = contact * by_height
        stands = float(by_height[SOLE_ROWS].max())
        # Points that are not in contact may be below the floor as well as above it, as on stairs.
        rests = self._is_held * contact
        return Support(
            (self._anchors - t) @ R, rests, on_floor, on_floor, stands, R[2], -float(t[2])
        )

    def hold(
        self,
        time_s: float,
        betas: FloatArray,
        frame: FittedFrame,
        T_world_camera: Float64Array,
        is_settled: bool,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the frame's rotations (K+1, 3, 3) with its feet held, and the contact (6,).

        :param betas: (P,) shape.
        :param frame: smoothed.
        :param T_world_camera: (4, 4) the floor at z = 0.
        :param is_settled: whether size and floor are no longer being estimated.
        """
        if self._betas is None or np.abs(betas - self._betas).max(initial=0.0) > SAME_SHAPE:
            self._betas, self._with_points = betas, with_contact_points(self._body, betas)
        body = self._with_points
        pelvis_at_rest = self._with_points.rest_joints(betas)[0]
        R_parts, t_parts = body.forward_kinematics(
            frame.rotations, frame.root_cam - pelvis_at_rest, betas
        )
        points = contact_point_positions(body, R_parts, t_parts)
        visible = np.clip(
            frame.joint_confidence[self._visible_parts] / VISIBLE_CONFIDENCE, 0.0, 1.0
        )
        step_s = time_s - self._window[-1].time_s if self._window else 0.0
        self._window.append(_Entry(time_s, points, visible, frame.soles))
        while len(self._window) > SPEED_FRAMES and self._window[0].time_s < time_s - WINDOW_S:
            self._window.popleft()
        self._probability = self._contact(T_world_camera[2, :3])
        R = T_world_camera[:3, :3]
        t = T_world_camera[:3, 3]
        points_world = points @ R.T + t
        before = self._points_world if self._points_world is not None else points_world
        old = self._away(before), self._away(points_world)
        was_held = self._is_held
        self._release_displaced(T_world_camera, step_s)
        self._update(points_world, step_s, DRIFT_S if is_settled else EARLY_DRIFT_S)
        new = self._away(before), self._away(points_world)
        changed = (self._is_held != was_held)[SOLE_ROWS].reshape(2, 2).any(axis=1)
        self._transition.change(changed, old, new, step_s)
        self._transition.advance(step_s)
        self._points_world = points_world
        self._shift = new[1] + self._transition.remainder
        self._shift[:, 2] += _rise(
            (points_world[SOLE_ROWS, 2].reshape(2, 2) + self._shift[:, 2:]).min(axis=1)
        )
        poses = R_parts[None], t_parts[None]
        shift = (self._shift @ R)[None]
        rotations = move_ends(body, LEGS, frame.rotations[None], poses, shift)[0]
        return rotations, self._probability

    def _contact(self, up: Float64Array) -> FloatArray:
        """Return the contact probability (6,) of the newest frame.

        :param up: (3,) unit vector, camera frame.
        """
        times = np.array([entry.time_s for entry in self._window])
        points, visible, rays = (
            np.array([getattr(entry, name) for entry in self._window])
            for name in ("points", "visible", "rays")
        )
        contact: FloatArray = resting_probability(points, up, times, np.zeros((len(times), 3)))[-1]
        contact *= visible[-1]
        # Depth is left out: a mean one turns the motion in the image into metres.
        seen = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=2)
        seen *= points[:, SOLE_ROWS, 2].mean(axis=0)[:, None]
        self._speed = speed_across(seen, times, None)[-1]
        contact[SOLE_ROWS] *= logistic(4 * (1 - self._speed / CONTACT_SPEED_M_S))
        return contact

    def _release_displaced(self, T_world_camera: Float64Array, step_s: float) -> None:
        """Let go of the feet that the image has shown elsewhere for long."""
        newest = self._window[-1]
        places = (self._anchors[SOLE_ROWS] - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
        depth = np.maximum(places[:, 2:], 1e-6)
        away_m = np.linalg.norm(places[:, :2] - newest.rays * depth, axis=1)
        # Keypoints of heels and toes are not exactly where a foot touches the floor: both must be
        # away.
        is_elsewhere = (
            (self._is_held[SOLE_ROWS] & (newest.visible[SOLE_ROWS] > 0.5) & (away_m > DISPLACED_M))
            .reshape(2, 2)
            .all(axis=1)
        )
        self._elsewhere_s[SOLE_ROWS] = np.where(
            np.repeat(is_elsewhere, 2), self._elsewhere_s[SOLE_ROWS] + step_s, 0.0
        )
        is_displaced = self._elsewhere_s > DISPLACED_S
        self._rehold_delay_s = np.where(is_displaced, REHOLD_DELAY_S, self._rehold_delay_s - step_s)
        self._is_held = self._is_held & ~is_displaced

    def _update(self, points_world: FloatArray, step_s: float, drift_s: float) -> None:
        """Move the places of holds, and begin and end these."""
        contact = self._probability
        share = (1 - np.exp(-step_s / drift_s)) * (contact > END)
        self._anchors[:, :2] += share[:, None] * (points_world - self._anchors)[:, :2]
        begins = ~self._is_held & (contact > BEGIN) & (self._rehold_delay_s <= 0)
        shown = points_world.copy()
        shown[SOLE_ROWS] += np.repeat(self._shift, 2, axis=0)
        self._anchors[begins] = shown[begins]
        self._anchors[begins, 2] *= 1 - floor_probability(shown[begins, 2])
        far = np.linalg.norm(points_world - self._anchors, axis=1) > LONGEST_STRETCH_M
        self._moving_s = np.where(contact > END, 0.0, self._moving_s + step_s)
        stays = (contact > END) | self._is_passed(points_world)
        self._is_held = (self._is_held | begins) & stays & ~far

    def _is_passed(self, points_world: FloatArray) -> BoolArray:
        """Return which points (6,) are of a foot that the other one swings past, and may only seem
        to move.
        """
        swings = self._speed.reshape(2, 2).mean(axis=1) > SWING_M_S
        is_passed = np.zeros(len(points_world), bool)
        is_passed[SOLE_ROWS] = np.repeat(swings[::-1], 2)
        rise = (points_world - self._anchors)[:, 2]
        return np.asarray(is_passed & (self._moving_s < PASSED_S) & (rise < RISE_M))

    def _away(self, points_world: FloatArray) -> FloatArray:
        """Return by how much each foot (2, 3) is away from where it is held, world; 0 where it is
        not.
        """
        away = (self._anchors - points_world)[SOLE_ROWS].reshape(2, 2, 3)
        held = self._is_held[SOLE_ROWS].reshape(2, 2, 1)
        return np.asarray((held * away).sum(axis=1) / np.maximum(held.sum(axis=1), 1))


def _rise(lowest: FloatArray) -> FloatArray:
    """Return by how much feet (2,) are raised onto the floor, if that is what they stand on,
    metres.

    :param lowest: (2,) height of the lowest sole of each.
    """
    rise = SOFT_M * np.logaddexp(0.0, -lowest / SOFT_M)
    return np.asarray(rise * floor_probability(np.minimum(lowest, 0.0)))


class Transition:
    """The remainders of some offsets (n, 3)."""

    def __init__(self, n: int) -> None:
        self._r: Float64Array = np.zeros((n, 3))
        self._v = np.zeros((n, 3))
        self._a = np.zeros((n, 3))

    @property
    def remainder(self) -> Float64Array:
        """What is to be added to the present offsets (n, 3)."""
        return self._r

    def advance(self, step_s: float) -> None:
        """Let time pass."""
        w = 2 * np.pi * TRANSITION_HZ
        t = step_s
        c0 = self._r
        c1 = self._v + w * self._r
        c2 = (self._a + 2 * w * self._v + w * w * self._r) / 2
        value = c0 + (c1 + c2 * t) * t
        slope = c1 + 2 * c2 * t
        decay = np.exp(-w * t)
        self._r = value * decay
        self._v = (slope - w * value) * decay
        self._a = (2 * c2 - 2 * w * slope + w * w * value) * decay

    def change(
        self,
        where: BoolArray,
        old: tuple[FloatArray, FloatArray],
        new: tuple[FloatArray, FloatArray],
        step_s: float,
    ) -> None:
        """Take over the difference of two courses of the offsets as of the frame before; `advance`
        comes after it.

        A long step then leaves time for the difference to die away.

        :param where: (n,) which offsets change from one to the other.
        :param old: (n, 3) as they were in the frame before, and would be now.
        :param new: (n, 3) as they would have been in the frame before, and are now.
        :param step_s: seconds between the two frames.
        """
        self._r = self._r + where[:, None] * (old[0] - new[0])
        if step_s > 0:
            self._v = self._v + where[:, None] * ((old[1] - old[0]) - (new[1] - new[0])) / step_s
