# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the extension: one zip for each platform and Python, validated and listed by Blender's own
tool.

Blender's ``extension`` command is one Python file that needs no running Blender; PyPI's bpy carries
it. What the Extensions Platform asks of a zip, and where the code answers, is in
docs/publishing.md.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from bill_of_materials import bill_of_materials
from guide_pages import FILES as GUIDE
from guide_pages import write_pages
from shipped_kernels import add_kernels
from source_time import source_time

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"
WHEELS = BUILD / "wheels"
STAGING = BUILD / "staging"
DIST = BUILD / "dist"
OTHER_DIST = BUILD / "dist_any_blender"

# pip's platform tags, newest first, down to the oldest systems that onnxruntime and llvmlite
# support.
PLATFORMS = {
    "windows-x64": ["win_amd64"],
    "macos-arm64": ["macosx_14_0_arm64"],
    "linux-x64": [
        "manylinux_2_28_x86_64",
        "manylinux_2_27_x86_64",
        "manylinux_2_17_x86_64",
        "manylinux2014_x86_64",
    ],
}
# The Python of Blender's own builds: the first Blender with it, and the first after it.
BLENDERS = {"3.11": ("4.2.0", "5.1.0"), "3.13": ("5.1.0", None)}
# Distributions use others as well. The newest lock has the hashes of their wheels, too.
OTHER_PYTHONS = ("3.14",)
# All imported packages. onnxruntime's metadata also requires flatbuffers, packaging and protobuf,
# but running a network imports none of them. numpy is always Blender's own.
PACKAGES = ("numba", "llvmlite", "onnxruntime", "opencv-contrib-python-headless", "av")
# Wheels that are compressed again, by LZMA, since a platform's zip would otherwise be too large.
# Blender unpacks wheels with Python's zipfile, which reads both.
REPACKED = {"linux-x64": ("llvmlite", "opencv-contrib-python-headless")}
CONTENT = ("__init__.py", "LICENSE", "THIRD_PARTY.md", "solver", "scope_addon", "assets")
# Clusters use the network, and live captures send poses to other programs, from the shell only:
# nothing in the extension opens a socket.
SENDERS = ("json_lines.py", "preview_page.py", "vmc.py")
LEFT_OUT = (
    *("__pycache__", "*.pyc", ".*", "sample_truth.npz", "pictures", "examples", "cluster"),
    *SENDERS,
)
NETWORK_NAMES = (
    *("pose_detection", "pose_landmark_lite", "pose_landmark_full", "pose_landmark_heavy"),
    *("palm_detection", "hand_landmark", "face_landmark", "face_expression"),
)
NETWORK_LICENCE = "LICENSE-mediapipe.txt"
BILL = "bill_of_materials.cdx.json"  # in the zip; a copy with the zip's name lies beside it
LIMIT_MB = 200


@dataclass(frozen=True)
class Target:
    """What a zip is made for: a platform, a Python, and Blender's own builds with that Python or
    any Blender.
    """

    platform: str
    python: str
    any_blender: bool = False

    @property
    def blenders(self) -> tuple[str, str | None]:
        """The first Blender that may install it, and the first that may not; None where there is no
        such.
        """
        return (BLENDERS["3.11"][0], None) if self.any_blender else BLENDERS[self.python]

    def file_name(self, version: str) -> str:
        """Return the name of its zip, which says what it is for."""
        first, end = (text and text.removesuffix(".0") for text in self.blenders)
        blender = (
            f"python_{self.python}"
            if self.any_blender
            else f"blender_{first}" + (f"_before_{end}" if end else "")
        )
        return f"scope-{version}-{blender}-{self.platform.replace('-', '_')}.zip"


