# SPDX-License-Identifier: GPL-3.0-or-later
"""The built extension: Blender's own tool accepts it, and every Blender chooses the wheels of its Python."""

import importlib.util
import shutil
import tomllib
import zipfile
from pathlib import Path

import bpy
import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
CP311 = "numba-0.68.1-cp311-cp311-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl"
CP313 = CP311.replace("311", "313")
STABLE = "opencv_contrib_python_headless-4.11.0.86-cp37-abi3-manylinux_2_17_x86_64.manylinux2014_x86_64.whl"


@pytest.fixture
def small_root(tmp_path):
    """A copy of the repository whose largest files, which take long to compress, are empty."""

    def copy(source, target):
        if source.endswith((".onnx", ".mp4", ".npz")):
            Path(target).touch()
        else:
            shutil.copy2(source, target)

    target = tmp_path / "repository"
    for name in ("solver", "scope_addon", "assets", "scripts"):
        shutil.copytree(ROOT / name, target / name, copy_function=copy, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("__init__.py", "LICENSE", "THIRD_PARTY.md", "blender_manifest.toml"):
        shutil.copy2(ROOT / name, target / name)
    return target


@pytest.fixture
def builder(tmp_path, monkeypatch):
    spec = importlib.util.spec_from_file_location("build_extension", ROOT / "scripts" / "build_extension.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for name in ("WHEELS", "STAGING", "DIST"):
        monkeypatch.setattr(module, name, tmp_path / name.lower())
    monkeypatch.setattr(module, "add_kernels", lambda *_: False)  # see test_shipped_kernels.py
    return module


def blenders_tool():
    path = Path(bpy.utils.resource_path("LOCAL"), "scripts", "addons_core", "bl_pkg", "cli", "blender_ext.py")
    spec = importlib.util.spec_from_file_location("blender_ext", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_wheel_names_make_every_blender_choose_the_right_wheel(builder):
    names = [builder.shipped_name(name) for name in (CP311, CP313, STABLE)]
    assert names[0] == CP311
    # The first releases of 4.2 compare only the names of wheels of one version, and run Python 3.11.
    assert max(names[:2]) == CP311
    tool = blenders_tool()
    if not hasattr(tool, "python_versions_from_wheel_python_tag"):
        pytest.skip(f"Blender {bpy.app.version_string} looks at nothing but the names' order")
    for name, wanted in zip(names, [{(3, 11)}, {(3, 13)}, {(3, 11), (3, 13)}], strict=True):
        assert wanted <= tool.python_versions_from_wheel_python_tag(name.split("-")[-3])
        assert tool.blender_platform_compatible_with_wheel_platform_from_filepath("linux-x64", name)
        assert not tool.blender_platform_compatible_with_wheel_platform_from_filepath("windows-x64", name)


def test_the_lock_files_list_every_wheel_with_hashes(builder):
    for python in builder.PYTHONS:
        entries = builder.locked(python)
        assert [line.split("==")[0] for line in entries.splitlines() if "==" in line] == list(builder.PACKAGES)
        assert entries.count("--hash=sha256:") >= 3 * len(builder.PACKAGES)


def fake_wheels(folder, names):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        with zipfile.ZipFile(folder / name, "w") as file:
            file.writestr("module.py", "")
    return [folder / name for name in names]


def without(target, archive, name):
    """A copy of an archive that lacks a file."""
    with zipfile.ZipFile(archive) as source, zipfile.ZipFile(target, "w") as file:
        for entry in source.infolist():
            if not entry.filename.endswith(name):
                file.writestr(entry, source.read(entry))
    return target


@pytest.mark.usefixtures("networks")
def test_a_build_with_empty_wheels(builder, small_root, tmp_path, monkeypatch):
    monkeypatch.setattr(builder, "ROOT", small_root)

    def wheels(platform):
        tag = builder.PLATFORMS[platform][0]
        names = [f"opencv_contrib_python_headless-4.11.0.86-cp37-abi3-{tag}.whl"]
        others = [name for name in builder.PACKAGES if not name.startswith("opencv")]
        names += [f"{name}-1.0-{cp}-{cp}-{tag}.whl" for cp in ("cp313", "cp311") for name in others]
        return fake_wheels(tmp_path / platform, names)

    monkeypatch.setattr(builder, "download_wheels", wheels)
    monkeypatch.setattr("sys.argv", ["build"])
    assert builder.main() == 0
    archives = sorted(p.name for p in builder.DIST.glob("*.zip"))
    assert [a.split("-")[-1] for a in archives] == ["linux_x64.zip", "macos_arm64.zip", "windows_x64.zip"]
    with zipfile.ZipFile(builder.DIST / archives[0]) as file:
        names = file.namelist()
    assert not any("numpy" in n or "/tests/" in n or n.startswith(("tests/", "tools/", ".")) for n in names)
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
    for folder in (p.strip("/") for p in manifest["build"]["paths_exclude_pattern"] if p.endswith("/")):
        assert not any(n.startswith(f"{folder}/") or f"/{folder}/" in n for n in names), folder
    for name in ("assets/lifter/lifter.onnx", "assets/prior/joint_prior.npz", "THIRD_PARTY.md"):
        short = without(tmp_path / "short.zip", builder.DIST / archives[0], name)
        with pytest.raises(SystemExit, match=f"{name} is missing"):
            builder.check(short)
    monkeypatch.setattr(builder, "PACKAGES", (*builder.PACKAGES, "forgotten"))
    with pytest.raises(SystemExit, match="0 wheels of forgotten for Python 3.13"):
        builder.check(builder.DIST / archives[0])


def test_an_unknown_platform_is_an_error(builder, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["build", "amiga"])
    assert builder.main() == 2
    assert "amiga" in capsys.readouterr().err
