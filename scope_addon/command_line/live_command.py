# SPDX-License-Identifier: GPL-3.0-or-later
"""The command that captures a camera, a stream or a playing video while it runs."""

from __future__ import annotations

import os
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...solver.errors import ScopeError
from ..errors import NoPersonError, UsageError, system_error_message
from ..installed import CAPTURE, check_installed, check_live, check_memory_limit
from ..live.unfinished import (
    SUFFIX,
    is_recording,
    is_unfinished,
    lock_of,
    remove_recording,
    unfinished_video,
)
from ..notices import counted
from ..options import Place, option, options_at
from ..options.body_choice import chosen_body
from ..output_paths import check_output, left_over, person_paths
from ..temporary import is_held
from .arguments import add_options, values_in_range
from .outputs import check_outputs, confine, refuse_inputs
from .signals import interrupted
from .terminal import ProgressLine, print_message

if TYPE_CHECKING:
    from ...solver.body import Body
    from ..live.footage_recording import FootageRecording
    from ..live.preview_page import PreviewPage
    from ..live.recording import PeopleRecording
    from ..live.run import LiveOptions, Output


def add_live(parser: ArgumentParser) -> None:
    """Add the arguments of ``scope live``."""
    parser.add_argument(
        "source",
        metavar="SOURCE",
        help="camera number or device, stream (rtsp://, http://, ...), or video, which is played "
        "in real time; or NAME.recording, which a killed capture has left, to finish it",
    )
    add_options(parser, Place.LIVE)
    parser.set_defaults(run=run_live_command)


def run_live_command(args: Namespace) -> dict[str, Any]:
    """Run ``scope live`` until the source ends or Ctrl-C, or ask a camera for its formats; return
    the report.

    :raises ScopeError: an argument is invalid, the source cannot be read, or an output failed.
    :raises KeyboardInterrupt: a second signal came; says what is written.
    """
    check_live()
    values = values_in_range(args, Place.LIVE)
    check_installed(CAPTURE if values["vmc"] is None else (*CAPTURE, "pythonosc"))
    if values["list_formats"]:
        used = ("list_formats", "json", "quiet")
        _refuse_others(values, used, "a capture, and --list-formats captures nothing")
        return _list_formats(args.source, quiet=args.json)
    check_memory_limit(with_scene=False)
    options = _checked(values)
    check_outputs(_paths(values), vars(args), overlay=values["keep_footage"])
    if values["keep_footage"]:  # its name is longer while it grows
        check_output(unfinished_video(values["keep_footage"]), (".mp4",))
    # Imported here, so that errors in the arguments are printed immediately.
    from ..live.open_source import is_stream

    to_finish = [Path(args.source)] if is_recording(args.source) else []
    if to_finish:
        used = ("record", "json", "quiet")
        _refuse_others(values, used, "a running capture, and this finishes a recording")
    is_served = values["json_port"] is not None or values["preview"]
    connects = is_stream(args.source) or values["vmc"] is not None or is_served
    confine(args, to_finish, connects=connects)
    report = (
        _finish_recording(Path(args.source), values["record"])
        if to_finish
        else _capture(args, values, options)
    )
    if not args.json:
        print_message(_summary(report))
    return report


