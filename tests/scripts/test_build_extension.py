# SPDX-License-Identifier: GPL-3.0-or-later
"""The built extension: one zip for each platform and Python, which Blender's own tool accepts and
lists.
"""

import ast
import hashlib
import importlib.util
import inspect
import json
import os
import re
import shutil
import tomllib
import zipfile
from pathlib import Path

import bpy
import pytest

from .script_modules import ROOT, script

CP311 = "numba-0.68.1-cp311-cp311-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl"
CP313 = CP311.replace("311", "313")
STABLE = (
    "opencv_contrib_python_headless-4.11.0.86-cp37-abi3-"
    "manylinux_2_17_x86_64.manylinux2014_x86_64.whl"
)
NEWER_STABLE = "av-18.1.0-cp311-abi3-manylinux_2_28_x86_64.whl"


@pytest.fixture
def small_root(tmp_path):
    """A copy of the repository whose largest files, which take long to compress, are empty."""

    def copy(source, target):
        if source.endswith((".onnx", ".mp4", ".npz", ".webp", ".png")):
            Path(target).touch()
        else:
            shutil.copy2(source, target)

    target = tmp_path / "repository"
    for name in ("solver", "scope_addon", "assets", "scripts", "docs"):
        shutil.copytree(
            ROOT / name,
            target / name,
            copy_function=copy,
            ignore=shutil.ignore_patterns("__pycache__"),
        )
    for name in ("__init__.py", "LICENSE", "THIRD_PARTY.md", "blender_manifest.toml"):
        shutil.copy2(ROOT / name, target / name)
    return target


@pytest.fixture
def builder(tmp_path, monkeypatch):
    module = script("build_extension")
    for name in ("WHEELS", "STAGING", "DIST", "OTHER_DIST"):
        monkeypatch.setattr(module, name, tmp_path / name.lower())
    monkeypatch.setattr(module, "add_kernels", lambda *_: False)  # see test_shipped_kernels.py
    return module


@pytest.fixture
def with_empty_wheels(builder, small_root, tmp_path, monkeypatch):
    """The builder of the small repository, with wheels that contain nothing."""
    lock = {python: "" for python in builder.BLENDERS}

    def wheels(target):
        tag = builder.PLATFORMS[target.platform][0]
        cp = "cp" + target.python.replace(".", "")
        names = [f"opencv_contrib_python_headless-4.11.0.86-cp37-abi3-{tag}.whl"]
        names += [
            f"{name}-1.0-{cp}-{cp}-{tag}.whl"
            for name in builder.PACKAGES
            if not name.startswith("opencv")
        ]
        folder = tmp_path / target.platform / target.python
        folder.mkdir(parents=True, exist_ok=True)
        for name in names:
            with zipfile.ZipFile(folder / name, "w") as file:
                package, version = name.split("-")[:2]
                stated = f"Name: {package}\nVersion: {version}\nLicense-Expression: MIT\n"
                file.writestr(zipfile.ZipInfo(f"{package}-{version}.dist-info/METADATA"), stated)
            lock[target.python] += (
                f"--hash=sha256:{hashlib.sha256((folder / name).read_bytes()).hexdigest()}\n"
            )
        return [folder / name for name in names]

    (small_root / "THIRD_PARTY.md").write_text("of empty wheels")
    monkeypatch.setattr(builder, "ROOT", small_root)
    monkeypatch.setattr(builder, "download_wheels", wheels)
    monkeypatch.setattr(builder, "locked", lock.__getitem__)
    return builder


def blenders_tool():
    path = Path(
        bpy.utils.resource_path("LOCAL"),
        "scripts",
        "addons_core",
        "bl_pkg",
        "cli",
        "blender_ext.py",
    )
    return module_at(path)


