# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the clips of a batch, capture one of them in a process of its own, and describe the outcome
for the report.

A task and its outcome consist of plain values, so that another process, or another machine, can do
it.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import NO_PERSON, system_error_message
from ..footage import (
    FOOTAGE_SUFFIXES,
    PICTURE_SUFFIXES,
    VIDEO_SUFFIXES,
    continued,
    display_text,
    is_sequence,
    numbered_from,
    pictures_in,
    unicode_text,
)
from ..temporary import remove
from .finished_clip import (
    FINISHED_FILE,
    content_of,
    file_hash,
    finished_file,
    read_finished,
    remove_finished,
)
from .request import program_version

# options that only a batch passes
SHOWN_COMMAND = "--shown-command"
STOP_WITH_STDIN = "--stop-with-stdin"
# likewise, only on a cluster
WINDOWS = "--windows"
WINDOWS_FOLDER = "--windows-folder"
# value of WINDOWS: capture the clip, or only say into how many windows it can be divided
COUNT = "count"
RATE = "--fps"  # option with which a picture stands for those that continue its sequence
FINISHED = ("done", "skipped", "no_person")  # statuses of clips that need not be captured again
DIVIDED = "divided"  # status of a clip that has several
REPORT = ".report"  # between a clip's name and the suffix of its page

Entry = dict[str, Any]  # the outcome of a clip, as the report has it
OVERLAY = ".overlay"  # precedes the suffix of an overlay, which is not footage
# as person_paths names the results of one of several people
_PERSON = re.compile(r"(.+)\.person[0-9]+")


class Extras(NamedTuple):
    """What a batch writes of every clip besides the result files."""

    overlays: bool = False
    reports: bool = False


NO_EXTRAS = Extras()


class CaptureSettings(NamedTuple):
    """What is the same for every clip of a batch.

    :param options: arguments of every capture: flag to text; None for a flag that takes no value.
    :param suffixes: suffixes of the result files, such as ``.npz``.
    :param extras: what else to write of each clip.
    :param further_files: paths of files that decide the results, besides those that the options
        name: what these refer to, such as a rig's textures.
    """

    options: dict[str, str | None]
    suffixes: tuple[str, ...]
    extras: Extras = NO_EXTRAS
    further_files: tuple[str, ...] = ()

    def basis(self, program_version: str) -> str:
        """Return the part of the clips' keys that is the same for all: program, options, and the
        contents of the files that decide the results.

        :raises OSError: a file cannot be read.
        """
        values = {k: v for k, v in self.options.items() if k != "--threads"}
        text = json.dumps(
            [program_version, sorted(values.items()), list(self.suffixes), self.extras]
        )
        digest = hashlib.sha256(text.encode())
        for flag, value in values.items():
            files = [Path(value)] if value else []  # a body, a network
            # a network's description
            files += [path.with_suffix(".json") for path in files if path.suffix == ".onnx"]
            if value and flag == "--calibration":
                from ..capture.camera.calibration_tables import files_of_calibration

                files = files_of_calibration(Path(value))
            # unlike Path's, False for what is too long for a name
            _add_files(digest, filter(os.path.isfile, files))
        _add_files(digest, map(Path, filter(os.path.isfile, self.further_files)))
        return digest.hexdigest()


class ClipTask(NamedTuple):
    """One clip to capture.

    :param name: name of its results below ``out``, without suffix.
    :param file: name of the footage in the report.
    :param footage: path of a video, an image, or a folder with an image sequence or with the videos
        of several cameras.
    :param out: output folder.
    :param basis: see `CaptureSettings.basis`.
    :param previous: entry of the previous report, if its files still exist.
    :param final: folder to which the results are moved later, or its address as it may be shown;
        empty if they stay in ``out``.
    :param address: of footage that was downloaded, as it may be shown; empty if it was not.
    :param windows: `COUNT`, or a range ``FIRST:END`` of windows that are to be observed; empty: the
        clip is captured.
    :param windows_folder: of a clip that is captured, with windows that were observed before.
    :param key: of the clip, if it is known.
    :param again: capture the clip even if its results are there.
    """

    name: str
    file: str
    footage: str
    out: str
    basis: str
    settings: CaptureSettings
    previous: Entry | None = None
    final: str = ""
    address: str = ""
    windows: str = ""
    windows_folder: str = ""
    key: str = ""
    again: bool = False


