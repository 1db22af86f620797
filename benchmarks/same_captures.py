# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether two versions of the program capture the same, bit for bit.

    python -m scope.benchmarks.same_captures record FILE      with the version before
    python -m scope.benchmarks.same_captures compare FILE     with the version after, on one machine

FILE is a JSON file: for each capture, a digest of its warnings and of every array of its motion
files. Captures differ between processors, so that a record holds on the machine that made it.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data"
# Name -> the command line's arguments; a word with a slash is a path below the data folder.
CAPTURES = {
    "sample": [],
    "sample_fast": ["--quality", "fast"],
    "pose2sim": ["pose2sim/cam1.mp4", "--end", "3"],
    "two_people": ["clips/two_people_portrait.mp4", "--people", "all"],
    "hands": ["clips/gesture_square.mp4", "--hands", "on", "--end", "2"],
    "face": ["clips/gesture_square.mp4", "--face", "--end", "2"],
    "moving_camera": ["clips/run_moving_camera.mp4", "--end", "3"],
    "still": ["people/inputs/shelf_c0.jpg", "--people", "all"],
    "standing": ["people/inputs/plumb_stand_man.mp4", "--end", "2"],
}


def digests(name: str, arguments: list[str]) -> dict[str, str]:
    """Capture, and return the digest of the warnings and of each array of each motion file.

    Exit where the capture fails: two that fail would be the same.
    """
    with tempfile.TemporaryDirectory() as folder:
        given = [str(DATA / word) if "/" in word else word for word in arguments]
        output = Path(folder) / f"{name}.npz"
        command = [sys.executable, "-m", "scope.scope_addon", "capture", *given, "-o", str(output)]
        run = subprocess.run([*command, "--json"], capture_output=True, text=True, check=False)
        if run.returncode != 0:
            sys.exit(
                f"{run.stderr}{name}: the capture ended with status {run.returncode}, see above"
            )
        found = {"warnings": _digest(json.dumps(json.loads(run.stdout)["warnings"]).encode())}
        for path in sorted(Path(folder).glob("*.npz")):
            with np.load(path) as arrays:
                for key in arrays.files:
                    value = arrays[key]
                    content = repr((value.dtype.str, value.shape)).encode() + value.tobytes()
                    found[f"{path.stem}/{key}"] = _digest(content)
        return found


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def main() -> int:
    """Record or compare, and print what differs."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("file", type=Path)
    parser.add_argument("captures", nargs="*", help=f"of {', '.join(CAPTURES)}; default: all")
    options = parser.parse_args()
    names = options.captures or list(CAPTURES)
    known = CAPTURES
    before = {}
    if options.what == "compare":
        known = before = json.loads(options.file.read_text("utf-8"))
    for name in names:
        if name not in known or name not in CAPTURES:
            parser.error(f"there is no capture {name!r}; choose of {', '.join(known)}")
    found = {name: digests(name, CAPTURES[name]) for name in names}
    if options.what == "record":
        options.file.write_text(json.dumps(found, indent=1) + "\n", "utf-8")
        return 0
    changed = 0
    for name in names:
        keys = sorted({*found[name], *before[name]})
        different = [key for key in keys if found[name].get(key) != before[name].get(key)]
        changed += bool(different)
        print(f"{name}: {'the same' if not different else ', '.join(different)}")
    return min(changed, 1)


if __name__ == "__main__":
    sys.exit(main())
