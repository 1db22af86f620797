# SPDX-License-Identifier: GPL-3.0-or-later
"""The world of a camera, one for all people: which way is up, where the floor is, and who stands on something else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...kinematics.axes import transform_points, world_from_level_camera
from ...kinematics.contact_points import SOLES
from ..camera.line_segments import Lines
from ..camera.verticals import estimate_up_from_lines
from .balance import along, carrying, center_of_mass, legs
from .placement import PlacedTrack

STANDING_KNEE_COS = np.cos(np.radians(30.0))  # thigh and shank within 30 degrees of one line
FLOOR_NOISE_M = 0.05  # scatter of a supporting foot's depth-borne height
STANCE_M = 0.2  # what a frame's stance tells of up, as far as the centre of mass of one who stands is over the feet
ROUNDS = 2
MOMENT_S = 0.1  # length of a clip that halves what its stances tell
LEAST_CONTACT = 1e-3  # of a frame, beside the probability that a foot stands
SAME_FLOOR_M = 0.4  # how far apart, for their distances are not known well, the feet of people on one floor may seem
UP_NOISE_RAD = np.radians(5.0)  # scatter of the body's own up direction over a clip


def up_from_standing(people: Sequence[PlacedTrack]) -> np.ndarray:
    """Up direction in the camera frame from the bodies themselves: ankles to neck while they stand.

    Frames count by how straight legs and trunk are and, since who lies or does push-ups is straight as well, by how
    upright they are in the picture; without any such frame the trunk alone decides, as far as it is upright, and a
    prior of one frame's weight says that cameras are held level.

    :return: (3,) unit vector.
    """
    trunk, body_up, weight = (np.concatenate(each) for each in zip(*map(_straightness, people), strict=True))
    level = np.array([0.0, -1.0, 0.0])
    weight *= np.maximum(body_up @ level, 0.0) ** 4
    if weight.sum() < 1.0:
        total = level + (np.maximum(trunk @ level, 0.0)[:, None] ** 2 * trunk).mean(0)
    else:
        total = level + (weight[:, None] * body_up).sum(0)
    if np.linalg.norm(total) < 1e-6:
        total = level
    return total / np.linalg.norm(total)


def _straightness(person: PlacedTrack) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions (T, 3) of trunk and body, and how straight the body is (T,), in the frames in which it was seen."""
    trunk = along(person.body, person.joints, "pelvis", "neck")
    straightness = np.ones(len(trunk))
    lower = np.zeros_like(trunk)
    for shank, thigh in legs(person.body, person.joints):
        straight = (shank * thigh).sum(1)
        straightness *= np.clip((straight - STANDING_KNEE_COS) / (1 - STANDING_KNEE_COS), 0, 1)
        lower += 0.5 * (shank + thigh)
    body_up = lower + trunk
    body_up /= np.maximum(np.linalg.norm(body_up, axis=1, keepdims=True), 1e-9)
    straightness *= np.clip(((lower / 2) * trunk).sum(1), 0, 1) ** 8
    return trunk[person.valid], body_up[person.valid], straightness[person.valid]


def up_from_bodies(people: Sequence[PlacedTrack]) -> np.ndarray:
    """Up direction in the camera frame from people who stand, walk or bend: their weight is over their feet.

    With d_t from the middle of what stands to the centre of mass, w_t the probability that a sole stands and no palm
    rests, and u_0 what the bodies' own axes say (`up_from_standing`),

        Σ_t (a u_0 + b w_t k_t max(y·d_t / |d_t|, 0)² d_t)

    points up, a being a length (`STANCE_M`). Forces average out over a clip, not in a moment: b grows from 0 to 1 with
    its length.
    Those who sit, kneel or lie have feet that keep still as well: k_t, which falls from 1 to 0 where both knees bend by
    60 to 75 degrees, and y, up in the picture, leave them out as far as they can.

    :return: (3,) unit vector.
    """
    start = up_from_standing(people)
    level, up = np.array([0.0, -1.0, 0.0]), start
    masses = [center_of_mass(each.body, each.joints) for each in people]
    carried = [carrying(each.body, each.joints) for each in people]
    for _ in range(ROUNDS):
        total = np.zeros(3)
        for each, mass, carries in zip(people, masses, carried, strict=True):
            contact = each.contact(up)
            above = mass - each.stands_at(contact)
            upright = np.maximum(above @ level, 0.0) / np.maximum(np.linalg.norm(above, axis=1), 1e-9)
            on_hands = contact[:, len(SOLES) :].max(axis=1, initial=0.0)
            weight = contact[:, : len(SOLES)].max(axis=1) * (1 - on_hands) * carries * upright**2
            lasts_s = float(np.ptp(each.times))
            total += STANCE_M * each.valid.sum() * start + lasts_s / (lasts_s + MOMENT_S) * (weight @ above)
        up = total / np.linalg.norm(total)
    return up


