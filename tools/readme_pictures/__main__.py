# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m scope.tools.readme_pictures``: make the pictures. Animations and real faces need no
../shared/data.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.atomic_write import atomic_path
from ...solver.body_file import ASSETS
from . import animation, photographs, pictures
from .clips import DATA

ANIMATIONS = ("talk",)
PICTURES = {
    "capture": pictures.sample,
    "against_truth": pictures.against_truth,
    "in_motion": pictures.in_motion,
    "along_the_view": pictures.along_the_view,
    "from_behind": pictures.from_behind,
    "two_floors": pictures.two_floors,
    "real_faces": photographs.real_faces,
}
WITHOUT_DATA = (*ANIMATIONS, "real_faces")
# drawn by `./scripts/bench` with these names, and copied from build/bench
BY_BENCHMARKS = ("smplify", "scenes")
# Shows two versions side by side, so it cannot be made again from one of them.
OF_TWO_VERSIONS = ("standing",)
MAX_BYTES = 60_000
LARGEST_BYTES = dict.fromkeys((*PICTURES, *BY_BENCHMARKS), MAX_BYTES) | {
    "real_faces": 120_000,
    "standing": 100_000,
}


def main() -> int:
    """Make all pictures, or those that are named."""
    known = [*ANIMATIONS, *PICTURES]
    parser = argparse.ArgumentParser(prog="readme_pictures", description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"one of {', '.join(known)}; default: all"
    )
    parser.add_argument(
        "-o",
        "--out",
        type=Path,
        default=ASSETS / "pictures",
        help="folder (default: assets/pictures)",
    )
    arguments = parser.parse_args()
    unknown = set(arguments.names) - set(known)
    if unknown:
        parser.error(
            f"there is no picture {', '.join(sorted(unknown))}; choose from {', '.join(known)}"
        )
    names = arguments.names or known
    if not set(names) <= set(WITHOUT_DATA) and not DATA.is_dir():
        print(f"{DATA} does not exist: the pictures show captures of its clips", file=sys.stderr)
        return 1
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name in names:
        if name in ANIMATIONS:
            _write_animation(name, arguments.out / f"{name}.webp")
        else:
            write_jpeg(arguments.out / f"{name}.jpg", PICTURES[name](), LARGEST_BYTES[name])
    return 0


def write_jpeg(path: Path, picture: NDArray[np.uint8], most_bytes: int = MAX_BYTES) -> None:
    """Write a JPEG, as good as its size allows."""
    bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    for quality in range(90, 30, -4):
        data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        if len(data) <= most_bytes:
            break
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)
    print(
        f"{path}: {picture.shape[1]} x {picture.shape[0]}, {len(data) / 1000:.0f} kB, quality "
        f"{quality}"
    )


def _write_animation(name: str, path: Path) -> None:
    frames = animation.talk_frames()
    most_bytes = animation.LARGEST_BYTES[name]
    with atomic_path(path) as temporary:
        quality = animation.write_webp(
            temporary, frames, animation.TALK.frames_per_second, most_bytes
        )
    height, width = frames[0].shape[:2]
    size_kb = path.stat().st_size / 1000
    print(
        f"{path}: {len(frames)} frames of {width} x {height}, {size_kb:.0f} kB, quality {quality}"
    )


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)  # footage and onnxruntime's threads can hang at exit
