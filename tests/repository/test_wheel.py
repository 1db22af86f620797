# SPDX-License-Identifier: GPL-3.0-or-later
"""The wheel contains the product and nothing else, and its solver works with only numpy and
numba.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from scope.scope_addon.machine_code.code_folders import places

ROOT = Path(__file__).resolve().parents[2]
PRODUCT = ("solver", "scope_addon")
DATA = {
    "scope/assets/body/LICENSE.md",
    "scope/assets/body/README.md",
    "scope/assets/body/expressions.npz",
    "scope/assets/body/growth.npz",
    "scope/assets/body/mouth.npz",
    "scope/assets/body/scope.npz",
    "scope/assets/body/scope_h.npz",
    "scope/assets/face/controls/mpfb.json",
    "scope/assets/face/controls/rigify.json",
    "scope/assets/face/controls/rigify_skin.json",
    "scope/assets/face/response.npz",
    "scope/assets/lifter/LICENSE.md",
    "scope/assets/lifter/README.md",
    "scope/assets/lifter/lifter.onnx",
    "scope/assets/networks/face_expression.onnx",
    "scope/assets/networks/face_landmark.onnx",
    "scope/assets/networks/hand_landmark.onnx",
    "scope/assets/networks/palm_detection.onnx",
    "scope/assets/networks/pose_detection.onnx",
    "scope/assets/networks/pose_landmark_full.onnx",
    "scope/assets/networks/pose_landmark_heavy.onnx",
    "scope/assets/networks/pose_landmark_lite.onnx",
    "scope/assets/prior/README.md",
    "scope/assets/prior/joint_prior.npz",
    "scope/assets/sample/LICENSE.md",
    "scope/assets/sample/sample.mp4",
    "scope/scope_addon/report/static/motion.js",
    "scope/scope_addon/report/static/page.js",
    "scope/scope_addon/report/static/style.css",
    "scope/scope_addon/report/static/viewer.js",
    "scope/scope_addon/report/static/webgl.js",
    "scope/scope_addon/ui/translations.txt",
    "scope/solver/py.typed",
}
CAPTURE_MODULES = ("cv2", "onnxruntime", "av", "bpy")

FIT = """
import importlib.util, sys
import numpy as np

for name in {capture}:
    assert importlib.util.find_spec(name) is None, name
import scope
from scope import solver

assert scope.__file__.startswith(sys.prefix), scope.__file__
assert solver.load_body("scope").K == 23 and solver.load_body("scope_h").K == 51
assert "left_knee" in solver.load_joint_prior().names
assert solver.__version__[0].isdigit()
body = solver.load_body("scope")
joints = body.rest_joints() * [1.0, -1.0, -1.0] + [0.0, 0.0, 3.0]
seen = solver.Keypoints3D(len(body.keypoint_names) + np.arange(24), joints, np.ones(24))
found = solver.fit(body, solver.Measurements(keypoints3d=seen))
print(np.abs(found.t_camera_part - joints).max())
"""


def folders() -> set[str]:
    """Every folder of the product that contains a module, as a path in the wheel."""
    found = {path.parent for name in PRODUCT for path in (ROOT / name).rglob("*.py")}
    return {f"scope/{folder.relative_to(ROOT).as_posix()}" for folder in found}


@pytest.fixture(scope="session")
def wheel(tmp_path_factory, networks) -> Path:
    """The wheel, built from a copy of the sources, so that nothing is written into the checkout."""
    place = tmp_path_factory.mktemp("wheel")
    source = place / "source"
    ignored = shutil.ignore_patterns("__pycache__", "pictures", "guide")
    for name in (*PRODUCT, "assets", "tests", "tools", "benchmarks", "scripts"):
        shutil.copytree(ROOT / name, source / name, ignore=ignored)
    for name in (
        "__init__.py",
        "setup.py",
        "pyproject.toml",
        "blender_manifest.toml",
        "README.md",
        "LICENSE",
        "THIRD_PARTY.md",
    ):
        shutil.copy(ROOT / name, source)
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--disable-pip-version-check",
        "--no-deps",
    ]
    command += ["--no-build-isolation", "--wheel-dir", str(place), str(source)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return next(place.glob("*.whl"))


@pytest.fixture(scope="session")
def installed(wheel, tmp_path_factory) -> Path:
    """The Python of an environment that has the wheel, numpy, numba and llvmlite."""
    place = tmp_path_factory.mktemp("environment")
    venv.create(place, with_pip=False, symlinks=os.name != "nt")
    packages = next(iter(place.rglob("site-packages")))
    for name in ("numpy", "numba", "llvmlite"):
        spec = find_spec(name)
        assert spec is not None
        assert spec.origin is not None
        package = Path(spec.origin).parent
        # where wheels keep their shared libraries
        for folder in (package, package.with_name(f"{name}.libs")):
            if folder.is_dir():
                (packages / folder.name).symlink_to(folder, target_is_directory=True)
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(packages)
    return next(
        path
        for path in (place / "bin" / "python", place / "Scripts" / "python.exe")
        if path.exists()
    )


def run(python: Path, *arguments: str) -> subprocess.CompletedProcess:
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "COVERAGE"))}
    # Machine code belongs to the content of sources, and the wheel's are those that other tests
    # compile.
    environment["NUMBA_CACHE_DIR"] = str(places()[0])
    command = [str(python), *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=python.parent, env=environment
    )


@pytest.mark.slow
def test_the_wheel_has_every_package_of_the_product_and_its_data(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    modules = {name for name in names if name.endswith(".py")}
    assert {name.rpartition("/")[0] for name in modules} == folders() | {"scope"}
    on_disk = {
        f"scope/{p.relative_to(ROOT).as_posix()}"
        for name in PRODUCT
        for p in (ROOT / name).rglob("*.py")
    }
    assert modules == on_disk | {"scope/__init__.py"}
    assert names - modules == DATA


@pytest.mark.slow
def test_the_version_is_stated_in_the_manifest_alone(wheel):
    version = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))["version"]
    assert wheel.name == f"scope_mocap-{version}-py3-none-any.whl"
    assert "version" not in tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def test_every_folder_of_modules_is_a_package():
    """A folder without `__init__.py` can be imported here, but would be missing in the wheel."""
    assert [
        f
        for f in sorted(folders())
        if not (ROOT / f.removeprefix("scope/") / "__init__.py").is_file()
    ] == []


@pytest.mark.slow
def test_the_wheel_requires_only_numpy_and_numba(wheel):
    with zipfile.ZipFile(wheel) as archive:
        metadata = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        lines = archive.read(metadata).decode().splitlines()
    needed = [
        line.removeprefix("Requires-Dist: ") for line in lines if line.startswith("Requires-Dist: ")
    ]
    names = [re.match(r"\w+", name)[0] for name in needed if "extra ==" not in name]
    assert names == ["numpy", "numba", "llvmlite"]  # the last of which numba needs anyway


@pytest.mark.slow
def test_the_wheel_states_the_licences_of_all_that_it_contains(wheel):
    with zipfile.ZipFile(wheel) as archive:
        contents = {
            name.partition(".dist-info/")[2]: archive.read(name) for name in archive.namelist()
        }
    lines = contents["METADATA"].decode().splitlines()
    assert "License-Expression: GPL-3.0-or-later AND Apache-2.0 AND CC0-1.0" in lines
    licences = {name.removeprefix("licenses/") for name in contents if name.startswith("licenses/")}
    assert licences == {
        "LICENSE",
        "THIRD_PARTY.md",
        "assets/body/LICENSE.md",
        "assets/lifter/LICENSE.md",
        "assets/networks/LICENSE-mediapipe.txt",
        "assets/sample/LICENSE.md",
        "solver/LICENSE",
    }


def test_every_pattern_of_licences_finds_some_where_no_networks_were_built():
    """setuptools warns of one that finds none, and will refuse it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    for pattern in project["license-files"]:
        assert [path for path in ROOT.glob(pattern) if path.parent.name != "networks"], pattern