def capture_clip(
    task: ClipTask,
    program: Sequence[str],
    run: Callable[[list[str]], tuple[int, str, str]],
    threads: int | None = None,
) -> Entry:
    """Capture a clip unless it is finished, and return its entry in the report, also if the clip
    fails.

    :param program: command that takes ``capture FILE -o OUT --json``.
    :param run: runs a process and returns its exit status, stdout and stderr.
    :param threads: of the networks; None if no number is to be given.
    """
    start = time.monotonic()
    footage = Path(task.footage)
    out = Path(task.out)
    try:
        key = task.key or clip_key(task.basis, footage, RATE in task.settings.options)
    except OSError as error:
        return failure(task, f"{footage} cannot be read: {error.strerror}")
    entry: Entry = {"file": task.file, "name": task.name, "key": key}
    # On a cluster, results are moved when they are finished.
    leaves_record = not task.final and not task.windows
    record = finished_file(out, task.name, key) if leaves_record else None
    if (finished := _finished_before(task, entry, record)) is not None:
        return finished
    try:
        (out / task.name).parent.mkdir(parents=True, exist_ok=True)
        if record is not None:
            remove_finished(out, task.name)
        status, stdout, stderr = run(_command(task, program, threads, record))
    except OSError as error:
        return entry | failure(task, system_error_message(error))
    entry["seconds"] = round(time.monotonic() - start, 2)
    report = _last_object(stdout)
    try:
        if status in (0, NO_PERSON) and not task.windows and not _is_unchanged(task, key):
            if record is not None:
                remove(record)
            return entry | failure(
                task,
                "the footage, or a file that the options name, was changed while it was captured; "
                "run the same command again",
            )
        if status == 0 and report is not None:
            return entry | _outcome(report, out, task.name)
    except OSError as error:
        return entry | failure(task, f"the footage or a result cannot be read again ({error})")
    message = _error_message(stderr)
    if status == NO_PERSON:
        return entry | {"status": "no_person", "outputs": [], "message": message}
    return entry | failure(task, message or f"the process ended with status {status}")


def _command(
    task: ClipTask, program: Sequence[str], threads: int | None, record: Path | None
) -> list[str]:
    """Return the command that captures a clip.

    :param record: that the process leaves when its results are complete; None: none.
    """
    footage = Path(task.footage)
    target = Path(task.out) / task.name
    command = [*program, *_arguments(footage, target, task.settings, threads)]
    # Of a part of a long clip, or of one whose parts were observed before.
    folder = task.windows_folder or (task.out if task.windows not in ("", COUNT) else "")
    given = {WINDOWS: task.windows, WINDOWS_FOLDER: folder, FINISHED_FILE: record}
    command += [f"{option}={value}" for option, value in given.items() if value]
    if task.final:  # a page about the capture shows its command
        # As text, because a path would take one of the slashes from an address.
        shown_target = f"{task.final.rstrip('/')}/{task.name}"
        shown = _arguments(footage, shown_target, task.settings, threads)
        if task.address:
            shown = [each.replace(task.footage, task.address) for each in shown]
        shown.remove(STOP_WITH_STDIN)
        command += [SHOWN_COMMAND, shlex.join([*program, *shown])]
    return command


def _finished_before(task: ClipTask, entry: Entry, record: Path | None) -> Entry | None:
    """Return the entry of a clip that an earlier batch has finished; None if there is no such clip.

    :param entry: begun, with the clip's key.
    :param record: see `finished_clip`; None if no process leaves one.
    """
    if task.previous and task.previous.get("key") == entry["key"]:
        return task.previous | {
            "file": task.file,
            "status": task.previous["status"].replace("done", "skipped"),
        }
    report = read_finished(record, Path(task.out)) if record and not task.again else None
    if report is None:
        return None
    try:
        return entry | _outcome(report, Path(task.out), task.name) | {"status": "skipped"}
    except OSError:
        return None


def _is_unchanged(task: ClipTask, key: str) -> bool:
    """Return whether footage and options are those of a clip's key, by which its results count as
    finished: its process has read them later.

    :raises OSError: a file cannot be read any more.
    """
    basis = task.settings.basis(program_version())
    return clip_key(basis, Path(task.footage), RATE in task.settings.options) == key


