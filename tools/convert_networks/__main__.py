# SPDX-License-Identifier: GPL-3.0-or-later
"""Command line of the converter: ``python -m scope.tools.convert_networks``."""

import argparse
import sys
from pathlib import Path

from ...scope_addon.errors import exit_status
from ...solver.errors import ScopeError
from .build import build_networks

_ROOT = Path(__file__).resolve().parents[2]


def main(argv: list[str] | None = None) -> int:
    """Build the networks; 0 when all are there, 1 with one sentence on stderr otherwise."""
    parser = argparse.ArgumentParser(
        prog="scope.tools.convert_networks",
        description="Fetch and convert the pose, hand and face networks.",
    )
    parser.add_argument(
        "--out", type=Path, default=_ROOT / "assets" / "networks", help="folder for the ONNX files"
    )
    parser.add_argument(
        "--downloads",
        type=Path,
        default=_ROOT / "build" / "downloads",
        help="cache of fetched packages",
    )
    parser.add_argument(
        "--force", action="store_true", help="convert again even if nothing has changed"
    )
    arguments = parser.parse_args(argv)
    try:
        built = build_networks(arguments.out, arguments.downloads, force=arguments.force)
    except OSError as error:
        print(
            f"convert_networks: {arguments.downloads} or {arguments.out} cannot be written "
            f"({error}); free some space or choose others with --downloads and --out",
            file=sys.stderr,
        )
        return 1
    except ScopeError as error:
        print(f"convert_networks: {error}", file=sys.stderr)
        return exit_status(error)
    print(f"{arguments.out}: " + (", ".join(built) if built else "up to date"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