def main() -> int:
    """Build the extension; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument(
        "platforms", nargs="*", metavar="PLATFORM", help=f"of {', '.join(PLATFORMS)} (default: all)"
    )
    parser.add_argument(
        "--python",
        choices=[*sorted(BLENDERS), *OTHER_PYTHONS],
        help="build for this Python alone (default: each of Blender's own)",
    )
    parser.add_argument(
        "--any-blender",
        action="store_true",
        help="for a distribution's Blender, whose Python is not that of Blender's own build; any "
        "version from 4.2 on"
        f" may install the zip, which is written to build/{OTHER_DIST.name}",
    )
    parser.add_argument(
        "--no-kernels",
        action="store_true",
        help="leave the compiled solver out; it is compiled on first use",
    )
    parser.add_argument(
        "--kernels-only",
        action="store_true",
        help="build no zip, only the compiled solver, in build/kernels, where another computer "
        "takes it from",
    )
    parser.add_argument(
        "--website", metavar="URL", default="", help="page for users, written into the manifest"
    )
    args = parser.parse_args()
    unknown = sorted(set(args.platforms) - set(PLATFORMS))
    if unknown:
        print(
            f"build: unknown platform {', '.join(unknown)}; choose of {', '.join(PLATFORMS)}",
            file=sys.stderr,
        )
        return 2
    if args.python in OTHER_PYTHONS and not args.any_blender:
        print(
            f"build: no Blender has Python {args.python} but a distribution's; add --any-blender",
            file=sys.stderr,
        )
        return 2
    pythons = [args.python] if args.python else sorted(BLENDERS)
    targets = [
        Target(p, python, args.any_blender)
        for p in args.platforms or PLATFORMS
        for python in pythons
    ]
    if args.kernels_only:
        made = [compile_kernels(target) for target in targets]
        return 0 if all(made) else 1
    folder = OTHER_DIST if args.any_blender else DIST
    folder.mkdir(parents=True, exist_ok=True)
    kept = set()
    for target in targets:
        archive = build(target, folder, args.website, kernels=not args.no_kernels)
        kept |= {archive, archive.with_suffix(".cdx.json")}
        size = archive.stat().st_size / 1e6
        print(f"{archive}  {size:.0f} MB", flush=True)
    for old in {*folder.glob("scope-*.zip"), *folder.glob("scope-*.cdx.json")} - kept:
        old.unlink()  # of other sources; what else lies here is not of this program
    if not args.any_blender:
        check_listing(folder, targets)
    return 0


def compile_kernels(target: Target) -> bool:
    """Compile the solver for a target; return whether this computer can."""
    wheels = download_wheels(target)
    stage(target, wheels)
    return add_kernels(STAGING, target.platform, target.python, wheels)


def build(target: Target, folder: Path, website: str = "", *, kernels: bool = True) -> Path:
    """Stage, zip, validate and check one target; return its zip."""
    wheels = download_wheels(target)
    stage(target, wheels, website)
    if kernels:
        add_kernels(STAGING, target.platform, target.python, wheels)
    version = tomllib.loads((STAGING / "blender_manifest.toml").read_text("utf-8"))["version"]
    archive = folder / target.file_name(version)
    made = source_time()
    bill = bill_of_materials(STAGING, wheels, target.platform, made)
    (STAGING / BILL).write_text(bill, "utf-8")
    stated = STAGING / "blender_manifest.toml"
    stated.write_text(with_licences(stated.read_text("utf-8"), bill), "utf-8")
    archive.with_suffix(".cdx.json").write_text(bill, "utf-8")
    blender_extension("validate", str(STAGING))
    write_zip(STAGING, archive, made)
    blender_extension("validate", str(archive))
    check(archive, target)
    return archive


def write_zip(folder: Path, archive: Path, made: datetime) -> None:
    """Pack a folder so that the same content gives the same bytes: sorted, and with one time and
    mode.

    Blender's own tool packs in the order of the file system, and with the times of the files.
    """
    temporary = archive.with_suffix(".partial")
    with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as file:
        for path in sorted(p for p in folder.rglob("*") if p.is_file()):
            entry = zipfile.ZipInfo(path.relative_to(folder).as_posix(), made.timetuple()[:6])
            entry.compress_type = (
                zipfile.ZIP_STORED if path.suffix == ".whl" else zipfile.ZIP_DEFLATED
            )
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            file.writestr(entry, path.read_bytes(), compresslevel=9)
    temporary.replace(archive)


def download_wheels(target: Target) -> list[Path]:
    """Return a target's wheels, as locked and as on PyPI; download them if they are missing."""
    folder = WHEELS / target.platform / target.python
    folder.mkdir(parents=True, exist_ok=True)
    pins = folder / "requirements.txt"
    wanted = locked(target.python)
    if (
        not pins.is_file()
        or pins.read_text("utf-8") != wanted
        or len(list(folder.glob("*.whl"))) != len(PACKAGES)
    ):
        for old in folder.iterdir():
            old.unlink()
        request = folder / "request.txt"
        request.write_text(wanted)
        command = [
            sys.executable,
            "-m",
            "pip",
            "download",
            "--quiet",
            "--disable-pip-version-check",
            "--no-deps",
        ]
        command += ["--only-binary=:all:", "--require-hashes", "--implementation", "cp"]
        command += ["--python-version", target.python]
        for tag in PLATFORMS[target.platform]:
            command += ["--platform", tag]
        subprocess.run([*command, "--dest", str(folder), "--requirement", str(request)], check=True)
        request.rename(pins)
    return sorted(folder.glob("*.whl"))


