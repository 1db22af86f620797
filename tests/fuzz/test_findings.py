# SPDX-License-Identifier: GPL-3.0-or-later
"""What once broke under attack, each as its finder saw it: from outside. The numbers are those of
the audit; findings that are not here are tested beside the modules.

Where a finding was a crash, much memory or the shell's, a process of its own is started, so that
it would fail alone.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scope.scope_addon import cli
from scope.scope_addon.cli import main

from ..machine_code.small_package import LONG_CALLEE, make_package
from .fuzz import CORPUS
from .targets import TARGETS

posix = pytest.mark.skipif(os.name == "nt", reason="needs POSIX's shell, signals or pipes")
linux = pytest.mark.skipif(
    sys.platform != "linux", reason="macOS does not enforce the limit, nor take any bytes as names"
)
PROGRAM = [sys.executable, "-m", "scope.scope_addon"]


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
        pytest.param(
            "COMMAND > /dev/full",
            "(No space left on device)",
            marks=pytest.mark.skipif(
                not os.path.exists("/dev/full"), reason="only Linux has this device"
            ),
        ),
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
@pytest.mark.usefixtures("blender_module")
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
