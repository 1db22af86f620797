# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/evaluate DATASET FOLDER [options]`: capture a data set, compare with its truth, print
the tables.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import sys
from functools import partial
from pathlib import Path
from typing import Any

from ...scope_addon.atomic_write import atomic_path, reason
from ...scope_addon.command_line.arguments import path_argument
from ...scope_addon.errors import OutputError, UsageError, exit_status
from ...scope_addon.footage import display_text
from ...scope_addon.job.request import code_version
from ...scope_addon.options.capture import QUALITIES
from ...scope_addon.untrusted.body_file import load_body
from ...solver.body import Body
from ...solver.errors import ScopeError
from .clips import Clip
from .models import Models
from .protocols import MEASURES, PROTOCOLS, Protocol
from .published import PUBLISHED
from .readers import READERS
from .run import Settings, captured_clip, forget, results_of
from .scores import Scores, score_clip

_ROOT = Path(__file__).resolve().parents[2]
INTERRUPTED = 130


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return its exit status: 1 also where clips could not be captured."""
    args = _parser().parse_args(arguments)
    try:
        return _run(args)
    except ScopeError as error:
        print(f"scope: {display_text(str(error))}", file=sys.stderr)
        return exit_status(error)
    except KeyboardInterrupt:
        print("scope: interrupted; run the same command again to go on", file=sys.stderr)
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="evaluate", description="Evaluate Scope on a public data set."
    )
    parser.add_argument("dataset", choices=READERS, metavar="DATASET", help=", ".join(READERS))
    parser.add_argument(
        "folder", type=path_argument, metavar="FOLDER", help="of the data set (docs/evaluation.md)"
    )
    qualities = [choice.value for choice in QUALITIES]
    parser.add_argument(
        "--quality", choices=qualities, default="best", help="preset (default: best)"
    )
    parser.add_argument(
        "--body", default="scope", metavar="BODY", help="that is captured: scope, or your SMPL file"
    )
    parser.add_argument(
        "--smpl", type=path_argument, metavar="FOLDER", help="of your SMPL or SMPL-X files"
    )
    parser.add_argument(
        "--regressor", type=path_argument, metavar="FILE", help="J_regressor_h36m.npy"
    )
    parser.add_argument(
        "--given-camera", action="store_true", help="give the capture the data set's intrinsics"
    )
    parser.add_argument(
        "--clips",
        default="*",
        metavar="PATTERN",
        help="names of clips, such as 'TS1' or 'S9 Walk*'",
    )
    parser.add_argument(
        "--results",
        type=path_argument,
        metavar="FOLDER",
        help="(default: build/evaluation/DATASET)",
    )
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="as of a capture")
    parser.add_argument(
        "--again", action="store_true", help="capture clips again that were captured before"
    )
    parser.add_argument(
        "--json", type=path_argument, metavar="FILE", help="write the figures as JSON"
    )
    return parser


def _run(args: argparse.Namespace) -> int:
    if not args.folder.is_dir():
        raise UsageError(f"{args.folder} is not a folder; give the one with the data set")
    models = Models(args.smpl, args.regressor)
    body = load_body(args.body)
    clips = [
        clip
        for clip in READERS[args.dataset](args.folder, models)
        if fnmatch.fnmatch(clip.name, args.clips)
    ]
    if not clips:
        raise UsageError(f"no clip of {args.folder} is named {args.clips}")
    settings = Settings(args.quality, args.body, args.given_camera, args.threads)
    results = args.results or _ROOT / "build" / "evaluation" / args.dataset
    scores, problems = _evaluate(clips, body, models, settings, results, args.again)
    figures = {name: _figures(each) for name, each in scores.items()}
    for name in figures:
        print(
            "\n".join(
                _lines(name, PROTOCOLS[name], figures[name], _joints_of(body, models), settings)
            ),
            end="\n\n",
        )
    for problem in problems:
        print(f"scope: {display_text(problem)}", file=sys.stderr)
    if args.json:
        _write(args.json, {"options": vars(settings), "protocols": figures, "problems": problems})
    return 1 if any(each.frames == 0 for each in scores.values()) or problems else 0


def _evaluate(
    clips: list[Clip], body: Body, models: Models, settings: Settings, results: Path, again: bool
) -> tuple[dict[str, Scores], list[str]]:
    """Return the scores by protocol, and what went wrong, in sentences."""
    regressor = models.regressor_for(body)
    program = code_version(_ROOT)
    scores: dict[str, Scores] = {name: Scores() for clip in clips for name in clip.protocols}
    problems = []
    other = 0
    for number, clip in enumerate(clips, 1):
        truth = clip.truth()  # before the capture, which takes long
        folder = results_of(results, clip)
        if again:
            forget(folder)
        say = partial(_say_of, f"{number}/{len(clips)}")
        captured = captured_clip(clip, truth.intrinsics, body, settings, folder, say)
        other += captured.program != program
        if captured.problem:
            problems.append(f"{clip.name} is not in these figures: {captured.problem}")
            continue
        for name in clip.protocols:
            scores[name].add(
                score_clip(clip, truth, body, captured.motions, PROTOCOLS[name], regressor)
            )
    if other:
        _say(
            f"{other} of the clips were captured by another version of Scope; --again captures "
            "them again"
        )
    return scores, problems


def _figures(scores: Scores) -> dict[str, Any]:
    counts = {
        "frames": scores.frames,
        "frames_seen": scores.seen,
        "people": scores.people,
        "missed": scores.missed,
    }
    return {"figures": scores.means(), **counts}


def _joints_of(body: Body, models: Models) -> str:
    if models.regressor_for(body) is not None:
        return (
            f"regressed from the mesh of {body.name} where the ground truth is too, else those of "
            f"its skeleton"
        )
    return f"those of the body '{body.name}'" + (
        "" if body.name == "smpl" else ", which is not SMPL"
    )


def _lines(
    name: str, protocol: Protocol, figures: dict[str, Any], joints: str, settings: Settings
) -> list[str]:
    """Return the table of a protocol: ours, the published rows, and what has to be known to compare
    them.
    """
    means = figures["figures"]
    rows = PUBLISHED.get(name, [])
    keys = [
        key for key in protocol.measures if key in means or any(key in row.figures for row in rows)
    ]
    head = ["", *(MEASURES[key] for key in keys), "source"]
    table = [head, ["---"] * len(head)]
    sources = list(dict.fromkeys(row.source for row in rows))
    for row in rows:
        figures_of = [_cell(row.figures.get(key)) for key in keys]
        table.append([row.method, *figures_of, f"[{sources.index(row.source) + 1}]"])
    table.append(
        [f"Scope, {settings.quality}", *(_cell(means.get(key)) for key in keys), "this run"]
    )
    found = f"{figures['frames_seen']} of {figures['frames']} frames were captured"
    missed = (
        f"; {figures['missed']} of {figures['people']} people were not found"
        if figures["missed"]
        else ""
    )
    return [
        protocol.title,
        "",
        *("| " + " | ".join(row) + " |" for row in table),
        "",
        f"Follows {protocol.follows}.",
        f"Scope: {found}{missed}; joints: {joints}; camera "
        f"{'given' if settings.camera else 'unknown'}.",
        *(f"[{number}] {source}" for number, source in enumerate(sources, 1)),
    ]


def _cell(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"


def _write(path: Path, figures: dict[str, Any]) -> None:
    try:
        with atomic_path(path) as temporary:
            temporary.write_text(json.dumps(figures, indent=1), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"cannot write {path}: {reason(error)}") from error


def _say_of(place: str, text: str) -> None:
    _say(f"{place} {text}")


def _say(text: str) -> None:
    print(f"scope: {display_text(text)}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
