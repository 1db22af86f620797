# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the climbs that build/bench/climbs lacks: ``python -m scope.benchmarks.climbs.render``.

Runs as a separate process, because Blender's module prints on standard output and can hang at exit.
A clip is kept until its ground truth changes.
"""

from __future__ import annotations

import os
import sys
from functools import partial

from ...solver import Body, load_body
from ..perception.held_out import all_takes
from ..perception.render_shots import fitted_new_performers, render_if_changed
from ..scenes.render import COMPARED, render_scene
from ..scenes.scene import write_truth
from .accuracy import FOLDER, truth_of
from .draw import DRAWS, PERFORMERS, draw_climb


def render_missing(body: Body) -> None:
    """Render what is not there or not true any more."""
    takes = [take for take in all_takes(fitted_new_performers()) if take.performer in PERFORMERS]
    for number in range(len(DRAWS)):
        scene = draw_climb(body, takes, number)
        video = FOLDER / f"climb_{number}.mp4"
        write = partial(write_truth, body=body, scene=scene)
        render = partial(render_scene, body, scene, 0)
        render_if_changed(video, truth_of(video), COMPARED, write, render)


if __name__ == "__main__":
    render_missing(load_body("scope"))
    sys.stderr.flush()
    os._exit(0)
