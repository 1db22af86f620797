# SPDX-License-Identifier: GPL-3.0-or-later
"""Machine code goes into an extension only if it was made from the extension's own sources."""

from pathlib import Path

import pytest

from .script_modules import ROOT, script

RASTERIZER = "scope_addon/capture/fitting/rasterizer.py"  # of the extension, with kernels
WHEELS = [
    Path("numba-0.68.1-cp313-cp313-win_amd64.whl"),
    Path("numba-0.68.1-cp311-cp311-win_amd64.whl"),
]


@pytest.fixture
def shipped(tmp_path, monkeypatch):
    module = script("shipped_kernels")
    monkeypatch.setattr(module, "KEPT", tmp_path / "kept")
    return module


@pytest.fixture
def staging(tmp_path):
    for name in ("solver/fit.py", RASTERIZER, "scope_addon/ui/panel.py"):
        path = tmp_path / "staging" / name
        path.parent.mkdir(parents=True)
        path.write_bytes(
            (ROOT / RASTERIZER).read_bytes() if name == RASTERIZER else b"# a source\n"
        )
    return tmp_path / "staging"


def keep(shipped, staging, wheels):
    """Put code where building on that platform would have put it."""
    kept = shipped.KEPT / "windows-x64" / "3.13"
    code = kept / "solver-01234567-0123456789ab" / "optimizer.optimize-0123456789ab.code"
    code.parent.mkdir(parents=True)
    code.write_text("code")
    (kept / shipped.MADE_FROM).write_text(shipped._digest(staging, wheels))
    return code.relative_to(kept)


def test_code_made_elsewhere_is_shipped(shipped, staging):
    code = keep(shipped, staging, WHEELS[:1])
    (staging / "scope_addon/ui/panel.py").write_text("# changed, but it compiles nothing\n")
    assert shipped.add_kernels(staging, "windows-x64", "3.13", WHEELS)
    assert (staging / "assets" / "kernels" / code).read_text("utf-8") == "code"


@pytest.mark.parametrize("changed", ["solver/fit.py", RASTERIZER])
def test_code_of_other_sources_is_not_shipped(shipped, staging, changed, capsys, monkeypatch):
    monkeypatch.setattr(shipped, "_THIS", {})  # this computer is of no platform
    keep(shipped, staging, WHEELS[:1])
    with (staging / changed).open("a") as source:
        source.write("# changed\n")
    assert not shipped.add_kernels(staging, "windows-x64", "3.13", WHEELS)
    assert not (staging / "assets").exists()
    assert "no compiled code for windows-x64, Python 3.13" in capsys.readouterr().err


def test_the_processors_are_those_that_the_solver_looks_for(shipped):
    from scope.solver.shipped_code import LEVELS

    assert shipped.PROCESSORS == {
        "windows-x64": LEVELS["x86_64"][0],
        "linux-x64": LEVELS["x86_64"][0],
        "macos-arm64": LEVELS["arm64"][0],
    }