def _capture(args: Namespace, values: Mapping[str, Any], options: LiveOptions) -> dict[str, Any]:
    """Capture until the source ends or Ctrl-C, and return the report.

    :raises ScopeError: the source cannot be read, or an output failed.
    :raises KeyboardInterrupt: a second signal came; says what is written.
    """
    from ..live.footage_recording import FootageRecording
    from ..live.open_source import open_source
    from ..live.recording import Keep, PeopleRecording
    from ..live.run import Listeners, run_live
    from ..live.source import FileSource
    from ..untrusted.body_file import load_body

    source = open_source(args.source)
    if isinstance(source, FileSource):
        others = {each.name for each in options_at(Place.LIVE)} - {"reconnect_s"}
        _refuse_others(values, others, "cameras and streams, and this is a file")
    name = chosen_body(values)
    body = load_body(name)
    with ExitStack() as stack:
        outputs = _outputs(values, body, stack)
        footage = (
            FootageRecording(values["keep_footage"], source.fps) if values["keep_footage"] else None
        )
        if footage and (left := unfinished_video(values["keep_footage"])).exists():
            print_message(f"{left} has the images of an earlier capture that was killed")
        recording = None
        if values["record"]:
            file = values["record"].with_suffix(SUFFIX)
            if is_held(lock_of(file)):
                raise UsageError(
                    f"another live capture records to {values['record']}, as {lock_of(file)} says; "
                    "give another name with --record, or remove that file if none runs"
                )
            if is_unfinished(file):
                print_message(f"{file} has a recording that is not finished: scope live {file}")
            keep = Keep(
                file, name, print_message, lambda: str((footage and footage.unfinished) or "")
            )
            recording = PeopleRecording(_paths(values), body, source, keep=keep)
        page = _preview(body, stack) if values["preview"] else None
        line = stack.enter_context(ProgressLine(sys.stderr, show=not args.quiet))
        with_camera = [output for output in (recording, page) if output]
        begin = _each([output.begin for output in with_camera])
        receive = _each([each for each in (footage and footage.add, page and page.receive) if each])
        listeners = Listeners(print_message, lambda state: line.write(str(state)), begin, receive)
        try:
            report = run_live(source, body, options, [*outputs, *with_camera], listeners)
        except BaseException as error:
            is_saved = _save_after_failure(recording, footage)
            if isinstance(error, KeyboardInterrupt) and is_saved:
                raise KeyboardInterrupt("what was recorded is written") from None
            raise
    saved = _save(recording, footage)
    _tell_left_over(values["record"], saved)
    report["outputs"] = [str(path) for path in saved]
    return report


def _save(recording: PeopleRecording | None, footage: FootageRecording | None) -> list[Path]:
    """Write what was recorded, the one even if the other fails, and return the files.

    :raises ScopeError: one is not where it should be; says where it is.
    """
    video = []
    failures: list[str] = []

    def save_video(footage: FootageRecording) -> None:
        try:
            video.append(footage.save())
        except (ScopeError, OSError):
            for failure in failures:  # which would not be told after this one
                print_message(failure)
            raise

    with ExitStack() as stack:
        if footage is not None:
            # Runs at the end, also after an error of the recording's.
            stack.callback(save_video, footage)
        with interrupted(recording.whereabouts if recording else ""):
            try:
                motions = recording.save() if recording is not None else []
            except ScopeError as error:
                failures.append(str(error))
                raise
    if footage is not None and footage.missing:
        print_message(footage.missing)
    return [*motions, *(path for path in video if path)]


def _tell_left_over(record: Path | None, saved: Sequence[Path]) -> None:
    """Tell which motion files beside those of a recording are of another one."""
    if record is not None and (others := left_over([record], saved)):
        print_message(f"warning: {others}")


def _save_after_failure(
    recording: PeopleRecording | None, footage: FootageRecording | None
) -> bool:
    """Write what was recorded before a failure, which is what the command then tells last; return
    whether there was anything.
    """
    try:
        saved = _save(recording, footage)
        for path in saved:
            print_message(f"wrote {path}, with everything until the capture ended")
        return bool(saved)
    except NoPersonError:
        return False
    except ScopeError as error:
        print_message(str(error))
    except (OSError, MemoryError) as error:
        print_message(system_error_message(error))
    return True


def _finish_recording(journal: Path, record: Path | None) -> dict[str, Any]:
    """Write the motion files of a recording that was not finished, and return the report.

    :param record: as the option gives it; None: beside the recording.
    :raises ScopeError: it cannot be read, or a file cannot be written.
    """
    from ..live.recording import unfinished_recording

    def paths(people: int) -> list[Path]:
        chosen = person_paths(record or journal.with_suffix(".npz"), people, separate=True)
        if record is None and (existing := [path for path in chosen if path.exists()]):
            raise UsageError(f"{existing[0]} exists; give another name with --record")
        return chosen

    recording, about = unfinished_recording(journal, paths)
    # The recording names what it was made of, as options do otherwise.
    named = [Path(about.body), Path(about.footage)]
    refuse_inputs(paths(about.people), filter(os.path.isfile, named))
    saved = recording.save()
    remove_recording(journal)
    _tell_left_over(record or journal.with_suffix(".npz"), saved)
    if about.footage and Path(about.footage).is_file():
        print_message(f"its images are in {about.footage}")
    return {
        "source": about.source,
        "seconds": round(recording.seconds, 2),
        "outputs": [str(path) for path in saved],
    }


