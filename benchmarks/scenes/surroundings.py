# SPDX-License-Identifier: GPL-3.0-or-later
"""Rooms and streets, light and dressed people of a scene in Blender. Needs bpy."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.scene.camera import blender_camera_matrix
from ...solver import Body
from ...tools.render_sample.stage import Triple, add_camera, set_up_rendering
from .dress import dressed
from .materials import Surface, add_surfaced_box, pictured, plain
from .patterns import boards, bricks, mottled, painting, stripes, tiles
from .scene import INDOORS, Scene

WALL_M = 0.1
ROOM_HEIGHT_M = 2.7
FREE_M = 0.6  # around people and camera
FAR_M = 40.0  # of the ground outdoors
SHARED = {"glass": (0.06, 0.08, 0.10), "bark": (0.12, 0.08, 0.05), "leaves": (0.05, 0.13, 0.03)}
AMBIENT_M = 4.0  # within which a surface takes ambient light away; only one bounce is followed
Rng = np.random.Generator


def build_scene(scene: Scene, body: Body) -> tuple[list[bpy.types.Object], NDArray[np.float64]]:
    """Build everything, ready to render; return the people's mesh objects and the positions of the
    lamps (n, 3).
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    set_up_rendering(bpy.context.scene, scene.size)
    add_camera(bpy.context.scene, scene.intrinsics, scene.size, scene.world_from_camera[0])
    rng = np.random.default_rng(scene.seed)
    low, high = _occupied(scene, body)
    lamps = _room(rng, low, high) if scene.surroundings == INDOORS else _street(rng, low, high)
    if scene.block is not None:
        size = scene.block.high - scene.block.low
        center = (scene.block.low + scene.block.high) / 2
        add_surfaced_box("block", _triple(center), _triple(size), _any(rng, "block"))
    _limit_light_paths(bpy.context.scene)
    return [dressed(body, person) for person in scene.people], lamps


def _limit_light_paths(scene: bpy.types.Scene) -> None:
    """Make a sample cost as little as it can: a path ends after one bounce, in ambient light if
    nothing is near.
    """
    cycles = scene.cycles
    cycles.use_light_tree = False
    scene.world.cycles.sampling_method = "NONE"
    cycles.use_fast_gi = True
    cycles.fast_gi_method = "REPLACE"
    cycles.ao_bounces_render = 1
    scene.world.light_settings.distance = AMBIENT_M


def move_camera(world_from_camera: NDArray[np.float64]) -> None:
    """Put the camera at a pose (4, 4)."""
    bpy.context.scene.camera.matrix_world = blender_camera_matrix(world_from_camera).T.tolist()


