# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: one argparse tree, used by the shell and by Blender's ``--command scope``.

Exit status: 0 done, 1 failed, 2 invalid arguments, 3 no person found. Progress and error messages
go to stderr; with ``--json``, stdout carries nothing but the report.
"""

from __future__ import annotations

import os
import shlex
import sys
from argparse import SUPPRESS, ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

from ..solver.body_file import ASSETS
from ..solver.errors import ScopeError
from .command_line.arguments import (
    add_options,
    add_outputs,
    body_and_options,
    non_default_arguments,
    path_argument,
    with_bare_values,
)
from .command_line.blender_module import discard_temporary
from .command_line.cluster_arguments import (
    WINDOW_SECONDS,
    add_window_arguments,
    add_window_seconds,
    dask_runner,
    folder_argument,
    local_folders,
    window_report,
    with_window_seconds,
)
from .command_line.import_command import add_import
from .command_line.live_command import add_live
from .command_line.outputs import (
    OF_RIGS,
    check_blender,
    check_outputs,
    checked_rigs,
    confine,
    default_outputs,
    distinct_paths,
    files_of_options,
    files_to_read,
    refuse_inputs,
    summary,
    write_outputs,
)
from .command_line.problem_command import add_problem_report
from .command_line.signals import interrupted, stopped_by_signals
from .command_line.terminal import (
    ProgressBar,
    open_standard_streams,
    print_message,
    stdout_for_report,
)
from .errors import (
    FAILED,
    OutputError,
    UsageError,
    exit_status,
    internal_error_message,
    keep_solver_hints_from_users,
    lacks_memory,
    system_error_message,
)
from .footage import display_text, files_of_footage, is_url, json_text
from .installed import CAPTURE, check_installed, check_memory_limit
from .job.clip_task import SHOWN_COMMAND, STOP_WITH_STDIN, Extras
from .job.finished_clip import FINISHED_FILE, write_finished
from .job.watched_footage import WatchedFiles, WatchedFootage
from .options.capture import OFF
from .output_paths import SUFFIXES, WITHOUT_SCENE
from .parent import end_with_parent
from .private_folder import lasting_folder

if TYPE_CHECKING:
    from .report.capture_page import CapturedClip

SAMPLE = ASSETS / "sample" / "sample.mp4"
PROGRAM = (sys.executable, "-m", str(__package__))


class _Parser(ArgumentParser):
    def __init__(self, **settings: Any) -> None:
        """Take flags by their full names only: `with_bare_values` knows no others."""
        super().__init__(**{"allow_abbrev": False, **settings})

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse the arguments, where some flags may come without a value; see
        `with_bare_values`.
        """
        given = sys.argv[1:] if args is None else list(args)
        return super().parse_known_args(with_bare_values(given), namespace)

    def error(self, message: str) -> NoReturn:
        """Raise UsageError instead of printing the whole usage."""
        raise UsageError(f"{message} (see {self.prog} --help)")


def build_parser() -> ArgumentParser:
    """Build the whole argparse tree."""
    parser = _Parser(
        prog="scope", description="Markerless motion capture: video in, animated body out."
    )
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", parser_class=_Parser
    )
    capture = commands.add_parser("capture", help="capture the people in a video or image")
    capture.set_defaults(run=run_capture)
    _add_capture_files(capture)
    add_options(capture)
    batch = commands.add_parser("batch", help="capture every video and image in a folder")
    batch.set_defaults(run=run_batch)
    _add_batch_files(batch)
    add_options(batch)
    add_import(
        commands.add_parser(
            "import", help="convert a motion file, of Scope or of another SMPL-based tool"
        )
    )
    add_live(
        commands.add_parser(
            "live", help="capture a camera, a stream or a playing video while it runs"
        )
    )
    add_problem_report(
        commands.add_parser(
            "report-a-problem",
            help="write what a problem report needs, without names of files, folders or people",
        )
    )
    return parser


