# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver's machine code for a platform and a Python, to be shipped in an extension.

It is made by the staged extension itself, with its own wheels in the Python of that Blender, for
the processor that `scope_addon/machine_code/code_folders.py` names; so it can be made on a computer
of that platform alone, by building there. It is kept in build/kernels/PLATFORM/PYTHON: a copy of
that folder serves another computer, if the sources are the same. Where there is none, the extension
works as well, and compiles the solver once on the user's computer.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
KEPT = ROOT / "build" / "kernels"
DEBIAN_READY = ROOT / "build" / "blender" / "ready"
MADE_FROM = "made_from"  # the file that says what the machine code was made from
_COMPILED = b"solver.kernel import"  # in each file of the extension that has kernels
PROCESSORS = {"windows-x64": "x86-64-v3", "linux-x64": "x86-64-v3", "macos-arm64": "apple-m1"}
_THIS = {
    ("Windows", "AMD64"): "windows-x64",
    ("Linux", "x86_64"): "linux-x64",
    ("Darwin", "arm64"): "macos-arm64",
}
_LIMIT_S = 1800


def add_kernels(staging: Path, target: str, python: str, wheels: Iterable[Path]) -> bool:
    """Put machine code into a staged extension; return whether there is any.

    :param target: the platform, as the extension's manifest names it.
    :param wheels: the extension's wheels for this platform and Python.
    """
    wheels = [w for w in wheels if "abi3" in w.name or f"cp{python.replace('.', '')}" in w.name]
    kept = KEPT / target / python
    wanted = _digest(staging, wheels)
    stated = kept / MADE_FROM
    if not stated.is_file() or stated.read_text("utf-8") != wanted:
        is_here = _THIS.get((platform.system(), platform.machine())) == target
        if not is_here or not (find_python(python) or _has_debian(python)):
            print(
                f"build: no compiled code for {target}, Python {python}: build on such a computer "
                "to have it",
                file=sys.stderr,
            )
            return False
        _compile(staging, target, python, wheels, kept)
        stated.write_text(wanted)
    for folder in kept.iterdir():
        if folder.is_dir():
            shutil.copytree(
                folder, staging / "assets" / "kernels" / folder.name, dirs_exist_ok=True
            )
    return True


def find_python(version: str) -> str | None:
    """Return a Python interpreter of a version; pyenv's are not on the PATH."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    names = [
        sys.executable,
        f"python{version}",
        *map(str, sorted(pyenv.glob(f"{version}*/bin/python"))),
    ]
    for name in names:
        ask = [name, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
        try:
            said = subprocess.run(ask, capture_output=True, text=True, check=False).stdout
        except OSError:
            continue
        if said.strip() == version:
            return name
    return None


def _has_debian(python: str) -> bool:
    """Return whether ./scripts/debian has been set up, whose Python is 3.13."""
    return python == "3.13" and DEBIAN_READY.is_file() and os.geteuid() == 0


def _command(python: str, folders: list[Path], variables: dict[str, str]) -> list[str]:
    """Return the start of the command line that runs a Python, with some folders, and environment
    variables.
    """
    if own := find_python(python):
        return [own]
    binds = [part for folder in folders for part in ("--bind", str(folder))]
    # it has an environment of its own
    given = [f"{name}={value}" for name, value in variables.items()]
    return [str(ROOT / "scripts" / "debian"), *binds, "env", *given, f"python{python}"]


def _compile(staging: Path, target: str, python: str, wheels: list[Path], kept: Path) -> None:
    print(
        f"build: compiling the solver for {target}, Python {python}: one or two minutes",
        file=sys.stderr,
        flush=True,
    )
    with tempfile.TemporaryDirectory(prefix="scope-kernels-") as name:
        packages = Path(name) / "packages"
        job = Path(name) / "job"
        job.mkdir()
        for wheel in [*wheels, _numpy_wheel(python)]:
            with zipfile.ZipFile(wheel) as file:
                file.extractall(packages)
        start = staging / "scope_addon" / "job" / "start_worker.py"
        # with what has been made before, of which some may still be good
        kernels = Path(name) / "kernels"
        if kept.is_dir():
            shutil.copytree(kept, kernels)
        for folder in kernels.glob("*"):
            os.utime(folder, (0, 0))
        variables = {
            "NUMBA_CPU_NAME": PROCESSORS[target],
            "NUMBA_CPU_FEATURES": "",
            "NUMBA_CACHE_DIR": str(kernels),
        }
        command = _command(python, [staging, Path(name)], variables)
        command += ["-I", "-B", str(start), str(staging), str(job), str(packages)]
        environment = os.environ | variables
        pipe = subprocess.PIPE
        with subprocess.Popen(
            command, env=environment, stdin=pipe, stdout=pipe, text=True
        ) as process:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(json.dumps({"warm_up": True}) + "\n")
            process.stdin.flush()  # open until the worker has ended: it ends with its parent
            messages = [json.loads(line) for line in process.stdout]
            process.wait(timeout=_LIMIT_S)
        if not messages or messages[-1]["event"] != "result":
            raise SystemExit(f"build: the solver could not be compiled: {messages[-1:]}")
        for folder in kernels.iterdir():
            if folder.stat().st_mtime == 0:  # the compiler has not used it
                shutil.rmtree(folder) if folder.is_dir() else folder.unlink()
        shutil.rmtree(kept, ignore_errors=True)
        kept.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(kernels, kept)


def _numpy_wheel(python: str) -> Path:
    """Return the locked numpy of a Python; an extension does not ship it."""
    folder = KEPT / "numpy" / python
    if not list(folder.glob("*.whl")):
        folder.mkdir(parents=True, exist_ok=True)
        lock = (ROOT / "scripts" / "requirements" / f"{python}.txt").read_text("utf-8")
        found = re.search(r"^numpy==\S+(?:.*\\\n)*.*$", lock, flags=re.M)
        assert found, python
        request = folder / "request.txt"
        request.write_text(found[0] + "\n")
        command = [
            sys.executable,
            "-m",
            "pip",
            "download",
            "--quiet",
            "--disable-pip-version-check",
            "--no-deps",
        ]
        command += [
            "--only-binary=:all:",
            "--require-hashes",
            "--python-version",
            python,
            "--dest",
        ]
        # pip copies a wheel to where it is wanted, and may be stopped half-way.
        with tempfile.TemporaryDirectory(dir=folder) as fetched:
            subprocess.run([*command, fetched, "--requirement", str(request)], check=True)
            (wheel,) = Path(fetched).glob("*.whl")
            wheel.replace(folder / wheel.name)
    return next(folder.glob("*.whl"))


def _digest(staging: Path, wheels: list[Path]) -> str:
    """Return a digest of what decides the machine code: the sources and the compiler."""
    digest = hashlib.sha256("\n".join(sorted(w.name for w in wheels)).encode())
    contents = {
        path.relative_to(staging).as_posix(): path.read_bytes()
        for folder in ("solver", "scope_addon")
        for path in (staging / folder).rglob("*.py")
    }
    for name, content in sorted(contents.items()):
        if name.startswith(("solver/", "scope_addon/machine_code/")) or _COMPILED in content:
            digest.update(name.encode() + b"\n" + content)
    return digest.hexdigest()
