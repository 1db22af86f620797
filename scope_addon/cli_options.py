# SPDX-License-Identifier: GPL-3.0-or-later
"""How to capture, as a command line says it: the same options for one clip and for a folder of them."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from ..solver.body import Body
from ..solver.loaders.body_file import BUILT_IN, body_with_hands
from .errors import UsageError
from .retarget.rig_source import ROOTS

if TYPE_CHECKING:
    from .capture.options import CaptureOptions

SHAPE_MODES = ("keyed", "per_frame", "baked")
QUALITIES = ("fast", "balanced", "best")
PROVIDERS = ("auto", "cpu", "cuda", "tensorrt", "directml", "coreml")


def named_path(text: str) -> Path:
    """A path as an argument has it. What is empty, such as a variable of the shell that is not set, is no name.

    :raises ArgumentTypeError: it is empty; else it would be the current folder.
    """
    if not text:
        raise argparse.ArgumentTypeError("the name is empty; give that of a file or folder")
    return Path(text)


def add_options(capture: argparse.ArgumentParser) -> None:
    """Declare them all."""
    capture.add_argument("--quality", choices=QUALITIES, default="best", help="speed against accuracy (default: best)")
    capture.add_argument(
        "--people",
        default="largest",
        metavar="N|all|largest",
        help="how many people at most; largest: the one who fills the picture most over the clip, but nobody less than"
        " half as large as somebody beside them (default: largest)",
    )
    capture.add_argument("--start", metavar="TIME", help="from when: seconds, MM:SS, HH:MM:SS.mmm or HH:MM:SS:FF")
    capture.add_argument("--end", metavar="TIME", help="until when, inclusive")
    capture.add_argument("--fps", metavar="N", help="use so many frames per second, such as 12 or 29.97")
    capture.add_argument(
        "--body", default="scope", help=f"{', '.join(BUILT_IN)}, or your own .npz or .pkl (default: scope)"
    )
    capture.add_argument("--hands", action="store_true", help="fingers too, on scope_h unless --body says otherwise")
    capture.add_argument(
        "--height",
        metavar="CM[,CM...]",
        help="how tall the people are, the most prominent one first: sets the size of everything (default: found)",
    )
    capture.add_argument("--focal-mm", type=float, metavar="MM", help="35 mm equivalent focal length of the camera")
    capture.add_argument("--fov", type=float, metavar="DEGREES", help="field of view along the longer side")
    capture.add_argument("--calibration", type=named_path, metavar="FILE", help="JSON with intrinsics, dist and size")
    capture.add_argument("--no-smoothing", action="store_true", help="every frame as it was solved, feet not held")
    capture.add_argument(
        "--shape-keys",
        choices=SHAPE_MODES,
        default="keyed",
        help="keyed once, per_frame, or baked into the mesh for engines that clamp morphs (default: keyed)",
    )
    capture.add_argument(
        "--file-per-person", action="store_true", help="a file for each of several people, in every format"
    )
    capture.add_argument(
        "--retarget",
        type=named_path,
        metavar="RIG",
        help="put the motion on the rig in this .blend, .fbx or .glb instead",
    )
    capture.add_argument("--rig-object", default="", metavar="NAME", help="the armature, where RIG holds several")
    capture.add_argument(
        "--bone-map", type=named_path, metavar="FILE", help="which bone is which: JSON saved in the panel"
    )
    capture.add_argument(
        "--retarget-root",
        choices=ROOTS,
        default=ROOTS[0],
        help="where the rig keeps the way over the floor (default: bone)",
    )
    capture.add_argument("--detector", type=named_path, metavar="FILE", help="your own person detector, an .onnx file")
    capture.add_argument(
        "--keypoints", type=named_path, metavar="FILE", help="your own keypoint network, an .onnx file"
    )
    capture.add_argument(
        "--provider", choices=PROVIDERS, default="auto", help="what the networks run on (default: the best there is)"
    )
    capture.add_argument("--threads", type=int, default=0, metavar="N", help="threads for the networks (default: all)")
    capture.add_argument("--json", action="store_true", help="print a machine-readable report on stdout")
    capture.add_argument("--quiet", action="store_true", help="no progress bar")


def body_and_options(args: argparse.Namespace) -> tuple[Body, CaptureOptions]:
    """What the arguments say about how to capture.

    :raises ScopeError: an argument cannot be meant, or there is no such body.
    """
    from ..solver.loaders.body_file import load_body
    from .capture.media.video_range import parse_range
    from .capture.options import CaptureOptions, check_options

    if args.threads < 0:
        raise UsageError(f"--threads takes a number from 1 on, or 0 for all, not {args.threads}")
    options = CaptureOptions(
        quality=args.quality,
        people=_people(args.people),
        wanted=parse_range(args.start, args.end, args.fps),
        heights_m=_heights(args.height),
        focal_mm=args.focal_mm,
        fov_deg=args.fov,
        calibration=args.calibration,
        smoothing=not args.no_smoothing,
        hands=args.hands,
        threads=args.threads,
        provider=args.provider,
        detector=args.detector,
        keypoints=args.keypoints,
    )
    body = load_body(body_with_hands(args.body) if args.hands else args.body)
    check_options(body, options)
    return body, options


def given_options(args: argparse.Namespace) -> dict[str, str | None]:
    """The options of a capture that differ from their defaults, as a command line has them; None: no value."""
    parser = argparse.ArgumentParser(add_help=False)
    add_options(parser)
    given: dict[str, str | None] = {}
    for action in parser._actions:
        value = getattr(args, action.dest)
        if value != action.default and action.dest not in ("json", "quiet"):
            given[action.option_strings[-1]] = None if action.nargs == 0 else str(value)
    return given


def _people(text: str) -> int | str:
    """``--people``: a number, "all" or "largest"."""
    if text in ("all", "largest"):
        return text
    if not re.fullmatch("[0-9]{1,6}", text) or int(text) < 1:
        raise UsageError(f"--people takes a number from 1 on, all or largest, not {text!r}")
    return int(text)


def _heights(text: str | None) -> tuple[float, ...]:
    """``--height``: centimetres, one number for each person."""
    try:
        return tuple(float(number) / 100 for number in text.split(",")) if text is not None else ()
    except ValueError as error:
        raise UsageError(f"--height takes centimetres, say 175, or 175,162 for two people, not {text!r}") from error
