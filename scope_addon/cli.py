# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: one argparse tree, used by the shell and by Blender's ``--command scope``.

Exit status: 0 done, 1 failed, 2 bad arguments, 3 no person found. Progress and the one sentence about a failure go to
stderr; with ``--json`` stdout carries the report alone.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn, TextIO

from ..solver.body import Body
from ..solver.errors import ScopeError
from ..solver.loaders.body_file import ASSETS
from .cli_options import add_options, body_and_options, given_options, named_path
from .errors import UsageError, exit_status
from .job.parent import stop_with_parent
from .motion import Motion
from .retarget.rig_source import ROOTS
from .scene.export.output_paths import SUFFIXES, check_output, person_paths

if TYPE_CHECKING:
    from .retarget.rig_source import RigSource

SAMPLE = ASSETS / "sample" / "sample.mp4"
MOTION_SUFFIXES = (".npz",)
OVERLAY_SUFFIXES = (".mp4", ".png", ".jpg")
_CLEAR_LINE = "\r\x1b[K"
_signals: list[int] = []  # that asked to stop
PROGRAM = (sys.executable, "-m", f"{__package__}.cli")


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One sentence instead of the whole usage."""
        raise UsageError(f"{message} (see {self.prog} --help)")


def build_parser() -> argparse.ArgumentParser:
    """The whole argparse tree."""
    parser = _Parser(prog="scope", description="Markerless motion capture: video in, animated body out.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    capture = commands.add_parser("capture", help="capture the people in a video or picture")
    capture.set_defaults(run=run_capture)
    capture.add_argument(
        "video",
        nargs="?",
        type=named_path,
        metavar="VIDEO",
        help="video, picture, or numbered pictures as a folder or walk_####.png (default: a sample)",
    )
    capture.add_argument(
        "-o",
        "--output",
        action="append",
        type=named_path,
        default=[],
        metavar="OUT",
        help=f"result file, may be repeated; the suffix says what: {', '.join(SUFFIXES)}"
        " (default: .npz and .glb beside the video)",
    )
    capture.add_argument(
        "--overlay", type=named_path, metavar="FILE", help="draw the body over the footage: .mp4, .png, .jpg"
    )
    capture.add_argument("--stop-with-stdin", action="store_true", help=argparse.SUPPRESS)  # as a batch starts it
    add_options(capture)
    batch = commands.add_parser("batch", help="capture every video and picture of a folder")
    batch.set_defaults(run=run_batch)
    batch.add_argument(
        "folder", type=named_path, metavar="FOLDER", help="folder of videos, pictures and picture sequences"
    )
    batch.add_argument("--out", type=named_path, required=True, metavar="FOLDER", help="where the results go")
    batch.add_argument(
        "--formats",
        default="npz,glb",
        metavar="LIST",
        help=f"what to write of every clip: {', '.join(s[1:] for s in SUFFIXES)} (default: npz,glb)",
    )
    batch.add_argument("--overlays", action="store_true", help="also write NAME.overlay.mp4 of every video")
    batch.add_argument("--recursive", action="store_true", help="folders below too")
    batch.add_argument("--jobs", type=int, default=1, metavar="N", help="clips captured at once (default: 1)")
    batch.add_argument("--again", action="store_true", help="also what was captured before and has not changed")
    add_options(batch)
    return parser


def main(argv: Sequence[str] | None = None, program: Sequence[str] = PROGRAM) -> int:
    """Run the command line; returns the exit status.

    :param program: how a process of its own is started that takes these arguments; a batch starts one per clip.
    """
    try:
        args, unknown = build_parser().parse_known_args(argv)
        if unknown:
            several = "; a folder of clips is for scope batch" if not unknown[0].startswith("-") else ""
            raise UsageError(f"cannot use {' '.join(unknown)} (see scope {args.command} --help{several})")
        args.program = list(program)
        with _stopped_by_signals(), _stdout_for_report() as stdout:
            if getattr(args, "stop_with_stdin", False):
                stop_with_parent()
            report = args.run(args)
            if args.json:
                print(json.dumps(report), file=stdout, flush=True)
        return report.pop("exit_status", 0)
    except ScopeError as error:
        print(f"scope: {error}", file=sys.stderr)
        return exit_status(error)
    except KeyboardInterrupt as stop:
        print(f"scope: stopped; {str(stop) or 'nothing was written'}", file=sys.stderr)
        return 130
    except (OSError, MemoryError) as error:
        print(f"scope: the system refused: {error}; free space or memory and try again", file=sys.stderr)
        return 1


def run_capture(args: argparse.Namespace) -> dict:
    """``scope capture``: check the arguments, capture, write every output; returns the report."""
    video = args.video or SAMPLE
    outputs = _each_once(args.output) or [video.with_suffix(".npz"), video.with_suffix(".glb")]
    _check_outputs(outputs, args.overlay, video)
    rig = _rig_of(args, outputs)

    body, options = body_and_options(args)
    # Imported here, so that --help and a wrong argument answer at once.
    from .capture.overlay.overlay_video import write_overlay
    from .capture.pipeline import capture

    with _ProgressBar(sys.stderr, show=sys.stderr.isatty() and not args.quiet) as progress:
        result = capture(video, body, options, progress)
        progress("writing", 0, 0)
        with _interrupted("some results may be there already, each of them whole"):
            written = _write(outputs, result.motions, body, video, args, rig)
            if args.overlay:
                write_overlay(
                    args.overlay,
                    video,
                    result.motions,
                    body,
                    progress=lambda i, n: progress("overlay", i, n),
                    wanted=options.wanted,
                )
                written.append(args.overlay)
    report = dict(result.report, outputs=[str(p) for p in written])
    for warning in report["warnings"]:
        _say(f"warning: {warning}")
    if not args.json:
        print(_summary(report), file=sys.stderr)
    return report


def run_batch(args: argparse.Namespace) -> dict:
    """``scope batch``: one process per clip, so that none can harm another; returns the report of all."""
    from .capture.pipeline import check_networks
    from .job.batch import Batch

    formats = [f".{f.strip().lstrip('.').lower()}" for f in args.formats.split(",") if f.strip()]
    for suffix in formats or ["."]:
        if suffix not in SUFFIXES:
            known = ",".join(s[1:] for s in SUFFIXES)
            raise UsageError(f"--formats takes a list out of {known}, not {args.formats!r}")
    if args.jobs < 1:
        raise UsageError(f"--jobs takes a number from 1 on, not {args.jobs}")
    _rig_of(args, [args.out / f"clip{suffix}" for suffix in formats])
    _, options = body_and_options(args)
    check_networks(options)  # what no clip can be captured with is said once, before the first
    batch = Batch(args.folder, args.out, args.program, given_options(args), formats, args.overlays)
    with _ProgressBar(sys.stderr, show=sys.stderr.isatty() and not args.quiet) as progress:
        with _interrupted("clips that are done stay, called again it goes on"):
            report = batch.run(args.jobs, recursive=args.recursive, again=args.again, progress=progress, say=_say)
    if not args.json:
        counts = ", ".join(f"{n} {what.replace('_', ' ')}" for what, n in report["counts"].items() if n)
        _say(f"{counts or 'nothing to capture'}; report in {batch.report_file}")
    return report


def _say(text: str) -> None:
    """A line of its own, also while a progress bar stands on the terminal."""
    clear = _CLEAR_LINE if sys.stderr.isatty() else ""
    print(f"{clear}scope: {text}", file=sys.stderr, flush=True)


def _rig_of(args: argparse.Namespace, outputs: list[Path]) -> RigSource | None:
    """The user's rig, tried before the work is done."""
    if args.retarget is None:
        given = {"--bone-map": args.bone_map, "--rig-object": args.rig_object}
        given["--retarget-root"] = args.retarget_root != ROOTS[0]
        for option, value in given.items():
            if value:
                raise UsageError(f"{option} is about a rig: give its file with --retarget")
        return None
    from .retarget.rig_source import rig_source

    rig = rig_source(args.retarget, args.rig_object, args.bone_map)
    scene_files = [p for p in outputs if p.suffix.lower() not in MOTION_SUFFIXES]
    if not scene_files:
        raise UsageError("--retarget needs an output that holds a rig, such as -o OUT.glb; a motion file holds none")
    for path in scene_files:
        if path.exists() and path.samefile(rig.path):
            raise UsageError(f"{path} is the rig's own file; choose another name")
    from .scene.rigs.rig_file import check_rig

    check_rig(rig, fingers=args.hands)
    return rig