def _list_formats(source: str, *, quiet: bool) -> dict[str, Any]:
    """Ask a camera for its formats.

    :raises ScopeError: it is not a camera, or does not answer.
    """
    from ..job.live_cameras import ask_for_formats

    camera = ask_for_formats(source)
    if not quiet:
        print_message(camera.label if camera.formats else f"{camera.label}: it reports no formats")
    return {"camera": camera.number, "name": camera.name, "formats": list(camera.formats)}


def _each(functions: Sequence[Callable[..., None]]) -> Callable[..., None]:
    """Return a function that calls others, one after another."""

    def call(*args: Any) -> None:
        for function in functions:
            function(*args)

    return call


def _paths(values: Mapping[str, Any]) -> list[Path]:
    """Return the motion files to write, one for each person."""
    return (
        person_paths(values["record"], values["live_people"], separate=True)
        if values["record"]
        else []
    )


def _refuse_others(values: Mapping[str, Any], used: Collection[str], advice: str) -> None:
    """Refuse options that have no effect here.

    :param used: names of those that have one.
    :param advice: what another one is for.
    :raises UsageError: it is given.
    """
    for each in options_at(Place.LIVE):
        if each.name not in used and values[each.name] != each.default:
            raise UsageError(f"{each.flag} is for {advice}: leave it out")


def _checked(values: Mapping[str, Any]) -> LiveOptions:
    """Check the options as far as possible without opening the source.

    :raises UsageError: a value is impossible, or contradicts another.
    """
    for flag, path, kind, suffix in (
        ("--record", values["record"], "motion file", ".npz"),
        ("--keep-footage", values["keep_footage"], "video", ".mp4"),
    ):
        if path and path.suffix.lower() != suffix:
            raise UsageError(
                f"{flag} writes a {kind}: give a name that ends in {suffix}, not {path.name}"
            )
    if not values["listen"].strip():
        raise UsageError(
            "--listen is empty, which would mean all networks; give an address, or leave it out"
        )
    if values["listen"] != option("listen").default and values["json_port"] is None:
        raise UsageError("--listen is the address on which --json-port listens: give it too")
    if len(values["heights_m"]) > values["live_people"]:
        raise UsageError(
            f"{len(values['heights_m'])} heights are given, but --people is {values['live_people']}"
        )
    from ..capture.camera.calibration import read_calibration
    from ..capture.camera.intrinsics import check_lens
    from ..live.run import LiveOptions

    check_lens(values["focal_mm"], values["fov_deg"], values["calibration"])
    if values["calibration"]:
        read_calibration(values["calibration"])
    return LiveOptions.of(values)


def _outputs(values: Mapping[str, Any], body: Body, stack: ExitStack) -> list[Output]:
    """Open the outputs; the stack closes them.

    :raises ScopeError: one cannot be opened.
    """
    outputs: list[Output] = []
    if values["json_port"] is not None:
        from ..live.json_lines import JsonServer

        server = stack.enter_context(
            JsonServer(body, values["listen"], values["json_port"], values["live_people"])
        )
        print_message(f"lines of JSON on {values['listen']} port {server.port}")
        outputs.append(server)
    if values["vmc"] is not None:
        from ..live.vmc import VmcSender, parse_address

        host, port = parse_address(values["vmc"], values["live_people"])
        for person in range(values["live_people"]):
            outputs.append(stack.enter_context(VmcSender(body, host, port + person, person)))
    return outputs


def _preview(body: Body, stack: ExitStack) -> PreviewPage:
    """Serve the preview; the stack ends it.

    :raises OutputError: it cannot be served.
    """
    from ..live.preview_page import PreviewPage

    page = stack.enter_context(PreviewPage(body))
    print_message(f"preview: open {page.address} in a browser")
    return page


def _summary(report: Mapping[str, Any]) -> str:
    written = "".join(f"; wrote {path}" for path in report["outputs"])
    if "latency_ms" not in report:  # of a recording that was not finished
        return f"{report['seconds']:g} s of {report['source']}{written}"
    latency = report["latency_ms"]
    return (
        f"{counted(report['poses'], 'pose')}, {report['poses_per_second']:g}/s, latency "
        f"{latency['median']:.0f} ms (p95 {latency['p95']:.0f} ms), {report['dropped']} of "
        f"{counted(report['frames'], 'frame')} dropped"
        + (f", {report['damaged']} more damaged and left out" if report["damaged"] else "")
        + written
    )