def _add_capture_files(capture: ArgumentParser) -> None:
    capture.add_argument(
        "video",
        nargs="?",
        type=path_argument,
        metavar="VIDEO",
        help="video, image, or numbered images as a folder or walk_####.png (default: a sample)",
    )
    capture.add_argument(
        "views",
        nargs="*",
        type=path_argument,
        metavar="VIEW",
        help="further videos of the same moment, of other cameras; all must stand still",
    )
    add_outputs(capture, ".npz and .glb next to the video; in the current folder for the sample")
    capture.add_argument(
        "--overlay",
        type=path_argument,
        metavar="FILE",
        help="draw the body over the footage: .mp4, .png, .jpg",
    )
    capture.add_argument(
        "--report",
        type=path_argument,
        metavar="FILE",
        help="one page about the capture to open in a browser: overlay, 3D view, plots, warnings: "
        ".html",
    )
    capture.add_argument(
        "--save-calibration",
        type=path_argument,
        metavar="FILE",
        help="of several cameras, write what was found of them as a calibration: .toml",
    )
    # Passed by a batch to its processes.
    capture.add_argument(STOP_WITH_STDIN, action="store_true", help=SUPPRESS)
    capture.add_argument(SHOWN_COMMAND, default="", help=SUPPRESS)
    capture.add_argument(FINISHED_FILE, type=Path, help=SUPPRESS)
    add_window_arguments(capture)


def _add_batch_files(batch: ArgumentParser) -> None:
    batch.add_argument(
        "folder",
        type=folder_argument,
        metavar="FOLDER",
        help="folder of videos, images and image sequences, or its URL",
    )
    batch.add_argument(
        "--out",
        type=folder_argument,
        required=True,
        metavar="FOLDER",
        help="output folder, or its URL",
    )
    batch.add_argument(
        "--formats",
        default="npz,glb",
        metavar="LIST",
        help=f"formats to write for every clip: {', '.join(s[1:] for s in SUFFIXES)} (default: "
        "npz,glb)",
    )
    batch.add_argument(
        "--overlays", action="store_true", help="also write NAME.overlay.mp4 for every video"
    )
    batch.add_argument(
        "--reports", action="store_true", help="also write the page NAME.report.html for every clip"
    )
    batch.add_argument("--recursive", action="store_true", help="include subfolders")
    batch.add_argument(
        "--views",
        action="store_true",
        help="the videos in a subfolder are of the same moment, by several cameras: one motion for "
        "each subfolder",
    )
    batch.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="clips captured in parallel (default: 1)"
    )
    batch.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="capture on the Dask cluster of this scheduler (tcp://HOST:8786, or its scheduler "
        "file); --jobs then "
        "counts the clips of each worker",
    )
    batch.add_argument(
        "--again", action="store_true", help="capture every clip again, including finished ones"
    )
    add_window_seconds(batch)


def main(
    argv: Sequence[str] | None = None,
    program: Sequence[str] = PROGRAM,
    *,
    own_process: bool = False,
) -> int:
    """Run the command line and return the exit status. Errors are printed, not raised, except with
    SCOPE_TRACEBACK set.

    :param argv: arguments; those of the process if None.
    :param program: command that takes these arguments; a batch starts one such process per clip.
    :param own_process: whether the process ends with the command, which may then confine it.
    """
    try:
        args, unknown = build_parser().parse_known_args(argv)
        if unknown:
            advice = "; use scope batch for several clips" if not unknown[0].startswith("-") else ""
            if file := next(
                (each for each in unknown if each.startswith("-") and os.path.exists(each)), ""
            ):
                advice = f"; to capture the file of that name, write ./{file}"
            raise UsageError(
                f"unknown arguments: {' '.join(unknown)} (see scope {args.command} --help{advice})"
            )
        args.program = list(program)
        args.own_process = own_process
        given = [*program, *(sys.argv[1:] if argv is None else argv)]
        internal = STOP_WITH_STDIN, f"{FINISHED_FILE}="
        shown = shlex.join([each for each in given if not each.startswith(internal)])
        args.command_text = getattr(args, "shown_command", "") or shown
        with stopped_by_signals(), stdout_for_report() as stdout:
            if getattr(args, "stop_with_stdin", False):
                end_with_parent(discard_temporary, interrupts=True)
            report = args.run(args)
            if args.json:
                _print_report(report, stdout)
        return int(report.get("exit_status", 0))
    except ScopeError as error:
        print_message(str(error))
        return exit_status(error)
    except KeyboardInterrupt as stop:
        print_message(f"stopped; {str(stop) or 'nothing was written'}")
        return 130
    except (OSError, MemoryError) as error:
        print_message(system_error_message(error))
        return FAILED
    except Exception as error:
        if os.environ.get("SCOPE_TRACEBACK"):
            raise
        text = (
            system_error_message(MemoryError())
            if lacks_memory(error)
            else internal_error_message(error)
        )
        print_message(text)
        return FAILED