def names_of_results(reported: Iterable[str], name: str) -> list[str]:
    """Return the names of a clip's results on the disk, of which a report may have `unicode_text`.

    :param name: of the clip, with which they begin, unless they are of windows.
    """
    start = unicode_text(name)
    names = []
    for each in reported:
        text = unicode_text(each)
        names.append(name + text.removeprefix(start) if text.startswith(start) else each)
    return names


def failure(task: ClipTask, message: str) -> Entry:
    """Return the entry of a clip that could not be captured, without passwords of addresses: it
    becomes a part of the batch's report.
    """
    return {
        "file": task.file,
        "name": task.name,
        "status": "failed",
        "message": display_text(message),
    }


def _outcome(report: dict[str, Any], out: Path, name: str) -> Entry:
    """Return what the report of a process that has ended well adds to the clip's entry.

    :param name: of the clip.
    :raises OSError: a result cannot be read.
    """
    if report.get("windows"):
        return {"status": DIVIDED, "windows": report["windows"]}
    paths = names_of_results(report.pop("outputs"), str(out / name))
    outputs = [Path(path).relative_to(out).as_posix() for path in paths]
    content = content_of(out, outputs)
    return {"status": "done", "outputs": outputs, "content": content, "report": report}


def _arguments(
    footage: Path, target: Path | str, settings: CaptureSettings, threads: int | None
) -> list[str]:
    """Return the arguments that capture a clip; ``target`` is the path or address of its results
    without suffix.
    """
    videos = [str(path) for path in videos_of_take(footage)] or [str(footage)]
    arguments = ["capture", *videos, "--json", "--quiet", STOP_WITH_STDIN]
    for suffix in settings.suffixes:
        arguments += ["-o", f"{target}{suffix}"]
    if settings.extras.reports:
        arguments += ["--report", f"{target}{REPORT}.html"]
    if settings.extras.overlays:
        begins = RATE in settings.options and len(numbered_from(footage)) > 1
        suffix = ".png" if _is_picture(footage) and not begins else ".mp4"
        arguments += ["--overlay", f"{target}{OVERLAY}{suffix}"]
    given: dict[str, str | None] = {} if threads is None else {"--threads": str(threads)}
    for option, value in (given | settings.options).items():
        # one argument: a value may begin with -
        arguments.append(option if value is None else f"{option}={value}")
    return arguments


def _is_picture(path: Path) -> bool:
    return path.suffix.lower() in PICTURE_SUFFIXES and not path.is_dir()


def clip_key(basis: str, footage: Path, rate_given: bool) -> str:
    """Hash the program, the options and the footage.

    :param basis: see `CaptureSettings.basis`.
    :param rate_given: whether a frame rate is given, so that a picture begins a sequence.
    :raises OSError: the footage cannot be read.
    """
    digest = hashlib.sha256(basis.encode())
    files = [footage]
    if footage.is_dir():
        # Not of what file managers add while a folder is captured.
        files = videos_of_take(footage) or pictures_in(footage)
    elif rate_given:
        files = numbered_from(footage) or files
    # The numbers of pictures are their times.
    digest.update(json.dumps([file.name for file in files]).encode())
    _add_files(digest, files)
    return digest.hexdigest()


def _add_files(digest: hashlib._Hash, files: Iterable[Path]) -> None:
    for file in files:
        digest.update(bytes.fromhex(file_hash(file)))


def _last_object(text: str) -> dict[str, Any] | None:
    """Return the JSON object on the last line; the lines before it are other output of the
    program.
    """
    for line in reversed(text.splitlines()):
        if line.startswith("{"):
            try:
                report = json.loads(line)
            except (ValueError, RecursionError):
                return None
            return report if isinstance(report, dict) else None
    return None


def _error_message(stderr: str) -> str:
    """Return the error message without the prefix of the program's name."""
    lines = [line.strip() for line in stderr.splitlines() if line.strip()]
    own = [
        line.removeprefix("scope: ")
        for line in lines
        if line.startswith("scope: ") and "warning:" not in line
    ]
    return (own or lines or [""])[-1]


