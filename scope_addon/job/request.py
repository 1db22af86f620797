# SPDX-License-Identifier: GPL-3.0-or-later
"""What a worker is asked to do, and the key under which its result can be found again."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from ..errors import UsageError

_SAMPLE_BYTES = 1 << 20  # of the footage's beginning and end; reading gigabytes would hold up the window


@dataclass(frozen=True)
class JobRequest:
    """One capture. Everything but ``threads`` and ``provider`` decides the result."""

    footage: str
    body: str = "scope"  # a built-in body's name or a file
    quality: str = "best"
    people: int | str = "largest"  # how many at most, "all", or "largest": the most prominent one
    height_m: float | None = None  # of the most prominent person; None: it is found
    focal_mm: float | None = None  # 35 mm equivalent
    fov_deg: float | None = None  # along the longer side
    calibration: str = ""  # a JSON file; empty: none
    start_s: float = 0.0  # of the video
    end_s: float | None = None  # None: to its end
    smoothing: bool = True
    hands: bool = False  # fingers too, on a body that has them
    detector: str = ""  # the user's own networks, ONNX files; empty: ours
    keypoints: str = ""
    provider: str = "auto"  # what the networks run on
    threads: int = 0  # 0: as many as there are cores

    def to_json(self) -> str:
        """One line."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> JobRequest:
        """:raises UsageError: not a request."""
        try:
            return cls(**json.loads(text))
        except (ValueError, TypeError) as error:
            raise UsageError(f"this is not a capture request: {error}") from error

    def key(self, code_version: str) -> str:
        """Hexadecimal key of the result: equal only for the same footage, options and program.

        :param code_version: changes whenever the program might capture differently.
        :raises OSError: the footage cannot be read.
        """
        values = asdict(self)
        del values["threads"], values["provider"], values["footage"]
        digest = hashlib.sha256(json.dumps([values, code_version], sort_keys=True).encode())
        _add_file(digest, Path(self.footage))
        for file in (Path(self.body), Path(self.calibration)):
            if file.is_file():
                _add_file(digest, file)
        for network in filter(None, (self.detector, self.keypoints)):
            for file in (Path(network), Path(network).with_suffix(".json")):
                if file.is_file():  # the worker says what is wrong with one that is not there
                    _add_file(digest, file)
        return digest.hexdigest()[:32]


def _add_file(digest: hashlib._Hash, path: Path) -> None:
    """Size, time of change, first and last megabyte."""
    status = path.stat()
    digest.update(f"{path.name} {status.st_size} {status.st_mtime_ns}".encode())
    with path.open("rb") as file:
        digest.update(file.read(_SAMPLE_BYTES))
        file.seek(max(0, status.st_size - _SAMPLE_BYTES))
        digest.update(file.read(_SAMPLE_BYTES))


def code_version(root: Path) -> str:
    """Of the installed program: names, sizes and times of change of its sources, networks, bodies and priors."""
    files = [*(root / "solver").rglob("*.py"), *(root / "scope_addon").rglob("*.py")]
    files += [f for kind in ("*.onnx", "*.npz", "*.json") for f in (root / "assets").rglob(kind)]
    # The panel does not decide what is captured, nor does the sample, which is footage like any other.
    apart = (root / "scope_addon" / "ui", root / "assets" / "sample")
    status = {f.relative_to(root).as_posix(): f.stat() for f in files if not any(map(f.is_relative_to, apart))}
    stamps = sorted((name, s.st_size, s.st_mtime_ns) for name, s in status.items())
    return hashlib.sha256(json.dumps(stamps).encode()).hexdigest()
