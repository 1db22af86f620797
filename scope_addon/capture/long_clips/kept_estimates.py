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
LARGEST = 1 << 30  # bytes of one capture's files; some five hours
_KEY_BYTES = 16
_PIXEL_STEP = 4  # rows of the crop between those in the key
# Files whose values are in memory; a capture asks in the order in which they were written.
_LOADED = 2
Values = Float64Array


class KeptEstimates:
    """A folder of files ``*.npz`` with keys (n, 16) and values (n, m); thread-safe.

    What cannot be read or written is not kept: nothing depends on it but time.

    :param folder: need not exist; None: nothing is kept.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._places: dict[bytes, tuple[Path, int]] = {}
        self._loaded: dict[Path, Values] = {}
        self._new: dict[bytes, Values] = {}
        self._written_s = time.monotonic()
        self._wrote = False
        self._bytes = 0
        if folder is not None:
            for path in sorted(folder.glob("*.npz")):
                if path.is_file():  # opening a pipe would wait for a writer
                    self._read_keys(path)

    def key(self, network: str, crop_rgb: Uint8Array, region: Region) -> bytes | None:
        """Return the key of an estimate; None if nothing is kept.

        :param crop_rgb: (H, W, 3), the network's input.
        """
        if self._folder is None:
            return None
        digest = hashlib.sha256(network.encode())
        digest.update(np.array([*region.center_px, region.side_px, region.rotation]).tobytes())
        digest.update(np.ascontiguousarray(crop_rgb[::_PIXEL_STEP]).tobytes())
        return digest.digest()[:_KEY_BYTES]

    def find(self, key: bytes | None) -> Values | None:
        """Return the values (m,) that were added with a key; None if there are none."""
        if key is None:
            return None
        with self._lock:
            if key not in self._places:
                return None
            path, row = self._places[key]
            if path not in self._loaded:
                self._load(path)
            values = self._loaded.get(path)
            return None if values is None else values[row]

    def add(self, key: bytes | None, values: Values) -> None:
        """Keep the values (m,) of a key, on disk after ``INTERVAL_S`` at most."""
        if key is None or self._folder is None:
            return
        with self._lock:
            self._new[key] = values
            if time.monotonic() - self._written_s >= INTERVAL_S:
                self._write()

    def _write(self) -> None:
        """Write what is new; after a failure, or when there is too much, nothing any more."""
        assert self._folder is not None
        self._written_s = time.monotonic()
        # The name sorts by time, and is no other process's.
        path = self._folder / f"{time.time_ns():020d}-{os.getpid()}.npz"
        try:
            if not self._wrote:
                self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            keys = np.frombuffer(b"".join(self._new), np.uint8).reshape(-1, _KEY_BYTES)
            write_npz(path, {"keys": keys, "values": np.stack(list(self._new.values()))})
            self._wrote = True
            self._bytes += path.stat().st_size
        except (OSError, ScopeError):
            self._folder = None
        if self._bytes > LARGEST:
            self._folder = None
        self._new.clear()

    def _read_keys(self, path: Path) -> None:
        with suppress(ScopeError, OSError, KeyError):
            keys = _read(path, "keys")["keys"]
            self._bytes += path.stat().st_size
            if keys.dtype == np.uint8 and keys.ndim == 2 and keys.shape[1] == _KEY_BYTES:
                self._places |= {row.tobytes(): (path, index) for index, row in enumerate(keys)}

    def _load(self, path: Path) -> None:
        with suppress(ScopeError, OSError, KeyError):
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