def find_clips(
    folder: Path,
    out: Path,
    *,
    recursive: bool,
    several_people: bool,
    views: bool = False,
    rate_given: bool = False,
) -> dict[str, Path]:
    """Return the clips in ``folder`` by the name of their results, without suffix, in alphabetical
    order of the files.

    :param out: output folder, whose files are not footage.
    :param recursive: include subfolders.
    :param several_people: whether a clip may have one result per person.
    :param views: whether the videos of a subfolder are views of one take, which is a clip then.
    :param rate_given: whether a frame rate is given, so that the first one of numbered pictures
        stands for all.
    """
    found = sorted(_footage_below(folder, out, recursive, views))
    if rate_given:
        others = continued(filter(_is_picture, found))
        found = [path for path in found if path not in others]
    stems = Counter(_stem(folder, path) for path in found)
    names = {}
    for path in found:
        relative = path.relative_to(folder)
        short = path.is_file() and stems[_stem(folder, path)] == 1
        names[path] = (relative.with_suffix("") if short else relative).as_posix()
    # a full name may be another clip's short one
    while full := _full_names_of_shared(folder, names, several_people):
        names |= full
    clips: dict[str, Path] = {}
    taken: set[str] = set()
    for path, name in names.items():
        # The output folder may not tell names apart of which the case of a letter is all that
        # differs, nor the report those that differ in bytes which are not UTF-8.
        unique = name
        number = 1
        while unicode_text(unique).casefold() in taken:
            number += 1
            unique = f"{name} {number}"
        taken.add(unicode_text(unique).casefold())
        clips[unique] = path
    return clips


def _full_names_of_shared(
    folder: Path, names: dict[Path, str], several_people: bool
) -> dict[Path, str]:
    """Return full names for clips whose short name is also used by another clip, or by one person's
    result of it.
    """
    folded = {path: name.casefold() for path, name in names.items()}
    counts = Counter(folded.values())
    full = {}
    for path, name in folded.items():
        person = _PERSON.fullmatch(name) if several_people else None
        if counts[name] > 1 or (person and person[1] in counts):
            full[path] = path.relative_to(folder).as_posix()
    return {path: name for path, name in full.items() if name != names[path]}


def _stem(folder: Path, path: Path) -> str:
    """Return the name that must be unique among clips; case-insensitive, as many file systems
    are.
    """
    return path.relative_to(folder).with_suffix("").as_posix().casefold()


def _footage_below(
    folder: Path, out: Path, recursive: bool, views: bool, above: tuple[Path, ...] = ()
) -> list[Path]:
    """Return the videos, pictures and picture sequences in a folder.

    :param above: the folders that lead to it, to which links are not followed: that would never
        end.
    """
    above = (*above, folder.resolve())
    found: list[Path] = []
    for path in folder.iterdir():
        suffix = path.suffix.lower()
        if path.name.startswith(".") or path == out or path.stem.endswith(OVERLAY):
            continue
        if path.is_dir():
            videos = videos_of_take(path) if views else []
            is_take = len(videos) > 1
            is_sequence_folder = _is_sequence_folder(path)
            if is_take or is_sequence_folder:
                found.append(path)
            elif not recursive:
                found += videos
            if recursive and not is_sequence_folder and path.resolve() not in above:
                below = _footage_below(path, out, recursive, views, above)
                # of a take's folder, only what lies in its subfolders
                found += [
                    each for each in below if not is_take or each.is_dir() or each.parent != path
                ]
        # Pipes are skipped, because opening one would block; a broken link is kept, to be reported
        # as a failed clip.
        elif suffix in FOOTAGE_SUFFIXES and (path.is_file() or not path.exists()):
            found.append(path)
    return found


def videos_of_take(folder: Path) -> list[Path]:
    """Return the videos in a folder, in alphabetical order; none if it cannot be read."""
    try:
        return sorted(
            path
            for path in folder.iterdir()
            if path.suffix.lower() in VIDEO_SUFFIXES
            and not path.name.startswith(".")
            and not path.stem.endswith(OVERLAY)
            and path.is_file()
        )
    except OSError:
        return []


def _is_sequence_folder(folder: Path) -> bool:
    """Return whether a folder contains one numbered sequence, and neither videos nor subfolders."""
    try:
        others = [p for p in folder.iterdir() if p.is_dir() or p.suffix.lower() in VIDEO_SUFFIXES]
        return is_sequence(pictures_in(folder)) and all(p.name.startswith(".") for p in others)
    except OSError:
        return False
