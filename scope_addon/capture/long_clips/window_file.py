# SPDX-License-Identifier: GPL-3.0-or-later
"""What was observed in a window as a file, for the process that joins the windows: plain arrays, no
Python objects.

A file may come from another machine, so whatever is read from it is checked. One that is missing,
damaged or of another window counts for nothing: the window is observed again.
"""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver.errors import InputError, ScopeError
from ...arrays import Uint8Array
from ...atomic_write import write_npz
from ...capture_report import warnings_as_json
from ...content import add_content
from ...notices import Notice, notices_of
from ...untrusted.files import read_members
from ..camera.background_record import BackgroundRecord
from ..camera.calibration_tables import files_of_calibration
from ..camera.corner_tracks import CornerTracks
from ..camera.heading_drift import FrameEdges
from ..camera.line_segments import Segments
from ..options import CaptureOptions
from ..perception.adapters.description import description_path
from ..perception.face_record import RECORD
from ..perception.landmark_network import KEYPOINT_COUNT
from ..perception.observation import PersonMask
from ..perception.region import Region
from ..tracking.appearance import SIZE as APPEARANCE_SIZE
from ..tracking.track import Tracklet
from .windows import Window, WindowRecord, known_reference

MASK_SIDE = 256
MAX_TEXT = 100_000
# Name: type and shape. The first length of several arrays is the same where the letter is: frames
# (N), tracklets (M), their rows (R), references (Q), masks (K), regions (S), edge frames (E), edges
# (L), corners (D).
_ARRAYS: dict[str, tuple[type[Any], str, tuple[int, ...]]] = {
    # Number, anchor, begin and end of the window, width and height of the image.
    "geometry": (np.float64, "6", ()),
    "rows": (np.int64, "2", ()),  # first, anchor
    "indices": (np.int64, "N", ()),
    "timestamps": (np.float64, "N", ()),
    "checksums": (np.uint32, "N", ()),
    "cut_rows": (np.int64, "C", ()),
    "R_first_camera": (np.float64, "N", (3, 3)),
    "known": (np.bool_, "N", ()),
    "inlier_shares": (np.float64, "I", ()),
    "bars": (np.float64, "B", (4,)),
    "corner_rows": (np.int64, "D", ()),  # one row for each time that a corner was seen
    "corner_numbers": (np.int64, "D", ()),
    "corner_points": (np.float32, "D", (2,)),
    "edge_rows": (np.int64, "E", (2,)),  # row and number of the edges
    "edge_ends": (np.float64, "L", (2, 2)),
    "edge_lengths": (np.float64, "L", ()),
    "anchor_regions": (np.float64, "S", (5,)),  # tracklet, centre, side, rotation
    "tracklets": (np.int64, "M", (2,)),  # number, number of rows
    "appearance": (np.float64, "M", (APPEARANCE_SIZE,)),
    "tracklet_rows": (np.int64, "R", ()),
    "values": (np.float32, "R", (KEYPOINT_COUNT, 6)),
    "centers": (np.float64, "R", (2,)),
    "sides": (np.float64, "R", ()),
    "hands": (np.float32, "H", (2, 21, 6)),  # R or 0 of them
    "faces": (np.float32, "F", (RECORD,)),  # likewise
    "references": (np.int64, "Q", (3,)),  # tracklet, row, whether the network found a body
    "reference_landmarks": (np.float64, "Q", (KEYPOINT_COUNT, 3)),
    "masks": (np.int64, "K", (2,)),  # tracklet, row
    "mask_regions": (np.float64, "K", (4,)),
    "mask_probability": (np.float16, "K", (MASK_SIDE, MASK_SIDE)),
    "text": (np.uint8, "T", ()),
}
Arrays = dict[str, NDArray[Any]]
LARGEST = 1 << 30  # bytes of the windows that are kept of one capture
_MOST_BYTES = 1 << 28  # of a network; a larger one is sampled
_UNIMPORTANT = ("threads",)  # options with which the result is the same, bit for bit


def window_name(number: int) -> str:
    """Return the name of a window's file."""
    return f"window{number:05d}.npz"


def save_window(folder: Path, record: WindowRecord, size: tuple[int, int]) -> Path:
    """Write a window's file, and return its path.

    :param size: of the image, width and height in pixels.
    :raises OSError: it cannot be written.
    """
    path = folder / window_name(record.window.number)
    window = record.window
    background = record.background
    segments = [edge.segments for edge in background.edge_frames]
    text = {"execution": record.execution, **warnings_as_json(record.warnings)}
    arrays = {
        "geometry": [window.number, window.anchor_s, window.begin_s, window.end_s, *size],
        "rows": [record.first, record.anchor],
        "indices": record.indices,
        "timestamps": record.timestamps,
        "checksums": record.checksums,
        "cut_rows": record.cut_rows,
        "R_first_camera": background.R_first_camera,
        "known": background.known,
        "inlier_shares": background.inlier_shares,
        "bars": background.bars,
        "corner_rows": background.corners.rows,
        "corner_numbers": background.corners.numbers,
        "corner_points": background.corners.points_px,
        "edge_rows": [(edge.row, len(edge.segments.lengths)) for edge in background.edge_frames],
        "edge_ends": _joined([each.ends_px for each in segments]),
        "edge_lengths": _joined([each.lengths for each in segments]),
        "anchor_regions": [
            (number, *_region_row(r)) for number, r in record.anchor_regions.items()
        ],
        "text": np.frombuffer(json.dumps(text).encode(), np.uint8),
        **_people_arrays(record.tracklets),
    }
    write_npz(path, {name: _as_declared(name, value) for name, value in arrays.items()})
    return path


