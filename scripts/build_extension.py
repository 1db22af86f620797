# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the extension: a staging copy with the wheels of every platform, zipped and validated by Blender's own tool.

Blender's ``extension build`` is one Python file that needs no running Blender; PyPI's bpy carries it.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from shipped_kernels import add_kernels

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"
WHEELS, STAGING, DIST = BUILD / "wheels", BUILD / "staging", BUILD / "dist"

# pip's platform tags, newest first, down to the oldest systems that onnxruntime and llvmlite support.
PLATFORMS = {
    "windows-x64": ["win_amd64"],
    "macos-arm64": ["macosx_14_0_arm64"],
    "linux-x64": ["manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"],
}
PYTHONS = ("3.13", "3.11")  # Blender 5.1 and later; 4.2 to 5.0
# All imported packages. onnxruntime's metadata also requires flatbuffers, packaging and protobuf, but running a network
# imports none of them. numpy is always Blender's own.
PACKAGES = ("numba", "llvmlite", "onnxruntime", "opencv-contrib-python-headless", "av")
CONTENT = ("__init__.py", "LICENSE", "THIRD_PARTY.md", "solver", "scope_addon", "assets")
LEFT_OUT = ("__pycache__", "*.pyc", ".*", "sample_truth.npz", "pictures", "guide", "examples")


def main() -> int:
    """Build the extension; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("platforms", nargs="*", metavar="PLATFORM", help=f"of {', '.join(PLATFORMS)} (default: all)")
    platforms = parser.parse_args().platforms or list(PLATFORMS)
    unknown = sorted(set(platforms) - set(PLATFORMS))
    if unknown:
        print(f"build: unknown platform {', '.join(unknown)}; choose of {', '.join(PLATFORMS)}", file=sys.stderr)
        return 2
    wheels = {platform: download_wheels(platform) for platform in platforms}
    stage(wheels)
    for platform in platforms:
        for python in PYTHONS:
            add_kernels(STAGING, platform, python, wheels[platform])
    shutil.rmtree(DIST, ignore_errors=True)
    DIST.mkdir(parents=True)
    blender_extension("build", "--source-dir", str(STAGING), "--output-dir", str(DIST), "--split-platforms")
    archives = sorted(DIST.glob("*.zip"))
    assert len(archives) == len(platforms), archives
    for archive in archives:
        blender_extension("validate", str(archive))
        check(archive)
        print(f"{archive}  {archive.stat().st_size / 1e6:.0f} MB")
    return 0


def download_wheels(platform: str) -> list[Path]:
    """Return the platform's wheels for every Python, as locked; download only those that are missing."""
    paths: list[Path] = []
    for python in PYTHONS:
        folder = WHEELS / platform / python
        folder.mkdir(parents=True, exist_ok=True)
        pins = folder / "requirements.txt"
        wanted = locked(python)
        if not pins.is_file() or pins.read_text() != wanted or len(list(folder.glob("*.whl"))) != len(PACKAGES):
            for old in folder.iterdir():
                old.unlink()
            request = folder / "request.txt"
            request.write_text(wanted)
            command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
            command += ["--only-binary=:all:", "--require-hashes", "--implementation", "cp", "--python-version", python]
            for tag in PLATFORMS[platform]:
                command += ["--platform", tag]
            subprocess.run([*command, "--dest", str(folder), "--requirement", str(request)], check=True)
            request.rename(pins)
        paths += sorted(folder.glob("*.whl"))
    return paths


def locked(python: str) -> str:
    """Return the entries of the shipped packages in a Python's lock, with their hashes."""
    text = (ROOT / "scripts" / "requirements" / f"{python}.txt").read_text()
    entries = re.findall(r"^(\S+?)==\S+(?:.*\\\n)*.*$", text, flags=re.M)
    blocks = re.findall(r"^\S+?==\S+(?:.*\\\n)*.*$", text, flags=re.M)
    found = {name: block for name, block in zip(entries, blocks, strict=True) if name in PACKAGES}
    missing = sorted(set(PACKAGES) - set(found))
    if missing:
        raise SystemExit(f"build: the lock for Python {python} lacks {', '.join(missing)}; run ./scripts/lock")
    return "\n".join(found[name] for name in PACKAGES) + "\n"