def up_from_floor(feet_cam: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Turns ``up`` so that the supporting feet lie in one level plane, as far as they are spread over the floor.

    Minimizes Σ_k (n·p̃_k)²/σ_floor² + N ‖n − up‖²/σ_up² over n, p̃ the lowest foot point of each frame less their median.

    :param feet_cam: (T, F, 3) points of the soles in the camera frame.
    """
    lowest = _lowest(feet_cam, up)
    p = lowest - np.median(lowest, axis=0)
    off = np.abs(p @ up)
    p = p[off <= max(3 * np.median(off), 1e-3)]  # jumps and misses do not support anybody
    kappa = len(p) * (FLOOR_NOISE_M / UP_NOISE_RAD) ** 2
    n = np.linalg.solve(p.T @ p + kappa * np.eye(3), kappa * up)
    return n / np.linalg.norm(n)


def upright(up_body: np.ndarray, feet_cam: np.ndarray, lines: Lines | None) -> np.ndarray:
    """(3,) up, from what bodies say: by the lines of the background, or else by where the feet were.

    Lines that only tell what is level in one direction, such as a fence's, take out what is not upright to it.
    """
    told = estimate_up_from_lines(lines or Lines.none(), up_body)
    if told.up is not None:
        return told.up
    up = up_from_floor(feet_cam, up_body)
    if told.level is not None:
        up = up - (up @ told.level) * told.level
    return up / np.linalg.norm(up)


def floor_height(soles_cam: np.ndarray, contact: np.ndarray, up: np.ndarray) -> float:
    """Height, along ``up`` from the camera, of what a person stands on: of each frame's lowest sole, the median.

    Frames count as far as anything stands in them: who jumps or climbs for most of a clip is not on the floor then.
    Feet that keep still in the air, of one who hangs by the hands, seem to stand. Where nothing ever stands, all
    frames count alike.

    :param soles_cam, contact: (T, F, 3) and (T, F) the probability that each stands.
    """
    lowest = (soles_cam @ up).min(axis=1)
    weight = contact.max(axis=1) + LEAST_CONTACT
    order = np.argsort(lowest)
    sums = np.cumsum(weight[order])
    return float(lowest[order[np.searchsorted(sums, 0.5 * sums[-1])]])


@dataclass(frozen=True)
class SharedWorld:
    """``T_world_camera`` (4, 4) for everybody, and the height of each person's own floor in it, metres."""

    T_world_camera: np.ndarray
    floors_m: list[float]

    @property
    def up(self) -> np.ndarray:
        """(3,) unit vector, in the first frame's camera axes."""
        return self.T_world_camera[2, :3]

    def floor_from_camera(self, person: int) -> np.ndarray:
        """(4, 4) as ``T_world_camera``, with the person's own floor at z = 0."""
        T = self.T_world_camera.copy()
        T[2, 3] -= self.floors_m[person]
        return T


def share_world(placed: list[PlacedTrack], lines: Lines | None = None) -> SharedWorld:
    """World of a static camera: z up, from the background's lines, or from all bodies and floors together; the floor at
    z = 0 and the origin below the first position of the first, most prominent person.

    Each person's feet count from their own mean place, so that neither a step nor a wrong distance tilts the world.
    """
    all_soles = [person.soles[person.valid] for person in placed]
    up = up_from_bodies(placed)
    centered = [soles - _lowest(soles, up).mean(axis=0) for soles in all_soles]
    up = upright(up, np.concatenate(centered), lines)
    stands = [person.contact(up)[person.valid, : len(SOLES)] for person in placed]
    heights = [floor_height(soles, contact, up) for soles, contact in zip(all_soles, stands, strict=True)]
    T_world_camera = world_from_level_camera(up, height=-heights[0])
    start = transform_points(T_world_camera, placed[0].joints[placed[0].valid.argmax(), :1])[0]
    T_world_camera[:2, 3] -= start[:2]
    own = [height - heights[0] for height in heights]
    return SharedWorld(T_world_camera, [h if abs(h) > SAME_FLOOR_M else 0.0 for h in own])


def _lowest(soles_cam: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(T, 3) the lowest sole point of each frame."""
    return soles_cam[np.arange(len(soles_cam)), (soles_cam @ up).argmin(axis=1)]