def module_at(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def manifest_of(archive):
    with zipfile.ZipFile(archive) as file:
        return tomllib.loads(file.read("blender_manifest.toml").decode())


def run(builder, monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", ["build", *arguments])
    return builder.main()


def test_wheels_keep_their_names_except_where_a_blender_would_skip_them(builder):
    for wheel in (CP313, STABLE, NEWER_STABLE):
        assert builder.shipped_name(wheel, "3.13") == wheel
    for wheel in (CP311, NEWER_STABLE):
        assert builder.shipped_name(wheel, "3.11") == wheel
    renamed = builder.shipped_name(STABLE, "3.11")
    assert renamed == STABLE.replace("cp37", "cp37.cp311")
    tool = blenders_tool()
    if not hasattr(tool, "python_versions_from_wheel_python_tag"):
        pytest.skip(f"Blender {bpy.app.version_string} does not look at a wheel's Python")
    # Blender 4.3 installs a wheel only where one of these is its own Python, 3.11.
    for wheel, fits in ((STABLE, False), (renamed, True), (CP311, True), (NEWER_STABLE, True)):
        versions = tool.python_versions_from_wheel_python_tag(
            wheel.removesuffix(".whl").split("-")[-3]
        )
        assert ((3, 11) in versions) == fits, wheel
    for wheel in (renamed, CP311, CP313):
        assert tool.blender_platform_compatible_with_wheel_platform_from_filepath(
            "linux-x64", wheel
        )
        assert not tool.blender_platform_compatible_with_wheel_platform_from_filepath(
            "windows-x64", wheel
        )


def test_every_blender_since_4_2_fits_one_zip_of_a_platform(builder):
    ranges = [builder.Target("linux-x64", python).blenders for python in sorted(builder.BLENDERS)]
    assert ranges == [("4.2.0", "5.1.0"), ("5.1.0", None)]
    manifests = [
        tomllib.loads(builder.manifest(builder.Target("linux-x64", p), []))
        for p in ("3.11", "3.13")
    ]
    found = [(m["blender_version_min"], m.get("blender_version_max")) for m in manifests]
    assert found == ranges
    other = builder.Target("linux-x64", "3.13", any_blender=True)
    assert "blender_version_max" not in tomllib.loads(builder.manifest(other, []))
    assert tomllib.loads(builder.manifest(other, []))["blender_version_min"] == "4.2.0"


def test_a_python_of_distributions_alone_needs_a_zip_for_any_blender(builder, monkeypatch, capsys):
    assert run(builder, monkeypatch, "linux-x64", "--python", "3.14") == 2
    assert "--any-blender" in capsys.readouterr().err
    name = builder.Target("linux-x64", "3.14", any_blender=True).file_name("1.0.0")
    assert name == "scope-1.0.0-python_3.14-linux_x64.zip"


def test_the_manifest_names_licences_and_holders_of_all_that_the_zip_contains(builder):
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))
    assert manifest["license"][0] == "SPDX:GPL-3.0-or-later"
    third_party = (ROOT / "THIRD_PARTY.md").read_text("utf-8")
    for licence in (
        "Apache-2.0",
        "BSD-2-Clause",
        "BSD-3-Clause",
        "MIT",
        "LGPL-2.1-or-later",
        "GPL-2.0-or-later",
    ):
        assert f"SPDX:{licence}" in manifest["license"]
        assert licence in third_party
    assert "SPDX:CC0-1.0" in manifest["license"]
    for package in builder.PACKAGES:
        assert f"| `{package}` |" in third_party
        assert package == "av" or package in " ".join(manifest["copyright"])
    validate = getattr(blenders_tool(), "pkg_manifest_validate_field_copyright", None)
    assert validate is None or validate(manifest["copyright"], True) is None


def test_a_zips_manifest_names_every_licence_of_its_bill_and_keeps_the_rest(builder):
    """Of libraries under one of several licences, it names the first."""
    text = builder.manifest(builder.Target("linux-x64", "3.13"), ["./wheels/av.whl"])
    named = ("MIT", "OpenSSL", "LGPL-3.0-or-later OR GPL-2.0-or-later", "IJG AND Zlib")
    named += ("GPL-3.0-or-later WITH GCC-exception-3.1", "LicenseRef-Intel")
    parts = [{"name": name, "licenses": [{"expression": name}]} for name in named]
    bill = json.dumps({"components": [{"components": parts[:3]}, *parts[3:]]}, indent=2)
    before = tomllib.loads(text)
    after = tomllib.loads(builder.with_licences(text, bill))
    added = ("GPL-3.0-or-later WITH GCC-exception-3.1", "IJG", "LGPL-3.0-or-later")
    added += ("LicenseRef-Intel", "OpenSSL", "Zlib")
    assert after == before | {"license": before["license"] + [f"SPDX:{name}" for name in added]}