def load_window(folder: Path, window: Window, size: tuple[int, int]) -> WindowRecord | None:
    """Read a window's file; None if it is missing, damaged, or of another window.

    :param size: of the image, width and height in pixels.
    """
    path = folder / window_name(window.number)
    try:
        if not path.is_file():  # opening a pipe would wait for a writer
            return None
        arrays = read_members(path, tuple(_ARRAYS), "")[0]
        _check(arrays)
        expected = [window.number, window.anchor_s, window.begin_s, window.end_s, *size]
        return _record(arrays, window, size) if arrays["geometry"].tolist() == expected else None
    except (ScopeError, OSError):
        return None


def _people_arrays(tracklets: dict[int, Tracklet]) -> dict[str, Any]:
    people = list(tracklets.values())
    references = [
        (n, row, call.result()) for n, t in tracklets.items() for row, call in t.references
    ]
    nothing = np.zeros((KEYPOINT_COUNT, 3))
    masks = [(n, row, mask) for n, t in tracklets.items() for row, mask in t.masks]
    return {
        "tracklets": [(number, len(tracklet.rows)) for number, tracklet in tracklets.items()],
        "appearance": [tracklet.appearance for tracklet in people],
        "tracklet_rows": _joined([tracklet.rows for tracklet in people]),
        "values": _joined([tracklet.values for tracklet in people]),
        "centers": _joined([tracklet.centers_px for tracklet in people]),
        "sides": _joined([tracklet.sides_px for tracklet in people]),
        "hands": _joined([tracklet.hands for tracklet in people]),
        "faces": _joined([tracklet.faces for tracklet in people]),
        "references": [(n, row, found is not None) for n, row, found in references],
        "reference_landmarks": [nothing if found is None else found for _, _, found in references],
        "masks": [(n, row) for n, row, _ in masks],
        "mask_regions": [_region_row(mask.region) for _, _, mask in masks],
        "mask_probability": [mask.probability for _, _, mask in masks],
    }


def _joined(parts: list[Any]) -> Any:
    """Return the arrays one after another; an empty list if all are empty."""
    full = [np.asarray(part) for part in parts if len(part)]
    return np.concatenate(full) if full else []


def _region_row(region: Region) -> tuple[float, ...]:
    return (*region.center_px, region.side_px, region.rotation)


def _as_declared(name: str, value: Any) -> NDArray[Any]:
    dtype, _, shape = _ARRAYS[name]
    array = np.asarray(value, dtype)
    return array if array.size else np.zeros((0, *shape), dtype)


def _check(arrays: Arrays) -> None:
    """Check types, shapes and numbers.

    :raises InputError: something does not fit.
    """
    lengths: dict[str, int] = {}
    for name, (dtype, letter, shape) in _ARRAYS.items():
        array = arrays.get(name)
        if (
            array is None
            or array.dtype != dtype
            or array.ndim != 1 + len(shape)
            or array.shape[1:] != shape
        ):
            raise InputError(f"{name} is missing or has another form")
        expected = int(letter) if letter.isdigit() else lengths.setdefault(letter, len(array))
        may_be_infinite = name == "geometry"
        if len(array) != expected or (
            array.dtype.kind == "f" and not may_be_infinite and not np.isfinite(array).all()
        ):
            raise InputError(f"{name} has another length, or numbers that are not finite")
    _require(
        lengths["H"] in (0, lengths["R"]) and lengths["F"] in (0, lengths["R"]), "hands and faces"
    )
    frames = lengths["N"]
    (first, anchor) = arrays["rows"].tolist()
    _require(0 <= first <= frames and first <= anchor <= frames, "rows")
    for name, column in (
        ("cut_rows", ...),
        ("edge_rows", 0),
        ("corner_rows", ...),
        ("tracklet_rows", ...),
        ("references", 1),
        ("masks", 1),
    ):
        rows = arrays[name][..., column] if isinstance(column, int) else arrays[name]
        _require(bool(((rows >= 0) & (rows < frames)).all()), name)
    _require(bool((np.diff(arrays["timestamps"]) > 0).all()), "timestamps")
    _require(bool((arrays["cut_rows"] >= first).all()), "cut_rows")
    numbers, counts = arrays["tracklets"].T
    _require(bool((counts >= 0).all()) and len(set(numbers.tolist())) == len(numbers), "tracklets")
    _require(
        _sums_to(counts, lengths["R"]) and _sums_to(arrays["edge_rows"][:, 1], lengths["L"]),
        "counts",
    )
    for rows in np.split(arrays["tracklet_rows"], np.cumsum(counts)[:-1]):
        _require(bool((np.diff(rows) > 0).all()), "tracklet_rows")
    _require(bool(np.isin(arrays["references"][:, 0], numbers).all()), "references")
    _require(bool(np.isin(arrays["masks"][:, 0], numbers).all()), "masks")
    sides = (arrays["sides"], arrays["mask_regions"][:, 2], arrays["anchor_regions"][:, 3])
    _require(all(bool((side > 0).all()) for side in sides), "sides")
    _require(lengths["T"] <= MAX_TEXT, "text")
    corners = arrays["corner_numbers"]
    # Each is at least once in the file, so that its number says nothing about memory.
    _require(bool(((corners >= 0) & (corners < len(corners))).all()), "corner_numbers")
    _require(bool((np.diff(arrays["corner_rows"]) >= 0).all()), "corner_rows")


