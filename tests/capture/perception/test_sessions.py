# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening a network leaves nothing behind: onnxruntime's wheels keep a list of events for a server
of Microsoft's.

And networks that are missing: a wheel made of the sources alone has none.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from scope.scope_addon.capture.perception import sessions
from scope.scope_addon.errors import SetupError, UsageError
from scope.solver.errors import ModelFileError

PROGRAM = """
import os
from scope.scope_addon.capture.perception.adapters import network_server
from scope.scope_addon.capture.perception.sessions import network_path, open_session
if {direct}:
    limits = {{"limit_bytes": 1 << 33, "limit_s": 30.0, "threads": 1, "mem_pattern": True}}
    path = str(network_path("face_expression"))
    request = {{"path": path, "providers": ["CPUExecutionProvider"], **limits}}
    answer, _ = network_server.Server().answer(request)
    assert answer["outputs"], answer
else:
    assert open_session(network_path("face_expression"), 1).get_outputs()
assert os.environ["ORT_DISABLE_TELEMETRY"] == "1"  # which versions that tell anything obey
"""


def test_opening_a_network_records_no_events(tmp_path: Path, networks: None) -> None:
    """Which would be sent some seconds later."""
    # Programs that say how much they tell, and the folders in which it would lie until it is sent.
    environment = {name: value for name, value in os.environ.items() if "TELEMETRY" not in name}
    for name in ("HOME", "XDG_CACHE_HOME", "TMPDIR"):
        folder = tmp_path / name
        folder.mkdir()
        environment[name] = str(folder)
    for direct in (True, False):
        program = PROGRAM.format(direct=direct)
        subprocess.run([sys.executable, "-c", program], env=environment, check=True, timeout=600)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_missing_and_damaged_networks_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sessions, "NETWORKS_FOLDER", tmp_path)
    with pytest.raises(
        SetupError,
        match="lite.onnx is missing.*a release's wheel contains them",
    ):
        sessions.network_path("pose_landmark_lite")
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"no network")
    with pytest.raises(ModelFileError, match=r"broken\.onnx"):
        sessions.open_session(broken, 1)
    with pytest.raises(UsageError, match="0 threads"):
        sessions.open_session(broken, 0)