@pytest.mark.slow
@pytest.mark.usefixtures("networks")
def test_six_zips_with_empty_wheels(with_empty_wheels, monkeypatch, capsys, tmp_path):
    builder = with_empty_wheels
    builder.DIST.mkdir()
    (builder.DIST / "scope_solver-0.1.0-py3-none-any.whl").write_text("made by another script")
    (builder.DIST / "scope-0.0.1-blender_5.1-linux_x64.zip").write_text("of other sources")
    assert run(builder, monkeypatch, "--website", "https://example.com/scope") == 0
    assert len(list(builder.DIST.glob("*.whl"))) == 1
    listed = json.loads((builder.DIST / "index.json").read_text("utf-8"))["data"]
    addresses = [entry["archive_url"] for entry in listed]
    assert len(addresses) == 6
    assert addresses == sorted(addresses)
    archives = sorted(p.name for p in builder.DIST.glob("*.zip"))
    version = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))["version"]
    blenders = ("blender_4.2_before_5.1", "blender_5.1")
    platforms = ("linux_x64", "macos_arm64", "windows_x64")
    assert archives == sorted(f"scope-{version}-{b}-{p}.zip" for b in blenders for p in platforms)
    assert "6 zips listed" in capsys.readouterr().out
    archive = builder.DIST / archives[0]
    target = builder.Target("linux-x64", "3.11")
    assert manifest_of(archive)["website"] == "https://example.com/scope"
    with zipfile.ZipFile(archive) as file:
        names = file.namelist()
    assert not any(
        "numpy" in n or "/tests/" in n or n.startswith(("tests/", "tools/", ".")) for n in names
    )
    assert set(builder.GUIDE) <= set(names)
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))
    for folder in (
        p.strip("/") for p in manifest["build"]["paths_exclude_pattern"] if p.endswith("/")
    ):
        assert not any(n.startswith(f"{folder}/") or f"/{folder}/" in n for n in names), folder
    senders = [p.strip("/") for p in manifest["build"]["paths_exclude_pattern"] if "/live/" in p]
    assert [Path(sender).name for sender in senders] == list(builder.SENDERS)
    assert not set(senders) & set(names)
    assert {
        "scope_addon/live/run.py",
        "scope_addon/job/live_capture.py",
        "scope_addon/ui/live_job.py",
    } <= set(names)

    def refused(file, match, **made_for):
        with pytest.raises(SystemExit, match=match):
            builder.check(
                file, builder.Target(**{"platform": "linux-x64", "python": "3.11", **made_for})
            )

    for name in (
        "assets/lifter/lifter.onnx",
        "assets/prior/joint_prior.npz",
        "THIRD_PARTY.md",
        "docs/guide.html",
    ):
        refused(changed(tmp_path / "other.zip", archive, {name: None}), f"{name} is missing")
    wheel = next(n for n in names if n.startswith("wheels/av-"))
    refused(
        changed(tmp_path / "other.zip", archive, {wheel: b"other"}), "av-.* is not the locked file"
    )
    refused(changed(tmp_path / "other.zip", archive, {wheel: None}), "is listed but not there")
    compiler = next(n for n in names if n.startswith("wheels/llvmlite-"))
    with zipfile.ZipFile(archive) as file:
        (tmp_path / "llvmlite.whl").write_bytes(file.read(compiler))
    with zipfile.ZipFile(tmp_path / "llvmlite.whl", "a") as file:
        file.writestr("added.py", "")
    refused(
        changed(
            tmp_path / "other.zip", archive, {compiler: (tmp_path / "llvmlite.whl").read_bytes()}
        ),
        "llvmlite-.* is not the locked file",
    )
    refused(archive, "made for linux-x64, not for windows-x64", platform="windows-x64")
    refused(archive, "not made for Blender 5.1.0", python="3.13")
    monkeypatch.setattr(builder, "LIMIT_MB", 0.1)
    refused(archive, "more than the limit of 0.1 MB")
    monkeypatch.setattr(builder, "LIMIT_MB", 200)
    builder.check(archive, target)
    monkeypatch.setattr(builder, "PACKAGES", (*builder.PACKAGES, "forgotten"))
    refused(archive, "0 wheels of forgotten")
    if hasattr(blenders_tool(), "pkg_manifest_detect_duplicates"):  # in newer Blenders
        shutil.copy(archive, builder.DIST / "twice.zip")
        every = [builder.Target(p, q) for p in builder.PLATFORMS for q in builder.BLENDERS]
        with pytest.raises(SystemExit, match="listed"):  # two for one Blender
            builder.check_listing(builder.DIST, [*every, target])