def _print_report(report: dict[str, Any], stdout: TextIO) -> None:
    """Print the report as one line of JSON.

    :raises OutputError: standard output is closed, full, or a pipe that nobody reads.
    """
    try:
        print(json_text(report), file=stdout, flush=True)
    except OSError as error:
        with suppress(OSError):
            stdout.close()  # would try again to write what it holds, when it is destroyed
        raise OutputError(
            f"the report cannot be written to standard output ({error.strerror}); all results are "
            "complete"
        ) from error


def run_capture(args: Namespace) -> dict[str, Any]:
    """Run ``scope capture``: check the arguments, capture, write every output; return the report.

    :raises ScopeError: an argument is invalid, or the capture or an output failed.
    """
    check_installed(CAPTURE)
    video = args.video or SAMPLE
    outputs = distinct_paths(args.output) or default_outputs(video)
    _check_files(args, video, outputs)
    # A rig may be edited during the capture.
    captured_with = {name: value for name, value in vars(args).items() if name not in OF_RIGS}
    named = WatchedFiles(files_of_options(captured_with))
    body, options = body_and_options(args)
    options = with_window_seconds(options, args)
    # Imported here, so that --help and errors in the arguments are printed immediately.
    from .job.watched_capture import watched_capture
    from .report.capture_page import CapturedClip

    confine(args, outputs)
    rigs = checked_rigs(args, outputs, args.hands != OFF, args.face)
    with ExitStack() as stack:
        progress = stack.enter_context(ProgressBar(sys.stderr, show=not args.quiet))
        if not args.views and (found := window_report(args, video, options, progress)):
            return found
        rate_given = options.wanted.fps is not None
        running = stack.enter_context(
            watched_capture(lasting_folder(), video, args.views, named, rate_given)
        )
        result = running.run(body, options, progress, windows_folder=args.windows_folder)
        progress("writing", 0, 0)
        with interrupted("some results may have been written already, each of them complete"):
            placed = result.report.placed_videos(args.views)
            written, warnings = write_outputs(
                outputs, result.motions, body, video, args, rigs, placed
            )
            captured = replace(result.report, warnings=[*result.report.warnings, *warnings])
            clip = CapturedClip(
                video, result.motions, body, captured, args.command_text, options.wanted
            )
            written += _write_extras(args, clip, running.footage, progress)
            running.check()
            report = captured.as_json() | {"outputs": [str(path) for path in written]}
            if args.finished_file:
                write_finished(args.finished_file, report)
    for warning in report["warnings"]:
        print_message(f"warning: {warning}")
    if not args.json:
        print(display_text(summary(report)), file=sys.stderr)
    return report


def _check_files(args: Namespace, video: Path, outputs: list[Path]) -> None:
    """Check that all results can be written, before anything is read.

    :raises ScopeError: one cannot.
    """
    if not args.video and not SAMPLE.is_file():
        raise UsageError(
            "the sample clip is only in the repository, not in this installation; "
            "give a VIDEO to capture"
        )
    if args.save_calibration and (not args.views or args.mirror):
        raise UsageError(
            "--save-calibration is for several videos, given one after the other, without --mirror"
        )
    inputs = vars(args) | {"video": video}
    check_outputs(outputs, inputs, args.overlay, args.report, args.save_calibration)
    check_blender(outputs)
    check_memory_limit(with_scene=any(path.suffix.lower() not in WITHOUT_SCENE for path in outputs))