def locked(python: str) -> str:
    """Return the entries of the shipped packages in a Python's lock, with their hashes."""
    lock = max(BLENDERS) if python in OTHER_PYTHONS else python
    text = (ROOT / "scripts" / "requirements" / f"{lock}.txt").read_text("utf-8")
    entries = re.finditer(r"^(\S+?)==\S+(?:.*\\\n)*.*$", text, flags=re.M)
    found = {entry[1]: entry[0] for entry in entries if entry[1] in PACKAGES}
    missing = sorted(set(PACKAGES) - set(found))
    if missing:
        raise SystemExit(
            f"build: the lock for Python {python} lacks {', '.join(missing)}; run ./scripts/lock"
        )
    return "\n".join(found[name] for name in PACKAGES) + "\n"


def shipped_name(wheel: str, python: str) -> str:
    """Return a wheel's file name in the zip: PyPI's, except where a Blender would then leave the
    wheel out.

    Blender 4.3, and the first updates of 4.2, compare a wheel's Python tag with their own Python
    also where the wheel is for the stable ABI, and skip ``cp37-abi3``. In the zip for their Python,
    such a wheel's name also has the tag of that Python. The wheel itself is unchanged.
    """
    *head, tag, abi, platform = wheel.removesuffix(".whl").split("-")
    own = "cp" + python.replace(".", "")
    if python == "3.11" and abi == "abi3" and tag != own:
        tag = f"{tag}.{own}"
    return "-".join([*head, tag, abi, platform]) + ".whl"


def is_repacked(wheel: str, target: Target) -> bool:
    """Return whether a target's zip ships a wheel in another compression than PyPI."""
    packages = REPACKED.get(target.platform, ())
    return wheel.startswith(tuple(f"{package.replace('-', '_')}-" for package in packages))


def repacked(wheel: Path) -> Path:
    """Return a wheel with the same files, compressed by LZMA.

    RECORD, in which a wheel states the hashes of its files, stays as it is. It takes minutes, so
    the result is kept beside the folders of the Pythons, some of which have a wheel in common.
    """
    result = wheel.parent.parent / "repacked" / wheel.name
    if not result.is_file():
        print(f"build: compressing {wheel.name}: a minute or two", file=sys.stderr, flush=True)
        result.parent.mkdir(exist_ok=True)
        partial = result.with_suffix(".partial")
        with zipfile.ZipFile(wheel) as source, zipfile.ZipFile(partial, "w") as file:
            for entry in source.infolist():
                copied = zipfile.ZipInfo(entry.filename, entry.date_time)
                copied.create_system = entry.create_system
                copied.external_attr = entry.external_attr
                file.writestr(copied, source.read(entry), zipfile.ZIP_LZMA)
        partial.replace(result)
    return result


