# SPDX-License-Identifier: GPL-3.0-or-later
"""Other optimizers on the same problem, one thread: each in an environment of its own.

scipy and Ceres use the dense baseline's residuals and Jacobian; momentum has its own (see
momentum_run.py). Environments are made once in build/bench. A peer that cannot be installed is left
out, with the reason. Not for CI.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

from ..frames import CACHE, ROOT
from .problem import make_problem

PACKAGES = {"scipy": "scipy==1.17.1", "ceres": "pyceres==2.6"}
MOMENTUM = "pymomentum-cpu==0.1.114.post0"
COMMON = ("numpy==1.26.4", "numba==0.68.1")


def run_all() -> dict[str, float | str]:
    """Return the microseconds of one iteration by peer, or why there is no figure."""
    found: dict[str, float | str] = {}
    for name in (*PACKAGES, "momentum"):
        try:
            found[name] = _run_momentum() if name == "momentum" else _run(name, PACKAGES[name])
        except (OSError, subprocess.CalledProcessError, ValueError) as error:
            reason = (getattr(error, "stderr", "") or str(error)).strip().splitlines()
            found[name] = "skipped: " + (reason[-1] if reason else type(error).__name__)
    return found


def _run(name: str, package: str) -> float:
    python = make_environment(name, *COMMON, package)
    path = CACHE / "path"  # the root folder under the name of the package
    path.mkdir(parents=True, exist_ok=True)
    link = path / "scope"
    if not link.exists():
        link.symlink_to(ROOT)
    environment = {**os.environ, "PYTHONPATH": str(path)}
    command = [str(python), "-m", "scope.benchmarks.solver.peer_run", name]
    done = subprocess.run(
        command, env=environment, cwd=path, capture_output=True, text=True, check=True
    )
    return float(done.stdout.strip().splitlines()[-1])


def _run_momentum() -> float:
    """Run Meta's momentum, whose packages exist for Python 3.12 only."""
    python = make_environment("momentum", MOMENTUM, interpreter=_python312())
    problem = make_problem(23, 10, 120)
    body = problem.body
    measured = problem.measurements
    assert measured.keypoints3d is not None
    assert measured.orientation_field is not None
    directions = np.asarray(measured.orientation_field.directions)
    offsets = body.l.copy()
    offsets[0] = 0.0  # the root's place is a parameter
    file = CACHE / "momentum.npz"
    np.savez(
        file,
        parents=body.parents,
        S=body.S,
        l=offsets,
        part=body.keypoint_part,
        v_bar=body.v_bar,
        points=measured.keypoints3d.points,
        axes=directions / np.linalg.norm(directions, axis=1, keepdims=True),
        root=problem.bank[1][0],
        weights=problem.stage[0, :4],
    )
    one = {name: "1" for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    command = [str(python), str(Path(__file__).with_name("momentum_run.py")), str(file)]
    done = subprocess.run(
        command, env={**os.environ, **one}, capture_output=True, text=True, check=True
    )
    return float(done.stdout.strip().splitlines()[-1])


def _python312() -> str:
    """Return the path of a Python 3.12, on the PATH or among pyenv's versions, which are not on
    it.
    """
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for candidate in ("python3.12", *sorted(str(p) for p in pyenv.glob("3.12*/bin/python"))):
        if not shutil.which(candidate):
            continue
        done = subprocess.run([candidate, "-c", "import venv"], capture_output=True, check=False)
        if done.returncode == 0:  # pyenv's shims exist but run no Python
            return candidate
    raise OSError("momentum needs Python 3.12, which is not here")


def make_environment(name: str, *packages: str, interpreter: str = sys.executable) -> Path:
    """Return the interpreter of an environment with these packages, made on first use."""
    folder = CACHE / name
    python = folder / "bin" / "python"
    stamp = folder / "installed"
    if not stamp.exists():
        print(f"installing {packages[-1]} in {folder}, once", file=sys.stderr)
        subprocess.run(
            [interpreter, "-m", "venv", str(folder)], check=True, capture_output=True, text=True
        )
        command = [
            str(python),
            "-m",
            "pip",
            "install",
            "--quiet",
            "--only-binary",
            ":all:",
            *packages,
        ]
        subprocess.run(command, check=True, capture_output=True, text=True)
        stamp.touch()
    return python
