# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m scope.tools.render_sample``: write assets/sample/sample.mp4 and sample_truth.npz.
Needs bpy.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from ...scope_addon.untrusted.body_file import load_body
from ...solver.body_file import ASSETS
from .choreography import choreograph
from .truth import BETAS, FPS, sample_shot, write_truth


def main() -> int:
    """Render the clip, or single frames of it to look at."""
    parser = argparse.ArgumentParser(prog="render_sample", description=__doc__)
    parser.add_argument(
        "-o", "--out", type=Path, default=ASSETS / "sample", help="folder (default: assets/sample)"
    )
    parser.add_argument(
        "--frames",
        type=int,
        nargs="*",
        help="render only these frames, as pictures, into the folder",
    )
    arguments = parser.parse_args()
    from .clip import render_clip, render_pictures

    body = load_body("scope")
    shot = sample_shot(*choreograph(body, BETAS, FPS))
    arguments.out.mkdir(parents=True, exist_ok=True)
    if arguments.frames is not None:
        render_pictures(body, shot, arguments.frames, arguments.out)
        return 0
    with tempfile.TemporaryDirectory(dir=arguments.out, prefix=".frames") as scratch:
        folder = Path(scratch)
        render_clip(body, shot, folder / "sample.mp4", folder)
        write_truth(folder / "sample_truth.npz", body, shot)
        for name in ("sample.mp4", "sample_truth.npz"):
            os.replace(folder / name, arguments.out / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
