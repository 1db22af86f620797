# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/bench travelling`: walkers and runners whom a hand-held camera follows."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...scope_addon.arrays import Float64Array
from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.pipeline import Capture, capture
from ...solver import Body, load_body
from ...solver.rotations import exp, log
from ..evaluation.metrics import aligned, pa_mpjpe, root_translation_error, similarity, wa_mpjpe
from ..frames import CACHE
from ..report import table
from .footage import FOCAL_PX, Camera, draw_clip, truth_of
from .surroundings import Surroundings
from .walk import RUNS, Walk, Walker

FOLDER = CACHE / "travelling"
SECONDS = 6.0
STEP_FRAMES = 15
SHAKE_DEG = 0.4
SHAKE_M = 0.012
BY_CHANCE = 12  # scenes whose walker, lens and camera are drawn by number
QUICK = ("backs away, street", "beside a walker")
SHOWN = {
    "root_percent": "root, % of the path",
    "path": "path, captured over true",
    "wa_mpjpe": "WA-MPJPE mm",
    "pa_mpjpe": "PA-MPJPE mm",
    "camera_percent": "camera position, % of its path",
    "camera_deg": "camera rotation, °",
    "frames_per_s": "frames/s",
    "warnings": "warnings",
}
# From a time and the walker's place (2,) on the floor to the camera's place and what it looks at.
Follow = Callable[[float, Float64Array], tuple[list[float], list[float]]]


@dataclass(frozen=True)
class TravellingScene:
    """Who is followed, where, and how."""

    walk: Walk
    surroundings: Callable[[], Surroundings]
    follow: Follow
    seed: int
    focal_px: float = FOCAL_PX
    seconds: float = SECONDS
    readout_s: float = 0.0

    def camera(self) -> Camera:
        """Return the camera that follows the walker."""

        def place(time_s: float) -> Float64Array:
            return self.walk.place(self.walk.speed_m_s * time_s)[0]

        return Camera(
            lambda t: np.array(self.follow(t, place(t))[0]),
            lambda t: np.array(self.follow(t, place(t))[1]),
            seed=self.seed,
            shake_deg=SHAKE_DEG,
            shake_m=SHAKE_M,
            focal_px=lambda _: self.focal_px,
            readout_s=self.readout_s,
        )


def _at(x: float, y: float, height: float) -> Follow:
    """Return a camera so far from the walker, who is in the middle of the picture."""
    return lambda _, p: ([p[0] + x, p[1] + y, height], [p[0], p[1], 0.95])


def _on_rails(x: float, y: float, height: float) -> Follow:
    """Return a camera that travels along the street only."""
    return lambda _, p: ([x, p[1] + y, height], [p[0], p[1], 0.95])


def _around(time_s: float, p: Float64Array) -> tuple[list[float], list[float]]:
    angle = 0.25 * time_s - 0.6
    eye = [3.8 * float(np.sin(angle)), p[1] - 3.8 * float(np.cos(angle)), 1.5]
    return eye, [p[0], p[1], 0.95]


def _rising(time_s: float, p: Float64Array) -> tuple[list[float], list[float]]:
    return [1.0, p[1] - 4.5, 1.0 + 0.25 * time_s], [p[0], p[1], 0.95]


def _street(seed: int) -> Callable[[], Surroundings]:
    return lambda: Surroundings.street(seed)


def _room(seed: int) -> Callable[[], Surroundings]:
    return lambda: Surroundings.room(seed)


_AWAY = Walk(1.5, 1.0, heading_deg=180.0, start=(0.0, -10.0))
_PAST = Walk(1.3, heading_deg=180.0, start=(0.0, -4.0))
_RUN = Walk(3.0, 0.72, heading_deg=180.0, start=(0.0, -8.0), style=RUNS)
SCENES = {
    "backs away, street": TravellingScene(Walk(1.3), _street(1), _on_rails(0.3, -4.2, 1.5), 1),
    "backs away, room": TravellingScene(
        Walk(1.1, 1.1, start=(0.0, 5.0)), _room(2), _on_rails(-0.5, -3.6, 1.4), 2
    ),
    "backs away from one who turns": TravellingScene(
        Walk(1.3, start=(0.0, 2.0), turn=0.12), _street(8), _at(0.4, -4.0, 1.5), 8
    ),
    "follows": TravellingScene(_AWAY, _street(3), _on_rails(0.8, -4.0, 1.6), 3),
    "beside a walker": TravellingScene(_PAST, _street(4), _on_rails(-4.2, 0.3, 1.4), 4),
    "beside a runner": TravellingScene(_RUN, _street(5), _on_rails(-4.6, 1.0, 1.3), 5),
    "around a walker": TravellingScene(Walk(0.9, 1.15, start=(0.0, 2.0)), _room(6), _around, 6),
    "rises": TravellingScene(Walk(1.2, start=(0.0, 2.0)), _street(7), _rising, 7),
    "backs away, plain street": TravellingScene(
        Walk(1.3), Surroundings.plain_street, _on_rails(0.3, -4.2, 1.5), 1
    ),
}


