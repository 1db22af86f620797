# SPDX-License-Identifier: GPL-3.0-or-later
"""Random scenes, reproducible by their number. `kinds.py` chooses the properties that groups are
made of.

Two of three scenes are for testing: their first person moves as in a recording that the lifting
network was not trained on, and no choice may be made by their results. The others, for development,
use the other recordings. Further scenes for testing show performers that nothing was trained on
(`tools.mocap.new_performers`), each as often as any other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...solver import Body
from ...solver.rotations import exp
from ...tools.readme_pictures.view import level_camera
from ...tools.train_lifter.split import is_held_out
from ..perception.held_out import Take, draw_section, floor_under, states_and_pelvis
from .kinds import CHILDREN, CLOTHES, SEED, Kind, kind_of, split_of
from .people import Person, Points
from .scene import NEW_PERFORMERS, STATIC, TEST, TRAVELLING, Block, Scene

SCENES = 60
SCENES_OF_NEW_PERFORMERS = 24
NEW_SEED = 12  # of scenes of new performers
FPS = 15.0
SECONDS = 1.2
STRIDE = 2  # frames of a recording between two of the clip
# wider than the default body's population
MAX_BETA = 4.0
BETA_SPREAD = 1.5
# a child of 0.62 has a head 1 + 0.6 * 0.38 times as large, relatively
CHILD_SCALE = (0.62, 0.85)
HEAD_GROWTH = 0.6
LOOSE_M = (0.008, 0.03)
HAIR_M = (0.0, 0.05)
FOCAL = (0.7, 1.7)  # over the longer side of the picture
HEIGHT_M = (0.5, 2.3)
DISTANCE_M = (2.2, 8.0)
# of a held camera; the share of the person's way that it follows
SHAKE_DEG = 0.3
PAN_LAG = 0.8
# of the picture's height; of its shorter side, what the person's stature appears as
MARGIN = 0.01
MIN_TALL = 0.6
MAX_HIDDEN = 0.5  # of the first person's limb joints, in all frames together, behind the block
# skin to camera; people from each other and from the block
NEAREST_M = 0.9
APART_M = 0.35
# that a camera is tested with
EVERY_VERTEX = 40
EVERY_FRAME = 4
# of all recordings, of each, and of each drawn person
TRIES = 400
TRIES_EACH = 20
CAMERAS_EACH = 20


def draw_scene(body: Body, takes: Sequence[Take], number: int, split: str | None = None) -> Scene:
    """Return the scene of that number.

    :param takes: all recordings, as of `all_takes`, of ``shared/data`` or of new performers.
    :param split: ``NEW_PERFORMERS``; None: as the number says.
    :raises ValueError: when no camera was found that has the first person in its picture.
    """
    split = split_of(number) if split is None else split
    rng = np.random.default_rng([NEW_SEED if split == NEW_PERFORMERS else SEED, number])
    own = recordings_of(takes, split)
    kind = kind_of(number, split, len(own))
    for attempt in range(TRIES):
        chosen = own[(kind.recording + attempt // TRIES_EACH) % len(own)]
        take = chosen[rng.integers(len(chosen))] if len(chosen) > 1 else chosen[0]
        first = draw_person(rng, body, take, kind.is_child, kind.wears_loose)
        if first is None:
            continue
        people = [first]
        if kind.has_company:
            other = takes[rng.integers(len(takes))]
            is_child, wears_loose = rng.random(2) < (np.mean(CHILDREN), np.mean(CLOTHES))
            second = draw_person(rng, body, other, is_child, wears_loose, len(first))
            if second is None:
                continue
            people.append(_beside(rng, body, first, second))
        for _ in range(CAMERAS_EACH):
            scene = film(rng, body, tuple(people), number, split, kind)
            if scene is not None:
                return scene
    raise ValueError(f"no camera was found for scene {number}: the limits are too narrow")


def recordings_of(takes: Sequence[Take], split: str) -> list[list[Take]]:
    """Return the recordings as which first persons of a split move: each by itself, or those of
    each new performer.
    """
    if split == NEW_PERFORMERS:
        return [
            [take for take in takes if take.performer == name]
            for name in sorted({t.performer for t in takes})
        ]
    held_out = split == TEST
    return [[take] for take in takes if bool(is_held_out(np.array(take.number))) == held_out]


def draw_person(
    rng: np.random.Generator,
    body: Body,
    take: Take,
    is_child: bool,
    wears_loose: bool,
    frames: int | None = None,
) -> Person | None:
    """Draw shape, size, clothes and a part of the take, with the feet on the floor; None if it is
    too short.

    The person stands at the origin in the middle of the clip, and is turned at random.
    """
    if round(take.fps) != STRIDE * FPS:
        return None
    try:
        section = draw_section(rng, body, take, SECONDS if frames is None else frames / FPS)[
            ::STRIDE
        ]
    except ValueError:
        return None
    if frames is not None and len(section) < frames:
        return None
    betas = np.clip(BETA_SPREAD * rng.standard_normal(body.P), -MAX_BETA, MAX_BETA)
    scale = float(rng.uniform(*CHILD_SCALE)) if is_child else 1.0
    states, pelvis = states_and_pelvis(body, take, section, betas)
    R_heading = exp(np.array([0.0, 0.0, rng.uniform(0, 2 * np.pi)]))
    states[:, 0] = R_heading @ states[:, 0]
    pelvis = pelvis @ R_heading.T
    pelvis[:, :2] -= pelvis[len(pelvis) // 2, :2]
    loose = rng.uniform(*LOOSE_M) if wears_loose else 0.0
    hair = rng.uniform(*HAIR_M)
    seed = int(rng.integers(1 << 31))
    head = 1.0 + HEAD_GROWTH * (1.0 - scale)
    person = Person(
        take.name,
        states,
        pelvis - body.rest_joints(betas)[0],
        betas,
        scale,
        head,
        loose,
        hair,
        seed,
    )
    floor = floor_under(body, _skin(body, person, every=1)) / scale
    return _moved(person, np.array([0.0, 0.0, -floor * scale]))


def _moved(person: Person, by: Points) -> Person:
    """Return the person moved by metres in the world."""
    rest = (
        person.rotations,
        person.trans + by / person.scale,
        person.betas,
        person.scale,
        person.head_scale,
    )
    return Person(person.take, *rest, person.loose_m, person.hair_m, person.seed)


def _beside(rng: np.random.Generator, body: Body, first: Person, second: Person) -> Person:
    """Return the second person somewhere around the first, as near as they keep apart."""
    angle = rng.uniform(0, 2 * np.pi)
    a = first.joints(body)
    b = second.joints(body)
    toward = np.array([np.cos(angle), np.sin(angle), 0.0])
    for distance in np.arange(0.6, 6.0, 0.2):
        gap = np.linalg.norm(a[:, :, None, :2] - b[:, None, :, :2] - distance * toward[:2], axis=-1)
        if gap.min() > APART_M:
            return _moved(second, (distance + rng.uniform(0, 1.0)) * toward)
    return _moved(second, 6.0 * toward)


def film(
    rng: np.random.Generator,
    body: Body,
    people: tuple[Person, ...],
    number: int,
    split: str,
    kind: Kind,
) -> Scene | None:
    """Draw a camera, and what stands in front of the first person; None if the person is not well
    in the picture.
    """
    first = people[0]
    frames = len(people[0])
    width, height = kind.size
    focal = rng.uniform(*FOCAL) * max(width, height)
    angle = rng.uniform(0, 2 * np.pi)
    eye_m = rng.uniform(*HEIGHT_M)
    distance = first.scale * rng.uniform(*DISTANCE_M)
    pelvis = first.joints(body)[:, 0]
    target = pelvis.mean(axis=0) + rng.normal(0, 0.15, 3)
    eye = np.array([*(target[:2] + distance * np.array([np.cos(angle), np.sin(angle)])), eye_m])
    eyes = np.tile(eye, (frames, 1))
    targets = np.tile(target, (frames, 1))
    follows = PAN_LAG * (_smooth(pelvis) - pelvis.mean(axis=0)) * [1, 1, 0]
    if kind.camera != STATIC:
        targets = targets + follows
    if kind.camera == TRAVELLING:
        eyes = (
            eyes
            + follows
            + np.linspace(0, 1, frames)[:, None] * rng.normal(0, 0.25, 3) * [1, 1, 0.2]
        )
    poses = np.array([look_at(e, t) for e, t in zip(eyes, targets, strict=True)])
    if kind.camera != STATIC:
        shake = _smooth(np.radians(SHAKE_DEG) * rng.normal(0, 3.0, (frames, 3)))
        poses[:, :3, :3] = poses[:, :3, :3] @ exp(shake)
    intrinsics = np.array([[focal, 0, width / 2 - 0.5], [0, focal, height / 2 - 0.5], [0, 0, 1]])
    block = _block(rng, body, people, eyes[0], target) if kind.has_block else None
    if kind.has_block and block is None:
        return None
    rest = (kind.size, FPS, kind.camera, kind.surroundings, block, int(rng.integers(1 << 31)))
    scene = Scene(number, split, people, intrinsics, poses, *rest)
    if block is not None and scene.hidden(first, body).mean() > MAX_HIDDEN:
        return None
    return scene if _well_inside(body, scene) else None


def look_at(eye: Points, target: Points) -> Points:
    """Return world_from_camera (4, 4) of a level camera at eye (3,) that looks at target (3,)."""
    return level_camera(eye, (target - eye) / np.linalg.norm(target - eye))


def _block(
    rng: np.random.Generator, body: Body, people: tuple[Person, ...], eye: Points, target: Points
) -> Block | None:
    """Draw a box between camera and first person that hides some of the legs, and that nobody
    touches.
    """
    joints = np.concatenate([person.joints(body).reshape(-1, 3) for person in people])
    toward = (eye - target)[:2] / np.linalg.norm((eye - target)[:2])
    tall = rng.uniform(0.3, 0.9) * people[0].scale
    half = np.append(rng.uniform(0.15, 0.7, 2), tall / 2)
    for distance in np.arange(0.5, 2.5, 0.1):
        center = np.append(target[:2] + distance * toward, tall / 2)
        gap = np.linalg.norm(np.maximum(np.abs(joints - center)[:, :2] - half[:2], 0), axis=1)
        if gap.min() > APART_M:
            outside = (np.abs(eye - center) > half + 0.3).any()
            return Block(center - half, center + half) if outside else None
    return None


def _well_inside(body: Body, scene: Scene) -> bool:
    """Return whether all of the first person is in the picture, large enough, and nobody is too
    near the camera.
    """
    width, height = scene.size
    joints = scene.project(scene.to_camera(scene.people[0].joints(body)))
    if (joints < 0).any() or (joints > np.array(scene.size) - 1).any():
        return False
    for k, person in enumerate(scene.people):
        skin = _skin(body, person, EVERY_FRAME)[:, ::EVERY_VERTEX]
        poses = scene.world_from_camera[::EVERY_FRAME]
        camera = np.einsum("tji,tvj->tvi", poses[:, :3, :3], skin - poses[:, None, :3, 3])
        if camera[..., 2].min() < NEAREST_M:
            return False
        if k == 0:
            pixels = scene.project(camera)
            margin = MARGIN * height
            if (
                pixels.min() < margin
                or (pixels.max((0, 1)) > np.array(scene.size) - 1 - margin).any()
            ):
                return False
            depth = np.median(camera[..., 2])
            if scene.intrinsics[0, 0] * person.stature_m(body) / depth < MIN_TALL * min(
                width, height
            ):
                return False
    return True


def _skin(body: Body, person: Person, every: int) -> Points:
    return np.array([person.skin(body, f) for f in range(0, len(person), every)])


def _smooth(values: Points) -> Points:
    """Return the values (T, 3), each the mean of those within a third of a second."""
    reach = round(FPS / 6)
    padded = np.pad(values, ((reach, reach), (0, 0)), mode="edge")
    sums = np.cumsum(np.concatenate([np.zeros((1, values.shape[1])), padded]), axis=0)
    smooth: Points = (sums[2 * reach + 1 :] - sums[: -2 * reach - 1]) / (2 * reach + 1)
    return smooth
