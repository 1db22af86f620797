# SPDX-License-Identifier: GPL-3.0-or-later
"""A recording on the disk while it runs, so that what ends a live capture does not end what was
recorded.

The file begins with a line of JSON, about the recording, and goes on with records, each a checksum
of four bytes and its content as numbers: a pose with its camera, or only number and time of a frame
in which the person was not seen. All are multiples of a block long, so that after a damaged one the
next is found. The file only grows, so a process that is killed leaves whole records and at most one
that is not. A thread writes it, because a disk may let a capture wait. If the disk refuses, as a
full one does, the file is written anew in another place.

Blender's window loads this module, so that what reads footage is imported where it is used.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import queue
import re
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...solver import Body
from ...solver.errors import InputError
from ..atomic_write import create_new, reason, sync_open_file
from ..errors import OutputError, UsageError
from ..options.live import MAX_PEOPLE
from ..private_folder import is_private
from ..temporary import hold, release, remove
from ..untrusted.files import in_one_line
from .pose import LivePose, Presence
from .unfinished import lock_of, other_places, temporary_place

if TYPE_CHECKING:
    from ..capture.camera.intrinsics import Camera

_SYNC_S = 2.0  # what a power cut can cost
_LONGEST_LINE = 1 << 16
_CHECKSUM_BYTES = 4
_SOURCE_BYTES = 120
_BLOCK_BYTES = 32
_SEEN = b"pose"
_UNSEEN = b"none"
# A record's content without a pose: with its checksum, one block.
_HEAD = np.dtype([("kind", "S4"), ("index", "<i8"), ("timestamp_s", "<f8"), ("person", "<i8")])
Record = tuple[LivePose, "Camera"]


@dataclass(frozen=True, slots=True)
class _UnseenFrame:
    """A frame in which a person was not seen."""

    index: int
    timestamp_s: float
    person: int


@dataclass(frozen=True)
class About:
    """What a recording is of: the same for all of its poses.

    :param body: name of a built-in body, or file of a user's own.
    :param fingerprint: of that body, see `fingerprint`.
    :param source: name of the camera, stream or file.
    :param fps: frames per second of the source, as a fraction.
    :param speed: how many times as fast as it plays everything happened.
    :param size: width and height of its images, pixels.
    :param origin: the frame number and time that become 0 in the motions; None: they stay.
    :param people: number of people who were followed.
    :param footage: file of the images, without an end; empty: they are not kept.
    """

    body: str
    fingerprint: int
    source: str
    fps: str
    size: tuple[int, int]
    speed: float
    origin: tuple[int, float] | None
    people: int
    footage: str


def fingerprint(body: Body) -> int:
    """Return a number that differs where bodies do."""
    return zlib.crc32(body.rest_joints(np.zeros(body.P)).tobytes(), body.P)


class Journal:
    """The growing file. `add` never waits, and never fails.

    :param path: a file of another name is made where this one exists.
    :param say: called with a sentence when the file cannot be written there, from another thread.
    """

    def __init__(self, path: Path, about: About, body: Body, say: Callable[[str], None]) -> None:
        self._about = about
        self._record = _record_type(body)
        self._say = say
        self._records: list[Record | _UnseenFrame] = []
        self._waiting: queue.SimpleQueue[Record | _UnseenFrame | None] = queue.SimpleQueue()
        self._places = [path, *(folder / path.name for folder in other_places(path.parent))]
        self._file: IO[bytes] | None = None
        # Where the recording is, or at least its beginning; None if it is in memory alone.
        self.path: Path | None = None
        if refused := self._begin():
            self._say_where(path, refused)
        self._thread = threading.Thread(target=self._run, name="scope-recording", daemon=True)
        self._thread.start()

    def add(self, pose: LivePose, camera: Camera) -> None:
        """Have a pose written, or that its person is not seen."""
        if pose.presence is Presence.SEEN:
            self._waiting.put((pose, camera))
        else:
            self._waiting.put(_UnseenFrame(pose.index, pose.timestamp_s, pose.person))

    def close(self) -> None:
        """Write what is waiting, and close the file."""
        if self._thread.is_alive():
            self._waiting.put(None)
            self._thread.join()
        if self._file is not None:
            with contextlib.suppress(OSError):
                self._file.close()
            self._file = None

    def remove(self) -> None:
        """Remove the file: what was recorded is somewhere else, or not wanted."""
        self.close()
        if self.path is not None:
            _remove_held(self.path)
            self.path = None

    def _run(self) -> None:
        synced_s = time.monotonic()
        while (record := self._waiting.get()) is not None:
            self._records.append(record)
            if self._file is None:
                continue
            try:
                _write(self._file, self._packed(record))
                if time.monotonic() - synced_s > _SYNC_S:
                    sync_open_file(self._file.fileno())
                    synced_s = time.monotonic()
            except OSError as error:
                self._go_on_elsewhere(error)

    def _go_on_elsewhere(self, error: OSError) -> None:
        """Write all records to the next place that takes them, and remove the file that failed."""
        former = self.path
        assert self._file is not None
        with contextlib.suppress(OSError):
            self._file.close()
        self._file = self.path = None
        assert former is not None
        self._begin()
        if self.path is None:
            self.path = former
        else:
            _remove_held(former)
        self._say_where(former, error)

    def _say_where(self, refused: Path, error: OSError) -> None:
        """Say where the recording is, since a place refuses it."""
        if self._file is not None:
            where = f"is kept in {self.path} while it runs"
        elif self.path is not None:
            where = f"begins in {self.path}, goes on in memory, and ends there if it is killed"
        else:
            where = "is in memory alone, and lost if it is killed"
        self._say(f"the recording {where}: {refused} cannot be written ({reason(error)})")

    def _begin(self) -> OSError | None:
        """Open a file in the next place that takes one, with the records so far.

        :return: why the first of these places refuses.
        """
        refused: OSError | None = None
        while self._places and self._file is None:
            wanted = self._places.pop(0)
            try:
                _make_place(wanted.parent)
                path = create_new(wanted)
            except OSError as error:
                refused = refused or error
                continue
            with contextlib.suppress(OSError):  # where there are no locks, it is not held
                hold(lock_of(path))
            try:
                file = path.open("wb", buffering=0)  # what is written is the system's at once
                _write(file, json.dumps(asdict(self._about)).encode() + b"\n")
                for record in self._records:
                    _write(file, self._packed(record))
                self._file = file
                self.path = path
            except OSError as error:
                refused = refused or error
                _remove_held(path)
        return refused

    def _packed(self, record: Record | _UnseenFrame) -> bytes:
        if isinstance(record, _UnseenFrame):
            row = np.array((_UNSEEN, record.index, record.timestamp_s, record.person), _HEAD)
        else:
            row = self._packed_pose(*record)
        content = row.tobytes()
        return zlib.crc32(content).to_bytes(_CHECKSUM_BYTES, "little") + content

    def _packed_pose(self, pose: LivePose, camera: Camera) -> NDArray[np.void]:
        row = np.zeros((), self._record)
        for name in _POSE_ARRAYS:
            row[name] = getattr(pose, name)
        row["kind"] = _SEEN
        row["index"] = pose.index
        row["timestamp_s"] = pose.timestamp_s
        row["person"] = pose.person
        row["intrinsics"] = camera.intrinsics
        row["dist"] = camera.dist
        row["focal_deviation"] = camera.focal_deviation
        row["camera"] = camera.source.encode()[:_SOURCE_BYTES]
        return row


def _write(file: IO[bytes], content: bytes) -> None:
    """Write all of something to a file without a buffer, of which a full disk may take a part.

    :raises OSError: the disk does not take all of it.
    """
    if file.write(content) < len(content):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _make_place(folder: Path) -> None:
    """Make a folder for a recording, if it does not exist.

    :raises OSError: it cannot be made, or is the temporary one and someone else has made it.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if folder == temporary_place() and not is_private(folder):
        raise PermissionError(errno.EACCES, f"{folder} is not this user's own")


