# SPDX-License-Identifier: GPL-3.0-or-later
"""The world that all people share: up direction, floor, and the floors of people who stand on
something else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....solver.body import Body
from ...arrays import BoolArray, Float64Array, FloatArray, unit_vectors
from ...kinematics.axes import transform_points, world_from_level_camera
from ...kinematics.contact_points import SOLES
from ..camera.line_segments import Lines
from ..camera.verticals import estimate_up_from_lines
from .balance import center_of_mass, direction, leg_directions, leg_support
from .placement import PlacedTrack

# The straightness of a leg whose knee is bent by 30 degrees is 0.
STANDING_KNEE_COS = np.cos(np.radians(30.0))
FLOOR_NOISE_M = 0.05  # σ_floor, scatter of a foot's height on the floor, which depends on its depth
STANCE_M = 0.2  # a, weight of u_0 relative to the displacement of the centre of mass from the feet
ROUNDS = 2
MOMENT_S = 0.1  # length of a clip in which the weight b is halved
MIN_CONTACT = 1e-3  # added to the contact probability of a frame
# The feet of people on one floor may differ so much in height, as their distances are uncertain.
SAME_FLOOR_M = 0.4
UP_NOISE_RAD = np.radians(5.0)  # σ_up, error of an up direction estimated from bodies
# How far under the soles the rest of a body has to be for it to rest on something else than the
# feet: in part, and entirely.
PARTLY_UNDER_M = 0.1
WHOLLY_UNDER_M = 0.2
FIRST_S = 0.5  # on uneven ground, of the contact that determines the floor
LEVEL_UP = (0.0, -1.0, 0.0)  # up in the axes of a level camera
# What the up direction follows from: edges of the background, how people stand and move, the floor
# past which a camera travels, or the path of the camera that the user gives.
LINES = "lines"
BODIES = "bodies"
FLOOR = "floor"
GIVEN = "given"
# Standard deviations of the up direction, degrees, in (clips, still images): the root mean square
# of its errors in five clips and five pictures of people whose true up direction is known, most of
# them with lines; that of the floor in seven rendered clips with a travelling camera.
UP_DEVIATIONS_DEG = {LINES: (1.5, 4.0), BODIES: (3.5, 11.0), FLOOR: (0.9, 0.9), GIVEN: (0.0, 0.0)}


def up_from_standing(people: Sequence[PlacedTrack]) -> Float64Array:
    """Estimate the up direction from standing bodies: from ankles to neck.

    Frames are weighted by how straight legs and trunk are. People lying down or doing push-ups are
    straight as well, so the weight also depends on how upright a person is in the image. If no
    frame has weight, the trunk alone is used, as far as it is upright. A prior with the weight of
    one frame assumes a level camera.

    :return: (3,) unit vector, camera axes.
    """
    trunk, body_up, weight = (
        np.concatenate(each) for each in zip(*map(_straightness, people), strict=True)
    )
    level = np.array(LEVEL_UP)
    weight *= np.maximum(body_up @ level, 0.0) ** 4
    if weight.sum() < 1.0:
        total = level + (np.maximum(trunk @ level, 0.0)[:, None] ** 2 * trunk).mean(0)
    else:
        total = level + (weight[:, None] * body_up).sum(0)
    return _unit(total)


def _straightness(person: PlacedTrack) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return directions (n, 3) of trunk and body, and how straight the body is (n,), in the n
    frames it was seen in.
    """
    trunk = direction(person.body, person.joints, "pelvis", "neck")
    straightness = np.ones(len(trunk))
    lower = np.zeros_like(trunk)
    for shank, thigh in leg_directions(person.body, person.joints):
        straight = (shank * thigh).sum(1)
        straightness *= np.clip((straight - STANDING_KNEE_COS) / (1 - STANDING_KNEE_COS), 0, 1)
        lower += 0.5 * (shank + thigh)
    body_up = unit_vectors(lower + trunk)
    straightness *= np.clip(((lower / 2) * trunk).sum(1), 0, 1) ** 8
    return trunk[person.valid], body_up[person.valid], straightness[person.valid]


def up_from_bodies(people: Sequence[PlacedTrack]) -> Float64Array:
    """Estimate the up direction from people who stand, walk or bend: their weight is above their
    feet.

    With d_t from the centre of the contact points to the centre of mass, w_t the probability that a
    sole is in contact and no palm is, and u_0 the direction of the bodies themselves
    (`up_from_standing`),

        Σ_t (a u_0 + b w_t k_t max(y·d_t / |d_t|, 0)² d_t)

    points up, where a is a length (`STANCE_M`). Inertial forces average out over a clip, but not in
    a single moment: b grows from 0 to 1 with the length of the clip. People who sit, kneel or lie
    have feet at rest as well. They are largely excluded by k_t, which falls from 1 to 0 while both
    knees bend from 60 to 75 degrees, and by y, up in the image.

    :return: (3,) unit vector, camera axes.
    """
    start = up_from_standing(people)
    level = np.array(LEVEL_UP)
    up = start
    masses = [center_of_mass(each.body, each.joints) for each in people]
    support = [leg_support(each.body, each.joints) for each in people]
    for _ in range(ROUNDS):
        total = np.zeros(3)
        for each, mass, supported in zip(people, masses, support, strict=True):
            contact = each.contact(up)
            above = mass - each.contact_center(contact)
            upright = np.maximum(above @ level, 0.0) / np.maximum(
                np.linalg.norm(above, axis=1), 1e-9
            )
            on_hands = contact[:, len(SOLES) :].max(axis=1, initial=0.0)
            weight = contact[:, : len(SOLES)].max(axis=1) * (1 - on_hands) * supported * upright**2
            duration_s = float(np.ptp(each.times))
            total += STANCE_M * each.valid.sum() * start + duration_s / (duration_s + MOMENT_S) * (
                weight @ above
            )
        up = _unit(total)
    return up


