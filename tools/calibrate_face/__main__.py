# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m scope.tools.calibrate_face``: write assets/face/response.npz from the sets poses and
shaded_talk.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from ...scope_addon.atomic_write import atomic_path
from ...scope_addon.capture.tracking.expression_fit import FILE
from .observe import seen_faces
from .response import measure_response

# set, and scale of its small pictures
MOVING = "shaded_talk"
DEGRADED = 0.5
LICENSE = "GPL-3.0-or-later, ours: measured by tools/calibrate_face on renders of the default body."


def main() -> int:
    """Measure and write."""
    parser = argparse.ArgumentParser(prog="calibrate_face", description=__doc__)
    parser.add_argument(
        "-o", "--out", type=Path, default=FILE, help="file (default: assets/face/response.npz)"
    )
    arguments = parser.parse_args()
    found = vars(
        measure_response(seen_faces("poses"), seen_faces(MOVING), seen_faces(MOVING, DEGRADED))
    )
    arrays = {name: v if name == "landmarks" else v.astype(np.float32) for name, v in found.items()}
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(arguments.out) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays, license=np.array(LICENSE))
    return 0


if __name__ == "__main__":
    sys.exit(main())