def _remove_held(path: Path) -> None:
    remove(path)
    release(lock_of(path))


def read_about(path: Path) -> About:
    """Read what a recording is of.

    :raises InputError: the file is no recording of ours.
    """
    try:
        with path.open("rb") as file:
            line = file.readline(_LONGEST_LINE)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({reason(error)})") from error
    values = _values(line)
    if not values:
        wrong = "its first line does not say of what"
    elif unsound := _unsound_entries(values):
        wrong = f"{', '.join(unsound)} in its first line"
    else:
        about = About(**values)
        origin = about.origin
        return replace(
            about,
            size=(int(about.size[0]), int(about.size[1])),
            origin=None if origin is None else (int(origin[0]), float(origin[1])),
        )
    raise InputError(
        f"{path} is not the recording of a live capture, or damaged ({wrong}); choose another "
        ".recording file, or capture its video if that was kept"
    )


def _values(line: bytes) -> dict[str, Any]:
    """Return the entries of a recording's first line; none where it is not one of ours."""
    if not line.endswith(b"\n"):
        return {}
    try:
        values = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return values if isinstance(values, dict) else {}


def _unsound_entries(values: dict[str, Any]) -> list[str]:
    """Return what is missing, unknown or damaged in a recording's first line, in words."""
    unsound = []
    for name, is_sound in _IS_SOUND.items():
        if name in values and not is_sound(values[name]):
            unsound.append(f"a damaged {name}")
        elif name not in values:
            unsound.append(f"no {name}")
    unknown = sorted(set(values) - set(_IS_SOUND))
    unsound.extend(f"an unknown {in_one_line(name)}" for name in unknown)
    return unsound


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_rate(value: object) -> bool:
    """Return whether something is a frame rate, as `str` writes a `Fraction`."""
    return isinstance(value, str) and re.fullmatch(_RATE, value) is not None


