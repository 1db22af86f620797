# SPDX-License-Identifier: GPL-3.0-or-later
"""The wheels of the solver alone: its code, the built-in bodies and the joint prior; one for each
system with machine code as well, and one for all others without.

Machine code is compiled for the system and the Python that run this, and kept in a folder; that of
other Pythons and systems in the same folder goes into wheels as well. The same sources and machine
code give the same bytes.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from source_time import source_time

ROOT = Path(__file__).resolve().parent.parent
CODE = ROOT / "build" / "solver_code"
NAME = "scope_solver"
# Files of the wheel's licences, and where they are found here: of the code, the prior, the bodies.
LICENCES = {
    "LICENSE": "solver/LICENSE",
    "assets/prior/LICENSE": "LICENSE",
    "assets/body/LICENSE.md": "assets/body/LICENSE.md",
}
LICENCE = "Apache-2.0 AND GPL-3.0-or-later AND CC0-1.0"  # of code, joint prior and bodies
ASSETS = (
    "assets/body/LICENSE.md",
    "assets/body/growth.npz",
    "assets/body/scope.npz",
    "assets/body/scope_h.npz",
    "assets/prior/README.md",
    "assets/prior/joint_prior.npz",
)
# By system and processor, the wheel's tag: that of numba's wheels. With no machine code, "any".
PLATFORMS = {
    "linux-x86_64": "manylinux_2_27_x86_64",
    "win32-x86_64": "win_amd64",
    "darwin-arm64": "macosx_12_0_arm64",
}
NEEDS = ("numpy", "numba")
# Optional extras, and the package that each needs for the examples of docs/solver_api.md.
EXTRAS = {"jax": "jax", "torch": "torch"}
DOCUMENTATION = "../docs/"  # what the README links to, which a wheel does not have
MADE_FROM = "made_from"  # in a folder of machine code: a digest of the sources
# What a researcher's first programs call: all that these compile is shipped.
WARM_UP = """
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scope import solver
from scope.solver.kernel import ship_code
from scope.solver.names import COCO
from scope.solver.shipped_code import shipped_folder

body = solver.load_body("scope")
coco = [body.point(f"coco/{name}") for name in COCO[:17]]
turns = np.tile(np.eye(3), (body.K + 1, 1, 1))
turns[0] = np.diag([1.0, -1.0, -1.0])
R, joints = body.forward_kinematics(turns, [0.0, 0.0, 3.0])
points = body.keypoints(R, joints, which=coco)
K = np.array([[1000.0, 0.0, 500.0], [0.0, 1000.0, 500.0], [0.0, 0.0, 1.0]])
pixels = points[:, :2] / points[:, 2:] * 1000.0 + 500.0
image = solver.Measurements(K, solver.Keypoints2D(coco, pixels, sigma_px=4.0))
bones = np.arange(1, body.K + 1)
ends = len(body.keypoint_names) + bones
starts = len(body.keypoint_names) + body.parents[1:]
everything = solver.Measurements(
    K,
    image.keypoints2d,
    solver.Keypoints3D(body.joint_names, joints, sigma_m=0.01),
    solver.OrientationField(starts, ends, joints[1:] - joints[body.parents[1:]]),
    solver.PosePriors([0], R[:1], joints[:1], [1.0], [1.0]),
    solver.FootContacts([coco[15]], points[15:16], [1.0]),
    solver.Floor([coco[15]], [0.0, -1.0, 0.0], -points[15, 1], [1.0]),
)
report = solver.Options(report=True)
first = solver.fit(body, everything, options=report)
solver.fit(body, image)
solver.fit(body, everything, init=first.state)
solver.linearize(body, everything, first.state)
solver.gauss_newton_step(body, everything, first.state)
clip = solver.fit_clip(body, [image, everything], focal=True)
views = [[solver.View(image), solver.View(image, np.eye(3), [0.0, 0.0, 0.001])]] * 6
stands = solver.StandingPoints([coco[15]], np.ones((6, 1)))
solver.fit_motion(body, views, np.arange(6) / 30.0, stands=stands, covariance=True)
solver.fit_motion(body, [everything] * 6, np.arange(6) / 30.0, window=0.1, overlap=0.05)
solver.fit_motion(body, [everything] * 6, np.arange(6) / 30.0, focal=True)
folder = Path(sys.argv[1]) / shipped_folder().name
folder.mkdir(parents=True, exist_ok=True)
ship_code(folder)
print(shipped_folder().name)
"""


def main() -> int:
    """Build the wheels; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument(
        "folder", type=Path, nargs="?", default=ROOT / "build" / "dist", help="for the wheels"
    )
    parser.add_argument("--code", type=Path, default=CODE, help="folder of machine code")
    parser.add_argument("--code-only", action="store_true", help="make no wheels")
    arguments = parser.parse_args()
    if missing := [name for name in NEEDS if importlib.util.find_spec(name) is None]:
        raise SystemExit(
            f"solver_wheel: {sys.executable} has no {' and no '.join(missing)}, with which the "
            f"solver is compiled: {sys.executable} -m pip install {' '.join(NEEDS)}"
        )
    digest = sources_digest()
    compile_code(arguments.code, digest)
    if not arguments.code_only:
        for platform in ("any", *PLATFORMS.values()):
            if made := build_wheel(arguments.folder, arguments.code, digest, platform):
                print(made)
    return 0