def _by_chance() -> dict[str, TravellingScene]:
    """Return scenes in which the camera follows faster or slower than people walk, with any
    lens.
    """
    rng = np.random.default_rng(77)
    scenes = {}
    for number in range(BY_CHANCE):
        surroundings = _room if number % 3 == 2 else _street
        speed_m_s = rng.uniform(0.8, 1.5)
        period_s = rng.uniform(0.95, 1.2)
        heading_deg = float(rng.choice([0, 180, 90])) if number % 3 != 2 else 0.0
        starts = {
            0.0: (rng.uniform(-0.5, 0.5), rng.uniform(1, 4)),
            180.0: (rng.uniform(-0.5, 0.5), rng.uniform(-6, -3)),
            90.0: (-3.0, 0.0),
        }
        turn = float(rng.choice([0, 0, 0.12]))
        walk = Walk(speed_m_s, period_s, heading_deg, starts[heading_deg], turn)
        height_m = rng.uniform(0.8, 2.1)
        focal_px = rng.uniform(520, 950)
        behind_m = rng.uniform(3.0, 4.5) * focal_px / FOCAL_PX
        side_m = rng.uniform(-1.5, 1.5)
        rate = rng.uniform(0.5, 1.2)
        follow = _lagging(walk, rate, (side_m, -behind_m, height_m))
        scenes[f"by chance {number}"] = TravellingScene(
            walk, surroundings(100 + number), follow, number, focal_px, 5.0
        )
    return scenes


def _lagging(walk: Walk, rate: float, offset: tuple[float, float, float]) -> Follow:
    """Return a camera that travels at so many times the walker's speed."""
    start = walk.place(0.0)[0]

    def follow(_: float, p: Float64Array) -> tuple[list[float], list[float]]:
        x, y = start + (p - start) * rate
        return [x + offset[0], y + offset[1], offset[2]], [p[0], p[1], 0.95]

    return follow


ROLLING = [name for name in SCENES if "turns" not in name and "plain" not in name]
ROLLING.remove("rises")
READOUT_S = 0.025  # of a phone
SCENES |= {
    f"{name}, rolling shutter": replace(SCENES[name], readout_s=READOUT_S) for name in ROLLING
}
SCENES |= _by_chance()


def travelling(quick: bool) -> dict[str, Any]:
    """Draw what is missing, measure, print the table, return the figures by scene.

    `quick` measures two scenes.
    """
    body = load_body("scope")
    figures = {}
    for name in QUICK if quick else SCENES:
        clip = draw_scene(body, name, FOLDER)
        start_s = time.perf_counter()
        captured = capture(clip, body, CaptureOptions())
        taken_s = time.perf_counter() - start_s
        figures[name] = score(body, clip, captured)
        figures[name]["frames_per_s"] = len(captured.motions[0]) / taken_s
    rows = [[name, *(row.get(key) for key in SHOWN)] for name, row in figures.items()]
    print(table(("scene", *SHOWN.values()), rows), flush=True)
    return figures


def draw_scene(body: Body, name: str, folder: Path) -> Path:
    """Draw the clip of a scene where it is missing; return it."""
    clip = folder / f"{name.replace(', ', '_').replace(' ', '_')}.mp4"
    if not clip.is_file():
        scene = SCENES[name]
        walkers = [Walker(body, scene.walk)]
        draw_clip(clip, scene.surroundings(), walkers, scene.camera(), scene.seconds)
    return clip


def score(body: Body, clip: Path, captured: Capture) -> dict[str, Any]:
    """Return the figures of a capture: `SHOWN`, without the rate."""
    with np.load(truth_of(clip)) as data:
        truth = {key: data[key] for key in data.files}
    motion = captured.motions[0]
    rotations = exp(motion.poses.reshape(len(motion), -1, 3).astype(float))
    trans = motion.trans.astype(float)
    joints = body.forward_kinematics(rotations, trans, motion.betas.astype(float))[1]
    true = truth["joints"][0][motion.frames]
    centers = truth["centers"][motion.frames]
    R_true = truth["R_world_camera"][motion.frames]
    found = np.asarray(motion.world_from_camera)
    own = found[:, :3, 3]
    apart_m = np.linalg.norm(aligned(own, similarity(own, centers)) - centers, axis=1)
    path_m = float(np.linalg.norm(np.diff(centers, axis=0), axis=1).sum())
    turned = np.swapaxes(found[:1, :3, :3], 1, 2) @ found[:, :3, :3]
    turned_true = np.swapaxes(R_true[:1], 1, 2) @ R_true
    error = np.linalg.norm(log(np.swapaxes(turned_true, 1, 2) @ turned), axis=1)
    return {
        "root_percent": float(root_translation_error(joints[:, 0], true[:, 0]).mean()),
        "path": _path_m(joints[:, 0]) / _path_m(true[:, 0]),
        "wa_mpjpe": float(wa_mpjpe(joints, true).mean()),
        "pa_mpjpe": float(pa_mpjpe(joints, true).mean()),
        "camera_percent": 100.0 * float(np.sqrt(np.square(apart_m).mean())) / path_m,
        "camera_deg": float(np.degrees(error.max())),
        "warnings": ", ".join(sorted({each.code for each in captured.report.warnings})),
    }


def _path_m(root: Float64Array) -> float:
    """Return how far a person travels whose pelvis is at these places (T, 3): without what changes
    within a step.
    """
    return float(np.linalg.norm(np.diff(root[::STEP_FRAMES, :2], axis=0), axis=1).sum())
