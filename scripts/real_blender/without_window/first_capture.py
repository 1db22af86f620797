# SPDX-License-Identifier: GPL-3.0-or-later
"""Time the first capture after installation, and the second: ``blender --background --python first_capture.py``.

The second begins with a cleared cache, which keeps the compiled solver. Writes out/first.json, and fails if a capture
compiles what the extension should contain, if the first takes more than 15 s longer, or if it shows any one stage for
so much longer, as it would while something else runs. Another part may run beside one of the two alone, on the same
cores, so that twice as long is no longer.
"""

from __future__ import annotations

import json
import time
from importlib import import_module
from pathlib import Path

import bpy

MOST_LONGER_S = 15.0
NAME = next(addon.module for addon in bpy.context.preferences.addons if addon.module.endswith(".scope"))


def capture() -> tuple[float, dict[str, float]]:
    """Capture the sample as the panel does; return how many seconds it took, in all and by stage."""
    job_class = import_module(f"{NAME}.scope_addon.ui.capture.capture_job").CaptureJob
    bpy.ops.scope.use_sample()
    since = last = time.monotonic()
    stages: dict[str, float] = {}
    job = job_class(bpy.context.scene)
    while job.step():
        time.sleep(0.05)
        now = time.monotonic()
        stages[job.progress.stage] = stages.get(job.progress.stage, 0.0) + now - last
        last = now
    return time.monotonic() - since, stages


def main() -> None:
    """Capture twice and compare."""
    cache = import_module(f"{NAME}.scope_addon.ui.preferences").cache()
    first, first_stages = capture()
    assert bpy.ops.scope.clear_cache() == {"FINISHED"}
    assert cache.size() == 0
    second, second_stages = capture()
    kept = sorted(str(path.relative_to(cache.kernels)) for path in cache.kernels.rglob("*.code"))
    found = {"first_s": first, "second_s": second, "compiled_here": len(kept)}
    found |= {"stages_first_s": first_stages, "stages_second_s": second_stages}
    Path("/scope/out/first.json").write_text(json.dumps(found, indent=1))
    print(json.dumps(found))
    assert not kept, f"the extension comes without {kept}"
    assert "compiling the solver" not in second_stages, second_stages
    assert first < 2.0 * second + MOST_LONGER_S, found
    longer = {stage: s - 2.0 * second_stages.get(stage, 0.0) for stage, s in first_stages.items()}
    assert max(longer.values()) < MOST_LONGER_S, longer


main()