def sources() -> list[Path]:
    """Return the files of the solver's package."""
    return sorted(
        path
        for path in (ROOT / "solver").rglob("*")
        if path.suffix == ".py" or path.name == "py.typed"
    )


def sources_digest() -> str:
    """Return a digest of the solver's files."""
    digest = hashlib.sha256()
    for path in sources():
        text = path.read_bytes().replace(b"\r\n", b"\n")
        digest.update(path.relative_to(ROOT).as_posix().encode() + b"\n" + text)
    return digest.hexdigest()


def refuse_changes(digest: str) -> None:
    """Stop where the solver's files are no longer those of a digest.

    :raises SystemExit: they are not.
    """
    if sources_digest() != digest:
        raise SystemExit(
            "solver_wheel: files of the solver changed while the wheel was made; run it again"
        )


def compile_code(folder: Path, digest: str) -> None:
    """Compile the solver with this Python into a folder in `folder`, unless that has been done.

    Code of other sources is removed. It is compiled from a copy of the solver without the rest of
    Scope, whose cache of machine code is another. For some processors, none is shipped.

    :param digest: of the sources.
    :raises SystemExit: it could not be compiled, or the sources have changed.
    """
    for made in folder.glob(f"*/{MADE_FROM}"):
        if made.read_text("utf-8") != digest:
            shutil.rmtree(made.parent)
    with tempfile.TemporaryDirectory(prefix="scope-solver-") as name:
        copy = Path(name)
        (copy / "scope").mkdir()
        shutil.copy(ROOT / "__init__.py", copy / "scope")
        shutil.copytree(
            ROOT / "solver",
            copy / "scope" / "solver",
            ignore=shutil.ignore_patterns("__pycache__", "machine_code"),
        )
        for asset in ASSETS:
            (copy / "scope" / asset).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / asset, copy / "scope" / asset)
        refuse_changes(digest)
        ask = "from scope.solver import shipped_code as s; print(s.shipped_folder().name); "
        target, _, processor = _run(copy, {}, ask + "print(s.shipped_processor())").partition("\n")
        if not processor.strip() or (folder / target / MADE_FROM).is_file():
            return
        chosen = {"NUMBA_CPU_NAME": processor.strip(), "NUMBA_CPU_FEATURES": ""}
        chosen["NUMBA_CACHE_DIR"] = str(copy / "cache")
        print(f"solver_wheel: compiling for {target}: one or two minutes", file=sys.stderr)
        _run(copy, chosen, WARM_UP, str(folder))
    (folder / target / MADE_FROM).write_text(digest, "utf-8")