def shipped_name(wheel: str) -> str:
    """Return the file name with which every Blender since 4.2.0 chooses the right wheel; the content is unchanged.

    - Until 4.4 Blender compares a wheel's Python tag with its own Python, also for the stable ABI, and would skip a
      ``cp37-abi3`` wheel; such a wheel also gets the tags of the supported Pythons.
    - 4.2's first releases ignore the tag and, of two wheels of one version, take the one whose name sorts last.
      Their Python is 3.11, so the others get a build number, which sorts before it.
    """
    name, version, *build, python, abi, platform = wheel.removesuffix(".whl").split("-")
    tags = ["cp" + p.replace(".", "") for p in sorted(PYTHONS)]
    if abi == "abi3":
        python = ".".join([python, *tags])
    elif python != "cp311":
        build = ["1"]
    return "-".join([name, version, *build, python, abi, platform]) + ".whl"


def stage(wheels: dict[str, list[Path]]) -> None:
    """Copy the shipped files and wheels into the staging folder, with a manifest that lists the wheels."""
    shutil.rmtree(STAGING, ignore_errors=True)
    (STAGING / "wheels").mkdir(parents=True)
    for name in CONTENT:
        source, target = ROOT / name, STAGING / name
        if source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns(*LEFT_OUT))
        else:
            shutil.copy2(source, target)
    names = []
    for path in (p for paths in wheels.values() for p in paths):
        target = STAGING / "wheels" / shipped_name(path.name)
        if not target.exists():  # a wheel for the stable ABI serves both Pythons
            os.link(path, target)
            names.append(f"./wheels/{target.name}")
    manifest = (ROOT / "blender_manifest.toml").read_text()
    top, tables = manifest.split("\n[", 1)
    lists = {"platforms": list(wheels), "wheels": names}
    for key, values in lists.items():
        top += f"\n{key} = [\n" + "".join(f'    "{value}",\n' for value in values) + "]\n"
    tables = tables.split("\n[build]")[0]  # the staging folder holds only what is shipped
    (STAGING / "blender_manifest.toml").write_text(f"{top}\n[{tables}\n")


def blender_extension(*arguments: str) -> None:
    """Run Blender's extension tool."""
    spec = importlib.util.find_spec("bpy")
    package = Path(spec.origin).parent if spec and spec.origin else ROOT / "no bpy"
    found = sorted(package.glob("*/scripts/**/blender_ext.py"))
    if not found:
        raise SystemExit("build: bpy, which contains Blender's extension tool, is not installed; run ./scripts/setup")
    done = subprocess.run([sys.executable, str(found[0]), *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"build: Blender's extension tool refused:\n{done.stdout}{done.stderr}")


def check(archive: Path) -> None:
    """Check what Blender's tool cannot: the archive contains everything that a capture needs, and not numpy."""
    with zipfile.ZipFile(archive) as file:
        names = file.namelist()
        manifest = tomllib.loads(file.read(next(n for n in names if n.endswith("blender_manifest.toml"))).decode())
    generated = manifest["build"]["generated"]  # the part of the lists that Blender's tool kept for this platform
    wheels = [Path(w).name for w in generated["wheels"]]
    problems = [f"{w} is listed but not there" for w in wheels if not any(n.endswith(f"wheels/{w}") for n in names)]
    for python in PYTHONS:
        tag = "cp" + python.replace(".", "")
        for package in PACKAGES:
            prefix = package.replace("-", "_") + "-"
            fitting = [w for w in wheels if w.startswith(prefix) and tag in re.split(r"[-.]", w)]
            if len(fitting) != 1:
                problems.append(f"{len(fitting)} wheels of {package} for Python {python}")
    if any(w.lower().startswith("numpy") for w in wheels):
        problems.append("numpy is shipped")
    networks = ("pose_detection", "pose_landmark_lite", "pose_landmark_full", "pose_landmark_heavy")
    networks += ("palm_detection", "hand_landmark")
    wanted = [f"assets/networks/{n}.onnx" for n in networks]
    wanted += ["assets/networks/LICENSE-mediapipe.txt", "assets/body/scope.npz", "assets/body/scope_h.npz"]
    wanted += ["assets/lifter/lifter.onnx", "assets/prior/joint_prior.npz", "assets/sample/sample.mp4"]
    wanted += [f"assets/{folder}/LICENSE.md" for folder in ("body", "lifter", "sample")]
    wanted += ["LICENSE", "THIRD_PARTY.md", "scope_addon/ui/__init__.py"]
    problems += [f"{w} is missing" for w in wanted if not any(n.endswith(w) for n in names)]
    if len(generated["platforms"]) != 1:
        problems.append(f"made for {', '.join(generated['platforms'])}, not for one platform")
    problems += [f"{n} does not belong in" for n in names if "__pycache__" in n or n.endswith((".pyc", ".nbi", ".nbc"))]
    if problems:
        raise SystemExit(f"build: {archive.name}: {'; '.join(problems)}")


if __name__ == "__main__":
    sys.exit(main())
