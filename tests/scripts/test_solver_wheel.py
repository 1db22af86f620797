# SPDX-License-Identifier: GPL-3.0-or-later
"""The wheel of the solver alone: what it contains, says and needs."""

import base64
import csv
import hashlib
import io
import subprocess
import sys
import zipfile

import pytest
from packaging.utils import parse_wheel_filename

from .script_modules import ROOT, script

SOLVER_WHEEL = script("solver_wheel")
CODE = "linux-x86_64-cpython-311"
OTHERS = ("darwin-arm64-cpython-313", "linux-x86_64-cpython-313", "linux-riscv64-cpython-311")
# Loads what a fit needs besides machine code, which is not compiled here.
LOAD = """
import sys
sys.path.insert(0, sys.argv[1])
from scope import solver
assert solver.load_body("scope").K == 23 and solver.load_body("scope_child_h").P == 11
assert "left_knee" in solver.load_joint_prior().names
assert solver.__file__.startswith(sys.argv[1]), solver.__file__
assert not any("scope_addon" in name for name in sys.modules)
for name in solver.__all__:
    getattr(solver, name)
"""


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    """The wheels by their platforms, with files in place of machine code."""
    place = tmp_path_factory.mktemp("solver_wheel")
    for name in (CODE, *OTHERS):
        made = place / "code" / name / "kernel.nbc"
        made.parent.mkdir(parents=True)
        made.write_bytes(b"code")
        (made.parent / "made_from").write_text("sources")
    digest = SOLVER_WHEEL.sources_digest()
    return {
        platform: SOLVER_WHEEL.build_wheel(place, place / "code", digest, platform)
        for platform in ("any", *SOLVER_WHEEL.PLATFORMS.values())
    }


@pytest.fixture
def wheel(wheels):
    """The wheel for Linux."""
    return wheels["manylinux_2_27_x86_64"]


def test_machine_code_is_in_the_wheel_of_its_system_alone(wheels):
    """As pip reads it: a wheel of pure Python is for every system, those with code are not."""
    assert wheels["win_amd64"] is None  # for which there is no code
    inside = {"any": set(), "manylinux_2_27_x86_64": {OTHERS[1], CODE}}
    inside["macosx_12_0_arm64"] = {OTHERS[0]}
    for platform, systems in inside.items():
        with zipfile.ZipFile(wheels[platform]) as archive:
            names = archive.namelist()
            (described,) = [name for name in names if name.endswith(".dist-info/WHEEL")]
            stated = archive.read(described).decode().splitlines()
        assert {name.split("/")[3] for name in names if "/machine_code/" in name} == systems
        assert f"Root-Is-Purelib: {'true' if platform == 'any' else 'false'}" in stated
        (tag,) = parse_wheel_filename(wheels[platform].name)[3]
        assert f"Tag: {tag}" in stated
        assert (tag.interpreter, tag.abi, tag.platform) == ("py3", "none", platform)


def test_it_has_the_solver_its_data_and_machine_code_and_nothing_else(wheels):
    with zipfile.ZipFile(wheels["macosx_12_0_arm64"]) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    sources = {
        f"scope/{path.relative_to(ROOT).as_posix()}" for path in (ROOT / "solver").rglob("*.py")
    }
    data = {
        "scope/__init__.py",
        "scope/solver/py.typed",
        f"scope/solver/machine_code/{OTHERS[0]}/kernel.nbc",
        "scope/assets/body/LICENSE.md",
        "scope/assets/body/growth.npz",
        "scope/assets/body/scope.npz",
        "scope/assets/body/scope_h.npz",
        "scope/assets/prior/README.md",
        "scope/assets/prior/joint_prior.npz",
    }
    assert names == sources | data


def test_its_record_holds(wheel):
    with zipfile.ZipFile(wheel) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()}
    record = next(name for name in contents if name.endswith("/RECORD"))
    rows = {row[0]: row[1:] for row in csv.reader(io.StringIO(contents[record].decode()))}
    assert set(rows) == set(contents)
    for name, (digest, size) in rows.items():
        if name != record:
            own = base64.urlsafe_b64encode(hashlib.sha256(contents[name]).digest())
            assert digest == f"sha256={own.decode().rstrip('=')}"
            assert int(size) == len(contents[name])


def test_it_states_its_licences_and_needs_numpy_and_numba_alone(wheel):
    with zipfile.ZipFile(wheel) as archive:
        metadata = next(name for name in archive.namelist() if name.endswith("/METADATA"))
        text = archive.read(metadata).decode()
    lines = text.splitlines()
    assert "License-Expression: Apache-2.0 AND GPL-3.0-or-later AND CC0-1.0" in lines
    needed = [
        line.removeprefix("Requires-Dist: ") for line in lines if line.startswith("Requires-Dist")
    ]
    assert [each.split(">")[0] for each in needed[:-2]] == ["numpy", "numba", "llvmlite"]
    assert needed[-2:] == ['jax; extra == "jax"', 'torch; extra == "torch"']
    assert [line for line in lines if line.startswith("Provides-Extra")] == [
        "Provides-Extra: jax",
        "Provides-Extra: torch",
    ]
    with zipfile.ZipFile(wheel) as archive:
        for name, heading in {
            "LICENSE": "Apache License",
            "assets/prior/LICENSE": "GNU GENERAL PUBLIC LICENSE",
            "assets/body/LICENSE.md": "# Licence of the default body",
        }.items():
            assert f"License-File: {name}" in lines
            licence = archive.read(metadata.replace("METADATA", f"licenses/{name}")).decode()
            assert licence.lstrip().startswith(heading)
    assert "joint prior (`assets/prior/joint_prior.npz`) is under GPL-3.0-or-later" in text
    assert "](../" not in text


def test_files_that_change_meanwhile_are_refused(tmp_path, monkeypatch):
    """Machine code would be that of others."""
    source = tmp_path / "solver" / "kernel.py"
    source.parent.mkdir()
    source.write_text("before")
    with monkeypatch.context() as patch:
        patch.setattr(SOLVER_WHEEL, "ROOT", tmp_path)
        digest = SOLVER_WHEEL.sources_digest()
        SOLVER_WHEEL.refuse_changes(digest)
        source.write_text("after")
        with pytest.raises(SystemExit, match="changed while the wheel was made; run it again"):
            SOLVER_WHEEL.refuse_changes(digest)
    with pytest.raises(SystemExit, match="changed while"):
        SOLVER_WHEEL.build_wheel(tmp_path / "dist", tmp_path / "code", digest)
    with pytest.raises(SystemExit, match="changed while"):
        SOLVER_WHEEL.compile_code(tmp_path / "code", digest)
    assert not (tmp_path / "dist").exists()


def test_it_works_without_the_rest_of_scope(wheel, tmp_path):
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    command = [sys.executable, "-c", LOAD, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_the_platforms_are_those_of_the_systems_that_code_is_shipped_for():
    from scope.solver.shipped_code import LEVELS, shipped_folder

    assert {system.partition("-")[2] for system in SOLVER_WHEEL.PLATFORMS} == set(LEVELS)
    if sys.platform == "linux" and "x86_64" in shipped_folder().name:
        assert any(shipped_folder().name.startswith(f"{each}-") for each in SOLVER_WHEEL.PLATFORMS)


def test_a_python_without_packages_says_what_it_needs():
    command = [sys.executable, "-I", "-S", str(ROOT / "scripts" / "solver_wheel.py")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith(f"solver_wheel: {sys.executable} has no numpy and no numba")
    assert done.stderr.count("\n") == 1