def is_locked(name: str, content: bytes, target: Target) -> bool:
    """Return whether a zip's wheel is the locked one, or has the same files if it is repacked."""
    lock = locked(target.python)
    if not is_repacked(name, target):
        return f"sha256:{hashlib.sha256(content).hexdigest()}" in lock
    for wheel in download_wheels(target):
        if shipped_name(wheel.name, target.python) == name:
            published = wheel.read_bytes()
            of_lock = f"sha256:{hashlib.sha256(published).hexdigest()}" in lock
            return of_lock and files_in(published) == files_in(content)
    return False


def files_in(wheel: bytes) -> list[tuple[str, int, int]]:
    """Return name, size and checksum of each file in a wheel."""
    with zipfile.ZipFile(io.BytesIO(wheel)) as file:
        return [(entry.filename, entry.file_size, entry.CRC) for entry in file.infolist()]


def stage(target: Target, wheels: list[Path], website: str = "") -> None:
    """Copy the shipped files and a target's wheels into the staging folder, with its manifest."""
    shutil.rmtree(STAGING, ignore_errors=True)
    (STAGING / "wheels").mkdir(parents=True)
    for name in CONTENT:
        source = ROOT / name
        goal = STAGING / name
        if source.is_dir():
            shutil.copytree(source, goal, ignore=shutil.ignore_patterns(*LEFT_OUT))
        else:
            goal.parent.mkdir(exist_ok=True)
            shutil.copy2(source, goal)
    write_pages(ROOT, STAGING)
    names = []
    for path in wheels:
        name = shipped_name(path.name, target.python)
        shipped = repacked(path) if is_repacked(path.name, target) else path
        os.link(shipped, STAGING / "wheels" / name)
        names.append(f"./wheels/{name}")
    (STAGING / "blender_manifest.toml").write_text(manifest(target, names, website))


def manifest(target: Target, wheels: list[str], website: str = "") -> str:
    """Return the manifest of a target: that of the repository, with its Blenders, platform, wheels
    and website.
    """
    top, tables = (ROOT / "blender_manifest.toml").read_text("utf-8").split("\n[", 1)
    first, end = target.blenders
    limits = f'blender_version_min = "{first}"' + (
        f'\nblender_version_max = "{end}"' if end else ""
    )
    top, count = re.subn(r'^blender_version_min = ".*"$', limits, top, flags=re.M)
    if count != 1:
        raise SystemExit("build: blender_manifest.toml must have one line blender_version_min")
    if website:
        top += f"\nwebsite = {json.dumps(website)}\n"
    for key, values in {"platforms": [target.platform], "wheels": wheels}.items():
        top += f"\n{key} = [\n" + "".join(f'    "{value}",\n' for value in values) + "]\n"
    tables = tables.split("\n[build]")[0]  # the staging folder holds only what is shipped
    return f"{top}\n[{tables}\n"


def with_licences(manifest: str, bill: str) -> str:
    """Return a manifest that also states the licences of a bill of materials; where one can choose
    between several, the first.
    """
    stated = tomllib.loads(manifest)["license"]
    expressions = re.findall(r'"expression": "([^"]+)"', bill)
    parts = {part for text in expressions for part in text.split(" AND ")}
    others = {f"SPDX:{part.split(' OR ')[0]}" for part in parts} - set(stated)
    listed = "".join(f"    {json.dumps(licence)},\n" for licence in [*stated, *sorted(others)])
    before, _, rest = manifest.partition("\nlicense = [\n")
    return f"{before}\nlicense = [\n{listed}{rest[rest.index(']') :]}"