def _run(packages: Path, variables: dict[str, str], program: str, *arguments: str) -> str:
    """Run a program with the packages of a folder, and return what it prints."""
    environment = {**os.environ, **variables, "PYTHONPATH": str(packages)}
    command = [sys.executable, "-W", "error", "-c", program, *arguments]
    done = subprocess.run(
        command, env=environment, cwd=packages, stdout=subprocess.PIPE, text=True, check=False
    )
    if done.returncode:
        raise SystemExit("solver_wheel: the solver could not be compiled; see above")
    return done.stdout


def build_wheel(folder: Path, code: Path, digest: str, platform: str = "any") -> Path | None:
    """Write the wheel of a platform, and return its path; None where there is no machine code of
    it.

    :param code: folder of machine code.
    :param digest: of the sources that the machine code was made from.
    :param platform: the tag; ``any`` for the wheel without machine code.
    :raises SystemExit: the sources have changed since; nothing is written.
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))
    version = manifest["version"]
    # Links of the README lead nowhere in a wheel; their texts stay.
    readme = (ROOT / "solver" / "README.md").read_text("utf-8")
    readme = re.sub(r"\[([^\]]+)\]\(" + re.escape(DOCUMENTATION) + r"[^)]*\)", r"\1", readme)
    metadata = [
        "Metadata-Version: 2.4",
        f"Name: {NAME.replace('_', '-')}",
        f"Version: {version}",
        "Summary: Sparse Gauss-Newton fitting of human pose and shape, with numpy and numba",
        f"License-Expression: {LICENCE}",
        *(f"License-File: {name}" for name in LICENCES),
        f"Requires-Python: {project['requires-python']}",
        *(f"Requires-Dist: {needed}" for needed in project["dependencies"]),
        *(f"Provides-Extra: {extra}" for extra in EXTRAS),
        *(f'Requires-Dist: {needed}; extra == "{extra}"' for extra, needed in EXTRAS.items()),
        "Description-Content-Type: text/markdown",
    ]
    information = f"{NAME}-{version}.dist-info"
    files = {f"scope/{path.relative_to(ROOT).as_posix()}": path for path in sources()}
    files |= {f"scope/{asset}": ROOT / asset for asset in ASSETS}
    files["scope/__init__.py"] = ROOT / "__init__.py"
    files |= {f"{information}/licenses/{name}": ROOT / path for name, path in LICENCES.items()}
    found = [
        path
        for system, tag in PLATFORMS.items()
        for path in sorted(code.glob(f"{system}-*/*.nb[ic]"))
        if tag == platform
    ]
    is_pure = platform == "any"
    if not (found or is_pure):
        return None
    files |= {f"scope/solver/machine_code/{p.parent.name}/{p.name}": p for p in found}
    contents = {name: path.read_bytes() for name, path in files.items()}
    refuse_changes(digest)
    contents[f"{information}/METADATA"] = ("\n".join(metadata) + f"\n\n{readme}").encode()
    wheel = [
        "Wheel-Version: 1.0",
        "Generator: scope",
        f"Root-Is-Purelib: {str(is_pure).lower()}",
        f"Tag: py3-none-{platform}",
    ]
    contents[f"{information}/WHEEL"] = ("\n".join(wheel) + "\n").encode()
    record = [f"{name},{_hash(content)}" for name, content in contents.items()]
    record.append(f"{information}/RECORD,,")
    contents[f"{information}/RECORD"] = ("\n".join(record) + "\n").encode()
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"{NAME}-{version}-py3-none-{platform}.whl"
    made = source_time().timetuple()[:6]
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            entry = zipfile.ZipInfo(name, made)
            entry.external_attr = 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    return target


def _hash(content: bytes) -> str:
    """Return the digest and the size of a file as a wheel's record has them."""
    digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
    return f"sha256={digest},{len(content)}"


if __name__ == "__main__":
    sys.exit(main())
