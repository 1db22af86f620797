# SPDX-License-Identifier: GPL-3.0-or-later
"""The requests to a worker: for a capture, with the key of its result in the cache, for a live
capture, for a camera's formats and for a frame; and the commands to a running live capture.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import threading
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Self

from ..content import add_content
from ..errors import SetupError, UsageError
from ..options import Place, option, options_at

ROOT = Path(__file__).resolve().parents[2]  # of the installed program
# the request to compile what a capture needs, without capturing anything
WARM_UP = json.dumps({"warm_up": True})
# What decides the result of a capture: folders, and how the names of the files end. The panel and
# the sample do not.
_DECIDES = {"solver": (".py",), "scope_addon": (".py",), "assets": (".onnx", ".npz", ".json")}
_DECIDE_NOTHING = ("scope_addon/ui", "assets/sample")
# of footage, of which a larger file is sampled; reading gigabytes would block the window
_MOST_BYTES = 1 << 25
# commands to a running live capture
RECORD = b"record\n"
STOP = b"stop\n"
_LONGEST = 4096  # bytes without an end of line, which is no command
MOTION = "person{}.npz"  # file of a live recording, by the person's number from 1 on


class LineRequest:
    """What a worker is asked for: one line of JSON, whose keys are the arguments of the
    constructor.
    """

    called: ClassVar[str]  # in messages
    first_key: ClassVar[str]  # which begins it, and no other kind of request
    content: dict[str, Any]  # the arguments, for which JSON has a form

    def to_json(self) -> str:
        """Return the request as one line of JSON."""
        return json.dumps(self.content)

    @classmethod
    def is_in(cls, text: str) -> bool:
        """Return whether a text is such a request, rather than another one."""
        return text.startswith(f'{{"{cls.first_key}": ')

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Parse a request.

        :raises UsageError: the text is not a request.
        """
        try:
            return cls(**json.loads(text))
        except (ValueError, TypeError, RecursionError) as error:
            raise UsageError(f"this is not {cls.called}: {error}") from error


class JobRequest(LineRequest):
    """One capture: the footage, further videos of the same moment, and a value for each option of
    `Place.WORKER`.
    """

    called = "a capture request"
    first_key = "footage"

    def __init__(self, footage: str, views: Sequence[str] = (), **values: Any) -> None:
        """Check the values, and fill in the defaults of the others.

        :raises UsageError: an option does not exist, or its value has the wrong type or is none of
            the choices.
        """
        self.footage = footage
        self.views = tuple(views)
        self.values = checked_values(values, Place.WORKER)
        self.content = {"footage": footage, "views": self.views, **self.values}

    def key(self, code_version: str) -> str:
        """Return the hexadecimal key of the result: equal only for the same footage, options and
        program.

        :param code_version: differs between programs whose results may differ; see `code_version`.
        :raises OSError: the footage cannot be read.
        """
        options = [option for option in options_at(Place.WORKER) if option.decides_result]
        values = {option.name: self.values[option.name] for option in options}
        digest = hashlib.sha256(json.dumps([values, code_version], sort_keys=True).encode())
        for footage in (self.footage, *self.views):
            _add_file(digest, Path(footage))
        for file in self.named_files():
            _add_file(digest, file)
        return digest.hexdigest()[:32]

    def named_files(self) -> list[Path]:
        """Return the existing files that options name and that decide the result; the worker
        reports missing ones.
        """
        # Imported here, because Blender loads this module when it starts.
        from ..capture.camera.calibration_tables import files_of_calibration

        named = [
            self.values[option.name]
            for option in options_at(Place.WORKER)
            if option.decides_result and (option.value_type is Path or option.name == "body")
        ]
        files: list[Path] = []
        for path in (Path(str(name)) for name in filter(None, named)):
            # A network's description lies next to it. The camera's name after a calibration's file
            # is among the values.
            beside = (path.with_suffix(".json"), *files_of_calibration(path))
            files += [file for file in dict.fromkeys((path, *beside)) if file.is_file()]
        return files