def blender_extension(*arguments: str) -> str:
    """Run Blender's extension tool; return what it says."""
    spec = importlib.util.find_spec("bpy")
    package = Path(spec.origin).parent if spec and spec.origin else ROOT / "no bpy"
    found = sorted(package.glob("*/scripts/**/blender_ext.py"))
    if not found:
        raise SystemExit(
            "build: bpy, which contains Blender's extension tool, is not installed; "
            "run ./scripts/setup"
        )
    done = subprocess.run(
        [sys.executable, str(found[0]), *arguments], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(f"build: Blender's extension tool refused:\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def check(archive: Path, target: Target) -> None:
    """Check what Blender's tool cannot: the size, and that all that a capture needs is there, and
    not numpy.
    """
    with zipfile.ZipFile(archive) as file:
        names = file.namelist()
        wheels = {Path(n).name: file.read(n) for n in names if n.endswith(".whl")}
        stated = tomllib.loads(file.read("blender_manifest.toml").decode())
    listed = [Path(w).name for w in stated["wheels"]]
    problems = [f"{w} is listed but not there" for w in listed if w not in wheels]
    problems += [f"{w} is there but not listed" for w in wheels if w not in listed]
    problems += [
        f"{name} is not the locked file"
        for name, content in wheels.items()
        if not is_locked(name, content, target)
    ]
    for package in PACKAGES:
        count = sum(w.startswith(package.replace("-", "_") + "-") for w in listed)
        if count != 1:
            problems.append(f"{count} wheels of {package}")
    if any(w.lower().startswith("numpy") for w in listed):
        problems.append("numpy is shipped")
    wanted = [f"assets/networks/{name}.onnx" for name in NETWORK_NAMES]
    wanted += [
        f"assets/networks/{NETWORK_LICENCE}",
        "assets/body/scope.npz",
        "assets/body/scope_h.npz",
    ]
    wanted += ["assets/body/expressions.npz", "assets/body/growth.npz", "assets/body/mouth.npz"]
    wanted += ["assets/face/response.npz"]
    wanted += [f"assets/face/controls/{rig}.json" for rig in ("rigify", "rigify_skin", "mpfb")]
    wanted += [
        "assets/lifter/lifter.onnx",
        "assets/prior/joint_prior.npz",
        "assets/sample/sample.mp4",
    ]
    wanted += [f"assets/{folder}/LICENSE.md" for folder in ("body", "lifter", "sample")]
    wanted += ["LICENSE", "THIRD_PARTY.md", BILL, *GUIDE]
    wanted += ["scope_addon/ui/__init__.py", "scope_addon/ui/translations.txt"]
    static = [
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "scope_addon" / "report" / "static").iterdir()
    ]
    wanted += static
    problems += [f"{w} is missing" for w in wanted if w not in names]
    if stated["platforms"] != [target.platform]:
        problems.append(f"made for {', '.join(stated['platforms'])}, not for {target.platform}")
    if (stated["blender_version_min"], stated.get("blender_version_max")) != target.blenders:
        problems.append(f"not made for Blender {' to '.join(str(b) for b in target.blenders)}")
    problems += [
        f"{n} does not belong in"
        for n in names
        if "__pycache__" in n or n.endswith((".pyc", ".nbi", ".nbc"))
    ]
    size = archive.stat().st_size / 1e6
    if size > LIMIT_MB:
        problems.append(f"it has {size:.0f} MB, more than the limit of {LIMIT_MB} MB")
    if problems:
        raise SystemExit(f"build: {archive.name}: {'; '.join(problems)}")


def check_listing(folder: Path, targets: list[Target]) -> None:
    """List the zips as an extension repository does: every one must be listed, and no Blender may
    fit two. Blender's tool lists in the order of the file system; here, it is that of the names.
    """
    said = blender_extension("server-generate", "--repo-dir", str(folder))
    listing = folder / "index.json"
    stated = json.loads(listing.read_text("utf-8"))
    entries = stated["data"]
    entries.sort(key=lambda entry: entry["archive_url"])
    listing.write_text(json.dumps(stated, indent=2) + "\n", "utf-8")
    found = sorted(
        (e["platforms"], e["blender_version_min"], e.get("blender_version_max")) for e in entries
    )
    wanted = sorted(([target.platform], *target.blenders) for target in targets)
    if found != wanted or "duplicate" in said.lower() or "error" in said.lower():
        raise SystemExit(f"build: Blender's tool listed {found}, not {wanted}, and said:\n{said}")
    print(f"{listing}  {len(entries)} zips listed for an extension repository")


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (OSError, subprocess.CalledProcessError) as error:
        left_mb = shutil.disk_usage(ROOT).free >> 20
        sys.exit(
            f"build: {error}; {left_mb} MB are left on the disk of {ROOT}: if that is why, free "
            "some space, and run this again"
        )