def test_blender_installs_a_wheel_that_is_compressed_again(builder, tmp_path):
    module = "answer = 42\n" * 1000
    record = "small/__init__.py,,\nsmall-1.0.dist-info/RECORD,,\n"
    files = {
        "small/__init__.py": module,
        "small-1.0.dist-info/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\n",
        "small-1.0.dist-info/RECORD": record,
    }
    wheel = tmp_path / "small-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in files.items():
            file.writestr(name, content)
    again = builder.repacked(wheel)
    first = again.read_bytes()
    again.unlink()
    assert builder.repacked(wheel).read_bytes() == first
    with zipfile.ZipFile(again) as file:
        assert {entry.compress_type for entry in file.infolist()} == {zipfile.ZIP_LZMA}
        assert {name: file.read(name).decode() for name in file.namelist()} == files
    (installer,) = Path(bpy.utils.resource_path("LOCAL")).rglob("wheel_manager.py")
    manager = module_at(installer)
    problems = []
    settings = {
        "local_dir": str(tmp_path / "local"),
        "local_dir_site_packages": str(tmp_path / "local" / "packages"),
        "wheel_list": [("scope", [str(again)])],
        "error_fn": problems.append,
        "remove_error_fn": lambda _, error: problems.append(error),
        "debug": False,
    }
    known = inspect.signature(manager.apply_action).parameters
    manager.apply_action(**{name: value for name, value in settings.items() if name in known})
    assert problems == []
    assert (tmp_path / "local" / "packages" / "small" / "__init__.py").read_text() == module


@pytest.mark.slow
@pytest.mark.usefixtures("networks")
def test_a_repeated_build_gives_the_same_bytes(with_empty_wheels, monkeypatch):
    builder = with_empty_wheels
    target = builder.Target("linux-x64", "3.13")
    builder.DIST.mkdir()
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    archive = builder.build(target, builder.DIST)
    first = archive.read_bytes()
    bill = archive.with_suffix(".cdx.json").read_bytes()
    with zipfile.ZipFile(archive) as file:
        assert file.read(builder.BILL) == bill
        assert file.namelist() == sorted(file.namelist())
        assert {entry.date_time for entry in file.infolist()} == {(2023, 11, 14, 22, 13, 20)}
    for path in builder.ROOT.rglob("*"):  # as after another checkout
        os.utime(path, (1e9, 1e9))
    unsorted_folder = Path.rglob
    monkeypatch.setattr(
        Path, "rglob", lambda *arguments: reversed(list(unsorted_folder(*arguments)))
    )
    assert builder.build(target, builder.DIST).read_bytes() == first
    assert archive.with_suffix(".cdx.json").read_bytes() == bill
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000002")
    assert builder.build(target, builder.DIST).read_bytes() != first


def changed(target, archive, contents):
    """A copy of an archive with other content in some files, or without those whose content is
    None.
    """
    with zipfile.ZipFile(archive) as source, zipfile.ZipFile(target, "w") as file:
        for entry in source.infolist():
            content = contents.get(entry.filename, source.read(entry))
            if content is not None:
                file.writestr(entry, content, zipfile.ZIP_STORED)
    return target


def test_no_shipped_module_uses_the_network_or_has_the_metadata_of_an_old_add_on():
    network = {
        "socket",
        "ssl",
        "urllib",
        "http",
        "ftplib",
        "smtplib",
        "xmlrpc",
        "requests",
        "webbrowser",
        "pip",
    }
    left_out = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))["build"][
        "paths_exclude_pattern"
    ]
    modules = [
        path
        for name in ("solver", "scope_addon")
        for path in (ROOT / name).rglob("*.py")
        if not any(f"/{path.relative_to(ROOT)}".startswith(folder) for folder in left_out)
    ]
    assert len(modules) > 100
    named = re.compile(rf"\b({'|'.join([*network, 'bl_info'])})\b")
    for module in modules:
        text = module.read_text("utf-8")
        for node in ast.walk(ast.parse(text)) if named.search(text) else ():
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += (
                [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            )
            assert not network & {name.split(".")[0] for name in names}, module
            if isinstance(node, ast.Name) and node.id == "bl_info":
                raise AssertionError(f"{module} has the metadata of an old add-on")


@pytest.mark.parametrize("possible", [True, False])
def test_the_compiled_solver_can_be_made_alone_for_another_computer(
    with_empty_wheels, monkeypatch, possible
):
    builder = with_empty_wheels
    made = []
    monkeypatch.setattr(
        builder, "add_kernels", lambda *arguments: made.append(arguments[1:3]) or possible
    )
    status = run(builder, monkeypatch, "windows-x64", "--python", "3.13", "--kernels-only")
    assert status == (0 if possible else 1)
    assert made == [("windows-x64", "3.13")]
    assert not builder.DIST.exists()