def _write_extras(
    args: Namespace, clip: CapturedClip, footage: WatchedFootage, progress: ProgressBar
) -> list[Path]:
    """Write what was asked for besides the results, and return the paths.

    :raises ScopeError: a file cannot be written, or the footage was changed.
    """
    from .capture.camera.calibration import write_calibration
    from .capture.overlay_video import write_overlay
    from .report.capture_page import write_capture_page

    def watched(stage: str) -> Callable[..., None]:
        return footage.watched(lambda i, n: progress(stage, i, n), to_end=True)

    if args.save_calibration:
        write_calibration(args.save_calibration, clip.motions[0])
    if args.overlay:
        write_overlay(
            args.overlay,
            clip.video,
            clip.motions,
            clip.body,
            progress=watched("overlay"),
            wanted=clip.wanted,
        )
    if args.report:
        write_capture_page(args.report, clip, watched("report"))
    return [*filter(None, (args.save_calibration, args.overlay, args.report))]


def run_batch(args: Namespace) -> dict[str, Any]:
    """Run ``scope batch``: capture each clip in its own process; return the report on all of them.

    :raises ScopeError: an argument is invalid, there is no footage, or the report cannot be
        written.
    """
    check_installed(CAPTURE)
    from .capture.options import check_networks
    from .job.batch import Batch, how_to_continue, worker_table

    formats = [f".{f.strip().lstrip('.').lower()}" for f in args.formats.split(",") if f.strip()]
    for suffix in formats or ["."]:
        if suffix not in SUFFIXES:
            known = ",".join(s[1:] for s in SUFFIXES)
            raise UsageError(
                f"--formats must be a list of formats among {known}, not {args.formats!r}"
            )
    if args.jobs < 1:
        raise UsageError(f"--jobs must be at least 1, not {args.jobs}")
    clips = [Path(args.out) / f"clip{suffix}" for suffix in formats]
    check_blender(clips)
    rigs = checked_rigs(args, clips, args.hands != OFF, args.face)
    _, options = body_and_options(args)
    check_networks(options)  # an unusable network is reported once, before the first clip
    extras = Extras(args.overlays, args.reports)
    with ExitStack() as stack:
        runner = None
        folder, out = local_folders(args, stack)
        if args.scheduler is not None:
            runner = dask_runner(args, None if args.program == list(PROGRAM) else args.program)
            stack.callback(runner.close)
        given = non_default_arguments(args)
        if args.window_seconds is not None:
            given[WINDOW_SECONDS] = f"{args.window_seconds:g}"
        # absolute, because a worker of a cluster may have another current folder
        files = [os.path.abspath(file) for rig in rigs for file in rig.files]
        batch = Batch(folder, out, args.program, given, formats, extras, is_url(args.out), files)
        footage = batch.clips(args.recursive, args.views)
        read = [*files_to_read(vars(args)), *map(Path, files)]
        for path in footage.values():
            read += [path] if path.is_file() else files_of_footage(path)
        refuse_inputs([batch.report_file, *batch.results(footage)], read)
        progress = stack.enter_context(ProgressBar(sys.stderr, show=not args.quiet))
        stack.enter_context(interrupted(how_to_continue(args.again)))
        report = batch.run(
            args.jobs,
            recursive=args.recursive,
            views=args.views,
            again=args.again,
            progress=progress,
            say=print_message,
            runner=runner,
        )
    if not args.json:
        for line in worker_table(report):
            print_message(line)
        counts = ", ".join(
            f"{count} {status.replace('_', ' ')}"
            for status, count in report["counts"].items()
            if count
        )
        print_message(
            f"{counts or 'nothing to capture'}; report in {args.out}/{batch.report_file.name}"
        )
    return report


def run() -> NoReturn:
    """Run ``main`` as the entry point of a process, and exit in a way that cannot hang.

    When bpy is unloaded, it destroys a condition variable on which one of its own threads still
    waits, which blocks forever, also if a signal has interrupted its import. All our files are
    written and closed at this point, so the process exits without running destructors.
    """
    open_standard_streams()
    keep_solver_hints_from_users()
    status = main(own_process=True)
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):  # a full disk, or a reader who went away
            stream.flush()
    discard_temporary()
    os._exit(status)


if __name__ == "__main__":
    run()