def _write(
    outputs: list[Path],
    motions: list[Motion],
    body: Body,
    video: Path,
    args: argparse.Namespace,
    rig: RigSource | None = None,
) -> list[Path]:
    """Write every result file; bpy is loaded only when one of them needs a scene."""
    motion_files = [p for p in outputs if p.suffix.lower() in MOTION_SUFFIXES]
    scene_files = [p for p in outputs if p not in motion_files]
    written: list[Path] = []
    for path in motion_files:
        targets = person_paths(path, len(motions))
        for target, motion in zip(targets, motions, strict=True):
            motion.save(target)
        written += targets
    if scene_files:
        from .capture.media.image_sequence import find_sequence
        from .scene.build import NEW_SCENE
        from .scene.export.export import ExportOptions, export_motions

        sequence = find_sequence(video, args.fps is not None)
        footage = sequence.paths[0] if sequence else video
        options = replace(NEW_SCENE, name=video.stem, shape=args.shape_keys)
        separate = ExportOptions(separate=args.file_per_person)
        if rig is not None:
            from .scene.rigs.rig_export import RigExportOptions, export_on_rig

            rig_options = RigExportOptions(options, args.retarget_root, separate)
            files, warnings = export_on_rig(motions, body, scene_files, rig, rig_options, footage)
        else:
            files, warnings = export_motions(motions, body, scene_files, footage, options, separate)
        written += files
        for warning in warnings:
            _say(f"warning: {warning}")
    return written