def _occupied(scene: Scene, body: Body) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and largest x and y (2,) of the people, the block and the camera, with room
    around them.
    """
    points = [person.joints(body).reshape(-1, 3) for person in scene.people]
    points.append(scene.world_from_camera[:, :3, 3])
    if scene.block is not None:
        points.append(np.array([scene.block.low, scene.block.high]))
    every = np.concatenate(points)[:, :2]
    return every.min(axis=0) - FREE_M, every.max(axis=0) + FREE_M


def _room(rng: Rng, low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """Build four walls, floor, ceiling, pictures, furniture along the walls, and lamps."""
    low = low - rng.uniform(0, 2.0, 2)
    high = high + rng.uniform(0, 2.0, 2)
    (x0, y0) = low
    (x1, y1) = high
    cx = (x0 + x1) / 2
    cy = (y0 + y1) / 2
    wide = x1 - x0
    deep = y1 - y0
    tall = ROOM_HEIGHT_M
    wall = _wall(rng)
    dark = plain("skirting", np.full(3, rng.uniform(0.05, 0.6)))
    add_surfaced_box("floor", (cx, cy, -0.05), (wide, deep, 0.1), _floor(rng))
    add_surfaced_box(
        "ceiling", (cx, cy, tall + 0.05), (wide, deep, 0.1), plain("ceiling", np.full(3, 0.8))
    )
    for side, (place, size, inward) in enumerate(
        [
            ((x0 - WALL_M / 2, cy), (WALL_M, deep), (1, 0)),
            ((x1 + WALL_M / 2, cy), (WALL_M, deep), (-1, 0)),
            ((cx, y0 - WALL_M / 2), (wide, WALL_M), (0, 1)),
            ((cx, y1 + WALL_M / 2), (wide, WALL_M), (0, -1)),
        ]
    ):
        add_surfaced_box(f"wall {side}", (*place, tall / 2), (*size, tall), wall)
        along = np.array([abs(inward[1]), abs(inward[0])])
        face = np.array(place) + WALL_M / 2 * np.array(inward)
        add_surfaced_box(
            f"skirting {side}", (*face, 0.05), (*(np.array(size) * along + 0.02), 0.1), dark
        )
        length = float(np.array(size) @ along)
        for k in range(rng.integers(1, 4)):  # pictures, doors, shelves
            at = face + along * rng.uniform(-0.4, 0.4) * length
            w = rng.uniform(0.4, 1.2)
            h = rng.uniform(0.4, 1.0)
            z = rng.uniform(1.2, 1.8)
            if rng.random() < 0.3:
                w = 0.9
                h = 2.0
                z = 1.0
            thick = 0.04 if rng.random() < 0.6 else rng.uniform(0.15, 0.35)
            extent = (*(along * w + (1 - along) * thick), h)
            add_surfaced_box(f"on wall {side} {k}", (*at, z), extent, _on_wall(rng, w, h))
    for k in range(rng.integers(0, 2)):
        add_surfaced_box(f"rug {k}", (cx, cy, 0.004), (wide / 3, deep / 3, 0.008), _any(rng, "rug"))
    lamps = np.array(
        [
            [cx + rng.uniform(-1, 1), cy + rng.uniform(-1, 1), tall - 0.1]
            for _ in range(rng.integers(1, 3))
        ]
    )
    for k, lamp in enumerate(lamps):
        data = bpy.data.lights.new(f"lamp {k}", "AREA")
        data.energy = rng.uniform(120, 260) * (wide * deep / 30) ** 0.5
        data.size = rng.uniform(0.6, 1.8)
        data.color = (1.0, rng.uniform(0.8, 1.0), rng.uniform(0.6, 1.0))
        _link(bpy.data.objects.new(f"lamp {k}", data)).location = lamp.tolist()
    _sky((0.9, 0.95, 1.0), rng.uniform(0.3, 0.6))
    return lamps


def _street(rng: Rng, low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """Build ground, houses with windows, trees and posts, and a sun."""
    center = (low + high) / 2
    add_surfaced_box("ground", (*center, -0.05), (2 * FAR_M, 2 * FAR_M, 0.1), _ground(rng))
    glass, bark, leaves = (plain(name, np.array(color)) for name, color in SHARED.items())
    reach = (high - low) / 2
    for k in range(rng.integers(1, 4)):  # houses to some sides
        axis = k % 2
        sign = 1 if rng.random() < 0.5 else -1
        away = np.zeros(2)
        away[axis] = sign * (reach[axis] + rng.uniform(2.0, 9.0) + 3.0)
        size = np.array([6.0, 6.0, rng.uniform(3.0, 8.0)])
        size[1 - axis] = rng.uniform(8.0, 20.0)
        at = center + away
        add_surfaced_box(f"house {k}", (*at, size[2] / 2), _triple(size), _house(rng))
        face = at.copy()
        face[axis] -= sign * (3.0 + 0.02)
        for row in np.arange(0.9, size[2] - 1.2, 2.6):
            for column in np.arange(-size[1 - axis] / 2 + 1.2, size[1 - axis] / 2 - 1.0, 2.2):
                place = np.array([*face, row + 0.7])
                extent = np.array([0.05, 0.05, 1.4])
                place[1 - axis] += column
                extent[1 - axis] = 1.0
                add_surfaced_box("window", _triple(place), _triple(extent), glass)
    for k in range(rng.integers(2, 7)):
        angle = rng.uniform(0, 2 * np.pi)
        at = center + (np.linalg.norm(reach) + rng.uniform(1.0, 12.0)) * np.array(
            [np.cos(angle), np.sin(angle)]
        )
        tall = rng.uniform(2.0, 4.5)
        if rng.random() < 0.6:
            bpy.ops.mesh.primitive_cylinder_add(
                radius=rng.uniform(0.1, 0.25), depth=tall, location=(*at, tall / 2)
            )
            bpy.context.object.data.materials.append(bark.material)
            for _ in range(4):
                crown = (*(at + rng.normal(0, 0.5, 2)), tall + rng.uniform(-0.3, 1.0))
                bpy.ops.mesh.primitive_ico_sphere_add(
                    subdivisions=3, radius=rng.uniform(0.7, 1.4), location=crown
                )
                bpy.context.object.data.materials.append(leaves.material)
        else:
            add_surfaced_box(f"post {k}", (*at, tall / 2), (0.12, 0.12, tall), glass)
    elevation = np.radians(rng.uniform(35, 75))
    azimuth = rng.uniform(0, 2 * np.pi)
    toward = np.array(
        [
            np.cos(azimuth) * np.cos(elevation),
            np.sin(azimuth) * np.cos(elevation),
            np.sin(elevation),
        ]
    )
    data = bpy.data.lights.new("sun", "SUN")
    overcast = rng.random() < 0.3
    data.energy, data.angle = (1.2, 0.8) if overcast else (rng.uniform(2.5, 4.0), 0.01)
    sun = _link(bpy.data.objects.new("sun", data))
    sun.rotation_euler = (np.pi / 2 - elevation, 0.0, azimuth + np.pi / 2)
    _sky((0.6, 0.75, 1.0) if not overcast else (0.9, 0.92, 0.95), rng.uniform(0.6, 1.0))
    return np.array([[*center, 0.0] + 1000.0 * toward])


def _sky(color: Triple, strength: float) -> None:
    world = bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*color, 1.0)
    background.inputs["Strength"].default_value = strength


def _link(thing: bpy.types.Object) -> bpy.types.Object:
    bpy.context.scene.collection.objects.link(thing)
    return thing


def _floor(rng: Rng) -> Surface:
    color = rng.uniform(0.1, 0.5) * np.array([1.0, 0.8, 0.6])
    if rng.random() < 0.5:
        return pictured("floor", boards(rng, color), 1.8)
    if rng.random() < 0.5:
        return pictured("floor", tiles(rng, color + rng.uniform(0, 0.2)), 1.6)
    return pictured("floor", mottled(rng, color * rng.uniform(0.5, 1.5, 3), 0.15, 0.8), 2.0)


def _wall(rng: Rng) -> Surface:
    color = np.clip(rng.uniform(0.3, 0.8) + rng.normal(0, 0.06, 3), 0.1, 0.85)
    if rng.random() < 0.6:
        return pictured("wall", mottled(rng, color, 0.05), 3.0)
    if rng.random() < 0.6:
        return pictured("wall", stripes(rng, color), 1.6)
    return pictured("wall", bricks(rng, color * [0.8, 0.55, 0.45]), 1.2)


def _ground(rng: Rng) -> Surface:
    if rng.random() < 0.4:
        return pictured("ground", mottled(rng, np.array([0.10, 0.16, 0.05]), 0.35, 0.9), 5.0)
    gray = np.full(3, rng.uniform(0.08, 0.35))
    return pictured(
        "ground", mottled(rng, gray, 0.12) if rng.random() < 0.6 else tiles(rng, gray), 4.0
    )


def _house(rng: Rng) -> Surface:
    color = rng.uniform(0.2, 0.7) * rng.uniform(0.7, 1.0, 3)
    made = bricks(rng, color * [0.8, 0.6, 0.5]) if rng.random() < 0.5 else mottled(rng, color, 0.06)
    return pictured("house", made, 1.6)


def _on_wall(rng: Rng, width: float, height: float) -> Surface:
    return (
        pictured("picture", painting(rng), width, height)
        if rng.random() < 0.5
        else _any(rng, "furniture")
    )


def _any(rng: Rng, name: str) -> Surface:
    color = rng.uniform(0.05, 0.6) * rng.uniform(0.5, 1.0, 3)
    return pictured(
        name, boards(rng, color) if rng.random() < 0.5 else mottled(rng, color, 0.08), 1.5
    )


def _triple(values: NDArray[np.float64]) -> Triple:
    x, y, z = (float(v) for v in values)
    return x, y, z