def up_from_floor(feet_cam: FloatArray, up: FloatArray) -> Float64Array:
    """Rotate ``up`` so that feet in contact lie in one horizontal plane, as far as they are spread
    over the floor.

    Minimizes Σ_k (n·p̃_k)²/σ_floor² + N ‖n − up‖²/σ_up² over n, with p̃ the lowest foot point of
    each frame minus their median.

    :param feet_cam: (T, F, 3) points of the soles, camera axes, metres.
    :param up: (3,) unit vector, camera axes.
    :return: (3,) unit vector, camera axes.
    """
    lowest = _lowest(feet_cam, up)
    p = lowest - np.median(lowest, axis=0)
    off = np.abs(p @ up)
    # Jumps and outliers, in which nothing is in contact, do not count.
    p = p[off <= max(3 * np.median(off), 1e-3)]
    kappa = len(p) * (FLOOR_NOISE_M / UP_NOISE_RAD) ** 2
    return _unit(np.linalg.solve(p.T @ p + kappa * np.eye(3), kappa * up))


def up_from_scene(
    up_body: FloatArray, feet_cam: FloatArray | None, lines: Lines | None
) -> tuple[FloatArray, str]:
    """Correct the up direction of the bodies by the lines of the background or, failing that, by
    the feet.

    Lines that determine only one horizontal direction, such as a fence's, remove the component
    along it.

    :param up_body: (3,) unit vector, camera axes.
    :param feet_cam: (T, F, 3) points of the soles, camera axes, metres; None: they are not on one
        floor.
    :return: (3,) unit vector, camera axes; `LINES` if lines alone determine it, else `BODIES`.
    """
    estimate = estimate_up_from_lines(lines or Lines.none(), up_body)
    if estimate.up is not None:
        return estimate.up, LINES
    up = up_body if feet_cam is None else up_from_floor(feet_cam, up_body)
    if estimate.level is not None:
        up = up - (up @ estimate.level) * estimate.level
    return _unit(up), BODIES


def floor_height(soles_cam: FloatArray, contact: FloatArray, up: FloatArray) -> float:
    """Estimate the height of a person's floor above the camera: the weighted median of each frame's
    lowest sole point.

    Frames are weighted by contact, because people who jump or climb for most of a clip are not on
    the floor then. (Feet that hang still in the air seem to be in contact, though.) If there is no
    contact at all, all frames count equally.

    :param soles_cam: (T, F, 3) points of the soles, camera axes, metres.
    :param contact: (T, F) contact probability of each point.
    :param up: (3,) unit vector, camera axes.
    """
    return _weighted_median((soles_cam @ up).min(axis=1), contact)


def resting_height(person: PlacedTrack, contact: FloatArray, up: FloatArray) -> float:
    """Estimate the height of a person's floor above the camera from whatever they rest on.

    The soles determine it (`floor_height`), unless the rest of the body is clearly under them, as
    when somebody lies on the floor, does a handstand, or does push-ups with raised feet. With d
    from the floor of the whole body up to that of the soles, the floor is lower than that of the
    soles by 0 up to d = a, by d from d = b on, and in between by b (d − a)/(b − a).

    :param contact: (n, F) contact probability of each sole point in the n frames they were seen in.
    :param up: (3,) unit vector, camera axes.
    """
    seen = person.valid
    height_of_soles = floor_height(person.soles[seen], contact, up)
    lowest_joints = (person.joints[seen] @ up - flesh_radii(person.body, person.betas)).min(axis=1)
    lowest = np.minimum((person.contact_points[seen] @ up).min(axis=1), lowest_joints)
    under_m = height_of_soles - _weighted_median(lowest, contact)
    # Soles that are not in the image are a guess, and so is what lies under them.
    under_m *= float(np.median(person.contact_points_visible[seen, : len(SOLES)].max(axis=1)))
    share = (under_m - PARTLY_UNDER_M) / (WHOLLY_UNDER_M - PARTLY_UNDER_M)
    return height_of_soles - min(max(share, 0.0) * WHOLLY_UNDER_M, max(under_m, 0.0))


def flesh_radii(body: Body, betas: FloatArray) -> Float64Array:
    """Return the (K+1,) distance of each joint from the nearest skin that moves with it, metres; 0
    of a joint without skin.
    """
    vertices = body.rest_vertices(betas)
    joints = body.rest_joints(betas)
    radii = np.zeros(len(joints))
    for k, joint in enumerate(joints):
        own = vertices[body.strongest_joints == k]
        if len(own):
            radii[k] = np.linalg.norm(own - joint, axis=1).min()
    return radii