def _is_size(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 2
        and all(isinstance(side, int) and 0 < side < 1 << 16 for side in value)
    )


def _is_origin(value: object) -> bool:
    if value is None:
        return True
    return (
        isinstance(value, list)
        and len(value) == 2
        and isinstance(value[0], int)
        and isinstance(value[1], (int, float))
        and abs(value[0]) < 1 << 63
        and abs(value[1]) < 1 << 63  # no time that is not finite, either
    )


_RATE = "[1-9][0-9]{0,17}(/[1-9][0-9]{0,17})?"
_IS_SOUND: dict[str, Callable[[Any], bool]] = {
    "body": _is_text,
    "fingerprint": lambda value: isinstance(value, int),
    "source": _is_text,
    "fps": _is_rate,
    "size": _is_size,
    "speed": lambda value: isinstance(value, float) and 0.0 < value < 1e6,
    "origin": _is_origin,
    "people": lambda value: isinstance(value, int) and 0 < value <= MAX_PEOPLE,
    "footage": _is_text,
}


def read_records(path: Path, about: About, body: Body) -> list[Record]:
    """Read the poses and cameras of a recording, without records that are damaged.

    :param body: that of the recording.
    :return: a frame in which the person is not seen has the person's pose before, and the camera of
        the record before.
    :raises InputError: the file cannot be read.
    :raises UsageError: the body is another one.
    """
    if fingerprint(body) != about.fingerprint:
        raise UsageError(
            f"{path} was recorded with another body than {about.body} is now; put back that file"
        )
    found: list[Record] = []
    last: dict[int, Record] = {}
    try:
        with path.open("rb") as file:
            file.readline(_LONGEST_LINE)
            for row in _whole_rows(file, _record_type(body)):
                person = int(row["person"])
                before = last.get(person)
                if not 0 <= person < about.people or not _is_sound_after(before, row):
                    continue
                if row["kind"] == _SEEN:
                    last[person] = _unpacked(row)
                elif before is not None:
                    unseen = replace(
                        before[0],
                        index=int(row["index"]),
                        timestamp_s=float(row["timestamp_s"]),
                        presence=Presence.LOST,
                    )
                    last[person] = unseen, found[-1][1]
                else:  # the first pose is damaged
                    continue
                found.append(last[person])
    except OSError as error:
        raise InputError(f"{path} cannot be read ({reason(error)})") from error
    return found


