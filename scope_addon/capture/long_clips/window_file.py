# SPDX-License-Identifier: GPL-3.0-or-later
"""What was observed in a window as a file, for the process that joins the windows: arrays, and JSON
that says where in the record they are; no Python objects.

A file may come from another machine, so its numbers are checked (`sound_record`). One that is
missing, damaged, of another window or of another version of the program counts for nothing: the
window is observed again.
"""

from __future__ import annotations

import hashlib
import json
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver.errors import ModelFileError, ScopeError
from ...atomic_write import write_npz
from ...content import add_content
from ...notices import Notice
from ...untrusted.files import UNREADABLE, read_npz
from ..camera.background_record import BackgroundRecord
from ..camera.calibration_tables import files_of_calibration
from ..camera.corner_tracks import CornerTracks
from ..camera.heading_drift import FrameEdges
from ..camera.line_segments import Segments
from ..frame_observer import Observed, Window
from ..options import CaptureOptions
from ..perception.adapters.description import description_path
from ..perception.observation import PendingReference, PersonMask
from ..perception.region import Region
from ..tracking.track import Tracklet
from .kept_estimates import KeptFolder
from .sound_record import is_sound

# The records of which an observation consists; no other class is made of a file.
_RECORDS = {
    record.__name__: record
    for record in (
        Observed,
        Window,
        Tracklet,
        PersonMask,
        Region,
        BackgroundRecord,
        FrameEdges,
        Segments,
        CornerTracks,
        Notice,
    )
}
_JSON = "json"  # the array with the text
Arrays = dict[str, NDArray[Any]]
_MOST_BYTES = 1 << 28  # of a network; a larger one is sampled
_UNIMPORTANT = ("threads",)  # options with which the result is the same, bit for bit


def window_name(number: int) -> str:
    """Return the name of a window's file."""
    return f"window{number:05d}.npz"


def save_window(folder: Path, observed: Observed) -> Path:
    """Write a window's file, and return its path.

    :raises OSError: it cannot be written.
    """
    path = folder / window_name(observed.window.number)
    arrays: Arrays = {}
    text = json.dumps(_as_json(observed, arrays))
    arrays[_JSON] = np.frombuffer(text.encode(), np.uint8)
    write_npz(path, arrays, replaces_links=True)
    return path


def load_window(folder: Path, window: Window) -> Observed | None:
    """Read a window's file; None if it is missing, damaged, or of another window."""
    path = folder / window_name(window.number)
    with suppress(ScopeError, AttributeError, *UNREADABLE):
        arrays = read_npz(path, ModelFileError, "window")
        observed = _of_json(json.loads(arrays[_JSON].tobytes()), arrays)
        if isinstance(observed, Observed) and observed.window == window and is_sound(observed):
            return observed
    return None


def _as_json(value: Any, arrays: Arrays) -> Any:
    """Return a value for JSON; arrays, and lists of them as one array, are added to ``arrays``."""
    if isinstance(value, list) and value and isinstance(value[0], np.ndarray):
        return {"list": _as_json(np.array(value), arrays)}
    if isinstance(value, np.ndarray):
        name = f"array{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, Future):
        return {"reference": _as_json(value.result(), arrays)}
    if is_dataclass(value):
        content = {each.name: getattr(value, each.name) for each in fields(value)}
        return {"record": type(value).__name__, "fields": _as_json(content, arrays)}
    if isinstance(value, dict):
        return {"items": [[key, _as_json(each, arrays)] for key, each in value.items()]}
    if isinstance(value, tuple):
        return {"tuple": [_as_json(each, arrays) for each in value]}
    if isinstance(value, list):
        return [_as_json(each, arrays) for each in value]
    return value


def _of_json(value: Any, arrays: Arrays) -> Any:
    """Return what `_as_json` was given."""
    if isinstance(value, list):
        return [_of_json(each, arrays) for each in value]
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return arrays[value["array"]]
    if "list" in value:
        return list(_of_json(value["list"], arrays))
    if "reference" in value:
        return known_reference(_of_json(value["reference"], arrays))
    if "record" in value:
        return _RECORDS[value["record"]](**_of_json(value["fields"], arrays))
    if "tuple" in value:
        return tuple(_of_json(value["tuple"], arrays))
    return {key: _of_json(each, arrays) for key, each in value["items"]}


def known_reference(landmarks: NDArray[Any] | None) -> PendingReference:
    """Return the result of the reference network as if it had been pending.

    :param landmarks: (33, 3) metres; None: it found no body.
    """
    call: PendingReference = Future()
    call.set_result(landmarks)
    return call


class KeptWindows:
    """The files of finished windows, after which a capture that was killed goes on.

    They depend on the footage, the program and the options: within the caller's folder, which is
    one of this footage and this program, each set of options has a folder of its own.

    :param unfinished: folder of the capture, need not exist; None: nothing is kept.
    """

    def __init__(self, unfinished: Path | None, options: CaptureOptions) -> None:
        self._kept: KeptFolder | None = None
        if unfinished is not None:
            self._kept = KeptFolder(unfinished / f"windows-{_digest(options)}")

    def load(self, window: Window) -> Observed | None:
        """Return what was observed in a window; None if that is not known."""
        if self._kept is None:
            return None
        self._kept.count(self._kept.path / window_name(window.number))
        return load_window(self._kept.path, window)

    def save(self, record: Observed) -> None:
        """Keep a window; after a failure, or when there is too much, none any more."""
        if self._kept is not None:
            self._kept.write(lambda folder: save_window(folder, record))


def _digest(options: CaptureOptions) -> str:
    """Return a name that differs where options, or the files that they name, may lead to another
    result.
    """
    described = []
    for field in fields(options):
        if field.name in _UNIMPORTANT:
            continue
        value = getattr(options, field.name)
        described.append(f"{field.name}={value!r}")
        if isinstance(value, Path):
            files = (*files_of_calibration(value), description_path(value))
            described += map(_state, files)
    return hashlib.sha256("\n".join(described).encode("utf-8", "surrogateescape")).hexdigest()[:32]


def _state(path: Path) -> str:
    """Return what changes with a file and its content."""
    digest = hashlib.sha256()
    try:
        add_content(digest, path, _MOST_BYTES)
    except OSError:
        return ""
    return digest.hexdigest()
