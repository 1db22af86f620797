# SPDX-License-Identifier: GPL-3.0-or-later
"""What once broke under attack, each as its finder saw it: from outside. The numbers are those of
the audit; findings that are not here are tested beside the modules.

All of F1, damaged machine code and no place for it, is in
``tests/machine_code/test_code_cache.py``. Where a finding was a crash, much memory or the shell's,
a process of its own is started, so that it would fail alone.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scope.scope_addon import cli
from scope.scope_addon.capture.perception.adapters import graph
from scope.scope_addon.cli import SAMPLE, main

from ..capture.perception.adapters.made_networks import huge, looping
from ..machine_code.small_package import LONG_CALLEE, make_package
from ..retarget.made_files import array, fbx, glb
from .fuzz import CORPUS
from .targets import TARGETS

posix = pytest.mark.skipif(os.name == "nt", reason="needs POSIX's shell, signals or pipes")
linux = pytest.mark.skipif(
    sys.platform != "linux", reason="macOS does not enforce the limit, nor take any bytes as names"
)
PROGRAM = [sys.executable, "-m", "scope.scope_addon"]
Said = Callable[..., str]


@pytest.fixture
def refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Said:
    """Run a command line in the test's folder; check that it fails in one sentence and writes
    nothing.
    """
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str, status: int = 1) -> str:
        before = sorted(tmp_path.iterdir())
        assert main(arguments) == status
        out, said = capfd.readouterr()
        assert out == ""
        assert one_sentence(said)
        assert sorted(tmp_path.iterdir()) == before
        return said

    return run


def one_sentence(said: str) -> bool:
    return said.startswith("scope: ") and said.count("\n") == 1 and "internal error" not in said


def shell(line: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a line of the shell, in which SCOPE is the program."""
    line = line.replace("SCOPE", shlex.join(PROGRAM))
    options: dict[str, Any] = {
        "capture_output": True,
        "text": True,
        "check": False,
        "stdin": subprocess.DEVNULL,
    }
    return subprocess.run(
        ["bash", "-c", line], cwd=folder, env={**os.environ, **environment}, **options
    )


def python(
    code: str, folder: Path, *arguments: str, **environment: str
) -> subprocess.CompletedProcess[str]:
    options: dict[str, Any] = {
        "capture_output": True,
        "text": True,
        "check": False,
        "errors": "surrogateescape",
    }
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, cwd=folder, env={**os.environ, **environment}, **options)


def walk(folder: Path) -> None:
    (folder / "walk.npz").write_bytes(TARGETS["motion"].seeds(folder)[0])


# F3: footage