@pytest.mark.parametrize("python", ["3.11", "3.13"])
def test_a_capture_installs_versions_that_were_tested_and_none_that_fail(python):
    """OpenCV 4.14 and 5 lack `setLogLevel`, onnxruntime from 1.29 on reports to its makers."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    lock = (ROOT / "scripts" / "requirements" / f"{python}.txt").read_text("utf-8")
    tested = dict(re.findall(r"^(\S+?)==(\S+)", lock, flags=re.M))
    fails = {
        "onnxruntime": ("1.27.0", "1.29.0", "1.32.0"),
        "opencv-contrib-python-headless": ("4.10.0.84", "4.14.0.94", "5.0.0.93"),
        "av": ("17.0.0", "19.0.0"),
        "numba": ("0.69.0",),
        "llvmlite": ("0.51.0",),
        "numpy": (),
    }
    for text in (*project["dependencies"], *project["optional-dependencies"]["capture"]):
        needed = Requirement(text)
        assert needed.specifier.contains(tested[needed.name]), text
        assert not [v for v in fails[needed.name] if needed.specifier.contains(v)], text


def test_the_extras_contain_every_package_of_a_missing_module():
    from scope.scope_addon.installed import EXTRAS

    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"][
        "optional-dependencies"
    ]
    assert set(EXTRAS.values()) == set(extras)
    assert set(EXTRAS) == {*CAPTURE_MODULES, "pythonosc", "distributed"}


@pytest.mark.slow
def test_the_solver_fits_with_only_numpy_and_numba(installed):
    """A body at rest, whose joints are known without the solver. With the command line's package,
    it finds the machine code that other tests have compiled.
    """
    program = "import scope.scope_addon\n" + FIT.format(capture=CAPTURE_MODULES)
    done = run(installed, "-W", "error", "-c", program)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize(
    "command", [["capture", "walk.mp4", "-o", "walk.npz"], ["batch", ".", "--out", "."]]
)
def test_the_command_line_reports_missing_packages(installed, command):
    done = run(installed, "-m", "scope.scope_addon", *command)
    assert done.returncode == 1
    says = "scope: cv2, onnxruntime, av must be installed for this: pip install "
    assert done.stderr.startswith(says)
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"][
        "optional-dependencies"
    ]
    named = [Requirement(text) for text in shlex.split(done.stderr.removeprefix(says))]
    assert named == [Requirement(text) for text in extras["capture"]]