def _sums_to(counts: NDArray[np.int64], total: int) -> bool:
    return bool(((counts >= 0) & (counts <= total)).all()) and int(counts.sum()) == total


def _require(holds: bool, name: str) -> None:
    if not holds:
        raise InputError(f"{name} does not fit the other arrays")


def _record(arrays: Arrays, window: Window, size: tuple[int, int]) -> WindowRecord:
    first, anchor = arrays["rows"].tolist()
    execution, warnings = _text(arrays["text"])
    counts = np.cumsum(arrays["edge_rows"][:, 1])[:-1]
    edges = zip(
        np.split(arrays["edge_ends"], counts), np.split(arrays["edge_lengths"], counts), strict=True
    )
    background = BackgroundRecord(
        arrays["timestamps"],
        arrays["R_first_camera"],
        arrays["known"],
        arrays["inlier_shares"].tolist(),
        [
            FrameEdges(int(row), Segments(*each))
            for (row, _), each in zip(arrays["edge_rows"], edges, strict=False)
        ],
        list(arrays["bars"]),
        CornerTracks(arrays["corner_rows"], arrays["corner_numbers"], arrays["corner_points"]),
    )
    return WindowRecord(
        window,
        arrays["indices"],
        arrays["timestamps"],
        arrays["checksums"],
        first,
        anchor,
        _tracklets(arrays, size),
        {int(n): _region(row) for n, *row in arrays["anchor_regions"].tolist()},
        arrays["cut_rows"].tolist(),
        background,
        execution,
        warnings,
    )


def _tracklets(arrays: Arrays, size: tuple[int, int]) -> dict[int, Tracklet]:
    tracklets: dict[int, Tracklet] = {}
    begin = 0
    for (number, count), appearance in zip(
        arrays["tracklets"].tolist(), arrays["appearance"], strict=True
    ):
        rows = slice(begin, begin + count)
        tracklets[number] = Tracklet(
            arrays["tracklet_rows"][rows].tolist(),
            list(arrays["values"][rows]),
            list(arrays["centers"][rows]),
            arrays["sides"][rows].tolist(),
            appearance,
            hands=list(arrays["hands"][rows]),
            faces=list(arrays["faces"][rows]),
        )
        begin += count
    for (number, row, found), landmarks in zip(
        arrays["references"].tolist(), arrays["reference_landmarks"], strict=True
    ):
        tracklets[number].references.append((row, known_reference(landmarks if found else None)))
    for (number, row), region, mask in zip(
        arrays["masks"].tolist(),
        arrays["mask_regions"].tolist(),
        arrays["mask_probability"],
        strict=True,
    ):
        tracklets[number].masks.append((row, PersonMask(_region(region), mask, size)))
    return tracklets


def _region(row: list[float]) -> Region:
    x, y, side_px, rotation = row
    return Region((x, y), side_px, rotation)


def _text(encoded: Uint8Array) -> tuple[str, list[Notice]]:
    """Return execution and warnings.

    :raises InputError: they are no text.
    """
    try:
        read = json.loads(encoded.tobytes())
        return str(read["execution"]), notices_of(read)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"the text of a window cannot be read: {error}") from error


class KeptWindows:
    """The files of finished windows, after which a capture that was killed goes on.

    They depend on the footage, the program and the options: within the caller's folder, which is
    one of this footage and this program, each set of options has a folder of its own. What cannot
    be read or written is not kept.

    :param unfinished: folder of the capture, need not exist; None: nothing is kept.
    """

    def __init__(
        self, unfinished: Path | None, options: CaptureOptions, size: tuple[int, int]
    ) -> None:
        self._folder = None if unfinished is None else unfinished / f"windows-{_digest(options)}"
        self._size = size
        self._bytes = 0

    def load(self, window: Window) -> WindowRecord | None:
        """Return what was observed in a window; None if that is not known."""
        if self._folder is None:
            return None
        with suppress(OSError):
            self._bytes += (self._folder / window_name(window.number)).stat().st_size
        return load_window(self._folder, window, self._size)

    def save(self, record: WindowRecord) -> None:
        """Keep a window; after a failure, or when there is too much, none any more."""
        if self._folder is None:
            return
        try:
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._bytes += save_window(self._folder, record, self._size).stat().st_size
        except (OSError, ScopeError):
            self._folder = None
        if self._bytes > LARGEST:
            self._folder = None


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
