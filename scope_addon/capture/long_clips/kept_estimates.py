# SPDX-License-Identifier: GPL-3.0-or-later
"""Estimates of the landmark networks on disk, so that a capture that was killed does not begin
again.

An estimate depends on its network, the region and the pixels in it alone. These are its key, so
that an estimate is found only where the network would give the same again, bit for bit, whatever
the footage and the options are.
"""

from __future__ import annotations

import hashlib
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver.errors import ModelFileError, ScopeError
from ...arrays import Float64Array, Uint8Array
from ...atomic_write import write_npz
from ...untrusted.files import read_npz
from ..perception.region import Region

INTERVAL_S = 20.0  # between two files: the work that a kill can cost
LARGEST = 1 << 30  # bytes of one capture's files of a kind; some five hours of estimates
_KEY_BYTES = 16
_PIXEL_STEP = 4  # rows of the crop between those in the key
# Files whose values are in memory; a capture asks in the order in which they were written.
_LOADED = 2
Values = Float64Array


class KeptFolder:
    """What cannot be written is not kept: nothing depends on it but time.

    :param folder: need not exist.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder
        self.is_open = True
        self._bytes = 0

    def write(self, write_file: Callable[[Path], Path]) -> None:
        """Write a file; after a failure, or when there is too much, nothing any more.

        :param write_file: takes the folder, and returns the file that it has written there.
        """
        # A link of that name leads where nobody has asked to write.
        if not self.is_open or self.path.is_symlink():
            return
        try:
            self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
            self.count(write_file(self.path))
        except (OSError, ScopeError):
            self.is_open = False

    def count(self, file: Path) -> None:
        """Count a file that may be there as kept."""
        with suppress(OSError):
            self._bytes += file.stat().st_size
        self.is_open &= self._bytes <= LARGEST


class KeptEstimates:
    """A folder of files ``*.npz`` with keys (n, 16) and values (n, m); thread-safe.

    :param folder: need not exist.
    """

    def __init__(self, folder: Path) -> None:
        self._kept = KeptFolder(folder)
        self._lock = threading.Lock()
        self._places: dict[bytes, tuple[Path, int]] = {}
        self._loaded: dict[Path, Values] = {}
        self._new: dict[bytes, Values] = {}
        self._written_s = time.monotonic()
        for path in sorted(folder.glob("*.npz")):
            self._read_keys(path)

    def key(self, network: str, crop_rgb: Uint8Array, region: Region) -> bytes:
        """Return the key of an estimate.

        :param crop_rgb: (H, W, 3), the network's input.
        """
        digest = hashlib.sha256(network.encode())
        digest.update(np.array([*region.center_px, region.side_px, region.rotation]).tobytes())
        digest.update(np.ascontiguousarray(crop_rgb[::_PIXEL_STEP]).tobytes())
        return digest.digest()[:_KEY_BYTES]

    def find(self, key: bytes) -> Values | None:
        """Return the values (m,) that were added with a key; None if there are none."""
        with self._lock:
            if key not in self._places:
                return None
            path, row = self._places[key]
            if path not in self._loaded:
                self._load(path)
            values = self._loaded.get(path)
            return None if values is None else values[row]

    def add(self, key: bytes, values: Values) -> None:
        """Keep the values (m,) of a key, on disk after ``INTERVAL_S`` at most."""
        with self._lock:
            if not self._kept.is_open:
                return
            self._new[key] = values
            if time.monotonic() - self._written_s >= INTERVAL_S:
                self._written_s = time.monotonic()
                self._kept.write(self._write)
                self._new.clear()

    def _write(self, folder: Path) -> Path:
        # The name sorts by time, and is no other process's.
        path = folder / f"{time.time_ns():020d}-{os.getpid()}.npz"
        keys = np.frombuffer(b"".join(self._new), np.uint8).reshape(-1, _KEY_BYTES)
        values = np.stack(list(self._new.values()))
        write_npz(path, {"keys": keys, "values": values}, replaces_links=True)
        return path

    def _read_keys(self, path: Path) -> None:
        with suppress(ScopeError, KeyError):
            keys = _read(path, "keys")["keys"]
            self._kept.count(path)
            if keys.dtype == np.uint8 and keys.ndim == 2:
                self._places |= {row.tobytes(): (path, index) for index, row in enumerate(keys)}

    def _load(self, path: Path) -> None:
        with suppress(ScopeError, KeyError):
            arrays = _read(path, "keys", "values")
            values = arrays["values"]
            rows = len(arrays["keys"])
            if (
                values.dtype == np.float64
                and values.ndim == 2
                and len(values) == rows
                and np.isfinite(values).all()
            ):
                while len(self._loaded) >= _LOADED:
                    self._loaded.pop(next(iter(self._loaded)))
                self._loaded[path] = values
                return
        self._places = {key: place for key, place in self._places.items() if place[0] != path}


def _read(path: Path, *names: str) -> dict[str, NDArray[Any]]:
    return read_npz(path, ModelFileError, "file of estimates", wanted=names)
