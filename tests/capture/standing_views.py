# SPDX-License-Identifier: GPL-3.0-or-later
"""A person who stands, with straight or bent knees, as exact keypoints in cameras all around."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.solver import Body
from scope.solver.rotations import exp

from .exact_tracks import centred, pixels_of

# degrees; of cameras around the person, and downwards
AZIMUTHS = (0, 30, 60, 90, 150, 180)
PITCHES = (0, 12)
DISTANCE_M = 3.5
K = np.array([[1000.0, 0, 640], [0, 1000.0, 500], [0, 0, 1]])


@dataclass(frozen=True)
class StandingView:
    """One camera's view: (33, 3) ``points``, metres, camera axes, mid-hip at 0; the camera's
    ``azimuth``; (3,) up.
    """

    points: np.ndarray
    azimuth: int
    up: np.ndarray

    @property
    def pixels(self) -> np.ndarray:
        """(33, 2) exact keypoints in the image of a camera K."""
        return pixels_of(self.points + [0.0, 0.0, DISTANCE_M], K)


def standing_views(
    body: Body, bend_deg: float, betas: np.ndarray | None = None
) -> Iterator[StandingView]:
    """Yield the views of a person of this shape whose arms hang and whose knees are bent by
    ``bend_deg`` degrees.

    Hips and ankles turn by half of it each, so that the hips stay above the ankles and the trunk
    upright.
    """
    betas = np.zeros(body.P) if betas is None else betas
    points = _keypoints(body, _pose(body, bend_deg, betas), betas)
    for azimuth in AZIMUTHS:
        for pitch in PITCHES:
            around = np.radians(azimuth)
            down = np.radians(pitch)
            R = (
                exp(np.array([down, 0.0, 0.0]))
                @ np.diag([1.0, -1.0, -1.0])
                @ exp(np.array([0.0, around, 0.0]))
            )
            yield StandingView(points @ R.T, azimuth, R @ [0.0, 1.0, 0.0])


def knee_flexion(points: np.ndarray, names: tuple[str, ...] = KEYPOINT_NAMES) -> float:
    """Return the mean angle of both knees in degrees, 0 where hip, knee and ankle are in line.

    :param points: (n, 3), of which ``names`` are the names.
    """
    return float(np.mean([_flexion(*_leg(points, names, side)) for side in ("left", "right")]))


def _leg(points: np.ndarray, names: tuple[str, ...], side: str) -> tuple[np.ndarray, np.ndarray]:
    hip, knee, ankle = (
        points[names.index(f"{side}_{joint}")] for joint in ("hip", "knee", "ankle")
    )
    return hip - knee, knee - ankle


def _flexion(thigh: np.ndarray, shank: np.ndarray) -> float:
    cosine = thigh @ shank / np.linalg.norm(thigh) / np.linalg.norm(shank)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _pose(body: Body, bend_deg: float, betas: np.ndarray) -> np.ndarray:
    """Return (24, 3) rotation vectors; the knee's rest angle is taken out, so that 0 is a straight
    leg.
    """
    names = list(body.joint_names)
    rest = body.rest_joints(betas)
    thigh, shank = _leg(rest, tuple(names), "left")
    rest_bend = np.arctan2(shank[1], shank[2]) - np.arctan2(thigh[1], thigh[2])
    turn = np.radians(bend_deg) - rest_bend
    pose = np.zeros((body.K + 1, 3))
    for side, sign in (("left", -1.0), ("right", 1.0)):
        pose[names.index(f"{side}_shoulder")] = 0.0, 0.0, sign * np.radians(70.0)
        pose[names.index(f"{side}_hip")] = -turn / 2, 0.0, 0.0
        pose[names.index(f"{side}_knee")] = turn, 0.0, 0.0
        pose[names.index(f"{side}_ankle")] = -turn / 2, 0.0, 0.0
    return pose


def _keypoints(body: Body, pose: np.ndarray, betas: np.ndarray) -> np.ndarray:
    R, t = body.forward_kinematics(exp(pose)[None], np.zeros((1, 3)), betas)
    at = body.keypoint_set("blazepose")
    return centred(body.keypoints(R, t, betas)[0][[at[name] for name in KEYPOINT_NAMES]])