def checked_values(values: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """Return the value of each option of a worker, with defaults.

    :raises UsageError: an option does not exist, or its value has the wrong type or is none of the
        choices.
    """
    options = {option.name: option for option in options_at(place)}
    for name, value in values.items():
        if name not in options:
            raise UsageError(
                f"a capture request has no option {name!r}; its options are {', '.join(options)}"
            )
        if problem := options[name].type_error(value):
            raise UsageError(f"{name} {problem}")
    filled = {name: values.get(name, option.default) for name, option in options.items()}
    return {
        name: tuple(value) if options[name].several else value for name, value in filled.items()
    }


def _add_file(digest: hashlib._Hash, path: Path) -> None:
    """Add name, modification time, and content, of a large file samples."""
    digest.update(os.fsencode(path.name) + f" {path.stat().st_mtime_ns}".encode())
    add_content(digest, path, _MOST_BYTES)


def code_version(root: Path = ROOT) -> str:
    """Hash the installed program: names, sizes and modification times of what decides the result of
    a capture.
    """
    status = {name: file.stat() for name, file in _program_files(root)}
    stamps = [(name, s.st_size, s.st_mtime_ns) for name, s in status.items()]
    return hashlib.sha256(json.dumps(stamps).encode()).hexdigest()


@cache
def program_version(root: Path = ROOT) -> str:
    """Hash names and contents of what decides the result of a capture: equal on machines with the
    same program.

    :raises SetupError: a file cannot be read.
    """
    digest = hashlib.sha256()
    for name, file in _program_files(root):
        try:
            content = file.read_bytes()
        except OSError as error:
            raise SetupError(
                f"{file}, a part of Scope, cannot be read ({error.strerror}); install it again"
            ) from error
        digest.update(json.dumps([name, hashlib.sha256(content).hexdigest()]).encode())
    return digest.hexdigest()


def _program_files(root: Path) -> list[tuple[str, Path]]:
    """Return the sources, networks, bodies and priors, sorted by their names below the root."""
    found = []
    for top, suffixes in _DECIDES.items():
        for place, folders, files in os.walk(root / top):
            below = Path(place).relative_to(root).as_posix()
            folders[:] = [
                name
                for name in folders
                if name != "__pycache__" and f"{below}/{name}" not in _DECIDE_NOTHING
            ]
            found += [
                (f"{below}/{name}", Path(place, name)) for name in files if name.endswith(suffixes)
            ]
    return sorted(found)


class LiveRequest(LineRequest):
    """A source, whether it may be a stream, and a value for each option of `Place.LIVE_WORKER`."""

    called = "the request of a live capture"
    first_key = "live"

    def __init__(self, live: str, *, online: bool = False, **values: Any) -> None:
        """Check the values, and fill in the defaults of the others.

        :param live: camera, stream or file.
        :param online: whether the network may be used.
        :raises UsageError: an option does not exist, or its value has the wrong type or is none of
            the choices.
        """
        if not isinstance(live, str) or not isinstance(online, bool):
            raise UsageError(
                "a live capture's request needs a source, and whether the network may be used"
            )
        self.source = live
        self.online = online
        self.values = checked_values(values, Place.LIVE_WORKER)
        self.content = {"live": live, "online": online, **self.values}


class Commands:
    """The commands so far. ``receive`` may be called from another thread."""

    def __init__(self) -> None:
        self.recording = threading.Event()
        self.stopped = threading.Event()
        self._unfinished = b""

    def receive(self, piece: bytes) -> None:
        """Take what was written, in any pieces; lines that are no command are ignored."""
        *lines, self._unfinished = (self._unfinished + piece).split(b"\n")
        self._unfinished = self._unfinished[-_LONGEST:]
        for line in lines:
            if line + b"\n" == RECORD:
                self.recording.set()
            elif line + b"\n" == STOP:
                self.stopped.set()


class FormatsRequest(LineRequest):
    """A camera, by number or device."""

    called = "the request for a camera's formats"
    first_key = "formats_of"

    def __init__(self, formats_of: str) -> None:
        """Check it.

        :raises UsageError: it is neither.
        """
        if not isinstance(formats_of, str) or not re.fullmatch(
            r"(/dev/video)?[0-9]{1,3}", formats_of
        ):
            raise UsageError("a request for formats needs the number of a camera")
        self.source = formats_of
        self.content = {"formats_of": formats_of}


class PictureRequest(LineRequest):
    """The frame of some footage at a time, as a capture with these options sees it."""

    called = "the request for a frame"
    first_key = "picture_of"

    def __init__(self, picture_of: str, *, time_s: float, rotate: str, mirror: bool) -> None:
        """Check the values.

        :param picture_of: path of the footage.
        :param rotate, mirror: the options of a capture.
        :raises UsageError: one is of the wrong type, or none of the choices.
        """
        is_time = type(time_s) in (int, float) and 0.0 <= time_s < float("inf")
        if not isinstance(picture_of, str) or not is_time:
            raise UsageError("a request for a frame needs the footage and a time")
        for name, value in (("rotate", rotate), ("mirror", mirror)):
            if problem := option(name).type_error(value):
                raise UsageError(f"{name} {problem}")
        self.footage = picture_of
        self.time_s = time_s
        self.rotate = rotate
        self.mirror = mirror
        self.content = {
            "picture_of": picture_of,
            "time_s": time_s,
            "rotate": rotate,
            "mirror": mirror,
        }