def _weighted_median(heights: FloatArray, contact: FloatArray) -> float:
    """Return the median of the heights (T,), weighted by the contact (T, F) in each frame."""
    weight = contact.max(axis=1) + MIN_CONTACT
    order = np.argsort(heights, kind="stable")
    sums = np.cumsum(weight[order])
    return float(heights[order[np.searchsorted(sums, 0.5 * sums[-1])]])


@dataclass(frozen=True)
class SharedWorld:
    """``T_world_camera`` (4, 4) for all people, and the height of each person's own floor in that
    world, metres.

    ``up_source``: what the up direction follows from, `LINES`, `BODIES`, `FLOOR` or `GIVEN`.
    """

    T_world_camera: Float64Array
    floors_m: list[float]
    up_source: str

    @property
    def up(self) -> Float64Array:
        """The (3,) unit vector in the first frame's camera axes."""
        return self.T_world_camera[2, :3]

    def floor_from_camera(self, person: int) -> Float64Array:
        """Return ``T_world_camera`` (4, 4) with the person's own floor at z = 0."""
        T = self.T_world_camera.copy()
        T[2, 3] -= self.floors_m[person]
        return T


def find_world(
    placed: list[PlacedTrack],
    lines: Lines | None = None,
    floor_up: FloatArray | None = None,
    T_world_first: Float64Array | None = None,
) -> SharedWorld:
    """Estimate the world: z up, the floor at z = 0, the origin below the first position of the most
    prominent person.

    The up direction is estimated from the background's lines, or from all bodies and floors
    together. Each person's feet are taken relative to their own mean position, so that neither a
    step nor a wrong distance tilts the world. On uneven ground, feet do not determine the up
    direction, and everybody's floor is what they stand on at first. In a still image, everybody's
    floor is what they stand on, too: whoever was brought to another floor would leave the image.

    :param placed: the most prominent person first.
    :param lines: of the background, in the first frame's camera axes.
    :param floor_up: (3,) of the floor that a travelling camera passes, in the same axes. It is
        used instead, except on uneven ground.
    :param T_world_first: (4, 4) of the first frame's camera in a given world, of which only the
        floor's height is estimated.
    """
    all_soles = [person.soles[person.valid] for person in placed]
    up = up_from_bodies(placed)
    centered = np.concatenate([soles - _lowest(soles, up).mean(axis=0) for soles in all_soles])
    if T_world_first is not None:
        up = T_world_first[2, :3]
        up_source = GIVEN
    elif floor_up is not None and not placed[0].uneven_ground:
        up, up_source = floor_up, FLOOR
    else:
        up, up_source = up_from_scene(up, None if placed[0].uneven_ground else centered, lines)
    contacts = [person.contact(up)[person.valid, : len(SOLES)] for person in placed]
    heights = []
    for person, soles, contact in zip(placed, all_soles, contacts, strict=True):
        if person.uneven_ground:
            rows = _first_contact(contact, person.times[person.valid])
            heights.append(floor_height(soles[rows], contact[rows], up))
        else:
            heights.append(resting_height(person, contact, up))
    T_world_camera = _on_floor(T_world_first, up, heights[0], placed[0])
    relative = [height - heights[0] for height in heights]
    same_m = SAME_FLOOR_M if len(placed[0].times) > 1 else 0.0
    return SharedWorld(T_world_camera, [h if abs(h) > same_m else 0.0 for h in relative], up_source)


def _on_floor(
    T_world_first: Float64Array | None, up: FloatArray, floor_m: float, first: PlacedTrack
) -> Float64Array:
    """Return the pose (4, 4) of the first frame's camera in the world whose floor is at z = 0.

    :param T_world_first: (4, 4) in a given world; None: the most prominent person begins at the
        origin.
    :param floor_m: the floor's height above the camera.
    """
    if T_world_first is not None:
        T_world_camera = T_world_first.copy()
        T_world_camera[2, 3] = -floor_m
        return T_world_camera
    T_world_camera = world_from_level_camera(up, height=-floor_m)
    start = transform_points(T_world_camera, first.joints[first.valid.argmax(), :1])[0]
    T_world_camera[:2, 3] -= start[:2]
    return T_world_camera


def _first_contact(contact: FloatArray, times: Float64Array) -> BoolArray:
    """Return the frames (T,) until somebody has been on the ground for `FIRST_S` altogether."""
    if len(times) < 2:
        return np.ones(len(times), np.bool_)
    on_ground_s = contact.max(axis=1) * np.gradient(times)
    return np.cumsum(on_ground_s) - on_ground_s < FIRST_S


def _lowest(soles_cam: FloatArray, up: FloatArray) -> FloatArray:
    """Return the (T, 3) lowest sole point of each frame."""
    return soles_cam[np.arange(len(soles_cam)), (soles_cam @ up).argmin(axis=1)]


def _unit(vector: FloatArray) -> Float64Array:
    return vector / np.linalg.norm(vector)
