# SPDX-License-Identifier: GPL-3.0-or-later
"""A disk of its own for a command, whose power can be cut: a file system in a file.

What the kernel has not written to the file when that is copied is lost, as in a power cut; the copy
is then mounted in its place.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .system_calls import copy_disk

# By name: the program that makes the file system, with options, and the options with which it is
# mounted. ext4 writes a file that replaces another early, unless it is told not to.
DISKS = {
    "ext4": (("mkfs.ext4", "-q"), "loop,noauto_da_alloc"),
    "ext4 writeback": (("mkfs.ext4", "-q"), "loop,noauto_da_alloc,data=writeback"),
    "ext4 journal": (("mkfs.ext4", "-q"), "loop,data=journal"),
    "xfs": (("mkfs.xfs", "-q"), "loop,nouuid"),
    "btrfs": (("mkfs.btrfs", "-q"), "loop"),
}
_BYTES = 512 << 20


class Disk:
    """A mounted file system."""

    def __init__(self, kind: str, folder: Path) -> None:
        self.image = folder / "disk"
        self.folder = folder / "mounted"
        self._make, self._options = DISKS[kind]

    def make(self) -> None:
        """Make and mount it."""
        self.folder.mkdir()
        with self.image.open("wb") as file:
            file.truncate(_BYTES)
        subprocess.run([*self._make, str(self.image)], check=True, capture_output=True)
        self._mount()

    def sync(self) -> None:
        """Have everything written."""
        handle = os.open(self.folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
        os.sync()

    def cut(self) -> None:
        """Cut the power now."""
        copy_disk(str(self.image))
        self.restart()

    def restart(self) -> None:
        """Mount what a cut has left, which lies beside the image."""
        self.unmount()
        os.replace(f"{self.image}.cut", self.image)
        self._mount()

    def unmount(self) -> None:
        """Unmount it."""
        subprocess.run(["umount", "--lazy", str(self.folder)], check=True)

    def _mount(self) -> None:
        command = ["mount", "-o", self._options, str(self.image), str(self.folder)]
        subprocess.run(command, check=True, capture_output=True)


@contextmanager
def new_disk(kind: str) -> Iterator[Disk]:
    """Give a new disk of a kind."""
    with tempfile.TemporaryDirectory(prefix="scope-disk-") as folder:
        disk = Disk(kind, Path(folder))
        disk.make()
        try:
            yield disk
        finally:
            disk.unmount()


def problem_with(kind: str) -> str:
    """Say why disks of a kind cannot be made here; empty if they can."""
    if sys.platform != "linux" or os.geteuid() != 0:
        return "only root mounts file systems, and only Linux these"
    program = DISKS[kind][0][0]
    if shutil.which(program) is None:
        return f"{program} is not installed"
    try:
        with new_disk(kind):
            return ""
    except subprocess.CalledProcessError as error:
        return f"the kernel mounts none here: {error.stderr.decode('utf-8', 'replace').strip()}"
