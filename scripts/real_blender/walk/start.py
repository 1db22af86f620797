# SPDX-License-Identifier: GPL-3.0-or-later
"""Run a random walk over the extension's operators in a Blender with a window, and judge how it
ended.

Usage, in the Debian with its own Python, in /scope: ``start.py SEED [STEPS]``. ``session.py`` takes
the steps. It logs each one before it is taken, so that a crash or a hang names its step; the same
seed takes the same steps.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

OUT = Path("/scope/out")
FOLDER = OUT / "walk"  # the walk's own files: its log, saved .blend files, exports
LONGEST_S = 1400.0
SHOWN_STEPS = 20
_WINDOW = ("1000", "700")  # without a graphics card, most of the time goes into drawing


def main(seed: int, steps: int) -> int:
    """Walk; return 1 if Blender crashed, hung, or printed a traceback."""
    subprocess.run(["rm", "-rf", str(FOLDER)], check=True)
    FOLDER.mkdir(parents=True)
    log = FOLDER / "steps.log"
    printed = FOLDER / "printed.log"
    print(f"walk: seed {seed}, {steps} steps", flush=True)
    script = str(Path(__file__).with_name("session.py"))
    command = ["blender", "--enable-event-simulate", "--window-geometry", "0", "0", *_WINDOW]
    command += ["--python-exit-code", "1", "--python", script, "--"]
    command += ["/scope/clips/walk.mp4", str(FOLDER), str(seed), str(steps)]
    with printed.open("w") as file:
        process = subprocess.Popen(
            command,
            stdout=file,
            stderr=subprocess.STDOUT,
            env=dict(os.environ, TMPDIR=str(FOLDER), PYTHONFAULTHANDLER="1"),
        )
        try:
            status = process.wait(LONGEST_S)
            ended = f"signal {signal.Signals(-status).name}" if status < 0 else f"status {status}"
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGABRT)  # faulthandler prints where it hangs
            status = process.wait()
            ended = f"no end within {LONGEST_S:.0f} s"
    results = FOLDER / "results.json"
    report = (
        json.loads(results.read_text("utf-8"))
        if results.is_file()
        else {"seed": seed, "failures": []}
    )
    if status and not report["failures"]:
        report["failures"] = [f"Blender ended with {ended}"]
    (OUT / "walk.json").write_text(json.dumps(report))
    if not report["failures"]:
        return 0
    print(f"walk: seed {seed} failed: {ended}; the last steps:")
    print(
        "\n".join(
            log.read_text(errors="replace").splitlines()[-SHOWN_STEPS:]
            if log.is_file()
            else ["none"]
        )
    )
    for crash in sorted(FOLDER.glob("*.crash.txt")):
        print(f"{crash.name}:\n{crash.read_text(errors='replace')[-6000:]}")
    if not results.is_file():
        print(printed.read_text(errors="replace")[-6000:])
    for failure in report["failures"]:
        print(f"walk: {failure}")
    return 1


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 500))