def _whole_rows(file: IO[bytes], pose_type: np.dtype[Any]) -> Iterator[np.void]:
    """Yield the contents of the records in a file from where it is, without damaged ones."""
    content_types = {_SEEN: pose_type, _UNSEEN: _HEAD}
    while len(block := file.read(_BLOCK_BYTES)) == _BLOCK_BYTES:
        checksum = int.from_bytes(block[:_CHECKSUM_BYTES], "little")
        content_type = content_types.get(block[_CHECKSUM_BYTES:][: len(_SEEN)])
        if content_type is None:
            continue
        next_block = file.tell()
        content = block[_CHECKSUM_BYTES:] + file.read(content_type.itemsize - _HEAD.itemsize)
        if len(content) == content_type.itemsize and zlib.crc32(content) == checksum:
            yield np.frombuffer(content, content_type)[0]
        else:
            file.seek(next_block)


def _is_sound_after(before: Record | None, row: np.void) -> bool:
    """Return whether the numbers of a record are finite, and its frame is after another one."""
    if before is not None:
        pose = before[0]
        if row["index"] <= pose.index or row["timestamp_s"] <= pose.timestamp_s:
            return False
    names = _FLOATS if row["kind"] == _SEEN else ("timestamp_s",)
    return row["index"] >= 0 and all(np.isfinite(row[name]).all() for name in names)


_POSE_ARRAYS = (
    "betas",
    "rotations",
    "root_cam",
    "T_world_camera",
    "joints",
    "contact",
    "raw_rotations",
    "raw_root_cam",
    "keypoints",
    "joint_confidence",
)
_FLOATS = (*_POSE_ARRAYS, "timestamp_s", "intrinsics", "dist", "focal_deviation")


def _record_type(body: Body) -> np.dtype[Any]:
    from ..capture.perception.landmark_network import KEYPOINT_COUNT

    joints = body.K + 1
    shapes: dict[str, tuple[int, ...]] = {
        "betas": (body.P,),
        "rotations": (joints, 3, 3),
        "root_cam": (3,),
        "T_world_camera": (4, 4),
        "joints": (joints, 3),
        "contact": (4,),
        "raw_rotations": (joints, 3, 3),
        "raw_root_cam": (3,),
        "keypoints": (KEYPOINT_COUNT, 3),
        "joint_confidence": (joints,),
        "intrinsics": (3, 3),
        "dist": (5,),
        "focal_deviation": (),
    }
    numbers = [(name, "<f8", shape) for name, shape in shapes.items()]
    fields = [*_HEAD.descr, *numbers, ("camera", f"S{_SOURCE_BYTES}")]
    filling = -(_CHECKSUM_BYTES + np.dtype(fields).itemsize) % _BLOCK_BYTES
    return np.dtype([*fields, ("filling", f"V{filling}")])


def _unpacked(row: np.void) -> Record:
    from ..capture.camera.intrinsics import Camera

    arrays: dict[str, Any] = {name: row[name].copy() for name in _POSE_ARRAYS}
    pose = LivePose(
        index=int(row["index"]),
        timestamp_s=float(row["timestamp_s"]),
        presence=Presence.SEEN,
        is_settled=True,
        person=int(row["person"]),
        **arrays,
    )
    source = bytes(row["camera"]).decode("utf-8", "replace")
    camera = Camera(
        row["intrinsics"].copy(), row["dist"].copy(), source, float(row["focal_deviation"])
    )
    return pose, camera


def saved_elsewhere(path: Path, save: Callable[[Path], object]) -> Path:
    """Save a result in the first of the other places that takes it, and return its path there.

    :param path: of the result, where it could not be saved.
    :raises OutputError: no place takes it.
    """
    problem: Exception = OutputError(f"there is no other place for {path}")
    for folder in other_places(path.parent):
        try:
            _make_place(folder)
            other = create_new(folder / path.name)
        except OSError as error:
            problem = error
            continue
        try:
            save(other)
            return other
        except (OSError, OutputError) as error:
            remove(other)
            problem = error
    raise OutputError(str(problem)) from problem
