# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m scope.tools.render_talk``: write build/talk/talk.mp4 and talk_truth.npz. Needs
bpy.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from ...scope_addon.untrusted.body_file import load_body
from .draw import draw_clip
from .shot import FOLDER, TRUTH, VIDEO, talk_shot, write_talk_truth


def main() -> int:
    """Render the room, and the clip of the person in it."""
    parser = argparse.ArgumentParser(prog="render_talk", description=__doc__)
    parser.add_argument(
        "-o", "--out", type=Path, default=FOLDER, help="folder (default: build/talk)"
    )
    arguments = parser.parse_args()
    from ..render_sample.stage import build_stage, render_room

    body = load_body("scope_h")
    shot = talk_shot(body)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=arguments.out, prefix=".frames") as scratch:
        folder = Path(scratch)
        render_room(
            build_stage(body, shot.intrinsics, shot.size, shot.world_from_camera),
            folder / "room.png",
        )
        room = cv2.cvtColor(cv2.imread(str(folder / "room.png")), cv2.COLOR_BGR2RGB).astype(
            np.uint8, copy=False
        )
        draw_clip(body, shot, room, arguments.out / VIDEO, folder / VIDEO)
        write_talk_truth(folder / TRUTH, body, shot)
        for name in (VIDEO, TRUTH):
            os.replace(folder / name, arguments.out / name)
    return 0


if __name__ == "__main__":
    status = main()
    sys.stderr.flush()
    os._exit(status)  # Blender's module can hang at exit
