# SPDX-License-Identifier: GPL-3.0-or-later
"""What a process that decodes other people's files must not be able to do, really attempted."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path


def what_succeeds(outside: Path, port: int) -> list[str]:
    """Attempt everything, and return the names of what the system has let happen.

    :param outside: folder with a file ``old``, a file ``lost`` and a folder ``empty``.
    :param port: of this computer, at which somebody listens.
    """
    old = outside / "old"
    attempts: dict[str, Callable[[], object]] = {
        "create": lambda: (outside / "new").write_bytes(b"1"),
        "append": lambda: old.open("ab").close(),
        "truncate": lambda: os.truncate(old, 0),
        "rename": lambda: old.rename(outside / "renamed"),
        "make a folder": lambda: (outside / "folder").mkdir(),
        "make a link": lambda: (outside / "link").symlink_to(outside),
        "remove": lambda: (outside / "lost").unlink(),
        "remove a folder": lambda: (outside / "empty").rmdir(),
        "start a program": lambda: subprocess.run([sys.executable, "-c", ""], check=True),
        "connect": lambda: socket.create_connection(("127.0.0.1", port), 60).close(),
        "use a local socket": lambda: socket.socket(socket.AF_UNIX).close(),
    }
    done = []
    for name, attempt in attempts.items():
        try:
            attempt()
            done.append(name)
        except PermissionError:
            pass
    return done
