# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene: people, a camera that may move, what stands around, and the ground truth of its clip."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.axes import transform_points
from ...solver import Body
from ...tools.render_sample.truth import Shot, project
from ..frames import CACHE
from .people import LIMB_JOINTS, Person, Points

FOLDER = CACHE / "scenes"  # of the clips and their ground truth
STATIC = "static"
PANNING = "panning"
TRAVELLING = "travelling"
SKIN_SPACING_M = 0.03  # between vertices: a ray that passes all of them farther away meets no skin
INDOORS = "indoors"
OUTDOORS = "outdoors"
DEVELOPMENT, TEST, NEW_PERFORMERS = SPLITS = ("development", "test", "new_performers")


@dataclass(frozen=True)
class Block:
    """A box on the floor, with edges along the axes of the world."""

    low: Points  # (3,) corner, metres
    high: Points  # (3,)

    def hides(self, eye: Points, points: Points) -> NDArray[np.bool_]:
        """Return (...,) bool: whether the box is between the eye (3,) and the points (..., 3)."""
        way = points - eye
        with np.errstate(divide="ignore", invalid="ignore"):
            to_low = (self.low - eye) / way
            to_high = (self.high - eye) / way
        enters = np.nanmax(np.minimum(to_low, to_high), axis=-1)
        leaves = np.nanmin(np.maximum(to_low, to_high), axis=-1)
        hidden: NDArray[np.bool_] = (enters < leaves) & (leaves > 0.0) & (enters < 1.0)
        return hidden


@dataclass(frozen=True)
class Scene:
    """People in front of a camera; the first person is the one that the scene is about."""

    number: int
    split: str  # DEVELOPMENT, TEST or NEW_PERFORMERS
    people: tuple[Person, ...]
    intrinsics: Points  # (3, 3) pixels
    world_from_camera: Points  # (T, 4, 4)
    size: tuple[int, int]  # width, height
    fps: float
    camera: str  # STATIC, PANNING or TRAVELLING
    surroundings: str  # INDOORS or OUTDOORS
    block: Block | None  # stands in front of the first person
    seed: int  # of what stands around

    def __len__(self) -> int:
        return len(self.world_from_camera)

    @property
    def name(self) -> str:
        """The name of the scene's files."""
        return f"{self.split}_{self.number:02d}"

    def to_camera(self, points_world: Points) -> Points:
        """Transform points (T, ..., 3) of all frames to the camera frame, metres."""
        flat = points_world.reshape(len(self), -1, 3)
        return transform_points(np.linalg.inv(self.world_from_camera), flat).reshape(
            points_world.shape
        )

    def project(self, points_camera: Points) -> Points:
        """Project points (..., 3) to pixels (..., 2)."""
        return project(points_camera, self.intrinsics)

    def shot(self, frame: int) -> Shot:
        """Return the camera of one frame, with the first person's motion."""
        first = self.people[0]
        stands = np.zeros((len(self), 2), bool)
        T_world_camera = self.world_from_camera[frame]
        return Shot(
            first.rotations,
            first.trans,
            first.betas,
            self.intrinsics,
            T_world_camera,
            self.size,
            self.fps,
            stands,
        )

    def hidden(self, person: Person, body: Body) -> NDArray[np.bool_]:
        """Return (T, 12) bool: which limb joints of a person are behind the block or outside the
        picture.
        """
        limbs = person.limbs(body)
        pixels = self.project(self.to_camera(limbs))
        out = ((pixels < 0) | (pixels > np.array(self.size) - 1)).any(axis=-1)
        if self.block is not None:
            for f in range(len(self)):
                out[f] |= self.block.hides(self.world_from_camera[f, :3, 3], limbs[f])
        return out

    def behind_others(self, person: Person, body: Body) -> NDArray[np.bool_]:
        """Return (T, 12) bool: which limb joints of a person are behind the skin of somebody
        else.
        """
        limbs = self.to_camera(person.limbs(body))
        behind = np.zeros(limbs.shape[:2], bool)
        for other in self.people:
            if other is person:
                continue
            skin = self.to_camera(np.array([other.skin(body, f) for f in range(len(self))]))
            for f in range(len(self)):
                rays = limbs[f] / np.linalg.norm(limbs[f], axis=1, keepdims=True)
                along = skin[f] @ rays.T  # (V, 12) metres from the camera
                beside = np.sqrt(np.maximum((skin[f] ** 2).sum(axis=1)[:, None] - along**2, 0.0))
                nearer = (along > 0) & (along < np.linalg.norm(limbs[f], axis=1))
                behind[f] |= (nearer & (beside < SKIN_SPACING_M)).any(axis=0)
        return behind

    def view_deg(self, person: Person, body: Body) -> Points:
        """Return the horizontal angle between the pelvis's front and the camera, (T,): 0 in front,
        180 behind.
        """
        toward = self.world_from_camera[:, :2, 3] - person.joints(body)[:, 0, :2]
        cosine = np.einsum(
            "ti,ti->t", toward / np.linalg.norm(toward, axis=1, keepdims=True), person.facing()
        )
        angle: Points = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        return angle


def write_truth(path: Path, body: Body, scene: Scene) -> None:
    """Write the ground truth of all N people as plain arrays.

    limbs (N, T, 12, 3) in the world and limbs_cam in the camera frame, metres, as ``names``; hidden
    (N, T, 12); view_deg (N, T); stature_m, mass_index, loose_m (N,); takes (N,); intrinsics,
    world_from_camera (T, 4, 4), size, fps; camera, surroundings, test.
    """
    people = scene.people
    limbs = np.array([person.limbs(body) for person in people])
    np.savez_compressed(
        path,
        limbs=limbs,
        limbs_cam=np.array([scene.to_camera(each) for each in limbs]),
        names=np.array(LIMB_JOINTS),
        hidden=np.array(
            [scene.hidden(person, body) | scene.behind_others(person, body) for person in people]
        ),
        view_deg=np.array([scene.view_deg(person, body) for person in people]),
        stature_m=np.array([person.stature_m(body) for person in people]),
        mass_index=np.array([person.mass_index(body) for person in people]),
        loose_m=np.array([person.loose_m for person in people]),
        takes=np.array([person.take for person in people]),
        intrinsics=scene.intrinsics,
        world_from_camera=scene.world_from_camera,
        size=np.array(scene.size),
        fps=scene.fps,
        camera=scene.camera,
        surroundings=scene.surroundings,
        test=scene.split != DEVELOPMENT,
    )
