# SPDX-License-Identifier: GPL-3.0-or-later
"""The content of each picture. Frames were chosen by eye; every figure in a picture is measured
when it is made.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.motion import Motion
from .clips import DATA, SAMPLE, SAMPLE_TRUTH, camera, captured, default_body, distance_cm, error_mm
from .footage import sample_with_body
from .panel import OURS, TRUTH, Color, Panel, next_to_each_other
from .shapes import joints, posed, true_joints
from .view import View, from_around, from_the_camera

# a second person; a filled-in pose
AMBER = (0.96, 0.70, 0.34)
FAINT = (0.74, 0.79, 0.86)
BOTH = [("Scope", OURS), ("ground truth", TRUTH)]
LEFT_WRIST = 20
HEAD = 15


def sample() -> NDArray[np.uint8]:
    """Draw the sample clip: the body over the footage, and from the side with the exact ground
    truth.
    """
    motion = captured(SAMPLE)[0]
    columns: list[NDArray[np.uint8]] = []
    for row in (48, 66, 119):
        panel = _with_truth(motion, row, _side(motion, row, (298, 330), 90, 2.35), SAMPLE_TRUTH)
        panel.heading(f"from the side, {error_mm(motion, row, SAMPLE_TRUTH):.0f} mm")
        if not columns:
            panel.legend(BOTH)
        columns.append(
            np.concatenate([sample_with_body(motion, row, (298, 330)), panel.finished()])
        )
    return next_to_each_other(columns)


def against_truth() -> NDArray[np.uint8]:
    """Draw camera 2 at a good moment and at an average one: the camera's view and the view from the
    side.
    """
    motion, truth = camera(2)
    panels = []
    for row in (37, 75):
        panels.append(_with_truth(motion, row, _front(motion, row, (222, 330), truth), truth))
        panels[-1].heading("camera 2")
        panels.append(_with_truth(motion, row, _side(motion, row, (222, 330), 90, 2.35), truth))
        panels[-1].heading(f"right side, {error_mm(motion, row, truth):.0f} mm")
    panels[0].legend(BOTH)
    return next_to_each_other([panel.finished() for panel in panels])


def in_motion() -> NDArray[np.uint8]:
    """Draw a runner every 0.9 s, filmed by a travelling camera, and two people shaking hands."""
    runner = captured(DATA / "clips" / "run_moving_camera.mp4")[0]
    run = _together([(runner, row, OURS) for row in range(4, 180, 27)], (598, 300), 0, 2.75, 12)
    run.heading("runner, travelling camera")
    first, second = captured(DATA / "clips" / "two_people_portrait.mp4", everybody=True)
    pair = _together([(first, 32, OURS), (second, 32, AMBER)], (298, 300), 30, 2.5, 12)
    pair.heading("two people, from another side")
    return next_to_each_other([run.finished(), pair.finished()])


def along_the_view() -> NDArray[np.uint8]:
    """Draw a failure: depth ambiguity, trunk and arms displaced along the line of sight (camera
    1).
    """
    return _hand_off(1, 52, 90, (14, 28))


def from_behind() -> NDArray[np.uint8]:
    """Draw a failure: lean and an occluded arm are not visible from behind (camera 4)."""
    return _hand_off(4, 64, -90, (-14, 28))


def two_floors() -> NDArray[np.uint8]:
    """Draw a failure: one floor for a clip in which a man jumps from a roof (walk_side_static)."""
    acrobat, walker = captured(DATA / "clips" / "walk_side_static.mp4", everybody=True)
    rows = (100, 150, 168, 175, 184, 193, 207)
    people = [(acrobat, row, OURS if acrobat.valid[row] else FAINT) for row in rows] + [
        (walker, 42, AMBER)
    ]
    panel = _together(people, (760, 420), 0, 4.7, 6)
    panel.heading("floor: the roof on which he stands at first")
    for row in rows:
        if not acrobat.valid[row]:
            panel.note("not seen: filled in", joints(acrobat, row)[0], (90, -40))
    low = posed(acrobat, default_body(), 193)
    foot = low[low[:, 2].argmin()]
    panel.note(f"lands {-foot[2]:.1f} m below the floor", foot, (-70, 4))
    panel.note("passer-by", joints(walker, 42)[HEAD], (26, -28))
    return panel.finished()


def _hand_off(number: int, row: int, turn: float, place: tuple[float, float]) -> NDArray[np.uint8]:
    """Draw a frame of a pose2sim camera: its view, the view from the side, and the error of the
    left hand.
    """
    motion, truth = camera(number)
    front = _with_truth(motion, row, _front(motion, row, (449, 380), truth), truth)
    front.heading(f"view of camera {number}")
    front.legend(BOTH)
    side = _with_truth(motion, row, _side(motion, row, (449, 380), turn, 2.35), truth)
    side.heading(
        f"from the {'right' if turn > 0 else 'left'}, {error_mm(motion, row, truth):.0f} mm"
    )
    true_hand = true_joints(motion, row, truth)["LWrist"]
    side.line(joints(motion, row)[LEFT_WRIST], true_hand, dashed=True)
    side.note(f"hand {distance_cm(motion, row, truth, 'LWrist'):.0f} cm off", true_hand, place)
    return next_to_each_other([front.finished(), side.finished()])


def _front(motion: Motion, row: int, size: tuple[int, int], truth: Path | None = None) -> View:
    shown = posed(motion, default_body(), row)
    if truth is not None:
        shown = np.concatenate([shown, list(true_joints(motion, row, truth).values())])
    return from_the_camera(motion, row, shown, size, 0.76)


def _side(motion: Motion, row: int, size: tuple[int, int], turn: float, height: float) -> View:
    vertices = posed(motion, default_body(), row)
    middle = (vertices.min(0) + vertices.max(0)) / 2 * [1, 1, 0] + [0, 0, 0.4 * height]
    return from_around(motion, row, middle, size, turn, height)


def _alone(motion: Motion, row: int, view: View) -> Panel:
    panel = Panel(view, joints(motion, row)[0])
    panel.body(default_body(), posed(motion, default_body(), row))
    return panel


def _with_truth(motion: Motion, row: int, view: View, truth: Path) -> Panel:
    panel = _alone(motion, row, view)
    panel.sticks(true_joints(motion, row, truth))
    return panel


def _together(
    people: Sequence[tuple[Motion, int, Color]],
    size: tuple[int, int],
    turn: float,
    height: float,
    pitch: float,
) -> Panel:
    """Draw several poses in one world, farther ones drawn first."""
    bodies = [(posed(motion, default_body(), row), color) for motion, row, color in people]
    everything = np.concatenate([vertices for vertices, _ in bodies])
    middle = (everything.min(0) + everything.max(0)) / 2
    view = from_around(people[0][0], people[0][1], middle, size, turn, height, pitch)
    panel = Panel(view, middle)
    for vertices, color in sorted(bodies, key=lambda b: -view.to_camera(b[0])[:, 2].mean()):
        panel.body(default_body(), vertices, color)
    return panel