@linux
def test_f3_a_picture_of_too_many_pixels(tmp_path: Path) -> None:
    """A PNG of 1.6 MB with 20,000 × 20,000 pixels took 13.8 GiB."""
    shutil.copy(CORPUS / "picture-20000.png", tmp_path / "bomb.png")
    done = shell("ulimit -v 3000000; SCOPE capture bomb.png -o a.npz", tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith(
        "scope: bomb.png has too many pixels, and at most 134 million can be read"
    )
    assert one_sentence(done.stderr)


# F4: rigs

IMPORT = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
from scope.scope_addon.cli import main
for rig in sys.argv[1:]:
    print(main(["import", "walk.npz", "--retarget", rig, "-o", "out.glb"]), flush=True)
sys.stderr.flush()
import os
os._exit(0)  # without Blender's exit handlers
"""
GLTF: dict[str, Any] = {
    "asset": {"version": "2.0"},
    "scenes": [{"nodes": [0]}],
    "nodes": [{"name": "Hips", "children": [1]}, {"name": "Spine", "translation": [0, 1, 0]}],
    "skins": [{"joints": [0, 1], "inverseBindMatrices": 0}],
    "buffers": [{"byteLength": 128}],
    "bufferViews": [{"buffer": 0, "byteLength": 128}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 2, "type": "MAT4"}],
}


@pytest.mark.slow
@linux
def test_f4_rigs_that_ask_for_everything(tmp_path: Path) -> None:
    """NaN gave a traceback; a count or /dev/zero took 9 GiB; a pipe was waited for; FBX took 60 s
    and 7.8 GiB.
    """
    walk(tmp_path)
    bones = [GLTF["nodes"][0], {"translation": [np.nan] * 3}]
    glb(tmp_path / "nan.glb", {**GLTF, "nodes": bones}, struct.pack("<f", np.nan) * 32)
    count = [{**GLTF["accessors"][0], "count": 2_000_000_000}]
    glb(tmp_path / "count.glb", {**GLTF, "accessors": count}, bytes(128))
    for name, uri in (("zero", "/dev/zero"), ("other", "/etc/passwd")):
        text = json.dumps({**GLTF, "buffers": [{"byteLength": 128, "uri": uri}]})
        (tmp_path / f"{name}.gltf").write_text(text)
    os.mkfifo(tmp_path / "pipe.glb")
    fbx(tmp_path / "bomb.fbx", array(b"d", 3, bytes(100_000_000)))
    damaged = bytearray(fbx(tmp_path / "mutated.fbx", array(b"d", 3, bytes(24))).read_bytes())
    damaged[60] ^= 0xFF
    (tmp_path / "mutated.fbx").write_bytes(damaged)
    says = {
        "nan.glb": "nan.glb: ",
        "count.glb": "count.glb: this glTF file is damaged",
        "zero.gltf": "refers to '/dev/zero', outside its own folder",
        "other.gltf": "refers to '/etc/passwd', outside its own folder",
        "pipe.glb": "pipe.glb is a pipe or a device",
        "bomb.fbx": "bomb.fbx: this FBX file is damaged",
        "mutated.fbx": "mutated.fbx: this FBX file is damaged",
    }
    done = python(IMPORT, tmp_path, *says)
    assert (done.returncode, done.stdout) == (0, "1\n" * len(says)), done.stderr
    for said, expected in zip(done.stderr.splitlines(keepends=True), says.values(), strict=True):
        assert one_sentence(said)
        assert expected in said
    assert not (tmp_path / "out.glb").exists()


# F7: networks


def test_f7_an_endless_loop(tmp_path: Path, refused: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    """The capture never ended."""
    monkeypatch.setattr(graph, "DEFAULT_OPENING_S", 1.5)
    looping(tmp_path / "loop.onnx")
    said = refused("capture", str(SAMPLE), "--keypoints", "loop.onnx", "-o", "a.npz")
    assert "loop.onnx was stopped because it gave no result within 1.5 s; choose" in said


@linux
def test_f7_a_constant_of_12_gigabytes(tmp_path: Path, refused: Said) -> None:
    """ConstantOfShape of 3e9 took all memory."""
    huge(tmp_path / "huge.onnx", 3_000_000_000)
    said = refused("capture", str(SAMPLE), "--keypoints", "huge.onnx", "-o", "a.npz")
    assert "huge.onnx cannot be run" in said
    assert "ailed to allocate" in said


# F9: standard streams

MOTION = """
import sys
from scope.scope_addon import cli
def run_capture(args):
    args.output[0].write_text("motion")
    print("of a library")
    return {"frames": 3}
cli.run_capture = run_capture
cli.run()
"""


def captured(redirection: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command line that captures nothing, but writes a file, with a shell's redirections."""
    command = shlex.join([sys.executable, "-c", MOTION, "capture", "-o", "a.npz", "--json"])
    done = shell(redirection.replace("COMMAND", command), folder)
    assert (folder / "a.npz").read_text("utf-8") == "motion"  # and no message
    return done


@posix
@pytest.mark.parametrize(
    ("redirection", "says"),
    [
        ("COMMAND > /dev/full", "(No space left on device)"),
        ("COMMAND >&-", "(Bad file descriptor)"),
        (
            "mkfifo gone; (read < gone; COMMAND) | (exec <&-; echo > gone); exit ${PIPESTATUS[0]}",
            "(Broken pipe)",
        ),
    ],
)
def test_f9_a_report_that_cannot_be_written(tmp_path: Path, redirection: str, says: str) -> None:
    """``--json >/dev/full`` and ``--json | true`` ended with a wrong status or message."""
    done = captured(redirection, tmp_path)
    assert done.returncode == 1
    assert (
        f"the report cannot be written to standard output {says}; all results are complete"
        in done.stderr
    )
    assert "Traceback" not in done.stderr
    assert "Exception" not in done.stderr


@posix
@pytest.mark.parametrize("redirection", ["COMMAND 2>&-", "COMMAND <&- 2>&-"])
def test_f9_messages_that_cannot_be_written_change_nothing(
    tmp_path: Path, redirection: str
) -> None:
    """``2>&-`` ended with a wrong status, or wrote messages into the next file that was opened."""
    done = captured(redirection, tmp_path)
    assert (done.returncode, done.stdout) == (0, '{"frames": 3}\n')


# F10, F14, F15: one sentence, whatever happens


def test_f10_an_error_of_our_own(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever nobody had thought of came as a traceback."""

    def fail(_: object) -> None:
        np.linalg.inv(np.zeros((2, 2)))

    monkeypatch.setattr(cli, "run_capture", fail)
    assert main(["capture"]) == 1
    out, said = capsys.readouterr()
    assert out == ""
    assert said.startswith(
        "scope: an internal error, LinAlgError: Singular matrix; please report it"
    )
    assert said.count("\n") == 1
    monkeypatch.setenv("SCOPE_TRACEBACK", "1")
    with pytest.raises(np.linalg.LinAlgError):
        main(["capture"])


FULL = """
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
from scope.scope_addon.cli import run
run()
"""


@posix
def test_f10_a_full_disk(tmp_path: Path) -> None:
    """The writer's traceback came before the sentence."""
    walk(tmp_path)
    done = python(
        FULL, tmp_path, "import", "walk.npz", "-o", "out.npz", PYTHONDONTWRITEBYTECODE="1"
    )
    assert done.returncode == 1
    assert one_sentence(done.stderr), done.stderr
    assert "out.npz" in done.stderr
    assert os.listdir(tmp_path) == ["walk.npz"]


@posix
def test_f14_a_signal_while_the_program_is_loaded(tmp_path: Path) -> None:
    """SIGTERM in the first two seconds ended it without a word.

    Numpy is imported after the handlers are installed; this stand-in sends the signal then.
    """
    code = (
        "import os, runpy, signal, sys\n"
        "class Finder:\n"
        "    def find_spec(name, *_):\n"
        "        name == 'numpy' and os.kill(os.getpid(), signal.SIGTERM)\n"
        "sys.meta_path.insert(0, Finder)\n"
        "sys.argv = ['scope', 'capture']\n"
        "runpy.run_module('scope.scope_addon', run_name='__main__')\n"
    )
    done = python(code, tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "scope: stopped\n")


@linux
@pytest.mark.parametrize(
    ("limit_kb", "output", "says"),
    [
        (
            1_500_000,
            "out.glb",
            "this shell limits a process to 1.54 GB of address space, but a capture needs 3.20 GB",
        ),
        (
            500_000,
            "out.npz",
            "this shell limits a process to 0.51 GB of address space, but a capture needs 2.50 GB",
        ),
        (110_000, "out.npz", "there is too little memory to load the program; free memory"),
    ],
)
def test_f15_a_shell_that_limits_memory(
    tmp_path: Path, limit_kb: int, output: str, says: str
) -> None:
    """``ulimit -v 1500000`` gave SIGSEGV: Blender's module was half loaded."""
    done = shell(f"ulimit -v {limit_kb}; exec SCOPE capture -o {output}", tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith(f"scope: {says}")
    assert one_sentence(done.stderr)
    assert not any(tmp_path.iterdir())


# F11 and the files that differed

KILLED = """
import os, pathlib, signal
from scope.scope_addon.atomic_write import atomic_path
from scope.scope_addon.command_line.blender_module import load_blender
load_blender()
with atomic_path(pathlib.Path("o.fbx")) as temporary:
    temporary.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.slow
@posix
def test_f11_nothing_is_left_and_fbx_files_are_the_same(tmp_path: Path) -> None:
    """Exports left ``blender_XXXXXX`` in TMPDIR, a killed one also ``.o.xxxx.fbx``; the same
    motion's .fbx differed.
    """
    for name in ("results", "temporary"):
        (tmp_path / name).mkdir()
    results = tmp_path / "results"
    walk(results)
    python(KILLED, results, TMPDIR=str(tmp_path / "temporary"))
    assert len(os.listdir(results)) == 3  # with the lock
    assert [path.name[:8] for path in (tmp_path / "temporary").glob("*/*")] == ["blender_"]
    contents = []
    for k in range(2):  # processes that hash texts in ways of their own
        environment = {"TMPDIR": str(tmp_path / "temporary"), "PYTHONHASHSEED": str(k + 1)}
        done = shell("SCOPE import walk.npz -o o.fbx --shape-keys baked", results, **environment)
        assert done.returncode == 0, done.stderr
        assert sorted(os.listdir(results)) == ["o.fbx", "walk.npz"]
        assert os.listdir(tmp_path / "temporary") == []
        contents.append((results / "o.fbx").read_bytes())
    assert contents[0] == contents[1]


# The rows without a number

COMPILED = """
import package.scope_addon
from package.solver.kernels import inner, outer
assert outer(0.5) == inner(0.5) + inner(1.0)
for kernel in (inner, outer):
    (made,) = kernel.overloads.values()
    found = [f for f in made.library._final_module.functions if not f.is_declaration]
    print(sorted({(f.linkage.name, "outer" if "outer" in f.name else "inner") for f in found}))
"""
LOADED = """
import package.scope_addon
from package.solver.kernels import inner, outer
hits = (sum(kernel.stats.cache_hits.values()) for kernel in (inner, outer))
print(outer(0.5) == inner(0.5) + inner(1.0), *hits)
"""


@pytest.mark.slow
def test_the_run_that_compiles_rounds_as_later_ones(tmp_path: Path) -> None:
    """The capture that compiled differed by 8e-13: callers ran whichever copy of a callee was made
    or loaded first.

    Copies of small kernels round alike, so that only their being separate can be seen here. One
    second of the sample clip shows it in two minutes: see "bit for bit" in docs/command_line.md.
    """
    (make_package(tmp_path) / "kernels.py").write_text(LONG_CALLEE)
    cache = str(tmp_path / "cache")
    inner, outer = map(eval, python(COMPILED, tmp_path, NUMBA_CACHE_DIR=cache).stdout.splitlines())
    assert inner == [("external", "inner")]
    assert outer == [("external", "outer"), ("internal", "inner")]
    assert python(LOADED, tmp_path, NUMBA_CACHE_DIR=cache).stdout == "True 1 1\n"