def _check_outputs(outputs: list[Path], overlay: Path | None, video: Path) -> None:
    """Everything that can be known to fail is said before the work, not after it."""
    for path in outputs:
        check_output(path)
    if overlay:
        check_output(overlay, OVERLAY_SUFFIXES)
    paths = [*outputs, overlay] if overlay else outputs
    for path in paths:
        if path.exists() and video.exists() and path.samefile(video):
            raise UsageError(f"{path} is the footage itself; choose another name")


def _each_once(outputs: list[Path]) -> list[Path]:
    """Without further names of the same file, such as ``out/case.npz`` and ``out/x/../case.npz``."""
    named: dict[str, Path] = {}
    for path in outputs:
        named.setdefault(os.path.normcase(os.path.realpath(path)), path)
    return list(named.values())


def _summary(report: dict) -> str:
    people = "1 person" if report["people"] == 1 else f"{report['people']} people"
    frames = "1 frame" if report["frames"] == 1 else f"{report['frames']} frames"
    return (
        f"{people}, {frames}, {report['fps']['total']:.1f} frames/s, "
        f"reprojection error {report['reprojection_px']:.1f} px, networks on {report['execution']}; "
        f"wrote {', '.join(report['outputs'])}"
    )


class _ProgressBar:
    """A one-line bar on a terminal; silent elsewhere. Stops whoever works on after a signal."""

    def __init__(self, stream: TextIO, *, show: bool) -> None:
        self.stream, self.show = stream, show

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show ``done`` of ``total`` (0: unknown) of a stage.

        :raises KeyboardInterrupt: a signal said so, and nobody heard it.
        """
        if _signals:
            raise KeyboardInterrupt
        if not self.show:
            return
        if total:
            filled = min(30, 30 * done // total)
            text = f"{stage:<20} [{'#' * filled}{'.' * (30 - filled)}] {done}/{total}"
        else:
            text = f"{stage:<20} {done or ''}"
        self.stream.write(f"{_CLEAR_LINE}{text[:100]}")
        self.stream.flush()

    def __enter__(self) -> _ProgressBar:
        return self

    def __exit__(self, *_: object) -> None:
        if self.show:
            self.stream.write(_CLEAR_LINE)


@contextmanager
def _stdout_for_report() -> Iterator[TextIO]:
    """Everything that libraries print to stdout, also from C, goes to stderr; the report gets the real stdout."""
    sys.stdout.flush()
    try:
        real = os.dup(1)
    except OSError:  # a shell without any stdout
        yield sys.stdout
        return
    os.dup2(2, 1)
    _flush_c()  # what waits there already, such as Blender's version, is no part of the report either
    try:
        with os.fdopen(os.dup(real), "w", encoding="utf-8") as stream:
            yield stream
    finally:
        sys.stdout.flush()
        _flush_c()
        os.dup2(real, 1)
        os.close(real)


@contextmanager
def _interrupted(what: str) -> Iterator[None]:
    """Have a Ctrl-C in here say what it left behind."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(what) from None


def _flush_c() -> None:
    """Write out what C libraries have buffered for stdout."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL("ucrtbase" if os.name == "nt" else None).fflush(None)


def _interrupt(number: int, _: FrameType | None) -> None:
    """Note it as well: what is raised within a callback of the interpreter's own is lost."""
    _signals.append(number)
    raise KeyboardInterrupt


@contextmanager
def _stopped_by_signals() -> Iterator[None]:
    """Ctrl-C and a request to end raise KeyboardInterrupt, so that nothing half-written and no process stays behind.

    Blender has a handler of its own for Ctrl-C, which only notes it: a batch would go on to its end.
    """
    _signals.clear()
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, _interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:  # None: not Python's, so Python cannot put it back
                signal.signal(number, handler)


def run() -> NoReturn:
    """Entry point of a process of our own: ``main``, then an exit that cannot hang.

    Blender's module destroys a condition variable at exit while one of its own threads still waits on it, which blocks
    forever; everything of ours is written and closed by then, so the process leaves without those destructors.
    """
    status = main()
    sys.stdout.flush()
    sys.stderr.flush()
    if "bpy" in sys.modules:
        os._exit(status)
    sys.exit(status)


if __name__ == "__main__":
    run()
