# SPDX-License-Identifier: GPL-3.0-or-later
"""Rooms and streets of textured boxes, drawn by casting a ray through each pixel."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit

from ...scope_addon.arrays import Float32Array, Float64Array, IndexArray, Uint8Array

TEXTURES = 4
TEXTURE_PX = 1024
PIXELS_PER_M = 96.0
LEVELS = 7  # of each texture, every one half as large as the one before
PLAIN_GREY = 165.0
# Cells along a side of the noise that a texture is the sum of, and their brightness.
_NOISE = ((16, 0.22), (48, 0.25), (128, 0.3), (512, 0.25))
_PATCHES = 60
ROOM = np.array([[-6.0, -14.0, 0.0], [6.0, 9.0, 3.2]])
STREET = np.array([[-7.0, -60.0, 0.0], [7.0, 50.0, 12.0]])


@dataclass(frozen=True)
class Surroundings:
    """What is around people."""

    shell: Float64Array  # (2, 3) least and largest corner of floor, walls and ceiling, metres
    boxes: Float64Array  # (B, 2, 3) of what stands there
    box_textures: IndexArray  # (B,) their numbers
    textures: tuple[Float32Array, ...]  # (TEXTURES, n, n, 3) of each level
    is_plain: bool  # without any texture

    @classmethod
    def room(cls, seed: int) -> Surroundings:
        """Return a room with furniture on both sides."""
        return cls._furnished(ROOM, 5.5, (-13.0, 8.0), seed)

    @classmethod
    def street(cls, seed: int) -> Surroundings:
        """Return a street with houses on both sides, and boxes before them."""
        return cls._furnished(STREET, 6.5, (-35.0, 25.0), seed)

    @classmethod
    def plain_street(cls) -> Surroundings:
        """Return a street in which nothing but the edges of floor and houses can be seen."""
        textures = tuple(np.zeros((TEXTURES, 8, 8, 3), np.float32) for _ in range(LEVELS))
        return cls(STREET, np.zeros((0, 2, 3)), np.zeros(0, np.int64), textures, is_plain=True)

    @classmethod
    def _furnished(
        cls, shell: Float64Array, widest_m: float, along_m: tuple[float, float], seed: int
    ) -> Surroundings:
        rng = np.random.default_rng(seed)
        boxes = []
        for _ in range(14):
            across = rng.choice([-1, 1]) * rng.uniform(2.6, widest_m)
            middle = np.array([across, rng.uniform(*along_m)])
            half = rng.uniform(0.2, 0.8, 2)
            height = rng.uniform(0.5, 2.5)
            boxes.append([[*(middle - half), 0.0], [*(middle + half), height]])
        numbers = rng.integers(0, TEXTURES, len(boxes))
        each = [_levels(_texture(seed * 10 + k)) for k in range(TEXTURES)]
        textures = tuple(np.stack(level) for level in zip(*each, strict=True))
        return cls(shell, np.array(boxes), numbers, textures, is_plain=False)

    def draw(
        self,
        R_world_camera: Float64Array,
        center: Float64Array,
        intrinsics: Float64Array,
        width: int,
        height: int,
    ) -> Uint8Array:
        """Return the picture (H, W, 3) RGB of a camera at a place in the world."""
        image = np.empty((height, width, 3), np.uint8)
        _cast(
            image,
            np.ascontiguousarray(R_world_camera),
            np.ascontiguousarray(center, np.float64),
            np.ascontiguousarray(intrinsics, np.float64),
            self.shell,
            self.boxes,
            np.asarray(self.box_textures, np.int64),
            self.textures,
            self.is_plain,
        )
        return image


def _texture(seed: int) -> Float32Array:
    """Return a texture of noise and patches, 0 to 255, that can be repeated."""
    rng = np.random.default_rng(seed)
    grey = np.zeros((TEXTURE_PX, TEXTURE_PX), np.float32)
    for cells, brightness in _NOISE:
        noise = np.tile(rng.random((cells, cells)).astype(np.float32), (3, 3))
        larger = cv2.resize(noise, (3 * TEXTURE_PX, 3 * TEXTURE_PX), interpolation=cv2.INTER_CUBIC)
        grey += brightness * larger[TEXTURE_PX : 2 * TEXTURE_PX, TEXTURE_PX : 2 * TEXTURE_PX]
    texture = grey[..., None] * rng.uniform(0.6, 1.0, 3)
    for _ in range(_PATCHES):
        x, y = rng.integers(0, 900, 2)
        width, height = rng.integers(15, 120, 2)
        patch = texture[y : y + height, x : x + width]
        patch[:] = 0.4 * patch + 0.6 * rng.random(3)
    scaled: Float32Array = (255.0 * np.clip(texture, 0.0, 1.0)).astype(np.float32)
    return scaled


def _levels(texture: Float32Array) -> list[Float32Array]:
    levels = [texture]
    for _ in range(LEVELS - 1):
        smaller = cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        levels.append(smaller.astype(np.float32))
    return levels


@njit(cache=True, fastmath=True)
def _cast(image, R, center, K, shell, boxes, box_textures, textures, is_plain):  # type: ignore
    """Draw into an image (H, W, 3); see `Surroundings.draw`."""
    ray = np.empty(3)
    point = np.empty(3)
    for v in range(image.shape[0]):
        for u in range(image.shape[1]):
            x = (u - K[0, 2]) / K[0, 0]
            y = (v - K[1, 2]) / K[1, 1]
            for i in range(3):
                ray[i] = R[i, 0] * x + R[i, 1] * y + R[i, 2]
                if abs(ray[i]) < 1e-7:
                    ray[i] = 1e-7
            # Where the ray leaves the shell, and through which of its faces.
            depth = 1e9
            axis = 0
            for i in range(3):
                leaves = max((shell[0, i] - center[i]) / ray[i], (shell[1, i] - center[i]) / ray[i])
                if leaves < depth:
                    depth = leaves
                    axis = i
            if axis == 2:
                number = 0 if ray[2] < 0 else 1
                shade = 0.85 if ray[2] < 0 else 1.05
            elif axis == 0:
                number = 2
                shade = 0.9
            else:
                number = 3
                shade = 0.75
            for k in range(len(boxes)):
                enters = -1e9
                leaves = 1e9
                side = 0
                for i in range(3):
                    first = (boxes[k, 0, i] - center[i]) / ray[i]
                    second = (boxes[k, 1, i] - center[i]) / ray[i]
                    if min(first, second) > enters:
                        enters = min(first, second)
                        side = i
                    leaves = min(leaves, max(first, second))
                if enters < leaves and 0.05 < enters < depth:
                    depth = enters
                    axis = side
                    number = box_textures[k]
                    shade = 0.95 if side == 0 else (0.7 if side == 1 else 1.1)
            if is_plain:
                for channel in range(3):
                    image[v, u, channel] = np.uint8(PLAIN_GREY * shade)
                continue
            for i in range(3):
                point[i] = center[i] + ray[i] * depth
            # The level whose pixels are about as large as those of the picture.
            length = np.sqrt(ray[0] ** 2 + ray[1] ** 2 + ray[2] ** 2)
            slant = max(abs(ray[axis]) / length, 0.12)
            footprint = depth * length / K[0, 0] / slant * PIXELS_PER_M
            level = 0
            while footprint > 1.42 and level < LEVELS - 1:
                footprint *= 0.5
                level += 1
            texture = textures[level][number]
            size = texture.shape[0]
            scale = PIXELS_PER_M / 2**level
            across = point[1] if axis == 0 else point[0]
            along = point[1] if axis == 2 else point[2]
            column = (across * scale + 37 * number) % size
            row = (-along * scale) % size
            left = int(column)
            top = int(row)
            right_share = column - left
            bottom_share = row - top
            left %= size
            top %= size
            right = (left + 1) % size
            bottom = (top + 1) % size
            for channel in range(3):
                upper = (1 - right_share) * texture[top, left, channel]
                upper += right_share * texture[top, right, channel]
                lower = (1 - right_share) * texture[bottom, left, channel]
                lower += right_share * texture[bottom, right, channel]
                value = (1 - bottom_share) * upper + bottom_share * lower
                image[v, u, channel] = np.uint8(min(255.0, value * shade))
