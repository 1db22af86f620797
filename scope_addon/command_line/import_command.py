# SPDX-License-Identifier: GPL-3.0-or-later
"""The command that imports a motion file and writes it in other formats."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from typing import Any

from ...solver.smpl_family import SKELETONS
from ..capture_report import warnings_as_json
from ..footage import display_text
from ..notices import counted
from ..options import Place
from .arguments import add_options, add_outputs, path_argument, values_in_range
from .outputs import (
    check_blender,
    check_outputs,
    checked_rigs,
    confine,
    distinct_paths,
    stem_of,
    write_outputs,
)
from .terminal import print_message


def add_import(parser: ArgumentParser) -> None:
    """Add the arguments of ``scope import``."""
    parser.add_argument(
        "motion",
        type=path_argument,
        metavar="MOTION",
        help="motion of Scope, AMASS, or an SMPL-based tracker (.npz, .npy, .pkl or .pt), or .bvh",
    )
    add_outputs(parser, ".glb next to the motion")
    add_options(parser, Place.IMPORT)
    parser.set_defaults(run=run_import, file_per_person=False)


def run_import(args: Namespace) -> dict[str, Any]:
    """Run ``scope import``: read the motion, write every output; return the report.

    :raises ScopeError: an argument is invalid, the motion cannot be used, or an output failed.
    """
    outputs = distinct_paths(args.output) or [args.motion.parent / f"{stem_of(args.motion)}.glb"]
    check_outputs(outputs, vars(args))
    check_blender(outputs)
    values = values_in_range(args, Place.IMPORT)
    # Imported here, so that errors in the arguments are printed immediately.
    from ..retarget.import_motions import import_motions

    confine(args, outputs)
    people = import_motions(args.motion, values["body"], values["up_axis"], values["motion_rate"])
    motions = [person.motion for person in people]
    body = people[0].body
    has_fingers = motions[0].joint_count > len(SKELETONS[24].joint_names)
    has_expressions = any(motion.face for motion in motions)
    rigs = checked_rigs(args, outputs, has_fingers, has_expressions)
    written, warnings = write_outputs(outputs, motions, body, args.motion, args, rigs)
    notes = dict.fromkeys(note for person in people for note in person.notes)
    warnings = [*notes, *warnings]
    for warning in warnings:
        print_message(f"warning: {warning}")
    frames = max(map(len, motions))
    rate = motions[0].mocap_framerate
    if not args.json and not args.quiet:
        names = display_text(", ".join(map(str, written)))
        print(f"{counted(frames, 'frame')} at {rate:g} frames/s; wrote {names}", file=sys.stderr)
    return {
        "source": str(args.motion),
        "body": body.name,
        "people": len(people),
        "frames": frames,
        "frame_rate": rate,
        **warnings_as_json(warnings),
        "outputs": [str(path) for path in written],
    }
